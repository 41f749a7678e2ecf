# SPDX-License-Identifier: Apache-2.0
"""Draws every effect of the library as 'activestereo effect show' does, and writes the page that shows them.

PYTHONPATH=build/python /usr/bin/python3 examples/effects/gallery.py [--out examples/effects]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.common.output_files import replace_file
from activestereo.compare.effect_trials import StripWorld
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects import builtin
from activestereo.report.strips import strip_figure

HEAD = """# Effects in pictures

Each strip is `activestereo effect show EFFECT -o FILE`: a picture of a small world without the effect, with it, and the
difference. Units, ranges and sources are on [the page of all effects](README.md). `gallery.py` writes this page.
"""
DPI, QUALITY = 55, 75


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder of the page")
    out = parser.parse_args().out
    (out / "strips").mkdir(parents=True, exist_ok=True)
    world = StripWorld(CaptureRenderer("cpu"))
    families: dict[str, list[str]] = {}
    for name, effect in builtin().items():
        figure = strip_figure([world.strip(effect)])
        replace_file(
            out / f"strips/{name}.jpg",
            lambda file, figure=figure: figure.savefig(
                file, format="jpeg", dpi=DPI, pil_kwargs={"quality": QUALITY, "optimize": True}
            ),
        )
        families.setdefault(effect.family, []).append(f"![{name.replace('_', ' ')}](strips/{name}.jpg)\n")
    parts = [HEAD, *(f"## {family.capitalize()}\n\n" + "\n".join(strips) for family, strips in families.items())]
    (out / "gallery.md").write_text("\n".join(parts))
    print(f"written: {len(builtin())} strips and gallery.md in {out}")


if __name__ == "__main__":
    main()
