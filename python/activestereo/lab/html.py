"""One self-contained web page: text is escaped, pictures and charts are data URIs, no script, nothing is loaded."""

import base64
import html
import io

import numpy as np
from matplotlib import colormaps
from PIL import Image

INK, MUTED, GRID = "#1f2933", "#66727f", "#e4e7eb"
BLUE, ORANGE, GREEN = "#3e6fb0", "#c8722c", "#3f8f6b"

_STYLE = """
body { margin: 0; background: #f4f5f7; color: #1f2933; font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 28px 28px 60px; }
h1 { font-size: 27px; line-height: 1.25; margin: 0 0 4px; } h2 { font-size: 20px; margin: 0 0 6px; } h3 { font-size: 15px; margin: 20px 0 6px; }
p { margin: 6px 0; max-width: 92ch; } .muted { color: #66727f; } .small { font-size: 13px; }
section { background: #fff; border: 1px solid #e4e7eb; border-radius: 8px; padding: 20px 24px 22px; margin: 18px 0; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); gap: 14px; margin: 18px 0 0; }
.card { background: #fff; border: 1px solid #e4e7eb; border-radius: 8px; padding: 14px 18px; }
.card b { display: block; font-size: 26px; line-height: 1.25; font-weight: 600; } .card span { color: #66727f; font-size: 13px; display: block; }
.pictures { display: grid; grid-template-columns: repeat(3, 1fr); gap: 12px 14px; margin: 10px 0 4px; }
figure { margin: 0; } figure img { width: 100%; display: block; border-radius: 3px; }
.pixels { image-rendering: pixelated; }
figcaption { font-size: 13px; color: #66727f; display: flex; justify-content: space-between; gap: 10px; margin-top: 4px; align-items: center; }
.scale { display: inline-flex; align-items: center; gap: 6px; white-space: nowrap; } .scale i { width: 90px; height: 9px; border-radius: 2px; }
table { border-collapse: collapse; font-size: 13.5px; font-variant-numeric: tabular-nums; margin: 8px 0; }
th { text-align: left; color: #66727f; font-weight: 600; } th, td { padding: 4px 14px 4px 0; border-bottom: 1px solid #eef0f2; vertical-align: top; }
td.n, th.n { text-align: right; white-space: nowrap; padding-left: 10px; } .wide { width: 100%; }
.bar { position: relative; height: 15px; width: 230px; background: #eef0f2; border-radius: 2px; margin-top: 3px; }
.bar i { position: absolute; left: 0; top: 0; bottom: 0; background: #3e6fb0; border-radius: 2px; }
.bar u { position: absolute; top: 6px; height: 3px; background: #1f2933; opacity: .75; } .bar s { position: absolute; top: -2px; bottom: -2px; width: 2px; background: #c8722c; }
details { margin: 8px 0; } summary { cursor: pointer; color: #3e6fb0; }
.headline { font-size: 17px; border-left: 4px solid #3e6fb0; padding: 4px 0 4px 14px; margin: 12px 0; }
.tag { display: inline-block; background: #e8eef6; color: #2c568f; border-radius: 4px; padding: 1px 8px; font-size: 13px; margin: 1px 4px 1px 0; }
"""


def page(title, body):
    """A whole document of body parts (trusted HTML)."""
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{text(title)}</title><style>{_STYLE}</style>'
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body><main>\n' + "\n".join(body) + "\n</main></body></html>\n"


def text(value):
    return html.escape(str(value))


def section(title, *parts):
    return f"<section><h2>{text(title)}</h2>\n" + "\n".join(parts) + "</section>"


def card(title, value, note):
    return f'<div class="card"><span>{text(title)}</span><b>{text(value)}</b><span>{text(note)}</span></div>'


def table(head, rows, numbers=(), wide=False):
    """head: texts; rows: cells of trusted HTML; numbers: indices of right-aligned columns."""
    cls = [' class="n"' if i in numbers else "" for i in range(len(head))]
    lines = ["<tr>" + "".join(f"<th{c}>{text(h)}</th>" for c, h in zip(cls, head, strict=True)) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td{c}>{cell}</td>" for c, cell in zip(cls, row, strict=True)) + "</tr>" for row in rows]
    return f'<table{" class=wide" if wide else ""}>' + "\n".join(lines) + "</table>"


def share_bar(share, interval=None, mark=None):
    """A share 0..1 as a bar, with its interval as a line and a mark to compare it with."""
    at = lambda value: 100.0 * min(max(value, 0.0), 1.0)  # noqa: E731
    parts = [f'<i style="width:{at(share):.1f}%"></i>']
    if interval:
        parts.append(f'<u style="left:{at(interval[0]):.1f}%;width:{at(interval[1]) - at(interval[0]):.1f}%"></u>')
    if mark is not None:
        parts.append(f'<s style="left:{at(mark):.1f}%"></s>')
    return f'<div class="bar">{"".join(parts)}</div>'


def picture(image, low, high, cmap, title, unit, power=1.0, empty=None):
    """A colour-mapped image [height][width], pixel by pixel, with its scale in the caption. empty: mask of pixels without data."""
    level = np.clip((np.asarray(image, dtype=np.float64) - low) / max(high - low, 1e-12), 0.0, 1.0) ** power
    pixels = colormaps[cmap](level, bytes=True)[..., :3]
    if empty is not None:
        pixels = np.where(empty[..., None], np.uint8(24), pixels)
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, format="png", optimize=True)
    stops = ",".join("rgb({},{},{})".format(*(round(255 * c) for c in colormaps[cmap]((i / 8) ** power)[:3])) for i in range(9))
    scale = f'<span class="scale">{low:.3g}<i style="background:linear-gradient(90deg,{stops})"></i>{high:.3g} {text(unit)}</span>'
    return f'<figure><img class="pixels" alt="{text(title)}" src="{_data("image/png", file)}"><figcaption>{text(title)}{scale}</figcaption></figure>'


def chart(figure, alt):
    """A matplotlib Figure as SVG, letters as shapes, so that it looks alike everywhere."""
    file = io.BytesIO()
    figure.savefig(file, format="svg", bbox_inches="tight", pad_inches=0.06, metadata={"Date": None})
    return f'<figure><img alt="{text(alt)}" src="{_data("image/svg+xml", file)}"></figure>'


def _data(kind, file):
    return f"data:{kind};base64,{base64.b64encode(file.getvalue()).decode()}"
