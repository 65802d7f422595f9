"""What include/diffusph.py promises, tried by Python itself. Called with the name of a check."""

import gc
import inspect
import json
import sys
import threading
import time

import diffusph
import numpy as np

N = 20


def cloud():
    return (np.indices((N, N)).reshape(2, -1).T + 0.5) / N


def solver(words="heat dim=2 threads=1", x=None):
    s = diffusph.Solver(words)
    s.set_box([0, 0], [1, 1], [True, True])
    s.set_particles(cloud() if x is None else x, m=1 / N**2, rho=1.0)
    s.set("kappa", 1.0)
    s.set("T", np.sin(2 * np.pi * cloud()[:, 0]))
    return s


def raises(kind, says, call):
    try:
        call()
    except kind as error:
        assert says in str(error), (says, str(error))
        return error
    raise AssertionError(f"nothing was raised where '{says}' was expected")


def tables():
    """The functions and the report, for a comparison with the header."""
    names = {"c_char_p": "char *", "LP_c_char": "char *", "c_long": "int64_t", "LP_c_long": "int64_t *", "c_int": "int32_t",
             "LP_c_int": "int32_t *", "c_double": "double", "LP_c_double": "double *", "c_void_p": "void *",
             "LP_c_void_p": "void * *", "LP_Report": "diffusph_report *"}
    callbacks = {diffusph._field_callback: "diffusph_field_callback", diffusph._log_callback: "diffusph_log_callback",
                 diffusph._progress_callback: "diffusph_progress_callback"}
    said = lambda kind: callbacks.get(kind) or names[kind.__name__]
    functions = {name: [said(kind) for kind in kinds] for name, kinds in diffusph._FUNCTIONS.items()}
    report = [[said(kind), name] for name, kind in diffusph.Report._fields_]
    print(json.dumps({"functions": functions, "report": report, "abi": diffusph.ABI, "version": diffusph.version()}))


def arrays():
    """Any layout, with the same bits; what can be read where it lies is not copied."""
    x, k = cloud(), 2 * np.pi
    T = np.sin(k * x[:, 0])
    usual = solver()
    usual.step(1e-3)
    expected, positions = usual.get("T"), usual.get("x")
    wide = np.zeros((N * N, 7))
    wide[:, 2:4], wide[:, 5] = x, T
    record = np.zeros(N * N, dtype=[("id", "i4"), ("x", "f8", 2), ("T", "f8")])
    record["x"], record["T"] = x, T
    packed = np.zeros(N * N, dtype=np.dtype([("flag", "i1"), ("T", "f8")]))
    packed["T"] = T
    exact = [(wide[:, 2:4], wide[:, 5]), (np.asfortranarray(x), T), (record["x"], record["T"]), (x, packed["T"]),
             (x[::-1][::-1], T[::-1][::-1]), (x.tolist(), T.tolist()), (x.astype(">f8"), T.astype(">f8")), (x, T[:, None])]
    for place, t in exact:
        s = solver(x=place)
        s.set("T", t)
        s.step(1e-3)
        for out in (None, np.empty(N * N), np.empty((N * N, 3))[:, 1], np.empty(2 * N * N)[::2], np.empty(N * N)[::-1],
                    np.empty((N * N, 1)), np.zeros_like(packed)["T"]):
            got = s.get("T", out=out)
            assert (out is None or got is out) and (np.ravel(got) == expected).all()
        for out in (np.empty((N * N, 2)), np.empty((N * N, 2), order="F"), np.empty((N * N, 4))[:, 1:3]):
            assert (s.get("x", out=out) == positions).all()
    # What lies between is not touched.
    wide[:] = 7.0
    s.get("T", out=wide[:, 3])
    assert (np.delete(wide, 3, axis=1) == 7.0).all() and (wide[:, 3] == expected).all()
    reversed_x = solver(x=x[::-1])
    assert (reversed_x.get("x") == x[::-1]).all()
    s.set("T", np.arange(N * N, dtype=np.int32))
    assert (s.get("T") == np.arange(N * N)).all() and (s.get("grad_T").shape, s.rate().shape) == ((N * N, 2), (N * N,))
    one = diffusph.Solver("heat dim=1")
    one.set_particles([0.1, 0.2, 0.3], m=[1.0, 1.0, 1.0], h=0.2)
    assert one.get("x").shape == (3,) and len(one) == 3 and one.dim == 1 and diffusph.Solver("heat")


