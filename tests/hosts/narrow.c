/* A host with less and more address space, as batch systems limit it: each limit in a process of its own, until one is
 * enough. Every call answers; none may end the process.
 */
#define _GNU_SOURCE
#include <diffusph.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { SIDE = 150, N = SIDE * SIDE, STEP = 512 << 10, LIMITS = 300 };
static double x[2 * N], T[N], flux[2 * N];
static const char *names[] = {"create", "set_particles", "set", "step", "get", "write", "write legacy", "read", "read legacy"};
enum { CALLS = sizeof names / sizeof *names };

static diffusph_solver *s;

static int call(int which)
{
    char why[300];
    switch (which) {
    case 0: return diffusph_create("heat dim=2 threads=1", &s, why, sizeof why);
    case 1: return diffusph_set_particles(s, N, x, 2, NULL, NULL, NULL);
    case 2: return diffusph_set_number(s, "m", 1.0 / N) || diffusph_set_number(s, "kappa", 1) || diffusph_set(s, "T", T, N, 1)
        ? DIFFUSPH_NO_MEMORY : 0;
    case 3: return diffusph_step(s, 1e-4, NULL);
    case 4: return diffusph_get(s, "flux", flux, N, 2);
    case 5: return diffusph_write_vtk(s, "narrow.vtu");
    case 6: return diffusph_write_vtk(s, "narrow.vtk");
    case 7: return diffusph_read_vtk(s, "narrow.vtu");
    default: return diffusph_read_vtk(s, "narrow.vtk");
    }
}

static size_t in_use(void)
{
    long pages = 0;
    FILE *f = fopen("/proc/self/statm", "r");
    if (!f || fscanf(f, "%ld", &pages) != 1)
        exit(2);
    fclose(f);
    return (size_t)pages * (size_t)sysconf(_SC_PAGESIZE);
}

int main(void)
{
    struct { int call, code; } *shared;
    long refused[CALLS] = {0}, ended = 0, other = 0, done = 0;
    size_t used = in_use();
    int i, limit, status;
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    for (i = 0; i < N; i++) {
        x[2 * i] = (i % SIDE + 0.5 + 0.2 * sin(7.0 * i)) / SIDE;
        x[2 * i + 1] = (i / SIDE + 0.5 + 0.2 * sin(5.0 * i)) / SIDE;
        T[i] = sin(6.28 * x[2 * i]);
    }
    for (limit = 0; limit < LIMITS && !done; limit++) {
        shared->call = shared->code = 0;
        if (fork() == 0) {
            struct rlimit space = {used + (size_t)limit * STEP, used + (size_t)limit * STEP};
            setrlimit(RLIMIT_AS, &space);
            for (i = 0; i < CALLS && !shared->code; i++) {
                shared->call = i;
                shared->code = call(i);
            }
            _exit(0);
        }
        wait(&status);
        if (WIFSIGNALED(status)) {
            ended++;
            printf("limit %d: %s ends the process\n", limit, names[shared->call]);
        } else if (shared->code == 0) {
            done++;
        } else if (shared->code == DIFFUSPH_NO_MEMORY) {
            refused[shared->call]++;
        } else {
            other++;
            printf("limit %d: %s answers %d\n", limit, names[shared->call], shared->code);
        }
    }
    for (i = 0; i < CALLS; i++)
        printf("%s refused %ld times\n", names[i], refused[i]);
    printf("%ld ended, %ld other codes, %s\n", ended, other, done ? "done" : "never enough");
    return ended || other || !done;
}
