"""A hot disc on a cloud of numpy points: conducts, and draws what came of it (heat.png, where matplotlib is installed)."""

import sys

import diffusph
import numpy as np

n = 64
random = np.random.default_rng(1)
x = (np.indices((n, n)).reshape(2, -1).T + 0.5 + random.uniform(-0.2, 0.2, (n * n, 2))) / n
T = np.where(np.hypot(*(x - 0.5).T) < 0.2, 400.0, 300.0)

with diffusph.Solver("heat dim=2 kernel=M6") as solver:
    solver.set_particles(x, m=1.0 / n**2, rho=1.0)
    solver.set("T", T)
    solver.set("kappa", 0.6)
    report = solver.step(0.02)
    solver.get("T", out=T)

print(f"T from {report.T_min:.1f} to {report.T_max:.1f} K in {report.stages} stages; energy {report.energy:.6f} J")
try:
    import matplotlib.pyplot as plt
except ImportError:
    sys.exit()
plt.figure(figsize=(5, 4))
plt.scatter(*x.T, c=T, s=6)
plt.colorbar(label="T, K")
plt.gca().set_aspect("equal")
plt.savefig("heat.png", dpi=150)
