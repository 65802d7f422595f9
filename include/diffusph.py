"""Diffusion on SPH particles: the diffusph library for Python and numpy.

    import numpy as np, diffusph

    with diffusph.Solver("heat dim=3 kernel=M6") as solver:
        solver.set_particles(x, m=m)          # x[n, 3]; rho and h are found where they are not given
        solver.set("T", T)                    # one value per particle, or one for all
        solver.set("kappa", 0.6)
        report = solver.step(dt)              # exactly dt, or diffusph.Error and nothing changed
        solver.get("T", out=T)

Arrays of doubles are read and written where they lie, whatever their strides, as long as the components of a particle are
side by side; others are copied. Names are words, which `catalogue` lists with their units. What a call promises is said in
diffusph.h, function by function; everything that can fail raises `Error`.

The library is looked for beside this file, in ../lib (where an installation has it), and where the system looks for
libraries; the environment variable DIFFUSPH_LIBRARY names another one.
"""

from __future__ import annotations

import ctypes
import os
import threading
from pathlib import Path
from typing import Any, Callable, NamedTuple, Optional, Sequence

import numpy as np
import numpy.typing as npt

__all__ = ["Error", "Recommendation", "Report", "Solver", "catalogue", "version"]

#: The binary interface that this file speaks, DIFFUSPH_ABI in diffusph.h.
ABI = 1

Doubles = npt.NDArray[np.float64]

_text = ctypes.c_char_p
_buffer = ctypes.POINTER(ctypes.c_char)
_count = ctypes.c_int64
_counts = ctypes.POINTER(ctypes.c_int64)
_status = ctypes.c_int32
_flags = ctypes.POINTER(ctypes.c_int32)
_double = ctypes.c_double
_doubles = ctypes.POINTER(ctypes.c_double)
_numbers = ctypes.POINTER(ctypes.c_uint32)
_handle = ctypes.c_void_p
_handles = ctypes.POINTER(ctypes.c_void_p)

_field_callback = ctypes.CFUNCTYPE(_status, ctypes.c_void_p, _double, _count, _numbers, _doubles, _doubles)
_progress_callback = ctypes.CFUNCTYPE(_status, ctypes.c_void_p, _double, _double)
_log_callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, _status, _text)


class Report(ctypes.Structure):
    """What a step did: diffusph_report of diffusph.h."""

    _fields_ = [
        ("size", ctypes.c_int64),
        ("time", ctypes.c_double),
        ("dt", ctypes.c_double),
        ("substeps", ctypes.c_int64),
        ("stages", ctypes.c_int64),
        ("applications", ctypes.c_int64),
        ("limit", ctypes.c_double),
        ("T_min", ctypes.c_double),
        ("T_max", ctypes.c_double),
        ("energy_before", ctypes.c_double),
        ("energy", ctypes.c_double),
        ("seconds", ctypes.c_double),
        ("rejected", ctypes.c_int64),
        ("iterations", ctypes.c_int64),
        ("heat_source", ctypes.c_double),
        ("heat_surface", ctypes.c_double),
        ("heat_fixed", ctypes.c_double),
    ]

    def __repr__(self) -> str:
        names = [field[0] for field in self._fields_[1:]]
        return "Report(" + ", ".join(f"{name}={getattr(self, name)!r}" for name in names) + ")"


#: Arguments of every function, in the order of diffusph.h; all answer an int32_t.
_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "diffusph_create": (_text, _handles, _buffer, _count),
    "diffusph_destroy": (_handle,),
    "diffusph_message": (_handle, _buffer, _count),
    "diffusph_particles": (_handle, _counts),
    "diffusph_dimensions": (_handle, _counts),
    "diffusph_set_box": (_handle, _doubles, _doubles, _flags),
    "diffusph_set_particles": (_handle, _count, _doubles, _count, _doubles, _doubles, _doubles),
    "diffusph_set": (_handle, _text, _doubles, _count, _count),
    "diffusph_set_number": (_handle, _text, _double),
    "diffusph_set_law": (_handle, _text, _text),
    "diffusph_set_kappa_callback": (_handle, _field_callback, ctypes.c_void_p),
    "diffusph_set_source_callback": (_handle, _field_callback, ctypes.c_void_p),
    "diffusph_set_progress_callback": (_handle, _progress_callback, ctypes.c_void_p),
    "diffusph_set_log_callback": (_handle, _log_callback, ctypes.c_void_p),
    "diffusph_step": (_handle, _double, ctypes.POINTER(Report)),
    "diffusph_cancel": (_handle,),
    "diffusph_limit": (_handle, _doubles),
    "diffusph_rate": (_handle, _doubles, _count, _count),
    "diffusph_plan": (_handle, _buffer, _count, _counts),
    "diffusph_recommend": (_handle, _double, _double, _buffer, _count, _doubles, _doubles),
    "diffusph_get": (_handle, _text, _doubles, _count, _count),
    "diffusph_get_number": (_handle, _text, _doubles),
    "diffusph_seconds": (_handle, _count, _buffer, _count, _doubles),
    "diffusph_write_vtk": (_handle, _text),
    "diffusph_write_series": (_handle, _text),
    "diffusph_read_vtk": (_handle, _text),
    "diffusph_count": (_text, _counts),
    "diffusph_name": (_text, _count, _buffer, _count),
    "diffusph_about": (_text, _count, _buffer, _count),
    "diffusph_error_name": (_status, _buffer, _count),
    "diffusph_version": (_buffer, _count),
    "diffusph_version_number": (),
    "diffusph_abi_version": (),
}

