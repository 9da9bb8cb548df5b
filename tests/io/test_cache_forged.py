"""A cache from elsewhere runs nothing, even one that is trusted: whatever a forged checkpoint names is refused with a SceneError."""

from __future__ import annotations

import json
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forged_states import packed, put_state, state
from kept_runs import pile

import rigidimpulse as ri
from rigidimpulse.io.cache.constants import Constants
from rigidimpulse.io.cache.decode import thaw
from rigidimpulse.io.cache.encode import LENGTHS, MARK
from rigidimpulse.io.cache.read import read
from rigidimpulse.io.cache.registry import FUNCTIONS, METHODS, classes, named_function

h5py = pytest.importorskip("h5py")
NAMES = "motion.force_step.Moment"


class Stopped(Exception):
    """Raised in the middle of a run."""


class RunsACommand:
    """Pickled, it would run a command of the system."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return os.system, (f"touch {self._mark}",)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of a cache of `pile` that was stopped on its way."""
    path = tmp_path_factory.mktemp("stopped") / "run.h5"

    def stop(now: float) -> None:
        if now >= 0.02:
            raise Stopped

    with pytest.raises(Stopped):
        ri.simulate(pile(), 0.1, 100.0, cache=ri.Cache(path, every=0.0), progress=stop)
    return path.read_bytes()


