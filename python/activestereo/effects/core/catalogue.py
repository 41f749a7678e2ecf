# SPDX-License-Identifier: Apache-2.0
"""Describes the effects as text, from their descriptors alone: a table for the terminal, a page for the
documentation."""

from textwrap import fill
from typing import Any

from activestereo.common.text_table import columns, markdown
from activestereo.effects.core.descriptor import Effect, Stage

_INDENT = 4 * " "
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


def table(effects: dict[str, Effect]) -> str:
    """Returns a text table with one line per effect: id, stage, family, and 'engine' or 'image only'. Its parameters
    and their units follow below each line."""
    rows = [("id", "stage", "family", "simulated")]
    rows += [(e.id, e.stage.name.lower(), e.family, _where(e)) for e in effects.values()]
    head, *lines = columns(rows).splitlines()
    for line, e in zip(lines, effects.values(), strict=True):
        said = ", ".join(p.name if p.unit == "1" else f"{p.name} [{p.unit}]" for p in e.parameters)
        head += f"\n{line}" + f"\n{fill(said, 80, initial_indent=_INDENT, subsequent_indent=_INDENT)}" * bool(said)
    return head


def as_json(effects: dict[str, Effect]) -> list[dict[str, Any]]:
    """Returns one dict per effect for JSON: id, stage, family, 'engine' or 'image only', and parameters with unit and
    range."""
    return [
        {
            "id": e.id,
            "stage": e.stage.name.lower(),
            "family": e.family,
            "simulated": _where(e),
            "parameters": [{"name": p.name, "unit": p.unit, "low": p.low, "high": p.high} for p in e.parameters],
        }
        for e in effects.values()
    ]


def page(effects: dict[str, Effect], differences: dict[str, float] | None = None) -> str:
    """Returns the documentation page in Markdown: an introduction with an example, the table of engine fields, and
    every effect by stage. differences: {effect id: relative difference of its image function from the engines}, see
    compare/effect_trials.py."""
    in_engine = sum(e.engine is not None for e in effects.values())
    lines = [
        "# Physical effects",
        "",
        _INTRODUCTION.format(count=len(effects), engine=in_engine, example=EXAMPLE.strip()),
    ]
    lines += _engine_table(effects, differences or {})
    for stage in Stage:
        chosen = [e for e in effects.values() if e.stage is stage]
        if chosen:
            lines += [f"## {_WHERE[stage]}", ""]
        for e in chosen:
            lines += _entry(e)
    return "\n".join(lines).rstrip() + "\n"


def _where(e: Effect) -> str:
    return "image only" if e.engine is None else "engine"


def _engine_table(effects: dict[str, Effect], differences: dict[str, float]) -> list[str]:
    rows = []
    for e in effects.values():
        fields = e.image_only if e.engine is None else ", ".join(f"`{name}`" for name in e.engine_fields)
        difference = f"{100 * differences[e.id]:.1f} %" if e.id in differences else ""
        rows.append((f"[{e.id}](#{e.id})", _where(e), fields, difference))
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


EXAMPLE = '''\
from activestereo.effects import Parameter, Stage, effect


@effect("filter_haze", stage=Stage.OPTICS, family="glare", source="my bench, May",
        parameters=[Parameter("fraction", unit="1", neutral=0.0, low=0.0, high=0.3, typical=0.05)])
def filter_haze(image, view, fraction):
    """A hazy filter spreads a fraction of all light evenly over the picture."""
    return (1 - fraction) * image + fraction * image.mean(axis=(-2, -1), keepdims=True)
'''

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
standard deviation of its prior). This page is made by `activestereo effect list --markdown`.

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
