# SPDX-License-Identifier: Apache-2.0
"""The results of a run as JSON, as tables and as a picture."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.sim_to_real import Agreement, agreement, agreement_table
from activestereo.common.output_files import replace_file, write_text
from sim_to_real.files import RunFolder
from sim_to_real.pose_error import CRITERIA, successes
from sim_to_real.poses import errors_of
from sim_to_real.settings import BenchmarkSettings
from sim_to_real.tuning import Model, candidates_of, models_of
from sim_to_real.worlds import SIMULATED, WORLDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

COLORS = {"clean": "#4477aa", "raster": "#ccaa33", "full": "#cc3366"}
_MARKERS = {"ICP": "o", "PPF": "s", "template": "^"}


@dataclass(frozen=True)
class Results:
    """errors: {world: [models, views, 2]} mm and degrees. foreign: which world stands for reality."""

    models: list[Model]
    errors: dict[str, NDArray[np.float64]]
    seed: int
    foreign: str

    @property
    def views(self) -> int:
        return int(self.errors["foreign"].shape[1])

    def rates(self, world: str, criterion: tuple[float, float]) -> NDArray[np.float64]:
        """[models] shares of views with a found pose."""
        return np.asarray(successes(self.errors[world], criterion).mean(axis=1))

    def agreements(self) -> dict[str, dict[str, Agreement]]:
        """{criterion: {world: Agreement}} with the foreign world."""
        out: dict[str, dict[str, Agreement]] = {}
        for criterion in CRITERIA:
            real = successes(self.errors["foreign"], criterion)
            own = {w: agreement(successes(self.errors[w], criterion), real, self.seed) for w in SIMULATED}
            out[f"{criterion[0]:.0f} mm {criterion[1]:.0f}°"] = own
        return out


def results(folder: RunFolder) -> Results:
    """The results of the test views that all worlds have. Raises ValueError if the run is not so far."""
    settings = BenchmarkSettings.read(folder)
    models = models_of(folder)
    candidates = candidates_of(models)
    rounds = max(1, min(folder.rounds(world, "test") for world in WORLDS))
    rows = [candidates.index(model.candidate) for model in models]
    errors = {world: errors_of(folder, world, "test", rounds, candidates)[rows] for world in WORLDS}
    return Results(models, errors, settings.seed, settings.foreign)


def write_report(found: Results, out: Path) -> list[str]:
    """gap.json, gap.md, gap.png, and scores.csv for `activestereo benchmark sim-to-real`. Returns the first table."""
    agreements = found.agreements()
    table = agreement_table(agreements)
    write_text(out / "gap.json", json.dumps(_as_json(found, agreements), indent=2) + "\n")
    write_text(out / "gap.md", "\n".join([*table, "", *model_table(found)]) + "\n")
    lines = ["criterion,method,world,view,found"]
    for name, criterion in zip(agreements, CRITERIA, strict=True):
        for world, errors in found.errors.items():
            for model, row in zip(found.models, successes(errors, criterion), strict=True):
                head = f"{name},{model.method} on {model.tuned_on},{world}"
                lines += [f"{head},{view},{int(is_found)}" for view, is_found in enumerate(row)]
    write_text(out / "scores.csv", "\n".join(lines) + "\n")
    picture = scatter(found)
    replace_file(out / "gap.png", lambda file: picture.savefig(file, format="png", dpi=110))
    return table


def model_table(found: Results) -> list[str]:
    """Lines of Markdown: the share of poses that each model finds in each world."""
    head = " | ".join(f"`{world}`" for world in WORLDS)
    lines = [f"| model | tuned on | its setting | {head} |", "|---|---|---|" + "---|" * len(WORLDS)]
    rates = [[found.rates(world, criterion) for criterion in CRITERIA] for world in WORLDS]
    for row, model in enumerate(found.models):
        setting = ", ".join(f"{key} {value}" for key, value in model.values.items())
        own = " | ".join(" / ".join(f"{100 * rate[row]:.0f}" for rate in pair) for pair in rates)
        lines.append(f"| {model.method} | `{model.tuned_on}` | {setting} | {own} |")
    return lines


def scatter(found: Results) -> Picture:
    """Scores of the models in each of our worlds over those in the foreign one; on the diagonal they are the same."""
    from matplotlib.figure import Figure as Picture
    from matplotlib.lines import Line2D

    picture = Picture(figsize=(10.0, 4.6))
    for axes, criterion in zip(picture.subplots(1, len(CRITERIA)), CRITERIA, strict=True):
        axes.plot([0, 100], [0, 100], color="0.7", linewidth=1)
        real = 100 * found.rates("foreign", criterion)
        for world in SIMULATED:
            own = 100 * found.rates(world, criterion)
            for row, model in enumerate(found.models):
                axes.plot(real[row], own[row], _MARKERS[model.method], color=COLORS[world], markersize=7, alpha=0.75)
        axes.set(xlim=(0, 103), ylim=(0, 103), aspect="equal")
        axes.set(title=f"within {criterion[0]:.0f} mm {criterion[1]:.0f}°")
        axes.set(xlabel="poses found in the foreign world, %", ylabel="poses found in the simulation, %")
    marks = [Line2D([], [], color=COLORS[world], marker="o", linestyle="", label=world) for world in SIMULATED]
    marks += [Line2D([], [], color="0.3", marker=m, linestyle="", label=name) for name, m in _MARKERS.items()]
    picture.legend(handles=marks, loc="center right", frameon=False)
    picture.subplots_adjust(left=0.07, right=0.87, wspace=0.22)
    return picture


def _as_json(found: Results, agreements: dict[str, dict[str, Agreement]]) -> dict[str, Any]:
    return {
        "views": found.views,
        "foreign": found.foreign,
        "models": [asdict(model) | {"values": model.values} for model in found.models],
        "criteria": [
            {
                "mm": criterion[0],
                "deg": criterion[1],
                "scores": {world: found.rates(world, criterion).tolist() for world in WORLDS},
                "agreement": {world: one.as_json() for world, one in own.items()},
            }
            for criterion, own in zip(CRITERIA, agreements.values(), strict=True)
        ],
    }