OBJECT = ["object", "core.simd.Simd", {"width": 4}]
ARRAY = ["array", "<f8", [2], True, "C", 0]
FORGED = {
    "an unknown class": state(["object", "os._wrap_close", {}]),
    "a class of the package that is no part of a state": state(["object", "io.gltf.container.Container", {}]),
    "a class whose objects hold addresses": state(["object", "engine.exact.compiled_loop.CompiledLoop", {}]),
    "a class by its module's variable": state(["object", "engine.run.os", {}]),
    "a class that is no text": state(["object", ["core.simd.Simd"], {"width": 4}]),
    "an abstract class": state(["object", "dynamics.forces.force.ForceTable", {}]),
    "a named tuple as an object": state(["object", NAMES, {}]),
    "an object as a named tuple": state(["named", "core.simd.Simd", 4]),
    "too few fields of a named tuple": state(["named", NAMES]),
    "another field": state(["object", "core.simd.Simd", {"width": 4, "height": 4}]),
    "a missing field": state(["object", "core.simd.Simd", {}]),
    "the class of an object": state(["object", "core.simd.Simd", {"width": 4, "__class__": 0}]),
    "the dictionary of an object": state(["object", "core.simd.Simd", {"width": 4, "__dict__": 0}]),
    "a method for a field": state(["object", "core.simd.Simd", {"width": 4, "__init__": 0}]),
    "fields that are no names": state(["object", "core.simd.Simd", [4]]),
    "an unknown function": state(["function", "os.system"]),
    "a function that is no text": state(["function", ["solver of rows"]]),
    "a method that is not in the table": state(OBJECT, ["method", [0], "__init__"]),
    "a method of a container": state(["list"], ["method", [0], "append"]),
    "a method of nothing": state(["method", None, "clock"]),
    "arguments of a class": state(OBJECT, ["partial", [0], [], {}]),
    "arguments of a text": state(["partial", "os.system", ["true"], {}]),
    "an unknown kind": state(["reduce", "os.system", ["true"]]),
    "a kind that is no text": state([["list"]]),
    "an empty node": state([]),
    "a node that is none": state("list"),
    "a later node": state(["tuple", [1]], ["tuple"]),
    "itself": state(["tuple", [0]]),
    "a node before the first": state(["tuple"], ["list", [-1]]),
    "a node beyond the last": state(["list", [1]]),
    "a node by no number": state(["list", ["0"]]),
    "a node by two numbers": state(["list", [0, 0]]),
    "an object in the place of a value": state(["list", {"a": 1}]),
    "a constant beyond the last": state(["constant", 0]),
    "a negative constant": state(["constant", -1]),
    "a factory of the system": state(["defaultdict", "os.system"]),
    "members that have no hash": state(["list"], ["set", [0]]),
    "a key twice": state(["dict", "a", 1, "a", 2]),
    "a key without a value": state(["dict", "a"]),
    "an array of objects": state(["array", "|O8", [1], True, "C", 0], arrays=bytes(8)),
    "an array of a type that is none": state(["array", "os.system", [1], True, "C", 0], arrays=bytes(8)),
    "a record of objects": state(["array", ["record", [["a", "|O8", 0]], 8, False], [1], True, "C", 0], arrays=bytes(8)),
    "a record beyond its size": state(["array", ["record", [["a", "<f8", 800]], 8, False], [1], True, "C", 0], arrays=bytes(8)),
    "an array of a negative length": state(["array", "<f8", [-1], True, "C", 0]),
    "two negative lengths": state(["array", "<f8", [-1, -2], True, "C", 0], arrays=bytes(16)),
    "a length that is no number": state(["array", "<f8", [True], True, "C", 0], arrays=bytes(8)),
    "a huge array": state(["array", "<f8", [2**60], True, "C", 0], arrays=bytes(16)),
    "an array of too many axes": state(["array", "<f8", [1] * 1000, True, "C", 0], arrays=bytes(8)),
    "an array in no order": state(["array", "<f8", [2], True, "K", 0], arrays=bytes(16)),
    "an array beside its line": state(["array", "<f8", [2], True, "C", 64], arrays=bytes(16)),
    "bytes twice": state(ARRAY, ARRAY, arrays=bytes(16)),
    "bytes too many": state(ARRAY, arrays=bytes(24)),
    "a view beyond its base": state(ARRAY, ["view", [0], "<f8", [2], True, 8, [8]], arrays=bytes(16)),
    "a view before its base": state(ARRAY, ["view", [0], "<f8", [2], True, 0, [-8]], arrays=bytes(16)),
    "a view from before its base": state(ARRAY, ["view", [0], "<f8", [1], True, -8, [8]], arrays=bytes(16)),
    "a view of long strides": state(ARRAY, ["view", [0], "<f8", [2], True, 0, [2**62]], arrays=bytes(16)),
    "a view without strides": state(ARRAY, ["view", [0], "<f8", [2], True, 0, []], arrays=bytes(16)),
    "a view of a list": state(["list"], ["view", [0], "<f8", [0], True, 0, [8]]),
    "a view of objects": state(ARRAY, ["view", [0], "|O8", [2], True, 0, [8]], arrays=bytes(16)),
    "a view that writes to what is only read": state(
        ["array", "<f8", [2], False, "C", 0], ["view", [0], "<f8", [2], True, 0, [8]], arrays=bytes(16)
    ),
    "a number of too many bytes": state(["scalar", "<f8", "00" * 9]),
    "no number": packed(b'[0,NaN,[["list"]]]'),
    "a number of too many digits": packed(b"[0," + b"9" * 10000 + b",[]]"),
    "deep nesting": packed(b"[" * 100_000),
    "deep nesting of objects": packed(b'{"a":' * 100_000),
    "deep nesting of types": packed(b'[0,[0],[["dtype",' + b'["rows",' * 20 + b'"<f8"' + b",[1]]" * 20 + b"]]]"),
    "no table": packed(b"{}"),
    "no JSON": packed(b"\xff\xfe"),
    "nothing": b"",
    "junk": b"junk",
    "a mark and no more": MARK,
    "a huge table": MARK + LENGTHS.pack(2**63, 0),
    "huge arrays": MARK + LENGTHS.pack(2, 2**63) + b"[]",
}


@pytest.mark.parametrize("what", FORGED)
def test_a_forged_state_is_refused(what: str) -> None:
    with pytest.raises(ri.SceneError, match="checkpoint"):
        thaw(FORGED[what], Constants([]))


def test_nodes_of_the_forged_states_are_read_where_they_are_right() -> None:
    # Else a mistake in all of them would pass for a refusal.
    assert thaw(state(OBJECT), Constants([])).width == 4
    backwards = state(ARRAY, ["view", [0], "<f8", [2], True, 8, [-8]], arrays=np.arange(2.0).tobytes())
    assert thaw(backwards, Constants([])).tolist() == [1.0, 0.0]
    assert thaw(state(["list", [0]]), Constants([]))[0][0][0] is not None
    assert thaw(state(["constant", 0], constants=1), Constants([[]])) == []