#: Bytes for a message, a name, a line.
_ROOM = 4096


class Error(Exception):
    """A call that failed, with nothing changed.

    `code` and `name` are the status as diffusph.h lists it, such as -2 and "BAD_VALUE"; the text says which argument, which
    index, which value, and what to do. Above 0 the same call may succeed with less.
    """

    def __init__(self, code: int, message: str):
        self.code = code
        self.name = _spoken(lambda buf, n: _library.diffusph_error_name(code, buf, n))
        super().__init__(message)

    def __str__(self) -> str:
        return f"{self.name}: {super().__str__()}"


class Recommendation(NamedTuple):
    """What `Solver.recommend` answers: words to create a solver with, what they err by, and the seconds that they take."""

    words: str
    error: float
    seconds: float


def _load() -> ctypes.CDLL:
    here = Path(__file__).resolve().parent
    named = os.environ.get("DIFFUSPH_LIBRARY")
    places = [named] if named else [*sorted(here.glob("libdiffusph*.so")), *here.parent.glob("lib/libdiffusph.so")]
    library = ctypes.CDLL(str(places[0]) if places else f"libdiffusph.so.{ABI}")
    for name, arguments in _FUNCTIONS.items():
        function = getattr(library, name)
        function.argtypes, function.restype = arguments, _status
    if library.diffusph_abi_version() != ABI:
        raise ImportError(f"{library._name} speaks interface {library.diffusph_abi_version()}, this file {ABI}")
    return library


def _spoken(call: Callable[[Any, int], int], room: int = _ROOM) -> str:
    buffer = ctypes.create_string_buffer(room)
    status = call(buffer, room)
    return buffer.value.decode("utf-8", "replace") if status == 0 else f"status {status}"


_library = _load()


def version() -> str:
    """The version of the library, like "0.1.0"."""
    return _spoken(_library.diffusph_version)


def catalogue(name: str) -> dict[str, str]:
    """What can be chosen, by name, and what it is: "models", "words", "kernels", "operators", "means", "integrators", "laws",
    "fields", "numbers", "rules" or "errors"."""
    count, word = ctypes.c_int64(), _bytes(name)
    status = _library.diffusph_count(word, ctypes.byref(count))
    if status:
        raise Error(status, f"there is no catalogue {name!r}")
    return {
        _spoken(lambda buf, n: _library.diffusph_name(word, i, buf, n)): _spoken(
            lambda buf, n: _library.diffusph_about(word, i, buf, n)
        )
        for i in range(count.value)
    }


def _bytes(text: str) -> bytes:
    encoded = text.encode()
    if b"\0" in encoded:
        raise ValueError(f"{text!r} contains a NUL")
    return encoded


def _path(path: str | os.PathLike[str]) -> bytes:
    encoded = os.fsencode(path)
    if b"\0" in encoded:
        raise ValueError(f"{path!r} contains a NUL")
    return encoded


def _pointer(array: Doubles) -> Any:
    return array.ctypes.data_as(_doubles)


def _stride(array: Doubles) -> Optional[int]:
    """Doubles from one particle of `array[n]` or `array[n, components]` to the next; none where it must be copied."""
    size = array.itemsize
    beside = array.ndim == 1 or array.shape[1] == 1 or array.strides[1] == size
    stride = array.strides[0] if len(array) > 1 else size * (array.shape[1] if array.ndim == 2 else 1)
    apart = stride % size == 0 and stride >= size * (array.shape[1] if array.ndim == 2 else 1)
    return stride // size if beside and apart and array.flags.aligned and array.dtype == np.float64 else None


