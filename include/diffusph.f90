! diffusph: diffusion on SPH particles. The Fortran interface, for Fortran 2003 and later.
!
! Compile this file with your own compiler and link with libdiffusph. Every function of the C interface is here under its
! own name, with the same arguments; diffusph.h documents them. In Fortran:
!
! - Each function answers a status: DIFFUSPH_DONE (0), > 0 (nothing changed, ask for less), < 0 (the call was wrong).
! - A solver is a type(c_ptr).
! - Texts are handed over as diffusph_c('kappa'), and come back through diffusph_text(buffer), the buffer being a
!   character(len=256) or an array of characters.
! - Arrays of any shape are passed as they are: x(3, n) with stride 3, xyzh(4, n) with stride 4, xyzh(4, 1) with stride 4
!   for the last row. Arguments that may be NULL in C are optional. Particles are numbered from 0.
! - A callback is passed as c_funloc(my_function), c_null_funptr takes it away; it has the abstract interface below.
module diffusph
    use, intrinsic :: iso_c_binding, only: c_char, c_double, c_funptr, c_int32_t, c_int64_t, c_loc, c_null_char, &
        c_null_ptr, c_ptr
    implicit none
    private :: c_char, c_double, c_funptr, c_int32_t, c_int64_t, c_loc, c_null_char, c_null_ptr, c_ptr
    private :: c_create, c_set_box, c_set_particles, c_step, c_plan, text_of_string, text_of_array

    integer(c_int32_t), parameter :: DIFFUSPH_DONE = 0
    integer(c_int32_t), parameter :: DIFFUSPH_STEP_TOO_LARGE = 1
    integer(c_int32_t), parameter :: DIFFUSPH_NOT_FINITE = 2
    integer(c_int32_t), parameter :: DIFFUSPH_OUT_OF_BOUNDS = 3
    integer(c_int32_t), parameter :: DIFFUSPH_GROWTH = 4
    integer(c_int32_t), parameter :: DIFFUSPH_CANCELLED = 5
    integer(c_int32_t), parameter :: DIFFUSPH_NOT_CONVERGED = 6
    integer(c_int32_t), parameter :: DIFFUSPH_CALLBACK_FAILED = 7
    integer(c_int32_t), parameter :: DIFFUSPH_OUT_OF_REACH = 8
    integer(c_int32_t), parameter :: DIFFUSPH_NULL_POINTER = -1
    integer(c_int32_t), parameter :: DIFFUSPH_BAD_VALUE = -2
    integer(c_int32_t), parameter :: DIFFUSPH_WRONG_COUNT = -3
    integer(c_int32_t), parameter :: DIFFUSPH_OUT_OF_ORDER = -4
    integer(c_int32_t), parameter :: DIFFUSPH_UNKNOWN_WORD = -5
    integer(c_int32_t), parameter :: DIFFUSPH_BOX_TOO_SMALL = -6
    integer(c_int32_t), parameter :: DIFFUSPH_IO = -7
    integer(c_int32_t), parameter :: DIFFUSPH_BAD_FILE = -8
    integer(c_int32_t), parameter :: DIFFUSPH_NO_MEMORY = -9
    integer(c_int32_t), parameter :: DIFFUSPH_BUSY = -10
    integer(c_int32_t), parameter :: DIFFUSPH_POISONED = -11
    integer(c_int32_t), parameter :: DIFFUSPH_FORKED = -12
    integer(c_int32_t), parameter :: DIFFUSPH_PANIC = -13

    integer(c_int32_t), parameter :: DIFFUSPH_LOG_ERROR = 1
    integer(c_int32_t), parameter :: DIFFUSPH_LOG_WARNING = 2
    integer(c_int32_t), parameter :: DIFFUSPH_LOG_INFO = 3
    integer(c_int32_t), parameter :: DIFFUSPH_LOG_DEBUG = 4

    integer(c_int32_t), parameter :: DIFFUSPH_VERSION_MAJOR = 0
    integer(c_int32_t), parameter :: DIFFUSPH_VERSION_MINOR = 1
    integer(c_int32_t), parameter :: DIFFUSPH_VERSION_PATCH = 0
    integer(c_int32_t), parameter :: DIFFUSPH_ABI = 1

    ! What a step did. The size is right from the start: leave it.
    type, bind(c) :: diffusph_report
        integer(c_int64_t) :: size = 17 * 8
        real(c_double) :: time = 0          ! reached, s
        real(c_double) :: dt = 0            ! the step, s
        integer(c_int64_t) :: substeps = 0
        integer(c_int64_t) :: stages = 0    ! of the last sub-step
        integer(c_int64_t) :: applications = 0
        real(c_double) :: limit = 0         ! a stable explicit step, s; diffusph_limit finds the largest
        real(c_double) :: T_min = 0
        real(c_double) :: T_max = 0
        real(c_double) :: energy_before = 0 ! sum of m c_v T, J
        real(c_double) :: energy = 0
        real(c_double) :: seconds = 0       ! of wall-clock time
        integer(c_int64_t) :: rejected = 0  ! sub-steps done again, shorter, for the tolerance
        integer(c_int64_t) :: iterations = 0 ! of conjugate gradients, of implicit integrators
        real(c_double) :: heat_source = 0   ! that sources brought in, J
        real(c_double) :: heat_surface = 0  ! through surfaces
        real(c_double) :: heat_fixed = 0    ! from particles of fixed T
    end type

    ! What callbacks look like. Particles are numbered from 0.
    abstract interface
        function diffusph_field_callback(user, time, n, particle, T, out) bind(c) result(status)
            import :: c_double, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: user
            real(c_double), value :: time
            integer(c_int64_t), value :: n
            integer(c_int32_t), intent(in) :: particle(n)
            real(c_double), intent(in) :: T(n)
            real(c_double), intent(out) :: out(n)
            integer(c_int32_t) :: status
        end function

        function diffusph_progress_callback(user, time, share) bind(c) result(status)
            import :: c_double, c_int32_t, c_ptr
            type(c_ptr), value :: user
            real(c_double), value :: time, share
            integer(c_int32_t) :: status
        end function

        subroutine diffusph_log_callback(user, level, text) bind(c)
            import :: c_char, c_int32_t, c_ptr
            type(c_ptr), value :: user
            integer(c_int32_t), value :: level
            character(kind=c_char), intent(in) :: text(*)
        end subroutine
    end interface

    ! The C string in a buffer as a Fortran text.
    interface diffusph_text
        module procedure text_of_string, text_of_array
    end interface

    interface
        ! Those with optional arguments have theirs below: before Fortran 2018, C's are not optional.
        function c_create(words, s, why, why_len) bind(c, name='diffusph_create') result(status)
            import :: c_char, c_int32_t, c_int64_t, c_ptr
            character(kind=c_char), intent(in) :: words(*)
            type(c_ptr), intent(inout) :: s
            type(c_ptr), value :: why
            integer(c_int64_t), value :: why_len
            integer(c_int32_t) :: status
        end function

        function diffusph_destroy(s) bind(c) result(status)
            import :: c_int32_t, c_ptr
            type(c_ptr), value :: s
            integer(c_int32_t) :: status
        end function

        function diffusph_message(s, buf, len) bind(c) result(status)
            import :: c_char, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(inout) :: buf(*)
            integer(c_int64_t), value :: len
            integer(c_int32_t) :: status
        end function

        function diffusph_particles(s, n) bind(c) result(status)
            import :: c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            integer(c_int64_t), intent(inout) :: n
            integer(c_int32_t) :: status
        end function

        function diffusph_dimensions(s, dim) bind(c) result(status)
            import :: c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            integer(c_int64_t), intent(inout) :: dim
            integer(c_int32_t) :: status
        end function

        function c_set_box(s, lo, hi, periodic) bind(c, name='diffusph_set_box') result(status)
            import :: c_double, c_int32_t, c_ptr
            type(c_ptr), value :: s
            real(c_double), intent(in) :: lo(*), hi(*)
            type(c_ptr), value :: periodic
            integer(c_int32_t) :: status
        end function

        function c_set_particles(s, n, x, stride, m, rho, h) bind(c, name='diffusph_set_particles') result(status)
            import :: c_double, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            integer(c_int64_t), value :: n
            real(c_double), intent(in) :: x(*)
            integer(c_int64_t), value :: stride
            type(c_ptr), value :: m, rho, h
            integer(c_int32_t) :: status
        end function

        function diffusph_set(s, name, data, n, stride) bind(c) result(status)
            import :: c_char, c_double, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: name(*)
            real(c_double), intent(in) :: data(*)
            integer(c_int64_t), value :: n, stride
            integer(c_int32_t) :: status
        end function

        function diffusph_set_number(s, name, value) bind(c) result(status)
            import :: c_char, c_double, c_int32_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: name(*)
            real(c_double), value :: value
            integer(c_int32_t) :: status
        end function

        function diffusph_set_law(s, name, words) bind(c) result(status)
            import :: c_char, c_int32_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: name(*), words(*)
            integer(c_int32_t) :: status
        end function

        function diffusph_set_kappa_callback(s, callback, user) bind(c) result(status)
            import :: c_funptr, c_int32_t, c_ptr
            type(c_ptr), value :: s
            type(c_funptr), value :: callback
            type(c_ptr), value :: user
            integer(c_int32_t) :: status
        end function

        function diffusph_set_source_callback(s, callback, user) bind(c) result(status)
            import :: c_funptr, c_int32_t, c_ptr
            type(c_ptr), value :: s
            type(c_funptr), value :: callback
            type(c_ptr), value :: user
            integer(c_int32_t) :: status
        end function

        function diffusph_set_progress_callback(s, callback, user) bind(c) result(status)
            import :: c_funptr, c_int32_t, c_ptr
            type(c_ptr), value :: s
            type(c_funptr), value :: callback
            type(c_ptr), value :: user
            integer(c_int32_t) :: status
        end function

        function diffusph_set_log_callback(s, callback, user) bind(c) result(status)
            import :: c_funptr, c_int32_t, c_ptr
            type(c_ptr), value :: s
            type(c_funptr), value :: callback
            type(c_ptr), value :: user
            integer(c_int32_t) :: status
        end function

        function c_step(s, dt, report) bind(c, name='diffusph_step') result(status)
            import :: c_double, c_int32_t, c_ptr
            type(c_ptr), value :: s
            real(c_double), value :: dt
            type(c_ptr), value :: report
            integer(c_int32_t) :: status
        end function

        function diffusph_cancel(s) bind(c) result(status)
            import :: c_int32_t, c_ptr
            type(c_ptr), value :: s
            integer(c_int32_t) :: status
        end function

        function diffusph_limit(s, dt) bind(c) result(status)
            import :: c_double, c_int32_t, c_ptr
            type(c_ptr), value :: s
            real(c_double), intent(inout) :: dt
            integer(c_int32_t) :: status
        end function

        function diffusph_rate(s, out, n, stride) bind(c) result(status)
            import :: c_double, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            real(c_double), intent(inout) :: out(*)
            integer(c_int64_t), value :: n, stride
            integer(c_int32_t) :: status
        end function

        function c_plan(s, buf, len, needed) bind(c, name='diffusph_plan') result(status)
            import :: c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            type(c_ptr), value :: buf
            integer(c_int64_t), value :: len
            type(c_ptr), value :: needed
            integer(c_int32_t) :: status
        end function

        function diffusph_recommend(s, wanted, dt, words, words_len, error, seconds) bind(c) result(status)
            import :: c_char, c_double, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            real(c_double), value :: wanted, dt
            character(kind=c_char), intent(inout) :: words(*)
            integer(c_int64_t), value :: words_len
            real(c_double), intent(inout) :: error, seconds
            integer(c_int32_t) :: status
        end function

        function diffusph_get(s, name, out, n, stride) bind(c) result(status)
            import :: c_char, c_double, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: name(*)
            real(c_double), intent(inout) :: out(*)
            integer(c_int64_t), value :: n, stride
            integer(c_int32_t) :: status
        end function

        function diffusph_get_number(s, name, value) bind(c) result(status)
            import :: c_char, c_double, c_int32_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: name(*)
            real(c_double), intent(inout) :: value
            integer(c_int32_t) :: status
        end function

        function diffusph_seconds(s, i, name, name_len, seconds) bind(c) result(status)
            import :: c_char, c_double, c_int32_t, c_int64_t, c_ptr
            type(c_ptr), value :: s
            integer(c_int64_t), value :: i
            character(kind=c_char), intent(inout) :: name(*)
            integer(c_int64_t), value :: name_len
            real(c_double), intent(inout) :: seconds
            integer(c_int32_t) :: status
        end function

        function diffusph_write_vtk(s, path) bind(c) result(status)
            import :: c_char, c_int32_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int32_t) :: status
        end function

        function diffusph_write_series(s, pvd_path) bind(c) result(status)
            import :: c_char, c_int32_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: pvd_path(*)
            integer(c_int32_t) :: status
        end function

        function diffusph_read_vtk(s, path) bind(c) result(status)
            import :: c_char, c_int32_t, c_ptr
            type(c_ptr), value :: s
            character(kind=c_char), intent(in) :: path(*)
            integer(c_int32_t) :: status
        end function

        function diffusph_count(list, count) bind(c) result(status)
            import :: c_char, c_int32_t, c_int64_t
            character(kind=c_char), intent(in) :: list(*)
            integer(c_int64_t), intent(inout) :: count
            integer(c_int32_t) :: status
        end function

        function diffusph_name(list, i, buf, len) bind(c) result(status)
            import :: c_char, c_int32_t, c_int64_t
            character(kind=c_char), intent(in) :: list(*)
            integer(c_int64_t), value :: i
            character(kind=c_char), intent(inout) :: buf(*)
            integer(c_int64_t), value :: len
            integer(c_int32_t) :: status
        end function

        function diffusph_about(list, i, buf, len) bind(c) result(status)
            import :: c_char, c_int32_t, c_int64_t
            character(kind=c_char), intent(in) :: list(*)
            integer(c_int64_t), value :: i
            character(kind=c_char), intent(inout) :: buf(*)
            integer(c_int64_t), value :: len
            integer(c_int32_t) :: status
        end function

        function diffusph_error_name(code, buf, len) bind(c) result(status)
            import :: c_char, c_int32_t, c_int64_t
            integer(c_int32_t), value :: code
            character(kind=c_char), intent(inout) :: buf(*)
            integer(c_int64_t), value :: len
            integer(c_int32_t) :: status
        end function

        function diffusph_version(buf, len) bind(c) result(status)
            import :: c_char, c_int32_t, c_int64_t
            character(kind=c_char), intent(inout) :: buf(*)
            integer(c_int64_t), value :: len
            integer(c_int32_t) :: status
        end function

        function diffusph_version_number() bind(c) result(number)
            import :: c_int32_t
            integer(c_int32_t) :: number
        end function

        function diffusph_abi_version() bind(c) result(number)
            import :: c_int32_t
            integer(c_int32_t) :: number
        end function
    end interface

