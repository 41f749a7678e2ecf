#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes README.md, the page of all effects, from their descriptors.

    PYTHONPATH=build/python python3 examples/effects/make_page.py            # writes it
    PYTHONPATH=build/python python3 examples/effects/make_page.py --check    # fails where it is not what they say
"""

import sys
from pathlib import Path

from activestereo.common.text_table import markdown
from activestereo.effects import Effect, Stage, builtin, known_differences

PAGE = Path(__file__).resolve().parent / "README.md"
_WHERE = {
    Stage.PROJECTOR: "Light leaves the projector",
    Stage.MEDIUM: "Light passes through air",
    Stage.SURFACE: "Surfaces and other lights",
    Stage.CAMERA: "Geometry, timing and sharpness of the cameras",
    Stage.OPTICS: "Light passes through the lens",
    Stage.CHARGE: "Light becomes charge",
    Stage.READOUT: "Charge is amplified and read",
    Stage.DIGITAL: "Counts are digitised",
    Stage.DISPARITY: "The device's matcher computes disparity",
    Stage.DEPTH: "The device computes depth",
}


def main(arguments: list[str]) -> int:
    text = page(builtin(), known_differences())
    if arguments == ["--check"]:
        if text != PAGE.read_text(encoding="utf-8"):
            print("examples/effects/README.md is not what the effects say: run make_page.py there")
        return int(text != PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(text, encoding="utf-8")
    return 0


def page(effects: dict[str, Effect], differences: dict[str, float]) -> str:
    """The page in Markdown: an introduction with an example, the table of engine fields, and every effect by stage.
    differences: {effect id: relative difference of its image function from the engines}."""
    _, example = (PAGE.parent / "filter_haze.py").read_text().split("\n", 1)  # below the licence
    in_engine = sum(e.engine is not None for e in effects.values())
    lines = [
        "# Physical effects",
        "",
        _INTRODUCTION.format(count=len(effects), engine=in_engine, example=example.strip()),
    ]
    lines += _engine_table(effects, differences)
    for stage in Stage:
        chosen = [e for e in effects.values() if e.stage is stage]
        if chosen:
            lines += [f"## {_WHERE[stage]}", ""]
        for e in chosen:
            lines += _entry(e)
    return "\n".join(lines).rstrip() + "\n"


def _engine_table(effects: dict[str, Effect], differences: dict[str, float]) -> list[str]:
    rows = []
    for e in effects.values():
        fields = e.image_only if e.engine is None else ", ".join(f"`{name}`" for name in e.engine_fields)
        difference = f"{100 * differences[e.id]:.1f} %" if e.id in differences else ""
        rows.append((f"[{e.id}](#{e.id})", "image only" if e.engine is None else "engine", fields, difference))
    head = ("effect", "simulated in", "engine fields, or why there is none", "difference")
    return ["## In the engines", "", _ENGINE, "", *markdown(head, rows), ""]


def _entry(e: Effect) -> list[str]:
    random = {"none": "", "static": ", random and fixed to the sensor", "temporal": ", random in every frame"}[
        e.randomness.value
    ]
    lines = [
        f"### {e.id}",
        "",
        e.summary.replace("\n", " "),
        "",
        f"![{e.id}](strips/{e.id}.jpg)",
        "",
        f"Family: {e.family}{random}. Source: {e.source}.",
        "",
    ]
    rows = [
        (f"`{p.name}`", p.unit, f"{p.neutral:g}", f"{p.low:g} to {p.high:g}", f"{p.typical_value:g}", p.source)
        for p in e.parameters
    ]
    if rows:
        lines += markdown(("parameter", "unit", "neutral", "range", "typical", "source"), rows)
    return [*lines, ""]


_ENGINE = """\
A simulated sensor applies most effects by changing these fields of kuafu and simsense, so that they cost no time. The
lab makes its images for scans from the same fields, without a render: cameras look up other pixels, dots lie elsewhere
in the pattern, optics blur and dim, and simsense's own signal counts. An effect that is *image only* has no such field:
the sensor applies its image function to the finished images, which costs a copy. The last column says how far images
without a render are from those of the engines, where they differ. It compares the changes that both make to the images
of a small scene at typical parameters: the root mean square of their difference, as a share of the engines' change.
`activestereo effect check --all` computes it, and removes the noise of the renders. The large differences have known
causes. The scene is only 160 pixels wide, and its dots and edges are finer than a pixel; blurs and shifts by a
fraction of a pixel (motion, rotations) then depend on detail that the pixels do not show. A parameter that the engines
find out by themselves, such as the light behind a clear surface, counts as it fits best. Indirect light of lamps
exists in the engines only."""

_INTRODUCTION = """\
An *effect* is one physical reason why a real sensor differs from the base model. This page lists all {count} of them
in the order of the pipeline, from the projector to the depth map; {engine} of them can be simulated inside the two
engines. Each effect is one function in `python/activestereo/effects`, of engine fields or of images, below a descriptor
with its parameters. At its *neutral* parameters an effect changes nothing. A *typical* value is about as far
from neutral as real sensors are: a fit starts from the assumption that parameters deviate by about this much (the
standard deviation of its prior). A picture shows a small world without the effect, with it, and the difference, as
`activestereo effect show EFFECT -o FILE` draws them. This page is made by `make_page.py`, its pictures by `strips.py`.

## Your own effect

```python
{example}
```

`activestereo effect check filter_haze.py` tests the laws that every effect must obey: neutral parameters change
nothing, the same seed gives the same bits, values stay finite, every parameter has an influence, and the input array is
not modified. The lab then ranks your effect beside the built-in ones. `python/activestereo/effects/core/descriptor.py`
says what the function receives and returns at each stage. `engine_effect` in
`python/activestereo/effects/core/moved.py` makes an effect of a function that changes the engines' fields; most
built-in files are examples, and `python/activestereo/effects/core/engine.py` is the specification. An effect may also
be written in C, as a shared library with the descriptors of `ks/effect.h`; [tinted_window.c](tinted_window.c) is an
example.
"""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
