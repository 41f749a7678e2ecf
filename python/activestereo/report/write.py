# SPDX-License-Identifier: Apache-2.0
"""Writes the files of a comparison: compare.json and report.html, a self-contained page that may include a diagnosis.
Writes the files of a diagnosis: its own report.html, diagnose.json, model.json and effect_stub.py."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.common.html_table import text
from activestereo.common.input_files import read_json
from activestereo.common.output_files import write_json, write_text, written_together
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.kept import content_key
from activestereo.model import SensorModel, write_model
from activestereo.model.library import library, with_effects_of
from activestereo.report.comparison import cards, comparison_sections, settings_section
from activestereo.report.diagnosis import diagnosis_sections
from activestereo.report.explorer import explorer_section
from activestereo.report.first_screen import comparison_first_screen, first_screen
from activestereo.report.models import model_images, told_errors
from activestereo.report.page import page
from activestereo.report.screen import Step
from activestereo.report.strips import found_strips
from activestereo.report.summary import what_is_missed

if TYPE_CHECKING:
    from activestereo.compare.compare import Comparison
    from activestereo.compare.image_errors import ImageErrors
    from activestereo.diagnose import Diagnosis
    from activestereo.effects import Effect


_SCRIPTS = ("picture.js", "zoom.js", "explorer.js", "strip.js")


def write_report(
    comparison: Comparison, folder: str | Path, diagnosis: dict[str, Any] | None = None,
    effects: Mapping[str, Effect] | None = None, progress: Callable[[float], object] | None = None,
    steps: Sequence[Step] = (),
) -> tuple[Path, Path]:  # fmt: skip
    """Writes compare.json and report.html into `folder`, made if absent, and returns their paths.

    diagnosis: diagnose.json's contents; None for the folder's own diagnose.json, if it belongs to this capture.
    effects: {id: Effect} that the diagnosis may name, None for the built-in ones. progress: called as progress(fraction
    done). steps: commands to paste, made by screen.command().
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if diagnosis is None:
        with suppress(OSError, ValueError):  # the folder's own, if it can be read and is of this capture
            stored = read_json(folder / "diagnose.json")
            if isinstance(stored, dict) and stored.get("capture", comparison.capture.name) == comparison.capture.name:
                diagnosis = stored
    html_text = report_page(comparison, diagnosis, effects, progress, steps=steps)
    with written_together(folder) as aside:
        write_json(aside / "compare.json", comparison.scores, allow_nan=False)
        write_text(aside / "report.html", html_text)
    return folder / "compare.json", folder / "report.html"


def report_page(
    comparison: Comparison, diagnosis: dict[str, Any] | None = None, effects: Mapping[str, Effect] | None = None,
    progress: Callable[[float], object] | None = None, found_errors: ImageErrors | None = None,
    steps: Sequence[Step] = (),
) -> str:  # fmt: skip
    """Returns the HTML of report.html. found_errors: as in model_images(); other arguments as in write_report()."""
    scores = comparison.scores
    images = model_images(comparison, diagnosis, effects, progress, found_errors)
    told = told_errors(comparison, found_errors)
    missed, explorer = what_is_missed(scores), explorer_section(comparison, images, told)
    body = [comparison_first_screen(comparison, images, missed, steps, told), cards(scores), explorer]
    if diagnosis:
        verdict = first_screen(diagnosis, comparison, images, steps, told)
        strips = found_strips(comparison, diagnosis, images, library() if effects is None else effects)
        sections = diagnosis_sections(diagnosis, images)
        sentences = "".join(f"<p>{text(sentence)}</p>" for sentence in missed)
        head = f"<h2>{text(scores['capture'])}: the model against the measurement</h2>{sentences}"
        body = [verdict, explorer, *strips, *sections, head, cards(scores)]
    body += [*comparison_sections(comparison), settings_section(scores)]
    return page(f"{scores['capture']}: comparison", body, _SCRIPTS)


def write_diagnosis_report(
    diagnosis: Diagnosis, folder: str | Path, effects: Mapping[str, Effect] | None = None,
    progress: Callable[[float], object] | None = None, steps: Sequence[Step] = (),
) -> Path:  # fmt: skip
    """Writes report.html of a diagnosis into `folder`, made if absent, and returns its path. It renders nothing.

    effects: {id: Effect} that the diagnosis chose from, None for the built-in ones. progress: called as
    progress(fraction done). steps: as in write_report().
    """
    path = Path(folder) / "report.html"
    path.parent.mkdir(parents=True, exist_ok=True)

    def made(steps: Sequence[Step]) -> str:
        result, comparison = diagnosis.result, diagnosis.comparison()
        if comparison is not None:
            return report_page(comparison, result, effects, progress, diagnosis.after, steps)
        screen = first_screen(result, steps=steps, unseen=diagnosis.unseen)
        return page(f"{result.get('capture', 'capture')}: diagnosis", [screen, *diagnosis_sections(result)])

    write_text(path, made(steps) if diagnosis.kept_as is None else _kept_page(diagnosis.kept_as, steps, made))
    return path


def _kept_page(kept_as: str, steps: Sequence[Step], make: Callable[[Sequence[Step]], str]) -> str:
    """Returns the HTML page of a diagnosis, from the cache if it was made before. kept_as: the diagnosis's cache key.
    make: builds the page with given steps. The cached page has marks in place of the commands, which name folders of
    this run; they are filled in last."""
    cache, key = LayerCache(), content_key("page", kept_as, [step.label for step in steps])
    marks = [replace(step, words=(f"{key}-{i}",)) for i, step in enumerate(steps)]
    stored = cache.get_arrays(key)
    if stored is None:
        stored = {"diagnosis/page": np.frombuffer(make(marks).encode(), np.uint8)}
        cache.put_arrays(key, stored)
    kept = stored["diagnosis/page"].tobytes().decode()
    for mark, step in zip(marks, steps, strict=True):
        kept = kept.replace(mark.text, text(step.text))
    return kept


def write_diagnosis(diagnosis: Diagnosis, folder: str | Path) -> list[Path]:
    """Writes diagnose.json, model.json and, for an unknown effect, effect_stub.py into the folder, made if absent.
    Returns their paths."""
    folder = Path(folder)
    with written_together(folder) as aside:
        write_json(aside / "diagnose.json", diagnosis.result)
        if diagnosis.stub:
            write_text(aside / "effect_stub.py", diagnosis.stub)
        model = diagnosis.sensor_model or with_effects_of(SensorModel(), diagnosis.model, None)
        write_model(aside / "model.json", model)
        names = sorted(path.name for path in aside.iterdir())
    return [folder / name for name in names]
