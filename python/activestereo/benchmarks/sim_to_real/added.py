# SPDX-License-Identifier: Apache-2.0
"""External models, such as learned ones, with scores from their own programs on a run's test views.

A file is a table, CSV with a header, in one of two forms:

    method,tuned_on,world,mm,deg,view,found         found: 1 where the pose of a view was found, else 0
    method,tuned_on,world,mm,deg,score              score: share of the views, 0 to 1

tuned_on says what the model learned from, in a word. world is clean, raster, full or foreign; mm and deg are the
criterion, 10 and 10 or 20 and 20. View 8 r + n is object n of round r, depth/WORLD/test-000r.npz; every model has every
world, criterion and view. The intervals resample models with found; a score stays fixed.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.sim_to_real.pose_error import CRITERIA
from activestereo.benchmarks.sim_to_real.worlds import WORLDS
from activestereo.common.input_files import read_text

_HEAD = ("method", "tuned_on", "world", "mm", "deg")
_FORMS = ((*_HEAD, "view", "found"), (*_HEAD, "score"))

Key = tuple[str, tuple[float, float]]  # a world and a criterion


@dataclass(frozen=True)
class AddedModel:
    """found: successes [views] by world and criterion; None with scores alone."""

    method: str
    tuned_on: str
    scores: dict[Key, float]
    found: dict[Key, NDArray[np.bool_]] | None


def read_added(path: Path, views: int) -> list[AddedModel]:
    """The models of a file, in its order, for a run of so many test views. Raises ValueError with the line or the
    missing part."""
    try:
        text = read_text(path, "utf-8-sig")  # with a byte order mark, as Excel writes it
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}: is not a table of text: {error}") from error
    columns = tuple(word.strip() for word in rows[0]) if rows else ()
    if columns not in _FORMS:
        forms = " or ".join(",".join(form) for form in _FORMS)
        raise ValueError(f"{path}: the first line is '{','.join(columns)}', expected {forms}")
    has_views = columns == _FORMS[0]
    values: dict[tuple[str, str], dict[tuple[Key, int], float]] = {}
    for number, row in enumerate(rows[1:], 2):
        if not row:
            continue
        try:
            method, tuned_on, key, view, value = _parsed(row, has_views, views)
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from None
        own = values.setdefault((method, tuned_on), {})
        if (key, view) in own:
            raise ValueError(f"{path}, line {number}: {method} on {tuned_on} has this line twice")
        own[key, view] = value
    if not values:
        raise ValueError(f"{path}: has no models")
    return [_model(path, *names, own, views if has_views else None) for names, own in values.items()]


def _parsed(row: list[str], has_views: bool, views: int) -> tuple[str, str, Key, int, float]:
    if len(row) != len(_FORMS[0] if has_views else _FORMS[1]):
        raise ValueError(f"has {len(row)} values")
    method, tuned_on, world, mm, deg, *rest = (word.strip() for word in row)
    if not method or not tuned_on:
        raise ValueError("method and tuned_on are empty" if not method and not tuned_on else "a name is empty")
    if world not in WORLDS:
        raise ValueError(f"unknown world '{world}' (known: {', '.join(WORLDS)})")
    try:
        criterion = float(mm), float(deg)
        numbers = [float(word) for word in rest]
    except ValueError:
        raise ValueError(f"'{','.join((mm, deg, *rest))}' are not all numbers") from None
    if criterion not in CRITERIA:
        known = ", ".join(f"{a:g},{b:g}" for a, b in CRITERIA)
        raise ValueError(f"unknown criterion {mm},{deg} (known: {known})")
    value, view = numbers[-1], numbers[0] if has_views else 0.0
    if has_views and view not in range(views):
        raise ValueError(f"view {rest[0]} is not one of the run's, 0 to {views - 1}")
    if has_views and value not in (0.0, 1.0):
        raise ValueError(f"found is {rest[-1]}, expected 0 or 1")
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"score is {rest[-1]}, expected 0 to 1")
    return method, tuned_on, (world, criterion), int(view), value


def _model(
    path: Path, method: str, tuned_on: str, own: dict[tuple[Key, int], float], views: int | None
) -> AddedModel:
    every = list(product(WORLDS, CRITERIA))
    for key in every:
        for view in range(views or 1):
            if (key, view) not in own:
                (world, (mm, deg)), of = key, "" if views is None else f" of view {view}"
                raise ValueError(f"{path}: {method} on {tuned_on} has no line{of} in {world} at {mm:g} mm {deg:g} deg")
    table = {key: np.array([own[key, view] for view in range(views or 1)]) for key in every}
    scores = {key: float(row.mean()) for key, row in table.items()}
    return AddedModel(method, tuned_on, scores, {k: row > 0 for k, row in table.items()} if views else None)