def errors():
    s = solver()
    before = s.get("T")
    error = raises(diffusph.Error, "T[3] is NaN", lambda: s.set("T", np.where(np.arange(N * N) == 3, np.nan, 1.0)))
    assert (error.code, error.name) == (-2, "BAD_VALUE")
    assert raises(diffusph.Error, "did you mean 'kappa'", lambda: s.set("kapa", 1.0)).name == "UNKNOWN_WORD"
    raises(diffusph.Error, "did you mean 'heat'", lambda: diffusph.Solver("heet"))
    raises(diffusph.Error, "no catalogue 'kernal'", lambda: diffusph.catalogue("kernal"))
    raises(diffusph.Error, "expected 400", lambda: s.set("T", np.ones(3)))
    raises(diffusph.Error, "finite", lambda: s.step(float("nan")))
    raises(diffusph.Error, "missing.vtu", lambda: s.read_vtk("missing.vtu"))
    for says, call in [
        ("(400,), and needs (n, 2)", lambda: s.set("b", np.ones(N * N))),
        ("(400,), and needs (n, 2)", lambda: s.set_particles(np.ones(N * N))),
        ("(400, 3), and needs (n, 2)", lambda: s.set_particles(np.ones((N * N, 3)))),
        ("m has the shape (3,), and needs (400,)", lambda: s.set_particles(cloud(), m=np.ones(3))),
        ("(400, 2), and needs (400,)", lambda: s.get("T", out=np.ones((N * N, 2)))),
        ("(5,), and needs (400,)", lambda: s.get("T", out=np.ones(5))),
        ("kappa_ij has the shape (400,), and needs (n, 3)", lambda: s.set("kappa_ij", np.ones(N * N))),
        ("lo has 1 values", lambda: s.set_box([0], [1, 1])),
        ("contains a NUL", lambda: s.set("T\0", 1.0)),
        ("contains a NUL", lambda: s.write_vtk("a.vtu\0b")),
        ("contains a NUL", lambda: s.write_series("a.pvd\0b")),
        ("contains a NUL", lambda: s.read_vtk("a.vtu\0b")),
    ]:
        raises(ValueError, says, call)
    locked = np.ones(N * N)
    locked.flags.writeable = False
    for out in (locked, np.ones(N * N, dtype=np.float32), [0.0] * N * N, np.ones(N * N, dtype=">f8")):
        raises(TypeError, "doubles that can be written", lambda: s.get("T", out=out))
    raises(TypeError, "array of numbers", lambda: s.set("T", np.full(N * N, "a")))
    raises(TypeError, "array of numbers", lambda: s.set("T", np.full(N * N, 1j)))
    # Positions and what comes with them are taken together, or not at all.
    x = s.get("x")
    for number in ({"m": -1.0}, {"rho": 0.0}, {"h": np.nan}):
        raises(diffusph.Error, f"{list(number)[0]}[0] is", lambda: s.set_particles(x[:20] + 0.01, **number))
        assert len(s) == N * N and (s.get("x") == x).all()
    assert (s.get("T") == before).all() and s.number("time") == 0.0
    nobody = diffusph.Solver("heat dim=2")
    nobody.set_particles(np.zeros((0, 2)), m=1.0)
    assert len(nobody) == 0 and nobody.get("x").shape == (0, 2)


