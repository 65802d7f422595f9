/*
 * diffusph: diffusion on SPH particles. The C interface.
 *
 * Made from the Rust sources by tests/suite/header.rs; do not edit.
 *
 * Conventions, for every function:
 *
 * - Statuses. A function answers DIFFUSPH_DONE (0), or a code above 0 (nothing was changed; the same call may succeed
 *   with less, such as a smaller step), or a code below 0 (the call or the world was wrong; nothing was changed either).
 *   diffusph_message says which argument, which index, which value, and what to do. Codes are listed below without
 *   their prefix: BAD_VALUE is DIFFUSPH_BAD_VALUE. Every function answers NULL_POINTER for a pointer that must not be
 *   NULL, BUSY, POISONED and FORKED; these are not repeated.
 * - Results are written only when the status is DIFFUSPH_DONE.
 * - Names and choices are words, such as "kappa" or "kernel=M6"; the catalogues (diffusph_count, diffusph_name,
 *   diffusph_about) list all of them. An unknown word is answered with those that are known.
 * - Arrays belong to the host; they are read or written during the call only. Counts and strides are int64_t; a stride is
 *   the number of doubles from one particle to the next. Particles are numbered from 0, in the host's order.
 * - Strings end with a NUL and are UTF-8. Texts are copied into the host's buffer, cut where they do not fit.
 * - Units are SI where the host uses SI; any consistent system works (set sigma_SB where surfaces radiate).
 * - A solver may be used from any thread, by one call at a time; a second call answers BUSY, except diffusph_cancel.
 *   Different solvers do not know of each other: there is no global state.
 * - Worker threads belong to the solver. In a host with OpenMP, OMP_WAIT_POLICY=passive keeps the host's idle threads
 *   from competing with them.
 * - Hosts that share space among processes call diffusph_rate on their own particles and ghosts around them, as many
 *   supports (kernel radius times h) as diffusph_get_number("ghost_supports") says, and step themselves: diffusph_step
 *   takes ghosts for particles of its own.
 * - The library prints nothing, installs no signal handler, and does not end the process.
 * - Memory that the system refuses is answered with NO_MEMORY. Two things cannot be: threads that start with some hundred
 *   bytes missing end the process (diffusph_create, except with threads=1), and a system that promises more memory than
 *   it has ends processes of its choice; diffusph_plan tells what a scene takes, and memory= bounds it.
 * - The host's floating-point environment (traps, rounding, flushing) is put aside during a call and is back after it.
 *   Callbacks run in the default environment, on the thread of the call. They must not throw, nor jump out.
 *
 *     diffusph_solver *s;
 *     char why[256];
 *     if (diffusph_create("heat dim=3 kernel=M6", &s, why, sizeof why)) { puts(why); return 1; }
 *     diffusph_set_particles(s, n, x, 3, m, NULL, NULL);
 *     diffusph_set(s, "T", T, n, 1);
 *     diffusph_set_number(s, "kappa", 0.6);
 *     if (diffusph_step(s, dt, NULL)) { diffusph_message(s, why, sizeof why); puts(why); }
 *     diffusph_get(s, "T", T, n, 1);
 *     diffusph_destroy(s);
 */

#ifndef DIFFUSPH_H
#define DIFFUSPH_H

#include <stdint.h>

/* The start of every report. */
#define DIFFUSPH_REPORT_INIT {sizeof(diffusph_report), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}

/**
 * Done.
 */
#define DIFFUSPH_DONE 0

/**
 * The step needs more work than max_applications allows.
 */
#define DIFFUSPH_STEP_TOO_LARGE 1

/**
 * A value became infinite or not a number.
 */
#define DIFFUSPH_NOT_FINITE 2

/**
 * A value left the bounds that the method keeps.
 */
#define DIFFUSPH_OUT_OF_BOUNDS 3

/**
 * T grew where nothing heats: the operator has growing modes on these particles.
 */
#define DIFFUSPH_GROWTH 4

/**
 * Stopped by diffusph_cancel or by the progress callback.
 */
#define DIFFUSPH_CANCELLED 5

/**
 * An iteration did not converge.
 */
