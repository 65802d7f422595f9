"""Particles that Python moves: a vortex winds up a hot half while heat is conducted. T goes on with its particle."""

import diffusph
import numpy as np

n, dt = 40, 0.01
state = np.zeros((n * n, 4))  # x, y, T and something of ours, side by side
x, T = state[:, :2], state[:, 2]  # the library reads and writes them where they lie
x[:] = (np.indices((n, n)).reshape(2, -1).T + 0.5) / n - 0.5
T[:] = x[:, 0] > 0

with diffusph.Solver("heat dim=2") as solver:
    for step in range(20):
        angle = 4.0 * dt * np.exp(-((4.0 * np.hypot(*x.T)) ** 2))
        turned = np.exp(1j * angle) * (x[:, 0] + 1j * x[:, 1])
        x[:, 0], x[:, 1] = turned.real, turned.imag
        solver.set_particles(x, m=1.0 / n**2, rho=1.0)
        if step == 0:
            solver.set("T", T)
            solver.set("kappa", 1e-3)
        report = solver.step(dt)
    solver.get("T", out=T)

print(f"t = {report.time:.2f} s: T from {T.min():.3f} to {T.max():.3f}, mean {T.mean():.6f}")
