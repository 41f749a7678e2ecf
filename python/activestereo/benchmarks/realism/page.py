# SPDX-License-Identifier: Apache-2.0
"""The board as JSON and as one page with pictures."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from activestereo.benchmarks.realism.board import DEVICE, Board, verdicts
from activestereo.benchmarks.realism.methods import METHODS
from activestereo.common.html_table import table, text
from activestereo.common.output_files import write_text

_WIDTH_PX = 300
_STYLE = (
    "body{font:14px sans-serif;margin:2em;max-width:110em}td,th{padding:2px 8px;text-align:right;white-space:nowrap}"
    "td:first-child,th:first-child{text-align:left}figure{display:inline-block;margin:4px}figcaption{font-size:12px}"
)


def write_board(found: Board, out: Path, about: dict[str, object]) -> None:
    """realism.json and realism.html."""
    rows = {name: {method: asdict(one) for method, one in row.items()} for name, row in found.rows.items()}
    lines = verdicts(found)
    content = about | {"views": list(found.views), "verdicts": lines, "measures": rows}
    write_text(out / "realism.json", json.dumps(content, indent=1) + "\n")
    methods = (DEVICE, *METHODS)
    cells = [[text(name), *(_cell(row.get(method)) for method in methods)] for name, row in found.rows.items()]
    parts = [f"<p>{text(line)}</p>" for line in lines]
    parts.append(table(["measure", *methods], cells))
    for view, pictures in found.pictures.items():
        parts.append(f"<h2>{text(view)}</h2>")
        known = pictures["truth"]
        low, high = np.nanpercentile(known, [1, 99])
        parts += [_figure(name, image, float(low), float(high)) for name, image in pictures.items()]
    head = f"<h1>Realism of depth: {len(found.views)} real views of {text(about['sensor'])}</h1>"
    page = f"<!doctype html><meta charset=utf-8><title>Realism</title><style>{_STYLE}</style>{head}{''.join(parts)}"
    write_text(out / "realism.html", page + "\n")


def _cell(one: object) -> str:
    if one is None:
        return "–"
    value, low, high = (getattr(one, name) for name in ("value", "low", "high"))
    return f"{value:.3g} <small>({low:.3g}–{high:.3g})</small>"


def _figure(name: str, disparity: NDArray[np.float32], low: float, high: float) -> str:
    from matplotlib import colormaps

    step = max(1, disparity.shape[1] // _WIDTH_PX)
    image = disparity[::step, ::step]
    shade = colormaps["turbo"](np.clip((np.nan_to_num(image, nan=low) - low) / max(high - low, 1e-6), 0.0, 1.0))
    pixels = (255.0 * shade[..., :3] * np.isfinite(image)[..., None]).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "png")
    source = base64.b64encode(buffer.getvalue()).decode()
    return f'<figure><img src="data:image/png;base64,{source}"><figcaption>{text(name)}</figcaption></figure>'
