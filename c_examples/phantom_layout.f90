! A host that keeps xyzh(4, n) and vxyzu(4, n) as Phantom does: positions with stride 4, h and u as the fourth row of each,
! handed over and taken back without copies, in single calls.
program phantom_layout
    use, intrinsic :: iso_c_binding
    use, intrinsic :: iso_fortran_env, only: error_unit
    use diffusph
    implicit none
    integer, parameter :: nx = 16, ny = 8, steps = 5
    integer(c_int64_t), parameter :: n = nx*ny*ny, four = 4
    real(c_double), parameter :: dx = 1.0_c_double/nx, k = 2*acos(-1.0_c_double), time = 0.01_c_double, h_fac = 1.2_c_double
    real(c_double) :: xyzh(4, n), vxyzu(4, n), u(n), velocities(3, n), error, energy_before, energy
    type(c_ptr) :: s = c_null_ptr
    character(len=512) :: why
    integer :: i

    do i = 0, int(n) - 1
        xyzh(:, i + 1) = [(mod(i, nx) + 0.5_c_double)*dx, (mod(i/nx, ny) + 0.5_c_double)*dx, &
                          (i/nx/ny + 0.5_c_double)*dx, h_fac*dx]
        vxyzu(:, i + 1) = [1.0_c_double, 2.0_c_double, 3.0_c_double, 2 + sin(k*xyzh(1, i + 1))]
    end do
    u = vxyzu(4, :)
    velocities = vxyzu(1:3, :)

    if (diffusph_create(diffusph_c('heat dim=3 kernel=M4'), s, why, len(why, c_int64_t)) /= 0) then
        write (error_unit, '(a)') diffusph_text(why)
        error stop 1
    end if
    call check(diffusph_set_box(s, [0.0_c_double, 0.0_c_double, 0.0_c_double], &
                                [1.0_c_double, ny*dx, ny*dx], [1_c_int32_t, 1_c_int32_t, 1_c_int32_t]))
    call check(diffusph_set_particles(s, n, xyzh, four))
    call check(diffusph_set_number(s, diffusph_c('m'), dx**3))
    call check(diffusph_set(s, diffusph_c('h'), xyzh(4, 1), n, four))
    call check(diffusph_set(s, diffusph_c('u'), vxyzu(4, 1), n, four))
    call check(diffusph_set_number(s, diffusph_c('kappa'), 1.0_c_double))

    ! On purpose: a stride that is shorter than a position.
    if (diffusph_set_particles(s, n, xyzh, 2_c_int64_t) /= DIFFUSPH_BAD_VALUE) error stop 2
    print '(2a)', 'on purpose: ', diffusph_error(s)

    call check(diffusph_get_number(s, diffusph_c('energy'), energy_before))
    do i = 1, steps
        call check(diffusph_step(s, time/steps))
    end do
    call check(diffusph_get_number(s, diffusph_c('energy'), energy))
    call check(diffusph_get(s, diffusph_c('u'), vxyzu(4, 1), n, four))
    call check(diffusph_write_vtk(s, diffusph_c('phantom_layout.vtu')))
    call check(diffusph_destroy(s))

    error = maxval(abs(vxyzu(4, :) - (2 + exp(-k**2*time)*(u - 2))))
    print '(a,es8.1)', 'error: ', error
    if (error > 0.25_c_double*(k*dx)**2*k**2*time*exp(-k**2*time)) error stop 3 ! second order in the spacing
    if (abs(energy - energy_before) > 1e-13_c_double*energy_before) error stop 4
    ! The velocities between the energies are untouched.
    if (any(transfer(vxyzu(1:3, :), 0_c_int64_t, 3*int(n)) /= transfer(velocities, 0_c_int64_t, 3*int(n)))) error stop 5
contains
    subroutine check(status)
        integer(c_int32_t), intent(in) :: status
        if (status == DIFFUSPH_DONE) return
        write (error_unit, '(a)') diffusph_error(s)
        error stop 1
    end subroutine
end program
