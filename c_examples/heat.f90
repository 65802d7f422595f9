! From Fortran: a periodic plate heated by a source that is a function of the host.
!
! With the source A sin(kx) and T = 0 at first, T = A/(kappa k^2) (1 - exp(-kappa k^2 t / (rho c_v))) sin(kx).
module heating
    use, intrinsic :: iso_c_binding
    implicit none
    real(c_double), parameter :: pi = acos(-1.0_c_double), k = 2*pi, strength = 40
contains
    ! Heat released per volume; user is the host's array of positions.
    function released(user, time, n, particle, T, out) bind(c) result(status)
        type(c_ptr), value :: user
        real(c_double), value :: time
        integer(c_int64_t), value :: n
        integer(c_int32_t), intent(in) :: particle(n)
        real(c_double), intent(in) :: T(n)
        real(c_double), intent(out) :: out(n)
        integer(c_int32_t) :: status
        real(c_double), pointer :: x(:, :)
        call c_f_pointer(user, x, [2_c_int64_t, n])
        out = strength*sin(k*x(1, particle + 1)) ! particles are numbered from 0
        status = merge(0_c_int32_t, 1_c_int32_t, time >= 0 .and. all(T < huge(T)))
    end function
end module

program heat
    use, intrinsic :: iso_c_binding
    use, intrinsic :: iso_fortran_env, only: error_unit
    use diffusph
    use heating
    implicit none
    integer, parameter :: side = 24, steps = 10
    integer(c_int64_t), parameter :: n = side**2
    real(c_double), parameter :: rho = 2, kappa = 0.6_c_double, time = 0.05_c_double
    real(c_double), target :: x(2, n)
    real(c_double) :: T(n), m(n), expected(n), error, limit
    type(c_ptr) :: s = c_null_ptr
    type(diffusph_report) :: report
    character(len=512) :: why
    integer :: i

    do i = 1, int(n)
        x(:, i) = [mod(i - 1, side) + 0.5_c_double, (i - 1)/side + 0.5_c_double]/side
    end do
    m = rho/real(n, c_double)
    T = 0

    if (diffusph_create(diffusph_c('heat dim=2 kernel=M4 integrator=rkl2'), s, why, len(why, c_int64_t)) /= 0) then
        write (error_unit, '(a)') diffusph_text(why)
        error stop 1
    end if
    call check(diffusph_set_box(s, [0.0_c_double, 0.0_c_double], [1.0_c_double, 1.0_c_double], [1_c_int32_t, 1_c_int32_t]))
    call check(diffusph_set_particles(s, n, x, 2_c_int64_t, m))
    call check(diffusph_set(s, diffusph_c('T'), T, n, 1_c_int64_t))
    call check(diffusph_set_number(s, diffusph_c('kappa'), kappa))
    call check(diffusph_set_source_callback(s, c_funloc(released), c_loc(x)))

    ! An error made on purpose: it says what is wrong, and changes nothing.
    if (diffusph_set_number(s, diffusph_c('kappa'), -1.0_c_double) /= DIFFUSPH_BAD_VALUE) error stop 2
    print '(2a)', 'on purpose: ', diffusph_error(s)
    if (index(diffusph_error(s), 'kappa is -1') /= 1) error stop 3

    call check(diffusph_limit(s, limit))
    do i = 1, steps
        call check(diffusph_step(s, time/steps, report))
        print '(a,f6.3,a,i0,a,f6.3,a)', 't = ', report%time, ': ', report%stages, ' stages, ', report%dt/limit, ' explicit steps'
    end do
    call check(diffusph_get(s, diffusph_c('T'), T, n, 1_c_int64_t))
    call check(diffusph_write_vtk(s, diffusph_c('heat_f90.vtu')))
    call check(diffusph_destroy(s))

    expected = strength/(kappa*k**2)*(1 - exp(-kappa*k**2*time/rho))*sin(k*x(1, :))
    error = maxval(abs(T - expected))
    print '(a,es8.1)', 'error: ', error
    if (error > 0.05_c_double*(k/side)**2*maxval(expected)) error stop 4 ! second order in the spacing
contains
    subroutine check(status)
        integer(c_int32_t), intent(in) :: status
        if (status == DIFFUSPH_DONE) return
        write (error_unit, '(a)') diffusph_error(s)
        error stop 1
    end subroutine
end program
