/* A host whose allocations are refused: the n-th alone, or the n-th and all after it, for many n, each in a process of its
 * own. A call may answer NO_MEMORY, with a message, and must then be as if it had not been made; nothing else may happen, but
 * while threads are started.
 * Prints how often what did.
 *
 *     scarce WORDS EVERY FOLDER     every EVERY-th allocation, files in FOLDER
 */
#define _GNU_SOURCE
#include <diffusph.h>
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

/* Shared with the parent, which outlives what is tested. */
struct record {
    atomic_long asked;
    atomic_int armed;
    long first;
    int onward, code, failed, call, silent, changed, lost;
};
static struct record *record;

static int refused(void)
{
    long k;
    if (!record || !record->armed)
        return 0;
    k = atomic_fetch_add(&record->asked, 1) + 1;
    if (record->first && (k == record->first || (record->onward && k > record->first))) {
        errno = ENOMEM;
        return 1;
    }
    return 0;
}
void *malloc(size_t n) { return refused() ? NULL : __libc_malloc(n); }
void *calloc(size_t n, size_t each) { return refused() ? NULL : __libc_calloc(n, each); }
void *realloc(void *old, size_t n) { return refused() ? NULL : __libc_realloc(old, n); }
void *aligned_alloc(size_t a, size_t n) { return refused() ? NULL : __libc_memalign(a, n); }
int posix_memalign(void **to, size_t a, size_t n)
{
    if (refused())
        return ENOMEM;
    *to = __libc_memalign(a, n);
    return *to ? 0 : ENOMEM;
}

enum { SIDE = 12, N = SIDE * SIDE };
static double x[2 * N], T[N], m[N], kappa[N], out[2 * N];
static const char *words;
static char file[2][300];
static diffusph_solver *s;

static int call(int which)
{
    static const double lo[2] = {0, 0}, hi[2] = {1, 1};
    static const int32_t periodic[2] = {1, 1};
    static char text[4000], why[300];
    double number;
    int64_t needed;
    switch (which) {
    case 0: return diffusph_create(words, &s, why, sizeof why);
    case 1: return diffusph_set_box(s, lo, hi, periodic);
    case 2: return diffusph_set_particles(s, N, x, 2, m, NULL, NULL);
    case 3: return diffusph_set(s, "T", T, N, 1);
    case 4: return diffusph_set(s, "kappa", kappa, N, 1);
    case 5: return diffusph_plan(s, text, sizeof text, &needed);
    case 6: return diffusph_step(s, 1e-3, NULL);
    case 7: return diffusph_get(s, "flux", out, N, 2);
    case 8: return diffusph_rate(s, out, N, 1);
    case 9: return diffusph_write_vtk(s, file[0]);
    case 10: return diffusph_write_vtk(s, file[1]);
    case 11: return diffusph_read_vtk(s, file[0]);
    case 12: return diffusph_read_vtk(s, file[1]);
    case 13: return diffusph_set_law(s, "kappa", "table T=-2,0,2 kappa=1,2,3");
    case 14: return diffusph_step(s, 1e-3, NULL);
    case 15: return diffusph_limit(s, &number);
    case 16: return diffusph_get_number(s, "growth_rate", &number);
    case 17: return diffusph_set(s, "nothing", T, N, 1) == DIFFUSPH_UNKNOWN_WORD ? 0 : DIFFUSPH_NO_MEMORY;
    case 18: return diffusph_write_series(s, file[0]) == DIFFUSPH_BAD_VALUE ? 0 : DIFFUSPH_NO_MEMORY;
    default: return -1000;
    }
}
enum { CALLS = 19 };

struct state { int has; double time, T[N], x[2 * N]; };

static void look(struct state *state)
{
    memset(state, 0, sizeof *state);
    if (!s || diffusph_get(s, "T", state->T, N, 1))
        return;
    state->has = 1;
    diffusph_get(s, "x", state->x, N, 2);
    diffusph_get_number(s, "time", &state->time);
}

/* One scene; a call that was refused is made again with memory to be had. */
static void scene(double *end)
{
    static struct state before, after;
    char text[300];
    int which, code;
    for (which = 0; which < CALLS; which++) {
        look(&before);
        record->call = which;
        record->armed = 1;
        code = call(which);
        record->armed = 0;
        if (code == 0)
            continue;
        record->code = code;
        record->failed = which;
        look(&after);
        record->changed |= memcmp(&before, &after, sizeof before) != 0;
        if (s && (diffusph_message(s, text, sizeof text) || !text[0]))
            record->silent = 1;
        record->first = 0;
        if (call(which))
            record->lost = 1;
    }
    if (diffusph_get(s, "T", end, N, 1))
        record->lost = 1;
    diffusph_destroy(s);
}

int main(int argc, char **argv)
{
    double *ends;
    long total, n, done = 0, answered = 0, begun = 0, ended = 0, other = 0, wrong = 0, every;
    int i, onward, status;
    if (argc != 4)
        return 2;
    words = argv[1];
    every = atol(argv[2]);
    snprintf(file[0], sizeof file[0], "%s/a.vtu", argv[3]);
    snprintf(file[1], sizeof file[1], "%s/a.vtk", argv[3]);
    for (i = 0; i < N; i++) {
        x[2 * i] = (i % SIDE + 0.5 + 0.2 * sin(7.0 * i)) / SIDE;
        x[2 * i + 1] = (i / SIDE + 0.5 + 0.2 * sin(5.0 * i)) / SIDE;
        T[i] = sin(6.28 * x[2 * i]);
        m[i] = 1.0 / N;
        kappa[i] = 1 + 0.5 * (i % 2);
    }
    record = mmap(NULL, sizeof *record, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ends = mmap(NULL, 2 * sizeof T, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (fork() == 0) {
        scene(ends);
        _exit(0);
    }
    wait(&status);
    total = record->asked;
    if (status || record->code || record->lost) {
        printf("with all memory: call %d answers %d\n", record->call, record->code);
        return 1;
    }
    for (onward = 0; onward < 2; onward++)
        for (n = 1 + onward; n <= total; n += every) {
            memset(record, 0, sizeof *record);
            record->first = n;
            record->onward = onward;
            if (fork() == 0) {
                alarm(60);
                scene(ends + N);
                _exit(0);
            }
            wait(&status);
            done++;
            answered += record->code == DIFFUSPH_NO_MEMORY;
            if ((WIFSIGNALED(status) || record->code == DIFFUSPH_BAD_VALUE) && record->call == 0
                && !strstr(words, "threads=1")) {
                begun++; /* by those who start threads, as the header says, or who start fewer */
            } else if (WIFSIGNALED(status)) {
                ended++;
                printf("allocation %ld%s: call %d ends the process\n", n, onward ? " on" : "", record->call);
            } else if (record->code && record->code != DIFFUSPH_NO_MEMORY) {
                other++;
                printf("allocation %ld%s: call %d answers %d\n", n, onward ? " on" : "", record->failed, record->code);
            } else if (record->silent || record->changed || record->lost || memcmp(ends, ends + N, sizeof T)) {
                wrong++;
                printf("allocation %ld%s: call %d answers %d; silent %d, changed %d, lost %d\n", n, onward ? " on" : "",
                       record->failed, record->code, record->silent, record->changed, record->lost);
            }
        }
    printf("%ld allocations, %ld refused in turn: %ld answered, %ld ended as threads began, %ld later, %ld other codes, "
           "%ld wrong\n", total, done, answered, begun, ended, other, wrong);
    return ended || other || wrong || !answered;
}
