"""Heat conduction as many write it by hand: Brookshaw's weights with M4 as a sparse matrix, explicit Euler steps.

Arguments, input, output and exit codes: as of lammps.py beside this file.
"""

import json
import math
import sys
import time

try:
    import numpy
    import scipy
    from scipy.sparse import csr_matrix
    from scipy.spatial import cKDTree
except Exception as reason:
    print(reason, file=sys.stderr)
    sys.exit(3)

SPACINGS = 1.3  # in a smoothing length
COURANT = 0.1  # of explicit steps, in squares of the spacing

dx, end = 1 / int(sys.argv[1]), float(sys.argv[2])
data = numpy.frombuffer(sys.stdin.buffer.read())
n = len(data) // 4
x, t = data[: 3 * n].reshape(n, 3), data[3 * n :].copy()
steps = math.ceil(end / (COURANT * dx * dx))
dt, h = end / steps, SPACINGS * dx

start = time.perf_counter()
pairs = cKDTree(x % 1.0, boxsize=1.0).query_pairs(2 * h, output_type="ndarray")
d = x[pairs[:, 0]] - x[pairs[:, 1]]
d -= numpy.round(d)
q = numpy.sqrt((d * d).sum(1)) / h
slope = numpy.where(q < 1, 2.25 * q - 3, -0.75 * (2 - q) ** 2 / q) / (math.pi * h**5)
weight = -2 * dx**3 * slope
i, j = numpy.concatenate([pairs, pairs[:, ::-1]]).T
matrix = csr_matrix((numpy.concatenate([weight, weight]), (i, j)), shape=(n, n))
diagonal = numpy.asarray(matrix.sum(1)).ravel()
for _ in range(steps):
    t += dt * (matrix @ t - diagonal * t)
seconds = time.perf_counter() - start
print(json.dumps({"version": scipy.__version__, "seconds": seconds, "steps": steps}))
sys.stdout.flush()
sys.stdout.buffer.write(t.tobytes())