#define DIFFUSPH_NOT_CONVERGED 6

/**
 * A callback of the host answered with a code other than 0.
 */
#define DIFFUSPH_CALLBACK_FAILED 7

/**
 * No choice is known to be as accurate as was asked for.
 */
#define DIFFUSPH_OUT_OF_REACH 8

/**
 * A pointer that must not be NULL is.
 */
#define DIFFUSPH_NULL_POINTER -1

/**
 * An argument, or an element of an array, has no meaning.
 */
#define DIFFUSPH_BAD_VALUE -2

/**
 * An array has another number of values than is needed.
 */
#define DIFFUSPH_WRONG_COUNT -3

/**
 * Something must be set first.
 */
#define DIFFUSPH_OUT_OF_ORDER -4

/**
 * A name that does not exist; the message lists those that do.
 */
#define DIFFUSPH_UNKNOWN_WORD -5

/**
 * Supports reach around the periodic box too often.
 */
#define DIFFUSPH_BOX_TOO_SMALL -6

/**
 * The system refused to read or write a file.
 */
#define DIFFUSPH_IO -7

/**
 * The content of a file is wrong.
 */
#define DIFFUSPH_BAD_FILE -8

/**
 * Not enough memory.
 */
#define DIFFUSPH_NO_MEMORY -9

/**
 * Another call is using this solver now.
 */
#define DIFFUSPH_BUSY -10

/**
 * An earlier call returned DIFFUSPH_PANIC; the solver can only be destroyed.
 */
#define DIFFUSPH_POISONED -11

/**
 * The process was forked after the solver was created; the child can only destroy it.
 */
#define DIFFUSPH_FORKED -12

/**
 * A defect of the library; the solver can only be destroyed.
 */
#define DIFFUSPH_PANIC -13

/**
 * A call failed, and the call was wrong.
 */
#define DIFFUSPH_LOG_ERROR 1

/**
 * A call failed, and can be tried again with less.
 */
#define DIFFUSPH_LOG_WARNING 2

/**
 * The plan, before the first step and whenever it has changed.
 */
#define DIFFUSPH_LOG_INFO 3

/**
 * A line about each step.
 */
#define DIFFUSPH_LOG_DEBUG 4

#define DIFFUSPH_VERSION_MAJOR 0

#define DIFFUSPH_VERSION_MINOR 1

#define DIFFUSPH_VERSION_PATCH 0

/**
 * The version that this header belongs to, as diffusph_version_number answers for the library.
 */
#define DIFFUSPH_VERSION_NUMBER (((DIFFUSPH_VERSION_MAJOR * 10000) + (DIFFUSPH_VERSION_MINOR * 100)) + DIFFUSPH_VERSION_PATCH)

/**
 * Grows when a host that was compiled with an older header would no longer work; see diffusph_abi_version.
 */
#define DIFFUSPH_ABI 1

/**
 * A solver. Use it from any thread, one call at a time.
 */
typedef struct diffusph_solver diffusph_solver;

/**
 * Fills `out` for the temperatures `T`: kappa in W/(m K), or heat released per volume in W/m^3. The arrays are in the
 * solver's order; `particle[k]` is the host's number (from 0) of the k-th value. An answer other than 0 makes the call
 * fail with CALLBACK_FAILED.
 */
typedef int32_t (*diffusph_field_callback)(void *user,
                                           double time,
                                           int64_t n,
                                           const uint32_t *particle,
                                           const double *T,
                                           double *out);

/**
 * Told between sub-steps which time is reached and which share (0 to 1) of the step is done. An answer other than 0
 * cancels the step.
 */
typedef int32_t (*diffusph_progress_callback)(void *user, double time, double share);

/**
 * Told what happens, at a level DIFFUSPH_LOG_*. The text lives until the callback returns.
 */
typedef void (*diffusph_log_callback)(void *user, int32_t level, const char *text);

/**
 * What a step did. Start with `diffusph_report report = DIFFUSPH_REPORT_INIT;`.
 */
