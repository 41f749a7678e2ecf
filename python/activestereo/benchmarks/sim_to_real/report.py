# SPDX-License-Identifier: Apache-2.0
"""The results of a run as JSON, as a table and as a picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import cycle
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.sim_to_real.added import AddedModel, read_added
from activestereo.benchmarks.sim_to_real.files import RunFolder
from activestereo.benchmarks.sim_to_real.pose_error import CRITERIA, successes
from activestereo.benchmarks.sim_to_real.poses import errors_of
from activestereo.benchmarks.sim_to_real.score import Agreement, Figure, agreement
from activestereo.benchmarks.sim_to_real.settings import BenchmarkSettings
from activestereo.benchmarks.sim_to_real.tuning import Model, candidates_of, models_of
from activestereo.benchmarks.sim_to_real.worlds import SIMULATED, WORLDS
from activestereo.common.output_files import replace_file, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

COLORS = {"clean": "#4477aa", "raster": "#ccaa33", "full": "#cc3366"}
_MARKERS = {"ICP": "o", "PPF": "s", "template": "^"}
_ADDED_MARKERS = "DvPX*<>p"


@dataclass(frozen=True)
class Results:
    """errors: {world: [models, views, 2]} mm and degrees. foreign: which world stands for reality. added: models of
    others, which follow the run's."""

    models: list[Model]
    errors: dict[str, NDArray[np.float64]]
    seed: int
    foreign: str
    added: tuple[AddedModel, ...] = ()

    @property
    def views(self) -> int:
        return int(self.errors["foreign"].shape[1])

    def rates(self, world: str, criterion: tuple[float, float]) -> NDArray[np.float64]:
        """[models] shares of views with a found pose, the added ones last."""
        own = successes(self.errors[world], criterion).mean(axis=1)
        return np.append(own, [model.scores[world, criterion] for model in self.added])

    @property
    def names(self) -> list[tuple[str, str, str]]:
        """[models] method, its tuning world, and its setting."""
        own = [(m.method, m.tuned_on, ", ".join(f"{k} {v}" for k, v in m.values.items())) for m in self.models]
        return own + [(model.method, model.tuned_on, "added") for model in self.added]

    def agreement(self, world: str, criterion: tuple[float, float]) -> Agreement:
        """The agreement of a world with the foreign one."""
        found, known = [], []
        for name in (world, "foreign"):
            key = name, criterion
            more = [model.found[key] for model in self.added if model.found is not None]
            found.append(np.concatenate([successes(self.errors[name], criterion), *(row[None] for row in more)]))
            known.append([model.scores[key] for model in self.added if model.found is None])
        return agreement(found[0], found[1], self.seed, (known[0], known[1]))


def results(folder: RunFolder, added: Sequence[Path] = ()) -> Results:
    """The results of the test views that all worlds have. added: files of models of others (added.py). Raises
    ValueError if the run is not so far, or such a file is not of this run."""
    settings = BenchmarkSettings.read(folder)
    models = models_of(folder)
    candidates = candidates_of(models)
    rounds = max(1, min(folder.rounds(world, "test") for world in WORLDS))
    rows = [candidates.index(model.candidate) for model in models]
    errors = {world: errors_of(folder, world, "test", rounds, candidates)[rows] for world in WORLDS}
    found = Results(models, errors, settings.seed, settings.foreign)
    more = tuple(model for path in added for model in read_added(path, found.views))
    names = [(own.method, own.tuned_on) for own in models] + [(own.method, own.tuned_on) for own in more]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"there are two models called {twice[0][0]} on {twice[0][1]}")
    return replace(found, added=more)


def write_report(found: Results, out: Path) -> None:
    """gap.json, gap.md and gap.png."""
    write_text(out / "gap.json", json.dumps(_as_json(found), indent=2) + "\n")
    write_text(out / "gap.md", "\n".join([*agreement_table(found), "", *model_table(found)]) + "\n")
    picture = scatter(found)
    replace_file(out / "gap.png", lambda file: picture.savefig(file, format="png", dpi=110))


