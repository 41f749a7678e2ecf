#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws the gallery: a small picture of each material, light and effect, and the page that shows them.

usage: gallery.py [--only NAME ...] [--spp N] [--out FOLDER] [--check]. Writes FOLDER/pictures/*.jpg and
FOLDER/README.md, beside this file where no folder is given. Needs PYTHONPATH=build/python.
"""

import argparse
import sys
from pathlib import Path

import camera  # noqa: F401  each module adds its tiles, in the order of the page
import denoising  # noqa: F401
import optics  # noqa: F401
import kuafu
import lights  # noqa: F401
import materials  # noqa: F401
import outputs  # noqa: F401
import stage
from PIL import Image
from tiles import TILES

HERE = Path(__file__).resolve().parent
COLUMNS = 4
ORDER = ("Materials", "Lights", "Projector", "Camera", "Optics", "Denoising", "Outputs")
HEAD = """# Gallery

What kuafu renders, one small picture each, made by
```sh
PYTHONPATH=build/python /usr/bin/python3 examples/gallery/gallery.py
```
Each is a few lines in this folder. 24 samples per pixel, denoised.
"""


def page():
    parts = [HEAD]
    for section in ORDER:
        parts.append(f"\n## {section}\n\n|" + " |" * COLUMNS + "\n|" + "--|" * COLUMNS + "\n")
        own = (t for t in TILES if t.section == section)
        cells = [f"![{t.title}](pictures/{t.name}.jpg)<br>**{t.title}**<br>{t.note}" for t in own]
        cells += [""] * (-len(cells) % COLUMNS)
        parts += [f"| {' | '.join(cells[i : i + COLUMNS])} |\n" for i in range(0, len(cells), COLUMNS)]
    return "".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", nargs="*", help="names of pictures")
    parser.add_argument("--spp", type=int, default=24, help="samples per pixel")
    parser.add_argument("--out", type=Path, default=HERE, help="folder for the pictures and the page")
    parser.add_argument("--check", action="store_true", help="write nothing; fail where the page is not what tiles say")
    arguments = parser.parse_args()
    if arguments.check:
        return int((arguments.out / "README.md").read_text() != page())
    stage.SAMPLES = arguments.spp
    device = kuafu.Device()
    (arguments.out / "pictures").mkdir(exist_ok=True)
    for t in TILES:
        if arguments.only and t.name not in arguments.only:
            continue
        Image.fromarray(t.draw(device)).save(arguments.out / "pictures" / f"{t.name}.jpg", quality=90)
        print(f"{t.section}: {t.name}", flush=True)
    (arguments.out / "README.md").write_text(page())
    return 0


if __name__ == "__main__":
    sys.exit(main())