typedef struct diffusph_report {
  /**
   * Bytes of this struct as the host knows it, set by the host; the library writes no more than that.
   */
  int64_t size;
  /**
   * Time reached, s.
   */
  double time;
  /**
   * The step, s.
   */
  double dt;
  /**
   * Sub-steps that it took.
   */
  int64_t substeps;
  /**
   * Stages of the last sub-step.
   */
  int64_t stages;
  /**
   * Applications of the operator.
   */
  int64_t applications;
  /**
   * A stable explicit step, s, as far as it was known without more work: diffusph_limit finds the largest.
   */
  double limit;
  /**
   * Smallest temperature, K.
   */
  double T_min;
  /**
   * Largest temperature, K.
   */
  double T_max;
  /**
   * Sum of m c_v T before the step, J.
   */
  double energy_before;
  /**
   * Sum of m c_v T after the step, J.
   */
  double energy;
  /**
   * Seconds of wall-clock time that it took.
   */
  double seconds;
  /**
   * Sub-steps that were done again, shorter, for the tolerance.
   */
  int64_t rejected;
  /**
   * Iterations of conjugate gradients, of implicit integrators.
   */
  int64_t iterations;
  /**
   * Heat that sources brought in, J.
   */
  double heat_source;
  /**
   * Heat that came in through surfaces (flux_in, h_conv, emissivity), J.
   */
  double heat_surface;
  /**
   * Heat that came in from particles of fixed T, J; with the two above it makes up energy - energy_before.
   */
  double heat_fixed;
} diffusph_report;

