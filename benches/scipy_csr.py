"""The rival of the benchmark: forward Euler with scipy's compressed sparse rows on the same particles.

scipy_csr.py POSITIONS N: raw doubles of N^3 points in the periodic unit cube. For each line "steps" on standard input
it prints the seconds of one step, the mean over so many.
"""
import sys
import time

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

path, n = sys.argv[1], int(sys.argv[2])
x = np.fromfile(path).reshape(-1, 3) % 1.0
count, h = len(x), 1.3 / n
tree = cKDTree(x, boxsize=1.0)
rows = []
for start in range(0, count, 50_000):
    part = cKDTree(x[start : start + 50_000], boxsize=1.0)
    near = part.sparse_distance_matrix(tree, 2 * h, output_type="coo_matrix").tocsr()
    q = near.data / h
    # M4: sigma = 1/pi, -2 f'(q)/q, in units of 1/h^5; the particle itself has distance 0 and no weight.
    slope = np.where(q < 1, 2.25 * q - 3.0, -0.75 * (2 - q) ** 2 / np.maximum(q, 1e-300))
    near.data = np.where(q > 0, -2 * slope / (np.pi * h**5 * count), 0.0)
    rows.append(near)
matrix = sparse.vstack(rows, format="csr")
matrix = matrix - sparse.diags(np.asarray(matrix.sum(axis=1)).ravel())
matrix.sort_indices()
matrix.data *= 0.03 / n**2
t = np.prod(np.sin(2 * np.pi * x), axis=1)
t += matrix @ t
for line in sys.stdin:
    steps = int(line)
    begin = time.perf_counter()
    for _ in range(steps):
        t += matrix @ t
    print((time.perf_counter() - begin) / steps, flush=True)
