# SPDX-License-Identifier: Apache-2.0
"""The page of all keys of the advanced mode, camera/advanced_mode/README.md:

PYTHONPATH=build/python python3 tests/python/shared/advanced_mode_page.py > README.md
"""

from activestereo.camera.advanced_mode.settings import keys
from activestereo.common.text_table import markdown

_TEXT = """\
# Advanced-mode keys
`activestereo depth RECORDING --settings FILE.json` matches a recording's infrared pairs as its camera would under a
D400's advanced-mode JSON. This page is written from `keys.toml`.

{mapped} of {count} settings set something here, {names} names with those of older files. Nobody outside of Intel knows
the D400's matcher: a key that has the camera's default leaves the matcher as the camera's preset has it, another moves
it by the same share, and no key is the device's own in its number. What a key does not set is told. Names and defaults
are librealsense's; a range is the field's width as published presets fill it.

{table}

Settings without an effect here, whose values are checked all the same: {rest}.
"""


def page() -> str:
    """The page's text."""
    mapped, rows = [key for key in keys().values() if key.to], []
    for key in mapped:
        possible = "{:g} to {:g}".format(*key.range) if key.words is None else ", ".join(key.words)
        name = f"`{key.name}`" + (f", `{key.alias}`" if key.alias else "")
        rows.append((name, key.default, possible, ", ".join(f"`{one}`" for one in key.to), key.meaning))
    return _TEXT.format(
        mapped=len(mapped),
        count=len(keys()),
        names=len(mapped) + sum(bool(key.alias) for key in mapped),
        table="\n".join(markdown(("key", "default", "range", "sets", "what it is on the camera"), rows)),
        rest=", ".join(f"`{key.name}`" for key in keys().values() if not key.to),
    )


if __name__ == "__main__":
    print(page(), end="")