#ifdef __cplusplus
extern "C" {
#endif /* __cplusplus */

/**
 * Creates a solver from words like "heat dim=3 kernel=M6 operator=brookshaw integrator=rkl2"; the catalogue "words"
 * lists them all. Worker threads are started now (as many as the process may use; the word threads= says otherwise)
 * and are joined by diffusph_destroy.
 *
 * \param words   what to create
 * \param s       receives the solver
 * \param why     receives the message on failure; may be NULL
 * \param why_len bytes that fit there
 *
 * Errors: UNKNOWN_WORD with the nearest known word, BAD_VALUE, NULL_POINTER.
 */
int32_t diffusph_create(const char *words,
                        struct diffusph_solver **s,
                        char *why,
                        int64_t why_len);

/**
 * Destroys a solver; its threads are gone when this returns. NULL is fine. In a forked child it frees what can be
 * freed and waits for nothing.
 *
 * Errors: BUSY while another call uses the solver; it lives on then.
 */
int32_t diffusph_destroy(struct diffusph_solver *s);

/**
 * What the last failed call on this solver had to say: which argument, which index, which value, and what to do.
 * Empty if none has failed. Where the solver cannot be asked (NULL, BUSY, FORKED), the text says that, and so does
 * the status.
 *
 * \param buf receives the text, cut where it does not fit
 * \param len bytes that fit there
 */
int32_t diffusph_message(struct diffusph_solver *s,
                         char *buf,
                         int64_t len);

/**
 * The number of particles; 0 before diffusph_set_particles.
 */
int32_t diffusph_particles(struct diffusph_solver *s, int64_t *n);

/**
 * The number of dimensions: 1, 2 or 3, as created.
 */
int32_t diffusph_dimensions(struct diffusph_solver *s, int64_t *dim);

/**
 * The box. Without it, space is open.
 *
 * \param lo       lower bounds, one per dimension, m
 * \param hi       upper bounds, one per dimension, m
 * \param periodic one per dimension, not 0 where the box repeats itself; NULL for none
 *
 * Errors: BAD_VALUE for bounds that are not finite or a periodic axis without length.
 */
int32_t diffusph_set_box(struct diffusph_solver *s,
                         const double *lo,
                         const double *hi,
                         const int32_t *periodic);

/**
 * Positions, and with them, where given, masses, densities and smoothing lengths. The same number of particles as
 * before moves them, and they keep everything else; where the number changes, what was given per particle must be given
 * again, or as one number: until then, calls that need it answer OUT_OF_ORDER and name it. Nothing is copied twice: a host's own layout is described by `stride`, so x[n][3] has 3, and
 * xyzh(4,n) of Fortran has 4.
 *
 * \param n      particles
 * \param x      positions, m; particle i at x[i * stride], dim doubles
 * \param stride doubles from one particle to the next
 * \param m      masses, kg, packed; NULL keeps what was set
 * \param rho    densities, kg/m^3, packed; NULL keeps what was set, or sums over neighbours
 * \param h      smoothing lengths, m, packed; NULL keeps what was set, or computes h_fac (m/rho)^(1/dim)
 *
 * Errors: BAD_VALUE naming the first bad element, NO_MEMORY.
 */
int32_t diffusph_set_particles(struct diffusph_solver *s,
                               int64_t n,
                               const double *x,
                               int64_t stride,
                               const double *m,
                               const double *rho,
                               const double *h);

/**
 * A quantity of each particle, in the host's order; the catalogue "fields" lists them with their units. "x" moves
 * the particles; "u" sets T, which from then on follows where c_v is set; "b" sets b_x, b_y and b_z at once (dim doubles
 * per particle) and "kappa_ij" a symmetric tensor (xx; xx, yy, xy; xx, yy, zz, xy, yz, xz).
 *
 * \param name   which
 * \param data   values; particle i at data[i * stride]
 * \param n      particles, as many as were set
 * \param stride doubles from one particle to the next; 1 if packed
 *
 * Errors: UNKNOWN_WORD, OUT_OF_ORDER before diffusph_set_particles, WRONG_COUNT, BAD_VALUE naming the first bad element.
 */
int32_t diffusph_set(struct diffusph_solver *s,
                     const char *name,
                     const double *data,
                     int64_t n,
                     int64_t stride);

/**
 * One value of a quantity for all particles, or a number of the solver such as "time"; the catalogues "fields" and
 * "numbers" list them.
 *
 * Errors: UNKNOWN_WORD, BAD_VALUE.
 */
int32_t diffusph_set_number(struct diffusph_solver *s,
                            const char *name,
                            double value);

/**
 * A quantity as a function of T, in words: "kappa" as "power kappa0=1 T0=300 n=2.5" or "table T=300,400 kappa=1,2";
 * the catalogue "laws" lists them. Setting the quantity takes the law away.
 *
 * Errors: UNKNOWN_WORD, BAD_VALUE.
 */
int32_t diffusph_set_law(struct diffusph_solver *s,
                         const char *name,
                         const char *words);

/**
 * Conductivity as a function of the host; NULL takes it away. It is called for every stage, with `user`.
 */
int32_t diffusph_set_kappa_callback(struct diffusph_solver *s, diffusph_field_callback callback, void *user);

/**
 * Heat released per volume as a function of the host, in place of the field "source"; NULL takes it away, and so does
 * setting "source". It is called for every stage, with `user`, and at `looks=8` times of each step besides: where it changes
 * between stages, sub-steps are taken so short that it is followed. What is on for less than an eighth of a step may be
 * missed: take shorter steps, or more looks.
 */
int32_t diffusph_set_source_callback(struct diffusph_solver *s,
                                     diffusph_field_callback callback,
                                     void *user);

/**
 * A function told how far a step is, which can cancel it; NULL takes it away.
 */
int32_t diffusph_set_progress_callback(struct diffusph_solver *s,
                                       diffusph_progress_callback callback,
                                       void *user);

/**
 * A function told of failed calls, of what a file has that is not taken, of the plan when it changes, and of each step; NULL takes it away. Without it,
 * nothing is told: the library prints nothing.
 */
int32_t diffusph_set_log_callback(struct diffusph_solver *s,
                                  diffusph_log_callback callback,
                                  void *user);

/**
 * Advances by exactly dt, in as many sub-steps as the method needs. Whatever goes wrong, the solver is as it was before.
 *
 * \param dt     s, finite, not negative
 * \param report receives what was done; start with DIFFUSPH_REPORT_INIT; may be NULL
 *
 * Errors: all codes above 0, OUT_OF_ORDER before T, m and kappa are set, BAD_VALUE, BOX_TOO_SMALL, NO_MEMORY.
 */
int32_t diffusph_step(struct diffusph_solver *s,
                      double dt,
                      struct diffusph_report *report);

/**
 * Makes the call that is running now return CANCELLED, with nothing changed; one whose work is nearly done may end as it
 * would have. From any thread, also from a callback and from a signal handler; the solver must not be destroyed meanwhile.
 * Does nothing if none is running.
 *
 * Errors: NULL_POINTER.
 */
int32_t diffusph_cancel(struct diffusph_solver *s);

/**
 * The largest stable explicit Euler step now, s; infinite where nothing diffuses.
 *
 * \param dt receives it
 *
 * Errors: as diffusph_step.
 */
int32_t diffusph_limit(struct diffusph_solver *s, double *dt);

/**
 * du/dt of each particle now, W/kg, for hosts that integrate themselves.
 *
 * \param out    receives the values; particle i at out[i * stride]
 * \param n      particles, as many as were set
 * \param stride doubles from one particle to the next; 1 if packed
 *
 * Errors: as diffusph_get.
 */
int32_t diffusph_rate(struct diffusph_solver *s, double *out, int64_t n, int64_t stride);

/**
 * What a step will do, what it leaves out and why, with bytes and pair operations; for people to read.
 *
 * \param buf    receives the text, cut where it does not fit; NULL if only its length is wanted
 * \param len    bytes that fit there
 * \param needed receives the bytes of the whole text with its NUL; may be NULL
 *
 * Errors: OUT_OF_ORDER before diffusph_set_particles and masses.
 */
int32_t diffusph_plan(struct diffusph_solver *s, char *buf, int64_t len, int64_t *needed);

/**
 * Which operator, kernel, h_fac and integrator reach an error cheapest on these particles, with T, kappa and all else as
 * they are now: many choices are tried on solvers of their own, which lasts as long as some hundred steps of dt. This
 * solver stays as it is. A given h is left aside, since h_fac is part of the choice; the progress callback is told the
 * share of choices tried, and callbacks of kappa and of the source are called for each.
 *
 * \param wanted    the most that T may be wrong by after dt: sqrt(sum (T - known)^2 / sum (known - mean)^2)
 * \param dt        s, positive; a step that is typical for the host
 * \param words     receives what to create a solver with
 * \param words_len bytes that fit there
 * \param error     receives what that choice errs by, the doubt of the reference included: weights that are exact for
 *                  polynomials of degree 6, or 4 where that fails
 * \param seconds   receives its wall-clock time from particles to answer, s: neighbours, weights, and a step of dt
 *
 * Errors: OUT_OF_REACH naming the most accurate choice; BAD_VALUE, also for a tensor kappa, for which there is no
 * reference; CANCELLED; as diffusph_step.
 */
int32_t diffusph_recommend(struct diffusph_solver *s,
                           double wanted,
                           double dt,
                           char *words,
                           int64_t words_len,
                           double *error,
                           double *seconds);

/**
 * A quantity of each particle, in the host's order; the catalogue "fields" lists them with their units. Vectors (x,
 * grad_T, flux, first_moment) have dim doubles per particle, all others one.
 *
 * \param name   which
 * \param out    receives the values; particle i at out[i * stride]; doubles between are not touched
 * \param n      particles, as many as were set
 * \param stride doubles from one particle to the next
 *
 * Errors: UNKNOWN_WORD, WRONG_COUNT, OUT_OF_ORDER naming what must be set first.
 */
int32_t diffusph_get(struct diffusph_solver *s,
                     const char *name,
                     double *out,
                     int64_t n,
                     int64_t stride);

/**
 * A number of the solver; the catalogue "numbers" lists them with their units.
 *
 * \param name  which
 * \param value receives it
 *
 * Errors: UNKNOWN_WORD, OUT_OF_ORDER.
 */
int32_t diffusph_get_number(struct diffusph_solver *s, const char *name, double *value);

/**
 * Where the time went since the solver was created: the i-th pass (from 0), in the order in which they first ran.
 *
 * \param i        which pass
 * \param name     receives its name
 * \param name_len bytes that fit there
 * \param seconds  receives its wall-clock time so far, s
 *
 * Errors: BAD_VALUE when there are not so many.
 */
int32_t diffusph_seconds(struct diffusph_solver *s,
                         int64_t i,
                         char *name,
                         int64_t name_len,
                         double *seconds);

/**
 * Writes the particles and their quantities, with the time: a .vtu, or a legacy .vtk if the name ends so. The file
 * appears whole or not at all. A .vtu holds all that decides how the solver goes on, except functions of the host; a legacy
 * file is for other tools and has no place for it.
 *
 * Errors: BAD_VALUE for another ending, IO, OUT_OF_ORDER before T, m and kappa are set.
 */
int32_t diffusph_write_vtk(struct diffusph_solver *s,
                           const char *path);

/**
 * Writes the next snapshot of a series and lists it: for "run.pvd", the files run_0000.vtu, run_0001.vtu and so on
 * beside it. Snapshots listed at this time or later are replaced, so that a restarted run goes on where it stands; no file
 * that an earlier entry needs (by a link, or as a piece of it) is touched, and no earlier entry is dropped, whether its file
 * can be seen or not. Whenever the process is killed, the list on disk names files of its times: a snapshot that takes the
 * place of another stands beside it first, as run_0002.new.vtu, and has its usual name once the list has no other of it.
 *
 * \param pvd_path the list, for ParaView; it ends in .pvd
 *
 * Errors: as diffusph_write_vtk; BAD_FILE when the list is none.
 */
int32_t diffusph_write_series(struct diffusph_solver *s,
                              const char *pvd_path);

/**
 * Takes particles from a VTK file (.vtu, .vtp, .pvtu, .pvtp, legacy .vtk). A snapshot of diffusph_write_vtk takes the place
 * of all that was set before (particles, quantities, numbers, laws, box and time), and the solver goes on from it to the bit
 * as the one that wrote it, if its words are the same; functions that were lent must be lent before. Of the file of another
 * program, positions are taken, every array with the name of a quantity that can be set, and the time if there is one.
 * In one and two dimensions particles may lie along any axes of the file, and are written along the same. The log is told
 * what the file has that is not taken, and what a legacy file of diffusph_write_vtk has no place for.
 *
 * Errors: IO, BAD_FILE, BAD_VALUE naming the first bad element, or where the particles fill more dimensions than the solver
 * has; OUT_OF_ORDER naming a function that the snapshot needs; nothing is changed then.
 */
int32_t diffusph_read_vtk(struct diffusph_solver *s,
                          const char *path);

/**
 * The number of items in a catalogue: "models", "words", "kernels", "operators", "means", "integrators", "laws",
 * "fields", "numbers", "rules" or "errors".
 *
 * \param list  which catalogue
 * \param count receives the number
 *
 * Errors: UNKNOWN_WORD.
 */
int32_t diffusph_count(const char *list,
                       int64_t *count);

/**
 * The name of the i-th item (from 0) of a catalogue.
 *
 * Errors: UNKNOWN_WORD, BAD_VALUE when there are not so many.
 */
int32_t diffusph_name(const char *list, int64_t i, char *buf, int64_t len);

/**
 * What the i-th item (from 0) of a catalogue is, in a line; for fields and numbers with the unit in brackets.
 *
 * Errors: as diffusph_name.
 */
int32_t diffusph_about(const char *list, int64_t i, char *buf, int64_t len);

/**
 * The name of a status, like "BAD_VALUE".
 *
 * Errors: BAD_VALUE when there is no such status.
 */
int32_t diffusph_error_name(int32_t code, char *buf, int64_t len);

/**
 * The version of the library, like "0.1.0".
 */
int32_t diffusph_version(char *buf, int64_t len);

/**
 * The version of the library as a number, major * 10000 + minor * 100 + patch; not a status.
 */
int32_t diffusph_version_number(void);

/**
 * The version of the binary interface; not a status. A host works with any library that answers DIFFUSPH_ABI.
 */
int32_t diffusph_abi_version(void);

#ifdef __cplusplus
} /* extern "C" */
#endif /* __cplusplus */

#endif  /* DIFFUSPH_H */