contains

    ! All are recursive, so that -fno-automatic does not share what is theirs between threads.

    recursive function diffusph_create(words, s, why, why_len) result(status)
        character(kind=c_char), intent(in) :: words(*)
        type(c_ptr), intent(inout) :: s
        character(kind=c_char), intent(inout), optional, target :: why(*)
        integer(c_int64_t), value :: why_len
        integer(c_int32_t) :: status
        type(c_ptr) :: to_why
        to_why = c_null_ptr
        if (present(why)) to_why = c_loc(why(1))
        status = c_create(words, s, to_why, why_len)
    end function

    recursive function diffusph_set_box(s, lo, hi, periodic) result(status)
        type(c_ptr), value :: s
        real(c_double), intent(in) :: lo(*), hi(*)
        integer(c_int32_t), intent(in), optional, target :: periodic(*)
        integer(c_int32_t) :: status
        type(c_ptr) :: to_periodic
        to_periodic = c_null_ptr
        if (present(periodic)) to_periodic = c_loc(periodic(1))
        status = c_set_box(s, lo, hi, to_periodic)
    end function

    recursive function diffusph_set_particles(s, n, x, stride, m, rho, h) result(status)
        type(c_ptr), value :: s
        integer(c_int64_t), value :: n
        real(c_double), intent(in) :: x(*)
        integer(c_int64_t), value :: stride
        real(c_double), intent(in), optional, target :: m(*), rho(*), h(*)
        integer(c_int32_t) :: status
        type(c_ptr) :: to_m, to_rho, to_h
        to_m = c_null_ptr
        to_rho = c_null_ptr
        to_h = c_null_ptr
        if (present(m)) to_m = c_loc(m(1))
        if (present(rho)) to_rho = c_loc(rho(1))
        if (present(h)) to_h = c_loc(h(1))
        status = c_set_particles(s, n, x, stride, to_m, to_rho, to_h)
    end function

    recursive function diffusph_step(s, dt, report) result(status)
        type(c_ptr), value :: s
        real(c_double), value :: dt
        type(diffusph_report), intent(inout), optional, target :: report
        integer(c_int32_t) :: status
        type(c_ptr) :: to_report
        to_report = c_null_ptr
        if (present(report)) to_report = c_loc(report)
        status = c_step(s, dt, to_report)
    end function

    recursive function diffusph_plan(s, buf, len, needed) result(status)
        type(c_ptr), value :: s
        character(kind=c_char), intent(inout), optional, target :: buf(*)
        integer(c_int64_t), value :: len
        integer(c_int64_t), intent(inout), optional, target :: needed
        integer(c_int32_t) :: status
        type(c_ptr) :: to_buf, to_needed
        to_buf = c_null_ptr
        to_needed = c_null_ptr
        if (present(buf)) to_buf = c_loc(buf(1))
        if (present(needed)) to_needed = c_loc(needed)
        status = c_plan(s, to_buf, len, to_needed)
    end function

    ! A Fortran text, without blanks at its end, as a C string.
    recursive function diffusph_c(text) result(string)
        character(len=*), intent(in) :: text
        character(kind=c_char, len=len_trim(text) + 1) :: string
        string = trim(text) // c_null_char
    end function

    ! Texts of any length are the functions' own names: gfortran loses the length of those in result(), with
    ! -fno-automatic.
    recursive function text_of_string(buffer)
        character(kind=c_char, len=*), intent(in) :: buffer
        character(len=:), allocatable :: text_of_string
        integer :: ends
        ends = index(buffer, c_null_char)
        if (ends == 0) ends = len(buffer) + 1
        text_of_string = buffer(:ends - 1)
    end function

    recursive function text_of_array(buffer)
        character(kind=c_char), intent(in) :: buffer(:)
        character(len=:), allocatable :: text_of_array
        integer :: i, ends
        ends = size(buffer)
        do i = size(buffer), 1, -1
            if (buffer(i) == c_null_char) ends = i - 1
        end do
        text_of_array = repeat(' ', ends)
        do i = 1, ends
            text_of_array(i:i) = buffer(i)
        end do
    end function

    ! What the last failed call on a solver had to say.
    recursive function diffusph_error(s)
        type(c_ptr), intent(in) :: s
        character(len=:), allocatable :: diffusph_error
        character(kind=c_char, len=1024) :: buffer
        integer(c_int32_t) :: status
        buffer(1:1) = c_null_char
        status = diffusph_message(s, buffer, len(buffer, c_int64_t))
        diffusph_error = text_of_string(buffer)
        if (status /= DIFFUSPH_DONE .and. len(diffusph_error) == 0) diffusph_error = 'there is no message'
    end function
end module
