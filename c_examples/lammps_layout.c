/* A host that keeps double **x as LAMMPS does (x[i] points into one block of n times 3), moves its particles, and
 * integrates their heat itself: du/dt from diffusph_rate, the step from diffusph_limit. No array is copied.
 *
 * The particles drift with the wave of temperature, so that in their frame it only decays, by exp(-k^2 kappa t). */
#include <diffusph.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 12, LAYERS = 6, N = SIDE * LAYERS * LAYERS };

/* One block, and a pointer to each row. */
static double **rows(size_t n, size_t columns)
{
    double *block = malloc(n * columns * sizeof *block), **row = malloc(n * sizeof *row);
    for (size_t i = 0; block != NULL && row != NULL && i < n; i++) {
        row[i] = block + i * columns;
    }
    return row;
}

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

int main(void)
{
    const double dx = 1.0 / SIDE, k = 2.0 * 3.14159265358979323846, end = 0.02, speed = 3.0;
    const double lo[3] = {0.0, 0.0, 0.0}, hi[3] = {1.0, LAYERS * dx, LAYERS * dx};
    const int32_t periodic[3] = {1, 1, 1};
    double **x = rows(N, 3), *u = malloc(N * sizeof *u), *du = malloc(N * sizeof *du), *start = malloc(N * sizeof *start);
    diffusph_solver *s = NULL;
    char why[512];
    if (x == NULL || u == NULL || du == NULL || start == NULL) {
        return 1;
    }
    for (int i = 0; i < N; i++) {
        x[i][0] = (i % SIDE + 0.5) * dx;
        x[i][1] = (i / SIDE % LAYERS + 0.5) * dx;
        x[i][2] = (i / SIDE / LAYERS + 0.5) * dx;
        u[i] = start[i] = sin(k * x[i][0]);
    }
    if (diffusph_create("heat dim=3 kernel=M4 threads=1", &s, why, sizeof why)) {
        fprintf(stderr, "%s\n", why);
        return 1;
    }
    TRY(diffusph_set_box, lo, hi, periodic);
    TRY(diffusph_set_particles, N, x[0], 3, NULL, NULL, NULL);
    TRY(diffusph_set_number, "m", dx * dx * dx);
    TRY(diffusph_set_number, "rho", 1.0); /* known to this host, so that nothing is summed for it */
    TRY(diffusph_set_number, "kappa", 1.0);

    /* On purpose: the rate before there is a temperature. */
    if (diffusph_rate(s, du, N, 1) != DIFFUSPH_OUT_OF_ORDER) {
        return 1;
    }
    diffusph_message(s, why, sizeof why);
    printf("on purpose: %s\n", why);

    double t = 0.0, limit;
    int steps = 0;
    while (t < end) {
        TRY(diffusph_set_particles, N, x[0], 3, NULL, NULL, NULL);
        TRY(diffusph_set, "u", u, N, 1);
        TRY(diffusph_rate, du, N, 1);
        TRY(diffusph_limit, &limit);
        const double dt = fmin(0.1 * limit, end - t);
        for (int i = 0; i < N; i++) {
            u[i] += dt * du[i];
            x[i][0] += dt * speed; /* out of the box and in again: the library wraps */
        }
        t += dt;
        steps++;
    }
    TRY(diffusph_write_vtk, "lammps_layout.vtu");

    double error = 0.0;
    for (int i = 0; i < N; i++) {
        error = fmax(error, fabs(u[i] - exp(-k * k * end) * start[i]));
    }
    printf("%d steps of the host, error %.1e\n", steps, error);
    diffusph_destroy(s);
    free(x[0]);
    free(x);
    free(u);
    free(du);
    free(start);
    /* Second order in the spacing: the rate of decay is right to a part of (k dx)^2. */
    return error < 0.25 * pow(k * dx, 2) * k * k * end * exp(-k * k * end) ? 0 : 1;
}
