/* A host that asks which operator, kernel and integrator reach an accuracy cheapest on particles like its own, creates a
 * solver with what it is told, and checks the answer. */
#include <diffusph.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 12, N = SIDE * SIDE };

static void stop_if(int32_t code, diffusph_solver *s, const char *call)
{
    char text[512];
    if (code != DIFFUSPH_DONE) {
        diffusph_message(s, text, sizeof text);
        fprintf(stderr, "%s: %s\n", call, text);
        exit(1);
    }
}
#define TRY(function, ...) stop_if(function(s, __VA_ARGS__), s, #function)

/* A solver with these words on a wave of temperature in the periodic unit square. */
static diffusph_solver *solver(const char *words, const double *x, const double *t)
{
    const double lo[2] = {0.0, 0.0}, hi[2] = {1.0, 1.0};
    const int32_t periodic[2] = {1, 1};
    diffusph_solver *s = NULL;
    char why[512];
    if (diffusph_create(words, &s, why, sizeof why)) {
        fprintf(stderr, "%s\n", why);
        exit(1);
    }
    TRY(diffusph_set_box, lo, hi, periodic);
    TRY(diffusph_set_particles, N, x, 2, NULL, NULL, NULL);
    TRY(diffusph_set_number, "m", 1.0 / N);
    TRY(diffusph_set_number, "rho", 1.0);
    TRY(diffusph_set_number, "kappa", 1.0);
    TRY(diffusph_set, "T", t, N, 1);
    return s;
}

int main(void)
{
    const double k = 2.0 * 3.14159265358979323846, wanted = 0.02, dt = 1.0 / (2.0 * k * k);
    double x[2 * N], t[N], error, seconds, off = 0.0, size = 0.0;
    char words[256], none[256];
    unsigned state = 1;
    for (int i = 0; i < 2 * N; i++) {
        const double cell = i % 2 == 0 ? i / 2 % SIDE : i / 2 / SIDE;
        state = 1664525u * state + 1013904223u;
        x[i] = (cell + 0.5 + 0.2 * ((state >> 8) / 8388608.0 - 1.0)) / SIDE;
    }
    for (int i = 0; i < N; i++) {
        t[i] = sin(k * x[2 * i]) * sin(k * x[2 * i + 1]);
    }

    diffusph_solver *s = solver("heat dim=2 threads=1", x, t);
    TRY(diffusph_recommend, wanted, dt, words, (int64_t)sizeof words, &error, &seconds);
    printf("for an error of %g: %s (%.1e in %.1f ms)\n", wanted, words, error, 1e3 * seconds);
    /* What nothing can reach is a status of its own, and the message names the best that there is. */
    if (diffusph_recommend(s, 1e-9, dt, none, (int64_t)sizeof none, &error, &seconds) != DIFFUSPH_OUT_OF_REACH) {
        return 1;
    }
    diffusph_destroy(s);

    s = solver(words, x, t);
    TRY(diffusph_step, dt, NULL);
    double found[N];
    TRY(diffusph_get, "T", found, N, 1);
    for (int i = 0; i < N; i++) {
        off += pow(found[i] - exp(-1.0) * t[i], 2.0);
        size += pow(exp(-1.0) * t[i], 2.0);
    }
    printf("against the exact answer it errs by %.1e\n", sqrt(off / size));
    diffusph_destroy(s);
    return sqrt(off / size) < wanted ? 0 : 1;
}