def test_pickles_of_older_caches_run_nothing(stopped: bytes, tmp_path: Path) -> None:
    mark, cache = tmp_path / "mark", tmp_path / "run.h5"
    forged = pickle.dumps((0, RunsACommand(mark)))
    for content in (forged, MARK + forged, pickle.dumps((0, getattr))):
        with pytest.raises(ri.SceneError, match="checkpoint"):
            thaw(content, Constants([]))
    cache.write_bytes(stopped)
    put_state(cache, forged)
    with pytest.raises(ri.SceneError, match="delete the cache, and run again"):
        ri.simulate(pile(), 0.1, 100.0, cache=ri.Cache(cache, trust=True))
    with h5py.File(cache, "r+") as file:
        file.attrs["format"] = "rigidimpulse cache 1"  # as a text of variable length, as it was then
    for look in (ri.load_recording, lambda path: ri.simulate(pile(), 0.1, 100.0, cache=path)):
        with pytest.raises(ri.SceneError, match=r"another version of the library.*delete it, and run again"):
            look(cache)
    assert not mark.exists()


def test_a_state_that_is_none_of_a_run_is_refused(stopped: bytes, tmp_path: Path) -> None:
    cache = tmp_path / "run.h5"
    for content in (state(OBJECT), state(["list"]), state(["object", "engine.run.Run", {}])):
        cache.write_bytes(stopped)
        put_state(cache, content)
        with pytest.raises(ri.SceneError, match="the checkpoint"):
            ri.simulate(pile(), 0.1, 100.0, cache=ri.Cache(cache, trust=True))


FIELDS = {
    "a text for the world": ({"world": "text"}, "Run.world is a str"),
    "a constant for the world": ({"world": [0]}, "Run.world is a"),
    "nothing for the world": ({"world": None}, "Run.world is a NoneType"),
    "a list for the recorder": ({"recorder": ["list"]}, "Run.recorder is a list"),
    "a text for an array": ({"box_min": "text"}, "Run.box_min is a str"),
    "another array": ({"box_min": ["array", "|u1", [0], True, "C", 0]}, "Run.box_min is an array of 1 axes of uint8"),
}


@pytest.mark.parametrize("what", FIELDS)
def test_a_state_with_fields_of_other_kinds_is_refused(what: str, stopped: bytes, tmp_path: Path) -> None:
    cache, (fields, told) = tmp_path / "run.h5", FIELDS[what]
    cache.write_bytes(stopped)
    known = read(cache)[1].state
    assert known is not None
    table_size, arrays_size = LENGTHS.unpack_from(known, len(MARK))
    begin = len(MARK) + LENGTHS.size
    number, root, nodes = json.loads(known[begin : begin + table_size])
    run = next(node for node in nodes if node[:2] == ["object", "engine.run.Run"])
    for name, child in fields.items():
        if isinstance(child, list) and isinstance(child[0], str):
            nodes.append(child)
            child = [len(nodes) - 1]
        run[2][name] = child
    put_state(cache, packed(json.dumps([number, root, nodes]).encode(), known[-arrays_size:]))
    with pytest.raises(ri.SceneError, match=rf"run\.h5.*engine\.run\.{told}.*delete the cache"):
        ri.simulate(pile(), 0.1, 100.0, cache=ri.Cache(cache, trust=True))


@pytest.mark.parametrize(
    ("claims", "told"),
    [
        ({"time": np.nan}, "at nan s"),
        ({"time": -1.0}, "at -1.0 s"),
        ({"frames": 2**63}, "counts 9223372036854775808"),
        ({"impacts": 2**32}, "counts 4294967296"),
        ({"length": 2**40}, "a state of 1099511627776 bytes"),
        ({"length": 3}, "another length than 3"),
    ],
)
def test_commits_of_wrong_numbers_are_refused(claims: dict[str, Any], told: str, stopped: bytes, tmp_path: Path) -> None:
    cache = tmp_path / "run.h5"
    cache.write_bytes(stopped)
    put_state(cache, state(OBJECT), **claims)
    with pytest.raises(ri.SceneError, match=told):
        read(cache)


def test_names_in_the_tables_are_what_they_say() -> None:
    known = classes()
    assert "engine.run.Run" in known and len(known) > 100
    for label, schema in known.items():
        assert label == f"{schema.made.__module__.removeprefix('rigidimpulse.')}.{schema.made.__name__}"
        assert not {"__class__", "__dict__", "__init__"} & (schema.fields | schema.optional)
    assert all(callable(named_function(name)) for name in FUNCTIONS)
    assert all(callable(vars(known[label].made)[name]) if label in known else False for label, name in METHODS)
