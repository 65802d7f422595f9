/* A wave of heat in a periodic box, from C: create, set, step, get, files, and an error made on purpose.
 *
 * T = 300 + sin(2 pi x) decays as exp(-(2 pi)^2 kappa / (rho c_v) t), which the program compares with at the end. */
#include <diffusph.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { SIDE = 24, N = SIDE * SIDE, STEPS = 10 };

static const double pi = 3.14159265358979323846;

static int failed(diffusph_solver *s, const char *what)
{
    char text[512];
    diffusph_message(s, text, sizeof text);
    fprintf(stderr, "%s: %s\n", what, text);
    diffusph_destroy(s);
    return 1;
}

/* An error names what is wrong and changes nothing. */
static int makes_errors(diffusph_solver *s)
{
    char text[512];
    double bad[N], before, after;
    for (int i = 0; i < N; i++) {
        bad[i] = 300.0;
    }
    bad[7] = NAN;
    if (diffusph_get_number(s, "energy", &before) != DIFFUSPH_DONE) {
        return 0;
    }
    if (diffusph_set(s, "T", bad, N, 1) != DIFFUSPH_BAD_VALUE) {
        return 0;
    }
    diffusph_message(s, text, sizeof text);
    printf("on purpose: %s\n", text);
    return strncmp(text, "T[7] is NaN", 11) == 0 && diffusph_get_number(s, "energy", &after) == DIFFUSPH_DONE
        && before == after;
}

int main(void)
{
    static double x[N][2], m[N], T[N], flux[N][2];
    const double lo[2] = {0.0, 0.0}, hi[2] = {1.0, 1.0};
    const int32_t periodic[2] = {1, 1};
    const double rho = 2.0, kappa = 0.6, c_v = 3.0, t = 0.1, k = 2.0 * pi;
    double energy;
    diffusph_report report = DIFFUSPH_REPORT_INIT;
    diffusph_solver *s;
    char why[512], plan[4096];

    for (int i = 0; i < N; i++) {
        x[i][0] = (i % SIDE + 0.5) / SIDE;
        x[i][1] = (i / SIDE + 0.5) / SIDE;
        m[i] = rho / N;
        T[i] = 300.0 + sin(k * x[i][0]);
    }

    if (diffusph_create("heat dim=2 kernel=M6 operator=brokshaw", &s, why, sizeof why) != DIFFUSPH_UNKNOWN_WORD) {
        fprintf(stderr, "a word that does not exist was taken\n");
        return 1;
    }
    printf("on purpose: %s\n", why);
    if (diffusph_create("heat dim=2 kernel=M6 operator=brookshaw integrator=rkl2", &s, why, sizeof why)) {
        fprintf(stderr, "create: %s\n", why);
        return 1;
    }

    if (diffusph_set_box(s, lo, hi, periodic)
        || diffusph_set_particles(s, N, &x[0][0], 2, m, NULL, NULL)
        || diffusph_set(s, "T", T, N, 1)
        || diffusph_set_number(s, "kappa", kappa)
        || diffusph_set_number(s, "c_v", c_v)) {
        return failed(s, "set");
    }
    if (!makes_errors(s)) {
        return failed(s, "an error was not answered as it should be");
    }

    if (diffusph_plan(s, plan, sizeof plan, NULL)) {
        return failed(s, "plan");
    }
    puts(plan);

    if (diffusph_get_number(s, "energy", &energy) || diffusph_write_series(s, "heat.pvd")) {
        return failed(s, "start");
    }
    for (int step = 0; step < STEPS; step++) {
        if (diffusph_step(s, t / STEPS, &report)) {
            return failed(s, "step");
        }
        printf("t = %g: %d stages, T from %.6f to %.6f\n", report.time, (int)report.stages, report.T_min, report.T_max);
    }
    if (diffusph_get(s, "T", T, N, 1) || diffusph_get(s, "flux", &flux[0][0], N, 2)
        || diffusph_write_series(s, "heat.pvd") || diffusph_write_vtk(s, "heat.vtk")) {
        return failed(s, "get or write");
    }

    double error = 0.0, flux_error = 0.0;
    const double decay = exp(-k * k * kappa / (rho * c_v) * t);
    for (int i = 0; i < N; i++) {
        error = fmax(error, fabs(T[i] - 300.0 - decay * sin(k * x[i][0])));
        flux_error = fmax(flux_error, fabs(flux[i][0] + kappa * k * decay * cos(k * x[i][0])));
    }
    diffusph_destroy(s);
    printf("errors: T %.1e, flux %.1e\n", error, flux_error);

    /* Second order in the spacing: the rate of decay is right to a part of (k dx)^2, and so is the flux. Energy is
     * conserved to rounding. */
    const double resolution = 0.5 * pow(k / SIDE, 2), drift = fabs(report.energy / energy - 1.0);
    const double T_allowed = resolution * k * k * kappa / (rho * c_v) * t * decay;
    return error < T_allowed && flux_error < resolution * kappa * k * decay && drift < 1e-14 ? 0 : 1;
}
