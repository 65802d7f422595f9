// From C++: a solver that destroys itself, errors as exceptions, and a conductivity that is a function of the host.
//
// A bar with T = 0 at one end and 1 at the other and kappa = 1 + T comes to rest at T = sqrt(1 + 3 x) - 1, because
// T + T^2/2 (Kirchhoff's transform) then is a straight line.
#include <diffusph.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

struct Error : std::runtime_error {
    Error(int32_t code, const std::string &text) : std::runtime_error(text), code(code) {}
    int32_t code;
};

class Solver {
public:
    explicit Solver(const char *words)
    {
        char why[512];
        diffusph_solver *made = nullptr;
        const int32_t code = diffusph_create(words, &made, why, sizeof why);
        if (code != DIFFUSPH_DONE) {
            throw Error(code, why);
        }
        handle.reset(made);
    }

    // solver(diffusph_step, dt, &report): any function, its status turned into an exception.
    template <class Function, class... Arguments>
    void operator()(Function function, Arguments... arguments)
    {
        const int32_t code = function(handle.get(), arguments...);
        if (code != DIFFUSPH_DONE) {
            char text[512] = "";
            diffusph_message(handle.get(), text, sizeof text);
            throw Error(code, text);
        }
    }

    void cancel() { diffusph_cancel(handle.get()); }

private:
    struct Destroy {
        void operator()(diffusph_solver *s) const { diffusph_destroy(s); }
    };
    std::unique_ptr<diffusph_solver, Destroy> handle;
};

int32_t one_plus_t(void *calls, double, int64_t n, const uint32_t *, const double *T, double *kappa)
{
    ++*static_cast<long *>(calls);
    std::transform(T, T + n, kappa, [](double t) { return 1.0 + t; });
    return 0;
}

// Waits in a step until another thread has cancelled it.
struct Waiting {
    std::atomic<bool> inside{false}, cancelled{false};
};

int32_t wait_for_cancel(void *user, double, double)
{
    auto *waiting = static_cast<Waiting *>(user);
    waiting->inside = true;
    while (!waiting->cancelled) {
        std::this_thread::yield();
    }
    return 0;
}

double exact(double x) { return std::sqrt(1.0 + 3.0 * x) - 1.0; }

bool cancels(Solver &solver, int64_t n)
{
    Waiting waiting;
    std::vector<double> before(n), after(n);
    solver(diffusph_get, "T", before.data(), n, int64_t{1});
    solver(diffusph_set_progress_callback, wait_for_cancel, static_cast<void *>(&waiting));
    std::thread other([&] {
        while (!waiting.inside) {
            std::this_thread::yield();
        }
        solver.cancel();
        waiting.cancelled = true;
    });
    int32_t code = DIFFUSPH_DONE;
    try {
        solver(diffusph_step, 10.0, nullptr);
    } catch (const Error &error) {
        code = error.code;
        std::printf("on purpose: %s\n", error.what());
    }
    waiting.inside = true; // in case the step never was
    other.join();
    solver(diffusph_set_progress_callback, nullptr, nullptr);
    solver(diffusph_get, "T", after.data(), n, int64_t{1});
    return code == DIFFUSPH_CANCELLED && before == after;
}

int run()
{
    const int inside = 40, beyond = 12;
    const int64_t n = inside + 2 * beyond;
    std::vector<double> x(n), m(n, 1.0 / inside), T(n), fixed(n);
    for (int64_t i = 0; i < n; ++i) {
        x[i] = (i - beyond + 0.5) / inside;
        // The ends: fixed particles that continue the solution, so that each neighbourhood is full.
        fixed[i] = x[i] < 0.0 || x[i] > 1.0;
        T[i] = fixed[i] != 0.0 ? exact(x[i]) : x[i];
    }

    Solver solver("heat dim=1 kernel=M6 operator=brookshaw mean=arithmetic integrator=rkl2 tolerance=off");
    long calls = 0;
    const double *computed = nullptr;
    solver(diffusph_set_particles, n, x.data(), int64_t{1}, m.data(), computed, computed);
    solver(diffusph_set, "T", T.data(), n, int64_t{1});
    solver(diffusph_set, "fixed", fixed.data(), n, int64_t{1});
    solver(diffusph_set_kappa_callback, one_plus_t, static_cast<void *>(&calls));
    try {
        solver(diffusph_set, "kapa", T.data(), n, int64_t{1});
        return 1;
    } catch (const Error &error) {
        std::printf("on purpose: %s\n", error.what());
    }
    if (!cancels(solver, n)) {
        return 1;
    }

    diffusph_report report = DIFFUSPH_REPORT_INIT;
    solver(diffusph_step, 3.0, &report); // slowest mode: exp(-pi^2 t), so e^-30 of it is left
    solver(diffusph_get, "T", T.data(), n, int64_t{1});
    solver(diffusph_write_vtk, "heat_cpp.vtu");

    double error = 0.0;
    for (int64_t i = beyond; i < n - beyond; ++i) {
        error = std::max(error, std::abs(T[i] - exact(x[i])));
    }
    std::printf("%ld calls for kappa, error %.1e\n", calls, error);
    // Pairs exchange differences of T + T^2/2 (mean=arithmetic), so the solution is exact to rounding.
    return error < 1e-12 ? 0 : 1;
}

} // namespace

int main()
{
    try {
        return run();
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