def _readable(values: npt.ArrayLike) -> tuple[Doubles, int]:
    """Values as an array that the library can read, and its stride: the same memory wherever that is possible."""
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"an array of numbers is needed, not of {array.dtype}")
    stride = _stride(array) if array.ndim in (1, 2) and array.dtype.isnative else None
    if stride is None:
        array = np.ascontiguousarray(array, dtype=np.float64)
        stride = _stride(array) if array.ndim in (1, 2) else None
    # Of no particles, or of a shape that is refused, any will do.
    return array, stride or (array.shape[1] if array.ndim == 2 else 1)


class Solver:
    """A diffusion solver on a set of particles, created from words such as "heat dim=3 kernel=M6 integrator=rkl2".

    `catalogue("words")` lists them all. Closed by `close`, by the end of a `with` block, or with the object. A second call
    from another thread while one is running raises BUSY, except `cancel`.
    """

    def __init__(self, words: str):
        self._handle: Optional[ctypes.c_void_p] = None
        self._kept: dict[str, Any] = {}
        # What a callback has raised; it runs on the thread of the call that asked it.
        self._raised = threading.local()
        handle, why = ctypes.c_void_p(), ctypes.create_string_buffer(_ROOM)
        status = _library.diffusph_create(_bytes(words), ctypes.byref(handle), why, _ROOM)
        if status:
            raise Error(status, why.value.decode("utf-8", "replace"))
        self._handle = handle

    def close(self) -> None:
        """Destroys the solver; its threads are gone afterwards. Closing twice is fine."""
        if self._handle is not None:
            status = _library.diffusph_destroy(self._handle)
            if status:
                raise Error(status, "another call is using this solver now")
            self._handle = None

    def __enter__(self) -> Solver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            _library.diffusph_destroy(self._handle)
            self._handle = None

    def _call(self, name: str, *arguments: Any) -> None:
        if self._handle is None:
            raise ValueError("this solver is closed")
        status = getattr(_library, name)(self._handle, *arguments)
        raised = self._raised.__dict__.pop("it", None)
        if status:
            error = Error(status, self._message())
            raise error if raised is None else raised from error
        if raised is not None:
            raise raised

    def _message(self) -> str:
        # Where the solver cannot be asked, the text says that, whatever the status.
        buffer = ctypes.create_string_buffer(_ROOM)
        _library.diffusph_message(self._handle, buffer, _ROOM)
        return buffer.value.decode("utf-8", "replace")

    def __len__(self) -> int:
        """The number of particles; 0 before `set_particles`."""
        n = ctypes.c_int64()
        self._call("diffusph_particles", ctypes.byref(n))
        return n.value

    def __bool__(self) -> bool:
        return True

    @property
    def dim(self) -> int:
        """The number of dimensions: 1, 2 or 3."""
        dim = ctypes.c_int64()
        self._call("diffusph_dimensions", ctypes.byref(dim))
        return dim.value

    def _components(self, name: str) -> int:
        """Doubles per particle of a quantity."""
        if name == "kappa_ij":
            return self.dim * (self.dim + 1) // 2
        return self.dim if "dim components" in catalogue("fields").get(name, "") else 1

    def _shaped(self, name: str, array: npt.NDArray[Any], n: Optional[int] = None) -> None:
        """Refuses an array of another shape than [n] or [n, components]: what lies behind it must not be read."""
        components = self._components(name)
        fits = array.ndim == 2 and array.shape[1] == components or array.ndim == 1 and components == 1
        if not fits or n is not None and len(array) != n:
            n_text = "n" if n is None else str(n)
            wanted = f"({n_text},)" if components == 1 else f"({n_text}, {components})"
            raise ValueError(f"{name} has the shape {array.shape}, and needs {wanted}")

    def set_box(
        self, lo: Sequence[float], hi: Sequence[float], periodic: Optional[Sequence[bool]] = None
    ) -> None:
        """The box: bounds, m, and on which axes it repeats itself. Without it, space is open."""
        dim = self.dim
        for name, values in (("lo", lo), ("hi", hi), ("periodic", periodic)):
            if values is not None and len(values) != dim:
                raise ValueError(f"{name} has {len(values)} values, and needs one for each of {dim} axes")
        low, high = ((ctypes.c_double * dim)(*values) for values in (lo, hi))
        flags = None if periodic is None else (ctypes.c_int32 * dim)(*(int(bool(p)) for p in periodic))
        self._call("diffusph_set_box", low, high, flags)

    def set_particles(
        self,
        x: npt.ArrayLike,
        m: Optional[npt.ArrayLike] = None,
        rho: Optional[npt.ArrayLike] = None,
        h: Optional[npt.ArrayLike] = None,
    ) -> None:
        """Positions x[n, dim], m (x[n] in one dimension), and masses, kg, densities, kg/m^3, and smoothing lengths, m, where
        they are given: each an array [n], or one number for all.

        As many particles as before are moved, and keep everything else.
        """
        positions, stride = _readable(x)
        self._shaped("x", positions)
        n, arrays = len(positions), {}
        for name, values in (("m", m), ("rho", rho), ("h", h)):
            if values is None:
                continue
            # A number too goes along with the positions: all are taken, or none.
            array = np.asarray(values) if np.ndim(values) else np.full(n, values, dtype=np.float64)
            self._shaped(name, array, n)
            arrays[name] = np.ascontiguousarray(array, dtype=np.float64).reshape(n)
        pointers = [_pointer(arrays[name]) if name in arrays else None for name in ("m", "rho", "h")]
        self._call("diffusph_set_particles", n, _pointer(positions), stride, *pointers)

    def set(self, name: str, values: npt.ArrayLike) -> None:
        """A quantity of each particle, in your order, or one number for all; or a number of the solver, such as "time".

        `catalogue("fields")` and `catalogue("numbers")` list them with their units.
        """
        if np.ndim(values) == 0:
            return self._call("diffusph_set_number", _bytes(name), float(values))  # type: ignore[arg-type]
        array, stride = _readable(values)
        self._shaped(name, array)
        self._call("diffusph_set", _bytes(name), _pointer(array), len(array), stride)

    def set_law(self, name: str, words: str) -> None:
        """A quantity as a function of T, in words: "kappa" as "power kappa0=1 T0=300 n=2.5"; `catalogue("laws")`."""
        self._call("diffusph_set_law", _bytes(name), _bytes(words))

    def set_kappa_callback(self, function: Optional[Callable[[float, Any, Doubles, Doubles], object]]) -> None:
        """Conductivity as your function(time, particle, T, out), which fills out; None takes it away.

        `particle` are your numbers of the particles, from 0. What it raises is raised by the call that asked it.
        """
        self._lend("diffusph_set_kappa_callback", function)

    def set_source_callback(self, function: Optional[Callable[[float, Any, Doubles, Doubles], object]]) -> None:
        """Heat released per volume, W/m^3, as your function(time, particle, T, out), which fills out; None takes it away."""
        self._lend("diffusph_set_source_callback", function)

    def _lend(self, name: str, function: Optional[Callable[..., object]]) -> None:
        def called(_: Any, time: float, n: int, particle: Any, t: Any, out: Any) -> int:
            if n == 0 or function is None:
                return 0
            array = np.ctypeslib.as_array
            t = array(t, (n,))
            t.flags.writeable = False
            particle = array(particle, (n,))
            particle.flags.writeable = False
            return self._guarded(lambda: function(time, particle, t, array(out, (n,))) and 0)

        lent = _field_callback(called) if function is not None else _field_callback()
        self._call(name, lent, None)
        self._kept[name] = lent

    def _guarded(self, work: Callable[[], object]) -> int:
        """The status of a callback; what it raises waits for the call that asked it to end."""
        try:
            return int(bool(work()))
        except BaseException as raised:  # noqa: BLE001, KeyboardInterrupt among them
            self._raised.it = raised
            return 1

    def set_progress_callback(self, function: Optional[Callable[[float, float], object]]) -> None:
        """function(time, share) is told between sub-steps which time is reached and which share of the step is done; a true
        answer, or what it raises, cancels the step."""
        lent = _progress_callback()
        if function is not None:
            lent = _progress_callback(lambda _, time, share: self._guarded(lambda: function(time, share)))
        self._call("diffusph_set_progress_callback", lent, None)
        self._kept["progress"] = lent

    def set_log_callback(self, function: Optional[Callable[[int, str], object]]) -> None:
        """function(level, text) is told of failed calls (1, 2), the plan (3) and each step (4); None takes it away."""
        lent = _log_callback()
        if function is not None:
            lent = _log_callback(
                lambda _, level, text: self._guarded(lambda: function(level, text.decode("utf-8", "replace")) and 0)
                and None
            )
        self._call("diffusph_set_log_callback", lent, None)
        self._kept["log"] = lent

    def step(self, dt: float) -> Report:
        """Advances by exactly dt, s, in as many sub-steps as the method needs; raises, with nothing changed, where it cannot."""
        report = Report(size=ctypes.sizeof(Report))
        self._call("diffusph_step", float(dt), ctypes.byref(report))
        return report

    def cancel(self) -> None:
        """From another thread: makes the call that is running now raise CANCELLED, with nothing changed."""
        if self._handle is not None:
            _library.diffusph_cancel(self._handle)

    def limit(self) -> float:
        """The largest stable explicit Euler step now, s."""
        dt = ctypes.c_double()
        self._call("diffusph_limit", ctypes.byref(dt))
        return dt.value

    def rate(self, out: Optional[Doubles] = None) -> Doubles:
        """du/dt of each particle now, W/kg, for hosts that integrate themselves."""
        return self._received("rate", out, lambda p, n, stride: self._call("diffusph_rate", p, n, stride))

    def get(self, name: str, out: Optional[Doubles] = None) -> Doubles:
        """A quantity of each particle, in your order: [n], or [n, dim] for vectors; written to `out` where that is given."""
        return self._received(
            name, out, lambda p, n, stride: self._call("diffusph_get", _bytes(name), p, n, stride)
        )

    def _received(self, name: str, out: Optional[Doubles], call: Callable[[Any, int, int], None]) -> Doubles:
        n, components = len(self), self._components(name)
        if out is None:
            out = np.empty(n if components == 1 else (n, components))
        if not isinstance(out, np.ndarray) or out.dtype != np.float64 or not out.flags.writeable:
            raise TypeError("out must be a numpy array of doubles that can be written")
        self._shaped(name, out, n)
        stride = _stride(out)
        if stride is not None:
            call(_pointer(out), n, stride)
            return out
        packed = np.empty(out.shape)
        call(_pointer(packed), n, components)
        out[...] = packed
        return out

    def number(self, name: str) -> float:
        """A number of the solver, such as "time", "energy" or "T_max"; `catalogue("numbers")` lists them."""
        value = ctypes.c_double()
        self._call("diffusph_get_number", _bytes(name), ctypes.byref(value))
        return value.value

    def plan(self) -> str:
        """What a step will do, what it leaves out and why."""
        needed = ctypes.c_int64()
        self._call("diffusph_plan", None, 0, ctypes.byref(needed))
        buffer = ctypes.create_string_buffer(needed.value)
        self._call("diffusph_plan", buffer, needed.value, None)
        return buffer.value.decode("utf-8", "replace")

    def recommend(self, wanted: float, dt: float) -> Recommendation:
        """Which words reach an error cheapest on these particles, for steps of dt; see diffusph_recommend."""
        words, error, seconds = ctypes.create_string_buffer(_ROOM), ctypes.c_double(), ctypes.c_double()
        received = (words, _ROOM, ctypes.byref(error), ctypes.byref(seconds))
        self._call("diffusph_recommend", float(wanted), float(dt), *received)
        return Recommendation(words.value.decode(), error.value, seconds.value)

    def seconds(self) -> dict[str, float]:
        """Where the time went since the solver was created, by pass, s."""
        found: dict[str, float] = {}
        name, seconds = ctypes.create_string_buffer(_ROOM), ctypes.c_double()
        arguments = (name, _ROOM, ctypes.byref(seconds))
        while self._handle is not None and _library.diffusph_seconds(self._handle, len(found), *arguments) == 0:
            found[name.value.decode()] = seconds.value
        return found

    def write_vtk(self, path: str | os.PathLike[str]) -> None:
        """Writes the particles and their quantities as a .vtu, or a legacy .vtk if the name ends so."""
        self._call("diffusph_write_vtk", _path(path))

    def write_series(self, pvd_path: str | os.PathLike[str]) -> None:
        """Writes the next snapshot of a series and lists it in a .pvd."""
        self._call("diffusph_write_series", _path(pvd_path))

    def read_vtk(self, path: str | os.PathLike[str]) -> None:
        """Takes particles from a VTK file; from a snapshot of write_vtk, all that the solver needs to go on."""
        self._call("diffusph_read_vtk", _path(path))
