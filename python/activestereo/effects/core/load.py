# SPDX-License-Identifier: Apache-2.0
"""Loads effects from a user's file: Python with the decorator, or a shared library with the descriptors of
capi/include/ks/effect.h."""

from __future__ import annotations

import ctypes as c
import importlib.util
import keyword
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.effects.core import plugin_records as records
from activestereo.effects.core.descriptor import Effect, Lever, Parameter, Randomness, RandomTerm, SharedBy, Stage
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View

_ENTRY = "ks_effect_plugin"
_RANDOMNESS = tuple(Randomness[name.upper()] for name in records.RANDOMNESS)
_LEVERS = tuple(Lever[name.upper()] for name in records.LEVER)
_SHARED_BY = tuple(SharedBy[name.upper()] for name in records.SHARED_BY)
_MOST_EFFECTS, _MOST_PARAMETERS = 256, 64
_RNG_PER = {Randomness.NONE: "rig", Randomness.STATIC: "sensor", Randomness.TEMPORAL: "frame"}


def load_plugin(path: str | Path) -> list[Effect]:
    """Returns the Effects of a shared library. Raises ValueError with the fault in its tables, or OSError if it cannot
    be loaded. It runs in this process with all rights: pointers in the tables are followed unchecked."""
    library = c.CDLL(str(Path(path).resolve()))
    try:
        entry = getattr(library, _ENTRY)
    except AttributeError:
        raise ValueError(f"{path}: exports no {_ENTRY}; see ks/effect.h") from None
    entry.restype, entry.argtypes = c.POINTER(records.Effect), [c.POINTER(c.c_uint32)]
    count = c.c_uint32()
    found = entry(c.byref(count))
    try:
        effects = [_effect(record, library) for record in _records(found, count.value, "effect", _MOST_EFFECTS)]
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if not effects:
        raise ValueError(f"{path}: {_ENTRY} gives no effect")
    return effects


def _records(first: Any, count: int, what: str, most: int) -> list[Any]:
    """Converts a C array to a list. Raises ValueError, which names `what`, if it is NULL or has more than `most`."""
    if count > most:
        raise ValueError(f"{count} {what}s are said to be there, the most is {most}")
    if count > 0 and not first:
        raise ValueError(f"{count} {what}s are said to be there, and NULL is in their place")
    return [first[i] for i in range(count)]


def _effect(record: records.Effect, library: c.CDLL) -> Effect:
    if record.header.type != records.TYPE_EFFECT or record.header.size_bytes != c.sizeof(records.Effect):
        raise ValueError(
            f"built against another ks/effect.h (its ks_effect has {record.header.size_bytes} bytes, not "
            f"{c.sizeof(records.Effect)})"
        )
    name = _text(record.id)
    if not name.isidentifier() or not record.apply or record.randomness >= len(_RANDOMNESS):
        raise ValueError(f"effect {name[:40]!r} needs an identifier as id, an apply function and a known randomness")
    parameters = tuple(
        map(_parameter, _records(record.parameters, record.parameter_count, "parameter", _MOST_PARAMETERS))
    )
    if len({p.name for p in parameters}) < len(parameters):
        raise ValueError(f"effect '{name}' has two parameters of one name")
    randomness = _RANDOMNESS[record.randomness]
    try:
        stage = Stage(record.stage)
    except ValueError:
        raise ValueError(f"effect '{name}' has stage {record.stage}, not one of KS_STAGE_*") from None

    def apply(value: Any, view: View, **values: float) -> Any:
        assert library  # keeps the library loaded while its code runs
        return _run(record.apply, name, randomness, value, view, [values[p.name] for p in parameters])

    texts: dict[str, Any] = {field: _text(getattr(record, field)) for field in ("family", "summary", "source")}
    terms = _records(record.random_terms, record.random_term_count, "random term", _MOST_PARAMETERS)
    judged = tuple(map(_random_term, terms))
    return Effect(name, stage=stage, parameters=parameters, apply=apply, randomness=randomness, judged=judged, **texts)


def _random_term(record: records.RandomTerm) -> RandomTerm:
    if record.lever >= len(_LEVERS) or record.shared_by >= len(_SHARED_BY):
        raise ValueError("a random term's lever or shared_by is none of KS_LEVER_*, KS_SHARED_BY_*")
    return RandomTerm(
        _text(record.parameter), _LEVERS[record.lever], _SHARED_BY[record.shared_by], _text(record.sparse_share)
    )


