"""The state of a run as bytes, and back, bit for bit.

What is written is the graph of objects that a run changes. Constants are written as numbers in the order in which a walk meets them: the
scene with all that people put into it (functions among it, which have no bytes), compiled shapes and their geometry; a run that goes on
has compiled them again, and walks them in the same order. Arrays that share memory share it again when they are read: a view is written
as its base, and where and how it lies in it.

Only what a run is made of (`HOMES`), plain containers and arrays are ever made from bytes.
"""

from __future__ import annotations

import builtins
import collections
import dataclasses
import functools
import importlib
import io
import pickle
from collections.abc import Iterable
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.kernels import Kernel

ATOMS = (str, bytes, int, float, bool, complex, type(None), type)
CONTAINERS: dict[str, tuple[Any, ...]] = {
    "builtins": (builtins.set, builtins.frozenset, builtins.slice, builtins.range, builtins.bytearray, builtins.complex),
    "collections": (collections.OrderedDict, collections.defaultdict, collections.deque),
    "functools": (functools.partial,),
}
LINE = 64
"""Bytes of a line of the processor's cache."""
HOMES = (
    "core.quaternion", "core.simd", "core.workers", "scene.accuracy", "scene.mass", "scene.joint", "scene.joint_six_axis",
    "collision", "motion", "model", "dynamics", "engine.exact", "engine.substepped", "engine.spheres", "engine.absent", "engine.islands",
    "engine.finder", "engine.touching",
    "engine.keyframe_paths", "engine.pair_events", "engine.pair_table", "engine.regime", "engine.run", "engine.soft_bodies",
    "engine.triggers", "engine.varying_forces", "recording.contact_log", "recording.contacts", "recording.events", "recording.impulses",
    "recording.recorder", "io.cache.freeze",
)  # fmt: skip
"""Packages and modules of what a state is made of: nothing in them reads or runs files."""
NUMPY = ("dtype", "ndarray", "scalar", "_reconstruct", "_frombuffer")
"""What numpy makes arrays of."""


class Constants:
    """Objects that a run does not change, and their numbers."""

    def __init__(self, roots: Iterable[Any]) -> None:
        """Walk the roots, depth first, by fields, items and array attributes."""
        self.objects: list[Any] = []
        self._number: dict[int, int] = {}
        waiting = list(roots)[::-1]
        while waiting:
            thing = waiting.pop()
            if isinstance(thing, ATOMS) or id(thing) in self._number:
                continue
            self._number[id(thing)] = len(self.objects)
            self.objects.append(thing)
            waiting.extend(_parts(thing)[::-1])

    def number(self, thing: Any) -> int | None:
        """Number of a constant, None for anything else."""
        return self._number.get(id(thing))


def _parts(thing: Any) -> list[Any]:
    """What a constant consists of, always in the same order; caches that fill up while it is used are no part of it."""
    if dataclasses.is_dataclass(thing):
        return [getattr(thing, field.name) for field in dataclasses.fields(thing)]
    if isinstance(thing, dict):
        return list(thing.values())
    return list(thing) if isinstance(thing, list | tuple) else []


class _Writer(pickle.Pickler):
    """Writes constants as numbers, views as views, bound methods as object and name."""

    def __init__(self, file: io.BytesIO, constants: Constants) -> None:
        super().__init__(file, protocol=5)
        self._constants = constants

    def persistent_id(self, obj: Any) -> int | None:
        return self._constants.number(obj)

    def reducer_override(self, obj: Any) -> Any:
        if type(obj) is np.ndarray:
            return _reduce_array(obj)
        if isinstance(obj, Kernel):
            return obj.py_func.__name__
        if hasattr(obj, "__func__") and hasattr(obj, "__self__"):
            return _bound, (obj.__self__, obj.__func__.__name__)
        return NotImplemented


def _reduce_array(array: np.ndarray) -> Any:
    base, writeable = array.base, array.flags.writeable
    if array.dtype.hasobject:
        return NotImplemented
    if type(base) is not np.ndarray:
        whole = np.require(array, requirements=["F" if array.flags.f_contiguous else "C"])
        order = "F" if whole.flags.f_contiguous else "C"
        return _owner, (pickle.PickleBuffer(whole.data), array.dtype, array.shape, order, _address(array) % LINE, writeable)
    offset = _address(array) - _address(base)
    return _view, (base, array.dtype, array.shape, offset, array.strides, writeable)


def _address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def _owner(data: Any, dtype: np.dtype, shape: tuple[int, ...], order: Any, residue: int, writeable: bool) -> np.ndarray:
    """An array with these bytes that lies as the one that was written does to the lines of the processor's cache: kernels count on it."""
    plain = np.frombuffer(data, dtype).reshape(shape, order=order)
    memory = np.empty(plain.nbytes + LINE, np.uint8)
    array = np.ndarray(shape, dtype, buffer=memory, offset=(residue - _address(memory)) % LINE, order=order)
    array[...] = plain
    array.flags.writeable = writeable
    return array


def _view(whole: np.ndarray, dtype: np.dtype, shape: tuple[int, ...], offset: int, strides: tuple[int, ...], writeable: bool) -> np.ndarray:
    """The view of `whole` that lies in it like this."""
    array = np.ndarray(shape, dtype, buffer=whole if whole.flags.c_contiguous else whole.T, offset=offset, strides=strides)
    array.flags.writeable = writeable
    return array


def _bound(thing: Any, name: str) -> Any:
    """A method of an object of this package."""
    if not _is_home(type(thing).__module__):
        raise pickle.UnpicklingError(f"a method of a {type(thing).__name__}")
    return getattr(thing, name)


def _is_home(module_name: str) -> bool:
    """Whether what a state is made of may come from a module."""
    return any(f"{module_name}.".startswith(f"rigidimpulse.{home}.") for home in HOMES)


class _Reader(pickle.Unpickler):
    """Makes nothing but objects of this package, containers and arrays."""

    def __init__(self, file: io.BytesIO, constants: Constants) -> None:
        super().__init__(file)
        self._constants = constants

    def persistent_load(self, pid: Any) -> Any:
        return self._constants.objects[pid]

    def find_class(self, module_name: str, global_name: str) -> Any:
        if module_name.split(".")[0] == "numpy" and global_name in NUMPY:
            return super().find_class(module_name, global_name)
        for known in CONTAINERS.get(module_name, ()):
            if known.__name__ == global_name:
                return known
        if _is_home(module_name):
            found = getattr(importlib.import_module(module_name), global_name, None)
            if getattr(found, "__module__", None) == module_name:
                return found
        raise pickle.UnpicklingError(f"{module_name}.{global_name} has no place in a checkpoint")


def freeze(state: Any, constants: Constants) -> bytes:
    """Return the bytes of a state.

    Raises:
        SceneError: something in it has no bytes: a force of a class of the user's own that keeps, say, an open file.

    """
    file = io.BytesIO()
    try:
        _Writer(file, constants).dump((len(constants.objects), state))
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise SceneError(f"the state of this run cannot be written: {error}", "simulate it without a cache") from None
    return file.getvalue()


def thaw(data: bytes, constants: Constants) -> Any:
    """Return the state that `freeze` wrote, with these constants.

    Raises:
        SceneError: the bytes are no state, or one with other constants.

    """
    remedy = "delete the cache, and run again"
    try:
        number, state = _Reader(io.BytesIO(data), constants).load()
    except Exception as error:
        raise SceneError(f"the checkpoint cannot be read: {type(error).__name__}: {error}", remedy) from None
    if number != len(constants.objects):
        raise SceneError("the checkpoint is of another scene", remedy)
    return state
