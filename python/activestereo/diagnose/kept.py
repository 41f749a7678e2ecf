# SPDX-License-Identifier: Apache-2.0
"""Keeps diagnoses on disk beside renders and fits, so that the same code and options never search a capture twice."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from activestereo.capture.capture import Capture
from activestereo.common.output_files import write_text
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.refine.fit_cache import capture_content, code_digest, content_key, effect_content
from activestereo.effects import Effect
from activestereo.model import SensorModel, read_model
from activestereo.model.write import model_json


@dataclass(frozen=True)
class Found:
    """A diagnosis without its images: the contents of diagnose.json and model.json, and the stub (Python text) of an
    effect."""

    result: dict[str, Any]
    model: SensorModel
    stub: str | None


def key_of(capture: Capture, effects: Mapping[str, Effect], *options: object) -> str | None:
    """Returns the cache key of a diagnosis that starts without effects; None if an effect is a user's own."""
    contents = [effect_content(effect) for effect in effects.values()]
    if None in contents:
        return None
    return content_key("diagnosis", code_digest(), capture_content(capture), contents, options)


def keep(cache: LayerCache, key: str, found: Found) -> None:
    """Writes a diagnosis to the cache."""
    record = found.result, model_json(found.model, "pattern.png"), found.stub
    cache.put_arrays(key, {"diagnosis/found": np.frombuffer(json.dumps(record).encode(), np.uint8)})


def kept(cache: LayerCache, key: str, capture: Capture) -> Found | None:
    """Reads a diagnosis from the cache; None if it holds none. The capture's folder may have moved since: the model
    gets the pattern file of the capture's present place."""
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
    return Found(result, found, stub)