def _parameter(record: records.Parameter) -> Parameter:
    name = _text(record.name)
    if not name.isidentifier() or keyword.iskeyword(name):
        raise ValueError(f"parameter name {name[:40]!r} is no identifier")
    return Parameter(
        name, _text(record.unit), record.neutral, record.low, record.high, record.typical, _text(record.source)
    )


def _text(pointer: bytes | None) -> str:
    text = (pointer or b"").decode(errors="replace")
    if not text.isprintable() or "\ufffd" in text:
        raise ValueError(f"the text {text[:40]!r} is no line of UTF-8")
    return text


def _run(function: Any, name: str, randomness: Randomness, value: Any, view: View, parameters: Sequence[float]) -> Any:
    images = value.images if isinstance(value, Light) else value
    images = np.ascontiguousarray(images, dtype=np.float64)
    out = np.empty_like(images)
    record = _view(view, name, randomness)
    numbers = (c.c_double * len(parameters))(*parameters)
    doubles = c.POINTER(c.c_double)
    planes = images.size // (view.shape[0] * view.shape[1])
    status = function(c.byref(record), numbers, planes, images.ctypes.data_as(doubles), out.ctypes.data_as(doubles))
    if status != 0:
        raise ValueError(f"{name}: the plug-in gave status {status}")
    return Light.of_images(out, value.supersampled) if isinstance(value, Light) else out


def _view(view: View, name: str, randomness: Randomness) -> records.View:
    """Converts a View to its C record."""
    frame = view.frame
    depth = np.ascontiguousarray(view.depth_m, dtype=np.float64)
    normal = np.ascontiguousarray(view.normal, dtype=np.float64)
    pattern = np.ascontiguousarray(view.pattern, dtype=np.float32)
    numbers = lambda array: tuple(np.asarray(array, dtype=np.float64).ravel())  # noqa: E731
    record = records.View(
        header=records.Header(size_bytes=c.sizeof(records.View), type=records.TYPE_EFFECT_VIEW),
        width=view.shape[1], height=view.shape[0], is_right=view.is_right, frame_id=frame.id,
        k=numbers(view.K), projector_k=numbers(view.projector_K),
        camera_to_projector=numbers(view.camera_to_projector), left_to_camera=numbers(view.left_to_camera),
        camera_velocity=numbers(frame.camera_velocity), baseline_m=view.baseline_m, max_dn=view.max_dn,
        exposure_s=frame.exposure_s, gain=frame.gain, timestamp_s=frame.timestamp_s,
        temperature_c=np.nan if frame.temperature_c is None else frame.temperature_c,
        random_seed=int(view.rng(name, per=_RNG_PER[randomness]).integers(0, 2**63)),
        depth_m=depth.ctypes.data, normal=normal.ctypes.data, pattern=pattern.ctypes.data,
        pattern_width=pattern.shape[1], pattern_height=pattern.shape[0],
    )  # fmt: skip
    record.kept = depth, normal, pattern  # it points to them
    return record


def load_effects(path: str | Path) -> dict[str, Effect]:
    """Returns {id: Effect} of a .py file or a shared library. Raises FileNotFoundError if there is no such file, or
    ValueError with the file's fault."""
    path = Path(path)
    if not path.is_file():
        words = "no such effect file (Python, or a shared library; built-in effects need none)"
        raise FileNotFoundError(2, words, str(path))
    try:
        found = _from_python(path) if path.suffix == ".py" else load_plugin(path)
    except OSError as error:
        raise ValueError(
            f"{path}: neither a Python file nor a shared library that loads: {error}; --model takes a model.json"
        ) from error
    if not found:
        raise ValueError(f"{path}: holds no effect; make one with the decorator activestereo.effects.effect")
    effects: dict[str, Effect] = {}
    for e in found:
        if effects.setdefault(e.id, e) is not e:
            raise ValueError(f"{path}: two effects have the id '{e.id}'")
    return effects


def _from_python(path: Path) -> list[Effect]:
    spec = importlib.util.spec_from_file_location(f"activestereo_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path}: is no Python file that can be imported")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # anything may go wrong in a user's file; the message names the line
        steps = [step.lineno for step in traceback.extract_tb(error.__traceback__) if step.filename == str(path)]
        line = getattr(error, "lineno", None) or (steps or [None])[-1]
        raise ValueError(f"{path}{f', line {line}' if line else ''}: {type(error).__name__}: {error}") from error
    return list({id(value): value for value in vars(module).values() if isinstance(value, Effect)}.values())
