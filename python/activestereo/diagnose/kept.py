# SPDX-License-Identifier: Apache-2.0
"""Caches fits and diagnoses on disk beside the renders. A second diagnosis of a capture repeats no fit, even with more
effects or other thresholds. With the same code and options it searches nothing.

The key of a fit is a hash of all that determines it: the observations (images, weights, geometry), the code of this
package, and the parameter space, start and settings of the fit. Fits with a user's own effect are never cached, because
its code is unknown.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np
import scipy

import activestereo
from activestereo.capture.capture import SIDES, Capture
from activestereo.common.output_files import write_text
from activestereo.common.processes import forked
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.evidence import Observation
from activestereo.effects import Effect, builtin
from activestereo.effects.engines.layers import scene_digest
from activestereo.model import SensorModel, read_model
from activestereo.model.write import model_json

# Raise it if the stored arrays change their meaning.
_FORMAT = 1
Arrays: TypeAlias = Mapping[str, np.ndarray]
# A diagnosis without its images: the contents of diagnose.json and model.json, and the stub (Python text) of an effect.
Found: TypeAlias = tuple[dict[str, Any], SensorModel, str | None]


class FitCache:
    """The fits to one capture, as one entry of the disk cache. It is read at the start and written by save(). workers:
    the number of processes that make fits."""

    def __init__(self, renders: LayerCache, observations: Sequence[Observation], workers: int = 1) -> None:
        self.workers = workers
        self._renders, self._key = renders, content_key(_FORMAT, code_digest(), observations)
        known: dict[str, dict[str, np.ndarray]] = {}
        for place, array in (renders.get_arrays(self._key) or {}).items():
            key, _, name = place.partition("/")
            known.setdefault(key, {})[name] = array
        self._known: dict[str, Arrays] = dict(known)
        self._kept_before = len(self._known)

    def __iter__(self) -> Iterator[str]:
        """Iterates over the keys of the cached fits."""
        return iter(self._known)

    def make_ahead(self, work: Callable[[Any], object], items: Sequence[Any]) -> None:
        """Runs work(item) for every item in worker processes, and caches the fits that they make. If an item fails
        there, the caller's own work(item) raises the error."""

        def made(item: Any) -> dict[str, Arrays]:
            before = len(self._known)
            work(item)
            return dict(islice(self._known.items(), before, None))

        for _, done in forked(made, items, self.workers):
            if done.exception() is None:
                self._known.update(done.result())

    def once(self, key: str | None, make: Callable[[], Arrays]) -> Arrays:
        """Returns the arrays cached under a key; if there are none, calls make() and caches its result. If key is None,
        it always calls make() and caches nothing."""
        if key in self._known:
            return self._known[key]
        made = make()
        if key is not None:
            self._known[key] = made
        return made

    def save(self) -> None:
        """Writes the cache entry if there are new fits."""
        if len(self._known) > self._kept_before:
            together = {f"{key}/{name}": array for key, one in self._known.items() for name, array in one.items()}
            self._renders.put_arrays(self._key, together)
            self._kept_before = len(self._known)


def effect_content(effect: Effect) -> str | None:
    """Returns text that identifies an effect: a built-in effect's id, plus a hash of its rendered images or curve if it
    uses them (refit.py). Returns None for other effects, whose code is unknown."""
    own = builtin().get(effect.id)
    if effect is own:
        return effect.id
    hash_of_images = getattr(getattr(effect.apply, "__self__", None), "content", None)
    if own is None or hash_of_images is None or replace(effect, apply=own.apply) != own:
        return None
    return f"{effect.id} {hash_of_images()}"


def content_key(*values: object) -> str:
    """Returns a hash of numbers, texts, arrays, and dataclasses, lists or mappings of these. File paths are ignored."""
    known: dict[int, tuple[object, bytes]] = {}

    def of(value: Any) -> bytes:
        if id(value) in known:
            return known[id(value)][1]
        digest = hashlib.sha256(type(value).__name__.encode())
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype.str}{value.shape}".encode())
            digest.update(np.ascontiguousarray(value).data)
        elif is_dataclass(value):
            digest.update(b"".join(of(getattr(value, field.name)) for field in fields(value)))
        elif isinstance(value, Mapping):
            digest.update(b"".join(of(name) + of(one) for name, one in value.items()))
        elif isinstance(value, list | tuple):
            digest.update(b"".join(map(of, value)))
        elif not isinstance(value, Path):
            digest.update(repr(value).encode())
        known[id(value)] = value, digest.digest()  # kept alive, so that no other value gets its id
        return digest.digest()

    return of(values).hex()


def capture_content(capture: Capture) -> str:
    """Returns a hash of all metadata, images and depths of a capture, and of its scene."""
    images = [(capture.ir(f, side), capture.known(f, side)) for f in capture.frames for side in SIDES]
    depths = [capture.depth(f) for f in capture.frames]
    return content_key(capture, capture.rig.projector.pattern(), images, depths, scene_digest(capture.scene_path))


@cache
def code_digest() -> str:
    """Returns a digest of this package's code and of the versions of the libraries that it computes with."""
    root, digest = Path(activestereo.__file__).parent, hashlib.sha256()
    kinds = {".py", ".html", ".css", ".js"}
    # A build tree may hold broken links.
    for path in sorted(path for path in root.rglob("*") if path.suffix in kinds and path.is_file()):
        digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    try:
        import cv2  # effects blur by it where there is one

        opencv = cv2.__version__
    except ImportError:
        opencv = "none"
    return f"{digest.hexdigest()} {np.__version__} {scipy.__version__} {opencv}"


def key_of(capture: Capture, effects: Mapping[str, Effect], *options: object) -> str | None:
    """Returns the cache key of a diagnosis that starts without effects; None if an effect is a user's own."""
    contents = [effect_content(effect) for effect in effects.values()]
    if None in contents:
        return None
    return content_key("diagnosis", code_digest(), capture_content(capture), contents, options)


def keep(cache: LayerCache, key: str, found: Found) -> None:
    """Writes a diagnosis to the cache under a key."""
    result, model, stub = found
    record = result, model_json(model, "pattern.png"), stub
    cache.put_arrays(key, {"diagnosis/found": np.frombuffer(json.dumps(record).encode(), np.uint8)})


def kept(cache: LayerCache, key: str, capture: Capture) -> Found | None:
    """Reads a diagnosis from the cache; returns None if there is none. The model gets the pattern file of `capture`,
    whose folder may have moved since."""
    stored = cache.get_arrays(key)
    if stored is None:
        return None
    result, model, stub = json.loads(stored["diagnosis/found"].tobytes())
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.json"
        path.with_name("pattern.png").touch()
        write_text(path, json.dumps(model))
        found = read_model(path)
    if found.pattern is not None and found.pattern.file is not None:
        found = replace(found, pattern=replace(found.pattern, file=capture.rig.projector.pattern_path))
    return result, found, stub
