# SPDX-License-Identifier: Apache-2.0
"""Builds self-contained web pages: text is escaped, pictures are data URIs, and scripts are inline. The content
security policy of a page forbids the browser to load anything else. Images are stored as lossless pictures of integer
codes, which the page decodes exactly: value = low + step * code."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from functools import cache
from importlib import resources
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image

from activestereo.common.html_table import text
from activestereo.report.lettering import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LARGEST_CODE = 2**16 - 1
_NOT_COMPARED = "#8a94a0"


def page(title: str, body: Sequence[str], scripts: Sequence[str] = ()) -> str:
    """Returns a whole HTML document. body: trusted HTML, which is not escaped. scripts: names of files in web/."""
    code = "".join(f"<script>\n{web_file(name)}</script>\n" for name in scripts)
    parts = {"title": text(title), "style": web_file("page.css"), "body": "\n".join(body), "scripts": code}
    return Template(web_file("page.html")).substitute(parts)


@cache
def web_file(name: str) -> str:
    """Reads a text file of the folder web/, which holds the page's template, style and scripts."""
    return resources.files("activestereo.report").joinpath(f"web/{name}").read_text(encoding="utf-8")


def section(title: str, *parts: str) -> str:
    return f"<section><h2>{text(title)}</h2>\n" + "\n".join(parts) + "</section>"


def card(title: str, value: str, note: str) -> str:
    return f'<div class="card"><span>{text(title)}</span><b>{text(value)}</b><span>{text(note)}</span></div>'


def share_bar(share: float) -> str:
    """Returns the HTML of a bar for a share 0..1, and of the share in percent."""
    bar = f'<div class="bar"><i style="width:{100.0 * min(max(share, 0.0), 1.0):.1f}%"></i></div>'
    return f"{bar}{100 * share:.0f} %"


def chart(figure: Figure, alt: str) -> str:
    """Returns HTML with a Matplotlib Figure as inline SVG. Letters are shapes, so that it looks alike everywhere."""
    file = io.BytesIO()
    save_figure(figure, file, format="svg", metadata={"Date": None})
    content = base64.b64encode(file.getvalue()).decode()
    return f'<figure><img alt="{text(alt)}" src="data:image/svg+xml;base64,{content}"></figure>'


def encoded_image(image: np.ndarray, step: float, valid: np.ndarray | None = None) -> dict[str, Any]:
    """Encodes an image [height][width] of numbers as {src, low, step, planes, has_empty} for web/picture.js. Decoded
    values are off by half a step at most. Codes up to 255 take one plane; larger codes take two, the high bytes above
    the low bytes.

    step: in the image's unit; it grows if 65535 steps do not span the image. valid: mask of pixels with a value; None:
    all finite pixels. Pixels without a value get code 0, and values then start at code 1."""
    image = np.asarray(image, dtype=np.float64)
    holds = np.isfinite(image) if valid is None else valid & np.isfinite(image)
    has_empty = not bool(holds.all())
    low, high = (float(image[holds].min()), float(image[holds].max())) if holds.any() else (0.0, 0.0)
    low = step * np.floor(low / step)
    first = int(has_empty)
    step = max(step, (high - low) / (_LARGEST_CODE - first))
    code = np.where(holds, np.rint((np.where(holds, image, low) - low) / step) + first, 0).astype(np.uint16)
    planes = [(code >> 8).astype(np.uint8)] if code.max(initial=0) > 255 else []
    planes.append((code & 255).astype(np.uint8))
    src = data_address(np.repeat(np.concatenate(planes)[..., None], 3, axis=2))
    return {"src": src, "low": low - first * step, "step": step, "planes": len(planes), "has_empty": has_empty}


def coloured(share: NDArray[np.float64], colours: str) -> NDArray[np.uint8]:
    """Colours an image [height][width] of shares 0..1 by a colour map of this name: uint8 [height][width][3]. Shares
    beyond 0 and 1 are clipped; NaN is grey: not compared."""
    colour_map = colormaps[colours].with_extremes(bad=_NOT_COMPARED)
    return np.asarray(colour_map(np.ma.masked_invalid(np.clip(share, 0.0, 1.0)), bytes=True))[..., :3]


def data_address(pixels: np.ndarray) -> str:
    """Encodes uint8 [height][width][3] as a data URI of lossless WebP, which takes about three quarters of PNG's
    bytes."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="webp", lossless=True, quality=20, method=4)
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}"
