# SPDX-License-Identifier: Apache-2.0
"""A picture of all kinds of effects: the first frame's image with each, and its change below."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np

from activestereo.benchmarks.inject.inject import plan
from activestereo.benchmarks.inject.kinds import KINDS, STRENGTHS
from activestereo.capture.capture import Capture
from activestereo.common.output_files import write_bytes

_COLUMNS = 4


def write_sheet(capture: Capture, strength: str, seed: int, black_dn: float | None, path: Path) -> None:
    """The sheet as a PNG. strength: one of STRENGTHS, for a number does not mean the same to two effects."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if strength not in STRENGTHS:
        raise ValueError(f"--sheet shows all effects: --strength is {strength!r}, expected {', '.join(STRENGTHS)}")
    number = next((n for n, frame in enumerate(capture.frames) if frame.has_infrared), 0)
    injections = [plan(capture, name, strength, seed, black_dn) for name in KINDS]
    first = capture.ir(capture.frames[number], "left")
    white = max(1.0, float(np.quantile(first, 0.995)))
    rows = -(-len(injections) // _COLUMNS)
    aspect = first.shape[0] / first.shape[1]
    figure = Figure(figsize=(12.0, rows * (6.0 * aspect + 0.4)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2 * rows, _COLUMNS, squeeze=False)
    for axis in axes.flat:
        axis.set_axis_off()
    for i, injection in enumerate(injections):
        side = injection.sides[0]
        before = capture.ir(capture.frames[number], side)
        after = injection.changed(number, side)
        above, below = axes[2 * (i // _COLUMNS), i % _COLUMNS], axes[2 * (i // _COLUMNS) + 1, i % _COLUMNS]
        above.imshow(after, cmap="gray", vmin=0, vmax=white)
        above.set_title(f"{injection.name} {injection.value:g}, {side}", fontsize=9)
        limit = max(1.0, float(np.quantile(np.abs(after - before), 0.99)))
        below.imshow(after - before, cmap="RdBu_r", vmin=-limit, vmax=limit)
        below.set_title(f"change, ±{limit:.0f} DN", fontsize=8)
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=64)
    write_bytes(path, stream.getvalue())
