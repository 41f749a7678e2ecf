# SPDX-License-Identifier: Apache-2.0
"""Measures which part of the simulation its realism rests on.

It compares the agreement of `full` with the foreign world, with more and fewer rays, with and without the denoiser,
with more and less noise, with nominal, random and measured materials. The models stay those of the run."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sim_to_real.files import RunFolder
from sim_to_real.measured_materials import Measured, with_measured
from sim_to_real.objects import objects
from sim_to_real.pictures import take_pictures
from sim_to_real.pose_error import CRITERIA, successes
from sim_to_real.poses import errors_of, find_poses
from activestereo.benchmarks.sim_to_real import Agreement, agreement
from sim_to_real.settings import BenchmarkSettings
from sim_to_real.tuning import candidates_of, models_of
from sim_to_real.worlds import World
from activestereo.common.output_files import replace_file, write_text
from activestereo.common.progress_bar import Progress, part_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

SAMPLES = (2, 4, 8, 16, 32, 64, 128)
NOISES = (0.0, 0.5, 1.0, 2.0, 4.0, 10.0)
KINDS = ("samples", "noise", "materials")


def variants(
    kinds: tuple[str, ...] = KINDS, samples: tuple[int, ...] = SAMPLES, has_measured: bool = False
) -> list[World]:
    """Worlds like `full`, except for the changes that `kinds` name. has_measured: add one with measured materials."""
    out = []
    if "samples" in kinds:
        for is_denoised in (True, False):
            word = "denoised" if is_denoised else "noisy"
            out += [World(f"full_{n}spp_{word}", "full", samples=n, is_denoised=is_denoised) for n in samples]
    if "noise" in kinds:
        out += [World(f"full_noise_{factor:g}", "full", noise=factor) for factor in NOISES]
    if "materials" in kinds:
        words = ("nominal", "random", "measured") if has_measured else ("nominal", "random")
        out += [World(f"full_{word}_materials", "full", materials=word) for word in words]
    return out


Ablation = list[tuple[World, list[Agreement]]]  # an agreement for each of CRITERIA


def ablate(
    folder: RunFolder,
    views: int,
    worlds: list[World],
    device: str | int = "auto",
    workers: int = 1,
    progress: Progress | None = None,
    measured: Measured | None = None,
) -> Ablation:
    """The agreement of each world with the foreign one over the first `views` test views of a run. measured: the data
    of the measured materials. Raises ValueError if the run is incomplete, has pictures of other measured materials, or
    lacks measured materials that a world asks for. Finished work stays, and the same call continues."""
    if not measured and any(world.materials == "measured" for world in worlds):
        raise ValueError("a world of measured materials is asked for without them: give measured=read_measured(...)")
    settings = BenchmarkSettings.read(folder)
    models = models_of(folder)
    candidates = candidates_of(models)
    rows = [candidates.index(model.candidate) for model in models]
    rounds = BenchmarkSettings(views=views).rounds("test")
    real = errors_of(folder, "foreign", "test", rounds, candidates)[rows]
    effort = [float(world.samples or settings.camera.samples) + 4.0 for world in worlds]
    if measured is not None:
        folder.keep_measured(measured)
    out: Ablation = []
    for n, world in enumerate(worlds):
        start, end = (sum(effort[:last]) / sum(effort) for last in (n, n + 1))
        middle = start + 0.8 * (end - start)
        own = part_of(progress, start, middle)
        things = with_measured(objects(), measured) if measured and world.materials == "measured" else objects()
        take_pictures(folder, settings, world, "test", rounds, device, workers, own, things)
        own = part_of(progress, middle, end)
        found = find_poses(folder, settings.seed, (world.name,), "test", rounds, candidates, workers, own)
        errors = found[world.name][rows]
        pairs = [(successes(errors, c), successes(real, c)) for c in CRITERIA]
        out.append((world, [agreement(*pair, settings.seed) for pair in pairs]))
    return out


def write_ablation(found: Ablation, out: Path) -> None:
    """ablation.json, ablation.md and ablation.png."""
    rows = [asdict(world) | {"agreement": [own.as_json() for own in both]} for world, both in found]
    write_text(out / "ablation.json", json.dumps(rows, indent=2) + "\n")
    write_text(out / "ablation.md", "\n".join(table(found)) + "\n")
    picture = chart(found)
    replace_file(out / "ablation.png", lambda file: picture.savefig(file, format="png", dpi=110))


def table(found: Ablation) -> list[str]:
    """Lines of Markdown."""
    names = [f"{figure}, {mm:.0f} mm {deg:.0f}°" for mm, deg in CRITERIA for figure in ("Pearson", "mean gap")]
    lines = ["| `full` with | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for world, both in found:
        figures = " | ".join(f"{own.pearson} | {own.gap}" for own in both)
        lines.append(f"| {_words(world)} | {figures} |")
    return lines


def chart(found: Ablation) -> Picture:
    """Pearson's correlation and the mean gap at the first criterion, over the varied quantity: a column for each."""
    from matplotlib.figure import Figure as Picture

    kinds = [kind for kind in KINDS if any(_kind(world) == kind for world, _ in found)]
    picture = Picture(figsize=(3.5 * len(kinds), 5.6), layout="constrained")
    axes = picture.subplots(2, len(kinds), sharey="row", squeeze=False)
    for column, kind in enumerate(kinds):
        own = [row for row in found if _kind(row[0]) == kind]
        for is_denoised, color in ((None, "#cc3366"), (True, "#cc3366"), (False, "#4477aa")):
            rows = [row for row in own if row[0].is_denoised is is_denoised]
            label = {None: "", True: "denoised", False: "not denoised"}[is_denoised]
            x = [
                {"samples": world.samples or 0, "noise": world.noise}.get(kind, n)
                for n, (world, _) in enumerate(rows)
            ]
            for line, figure in enumerate(("pearson", "gap") if rows else ()):
                figures = [getattr(both[0], figure) for _, both in rows]
                spread = np.maximum([[f.value - f.low for f in figures], [f.high - f.value for f in figures]], 0.0)
                form = "o" if kind == "materials" else "o-"
                axes[line, column].errorbar(x, [f.value for f in figures], spread, fmt=form, color=color, label=label)
        if kind == "samples":
            axes[0, column].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
            for line in (0, 1):
                axes[line, column].set_xscale("log", base=2)
                counts = sorted({world.samples or 0 for world, _ in own})
                axes[line, column].set_xticks(counts, [str(n) for n in counts])
        if kind == "materials":
            words = [world.materials for world, _ in own]
            axes[0, column].set(xticks=range(len(words)), xticklabels=words, xlim=(-0.5, len(words) - 0.5))
            axes[1, column].set(xticks=range(len(words)), xticklabels=words, xlim=(-0.5, len(words) - 0.5))
        axes[1, column].set_xlabel(_LABELS[kind])
    axes[0, 0].set_ylabel("Pearson's r")
    axes[1, 0].set_ylabel("mean gap")
    return picture


_LABELS = {"samples": "rays per pixel", "noise": "noise over the sensor's own", "materials": "materials"}


def _kind(world: World) -> str:
    if world.samples is not None:
        return "samples"
    return "materials" if world.name.endswith("materials") else "noise"


def _words(world: World) -> str:
    return {
        "samples": f"{world.samples} rays per pixel, {'denoised' if world.is_denoised else 'not denoised'}",
        "materials": f"{world.materials} materials",
        "noise": f"{world.noise:g} times the noise",
    }[_kind(world)]
