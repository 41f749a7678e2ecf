# SPDX-License-Identifier: Apache-2.0
"""Draws every effect of the library as 'activestereo effect show' does, for the page of all effects.

PYTHONPATH=build/python /usr/bin/python3 examples/effects/strips.py [--out examples/effects/strips]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.common.output_files import replace_file
from activestereo.report.effect_pictures import StripWorld
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects import builtin
from activestereo.report.strips import strip_figure

STYLE = {"format": "jpeg", "dpi": 55, "pil_kwargs": {"quality": 75, "optimize": True}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("strips"), help="folder of the strips")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    world = StripWorld(CaptureRenderer("cpu"))
    for name, effect in builtin().items():
        figure = strip_figure([world.strip(effect)])
        replace_file(out / f"{name}.jpg", lambda file, figure=figure: figure.savefig(file, **STYLE))
    print(f"written: {len(builtin())} strips in {out}")


if __name__ == "__main__":
    main()
