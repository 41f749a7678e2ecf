"""The effects as text: a table for the terminal, a page for the documentation. Both come from the descriptors alone."""

from activestereo.effects.core.descriptor import Effect, Parameter, Stage

_WHERE = {
    Stage.PROJECTOR: "Light leaves the projector",
    Stage.MEDIUM: "On the way through air",
    Stage.SURFACE: "At surfaces, and from other lights",
    Stage.CAMERA: "Where, when and how sharply the cameras look",
    Stage.OPTICS: "Through the lens",
    Stage.CHARGE: "Light becomes charge",
    Stage.READOUT: "Charge is amplified and read",
    Stage.DIGITAL: "Digital numbers",
    Stage.DISPARITY: "The matcher's disparity",
    Stage.DEPTH: "The device's depth",
}


def table(effects: dict[str, Effect]) -> str:
    """One line per effect: id, stage, family, whether the engines have it, parameters with units."""
    rows = [("id", "stage", "family", "simulated", "parameters")]
    rows += [(e.id, e.stage.name.lower(), e.family, _where(e), ", ".join(_with_unit(p) for p in e.parameters)) for e in effects.values()]
    last = len(rows[0]) - 1
    widths = [max(len(row[i]) for row in rows) for i in range(last)]
    return "\n".join("  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[last]]) for row in rows)


def page(effects: dict[str, Effect], differences: dict[str, float] | None = None) -> str:
    """Markdown: a user's own effect as an example, what the engines have, then every effect in the light's order with its parameters.
    differences: how far the image function is from the engines, see lab/surrogate.py."""
    in_engine = sum(e.engine is not None for e in effects.values())
    lines = ["# Physical effects", "", _INTRODUCTION.format(count=len(effects), engine=in_engine, example=EXAMPLE.strip())]
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
    lines = ["## In the engines", "", _ENGINE, "", "| effect | simulated in | engine fields, or why there is none | difference |", "|---|---|---|---|"]
    for e in effects.values():
        fields = e.image_only if e.engine is None else ", ".join(f"`{name}`" for name in e.engine_fields)
        told = f"{100 * differences[e.id]:.1f} %" if e.id in differences else ""
        lines.append(f"| [{e.id}](#{e.id}) | {_where(e)} | {fields} | {told} |")
    return [*lines, ""]


def _with_unit(parameter: Parameter) -> str:
    return parameter.name if parameter.unit == "1" else f"{parameter.name} [{parameter.unit}]"


def _entry(e: Effect) -> list[str]:
    random = {"none": "", "static": ", random and fixed to the sensor", "temporal": ", random in every frame"}[e.randomness.value]
    lines = [f"### {e.id}", "", e.summary.replace("\n", " "), "", f"Family: {e.family}{random}. Source: {e.source}.", ""]
    if e.parameters:
        lines += ["| parameter | unit | neutral | range | typical | |", "|---|---|---|---|---|---|"]
    for p in e.parameters:
        lines.append(f"| `{p.name}` | {p.unit} | {p.neutral:g} | {p.low:g} to {p.high:g} | {p.typical_value:g} | {p.source} |")
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
Under a model the simulator moves these fields of kuafu and simsense; what is *image only* is applied to the images by the sensor, at the cost of a copy.
The lab's scans use the image function of every effect. *Difference*: what it and the engines change in the images of a small world at typical
values, root mean square of the difference over the engines' change (of random fields: of their standard deviations), by
`build/bin/activestereo effect measure`; the renders' noise has no part in it. The large ones have causes: the world is 160 pixels wide, and its dots and edges are finer than
a pixel, so that blurs of half a pixel and shifts of a fraction of one (resampling, motion, rotations) depend on what the pixels do not show; below a closed surface that transmits there is
no light from behind, which the image function of `transmission` fits and no engine field has; bounced light of lamps is in the engines alone."""

_INTRODUCTION = """\
What may make a real sensor differ from the base model: {count} effects, in the order of the light's way; {engine} of them are simulated inside of the engines. Each is one file in
`python/activestereo/effects`. An effect's *neutral* parameters change nothing; *typical* is one prior deviation from there.
This page is made by `activestereo effect list --markdown`.

## Your own effect

```python
{example}
```

`activestereo effect check filter_haze.py` tries the laws that every effect obeys: neutral parameters are the identity, the same
seed gives the same bits, values stay finite, every parameter has an influence, the input is left alone. The lab then ranks it
beside the built-in ones. What the function gets and returns by stage is told in `python/activestereo/effects/core/descriptor.py`.
An effect may also say what it is inside of the engines: `engine=` a function that changes the engines' inputs, see any built-in file and
`python/activestereo/effects/core/engine.py`.
The same in C is a shared library with the descriptors of `ks/effect.h`, see [tinted_window.c](tinted_window.c).
"""