def agreement_table(found: Results) -> list[str]:
    """Lines of Markdown: how each world agrees with the foreign one."""
    lines = ["| poses within | learnt and ranked in | Pearson | Spearman | mean gap |", "|---|---|---|---|---|"]
    for criterion in CRITERIA:
        for world in SIMULATED:
            own = found.agreement(world, criterion)
            figures = " | ".join(shown(figure) for figure in (own.pearson, own.spearman, own.gap))
            lines.append(f"| {_named(criterion)} | `{world}` | {figures} |")
    return lines


def model_table(found: Results) -> list[str]:
    """Lines of Markdown: the share of poses that each model finds in each world."""
    head = " | ".join(f"`{world}`" for world in WORLDS)
    lines = [f"| model | tuned on | its setting | {head} |", "|---|---|---|" + "---|" * len(WORLDS)]
    rates = [[found.rates(world, criterion) for criterion in CRITERIA] for world in WORLDS]
    for row, (method, tuned_on, setting) in enumerate(found.names):
        own = " | ".join(" / ".join(f"{100 * rate[row]:.0f}" for rate in pair) for pair in rates)
        lines.append(f"| {method} | `{tuned_on}` | {setting} | {own} |")
    return lines


def scatter(found: Results) -> Picture:
    """Scores of the models in each of our worlds over those in the foreign one; on the diagonal they are the same."""
    from matplotlib.figure import Figure as Picture
    from matplotlib.lines import Line2D

    picture = Picture(figsize=(10.0, 4.6))
    more = dict.fromkeys(model.method for model in found.added if model.method not in _MARKERS)
    markers = _MARKERS | dict(zip(more, cycle(_ADDED_MARKERS)))
    for axes, criterion in zip(picture.subplots(1, len(CRITERIA)), CRITERIA, strict=True):
        axes.plot([0, 100], [0, 100], color="0.7", linewidth=1)
        real = 100 * found.rates("foreign", criterion)
        for world in SIMULATED:
            own = 100 * found.rates(world, criterion)
            for row, (method, _, _) in enumerate(found.names):
                axes.plot(real[row], own[row], markers[method], color=COLORS[world], markersize=7, alpha=0.75)
        axes.set(xlim=(0, 103), ylim=(0, 103), aspect="equal", title=f"within {_named(criterion)}")
        axes.set(xlabel="poses found in the foreign world, %", ylabel="poses found in the simulation, %")
    marks = [Line2D([], [], color=COLORS[world], marker="o", linestyle="", label=world) for world in SIMULATED]
    marks += [Line2D([], [], color="0.3", marker=m, linestyle="", label=name) for name, m in markers.items()]
    picture.legend(handles=marks, loc="center right", frameon=False)
    picture.subplots_adjust(left=0.07, right=0.87, wspace=0.22)
    return picture


def shown(figure: Figure) -> str:
    """'0.97 (0.91 to 0.99)', or a dash without a value."""
    if isnan(figure.value):
        return "–"
    return f"{figure.value:.2f} ({figure.low:.2f} to {figure.high:.2f})"


def _named(criterion: tuple[float, float]) -> str:
    return f"{criterion[0]:.0f} mm {criterion[1]:.0f}°"


def _as_json(found: Results) -> dict[str, Any]:
    return {
        "views": found.views,
        "foreign": found.foreign,
        "models": [asdict(model) | {"values": model.values} for model in found.models]
        + [{"method": model.method, "tuned_on": model.tuned_on} for model in found.added],
        "criteria": [
            {
                "mm": criterion[0],
                "deg": criterion[1],
                "scores": {world: found.rates(world, criterion).tolist() for world in WORLDS},
                "agreement": {world: agreement_json(found.agreement(world, criterion)) for world in SIMULATED},
            }
            for criterion in CRITERIA
        ],
    }


def agreement_json(own: Agreement) -> dict[str, list[float | None]]:
    """{figure: [value, low, high]}; null without a value."""
    return {
        name: [None if isnan(value) else value for value in figure.values()] for name, figure in asdict(own).items()
    }