def callbacks():
    s = solver()
    seen = []
    s.set_source_callback(lambda time, particle, T, out: (seen.append(sorted(particle)), out.fill(3.0)))
    assert abs(s.step(1e-3).heat_source - 3e-3) < 1e-12 and seen[0] == list(range(N * N))
    before = s.get("T")

    def fails(time, particle, T, out):
        raise KeyError("mine")

    for lend in (s.set_source_callback, s.set_kappa_callback):
        lend(fails)
        error = raises(KeyError, "mine", lambda: s.step(1e-3))
        assert error.__cause__.name == "CALLBACK_FAILED" and (s.get("T") == before).all()
        lend(None)
    s.set("kappa", 1.0)

    def writes(time, particle, T, out):
        T[0] = 1.0

    def renumbers(time, particle, T, out):
        particle[:] = particle[::-1].copy()

    order = s.get("x")
    for bad in (writes, renumbers):
        s.set_source_callback(bad)
        raises(ValueError, "read-only", lambda: s.step(1e-3))
        assert (s.get("x") == order).all()
    s.set_source_callback(None)
    shares = []
    s.set_progress_callback(lambda time, share: shares.append(share))
    s.step(1e-3)
    assert shares and shares[-1] == 1.0
    s.set_progress_callback(lambda time, share: True)
    assert raises(diffusph.Error, "cancel", lambda: s.step(1e-3)).name == "CANCELLED"

    def interrupts(time, share):
        raise KeyboardInterrupt

    s.set_progress_callback(interrupts)
    raises(KeyboardInterrupt, "", lambda: s.step(1e-3))
    s.set_progress_callback(None)
    told = []
    s.set_log_callback(lambda level, text: told.append((level, text)))
    raises(diffusph.Error, "", lambda: s.set("kapa", 1.0))
    s.step(1e-3)
    assert told[0][0] == 1 and "kapa" in told[0][1] and {3, 4} <= {level for level, _ in told}
    # What was lent outlives its name, and what was called back may not call.
    s.set_log_callback(None)
    caught = []

    def calls(time, particle, T, out):
        caught.append(raises(diffusph.Error, "", lambda: s.get("T")).name)
        out.fill(1.0)

    s.set_source_callback(calls)
    del calls
    gc.collect()
    s.step(1e-3)
    assert set(caught) == {"BUSY"}


def threads():
    """Calls let other Python threads run; one of them may cancel; solvers do not know of each other."""
    s = solver("heat dim=2 integrator=euler threads=1 max_applications=1000000000")
    failed = []
    running = threading.Thread(target=lambda: failed.append(raises(diffusph.Error, "", lambda: s.step(1e3)).name))
    running.start()
    time.sleep(0.3)
    assert raises(diffusph.Error, "another call", lambda: s.get("T")).name == "BUSY"
    s.cancel()
    running.join(10)
    assert failed == ["CANCELLED"] and s.number("time") == 0.0
    others = [threading.Thread(target=lambda: failed.append(solver().step(1e-3).stages)) for _ in range(4)]
    [t.start() for t in others], [t.join() for t in others]
    assert len(failed) == 5


def ends():
    with solver() as s:
        s.step(1e-3)
        s.write_vtk("a.vtu"), s.write_series("a.pvd")
        again = diffusph.Solver("heat dim=2 threads=1")
        again.read_vtk("a.vtu")
        s.step(1e-3), again.step(1e-3)
        assert (s.get("T") == again.get("T")).all()
        assert "stages" in s.seconds() and "sort" in s.plan() and s.limit() > 0
        words, error, seconds = s.recommend(0.1, 1e-3)
        assert words.startswith("heat") and error <= 0.1 and seconds > 0
    for call in (lambda: s.step(1.0), lambda: s.get("T"), lambda: len(s)):
        raises(ValueError, "closed", call)
    s.close(), s.cancel()
    for _ in range(200):
        solver("heat dim=2 threads=2")
    gc.collect()
    assert threading.active_count() == 1 and len([*__import__("pathlib").Path("/proc/self/task").iterdir()]) < 20


def documented():
    """Whatever has a public name says what it is, with types."""
    for name in diffusph.__all__:
        item = getattr(diffusph, name)
        assert inspect.getdoc(item), name
    for name, item in inspect.getmembers(diffusph.Solver, inspect.isfunction):
        if name.startswith("_"):
            continue
        assert item.__doc__ and "return" in item.__annotations__, name


if __name__ == "__main__":
    globals()[sys.argv[1]]()
