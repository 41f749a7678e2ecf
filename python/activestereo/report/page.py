# SPDX-License-Identifier: Apache-2.0
"""Builds a self-contained web page: text is escaped, pictures are data URIs, and scripts are inline. Its content
security policy forbids the browser to load anything."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from functools import cache
from importlib import resources
from string import Template
from typing import TYPE_CHECKING

from activestereo.common.html_table import text
from activestereo.report.lettering import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def page(title: str, body: Sequence[str], scripts: Sequence[str] = ()) -> str:
    """Returns a whole HTML document. body: parts as trusted HTML; scripts: names of files in web/."""
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


def share_bar(share: float, interval: Sequence[float] | None = None, mark: float | None = None) -> str:
    """Returns the HTML of a bar for a share 0..1. interval: drawn as a line; mark: drawn as a tick to compare with."""
    at = lambda value: 100.0 * min(max(value, 0.0), 1.0)  # noqa: E731
    parts = [f'<i style="width:{at(share):.1f}%"></i>']
    if interval:
        parts.append(f'<u style="left:{at(interval[0]):.1f}%;width:{at(interval[1]) - at(interval[0]):.1f}%"></u>')
    if mark is not None:
        parts.append(f'<s style="left:{at(mark):.1f}%"></s>')
    return f'<div class="bar">{"".join(parts)}</div>'


def chart(figure: Figure, alt: str) -> str:
    """Returns HTML with a Matplotlib Figure as inline SVG. Letters are shapes, so that it looks alike everywhere."""
    file = io.BytesIO()
    save_figure(figure, file, format="svg", metadata={"Date": None})
    content = base64.b64encode(file.getvalue()).decode()
    return f'<figure><img alt="{text(alt)}" src="data:image/svg+xml;base64,{content}"></figure>'
