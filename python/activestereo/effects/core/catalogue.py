"""The effects as text: a table for the terminal, a page for the documentation. Both come from the descriptors alone."""

from activestereo.effects.core.descriptor import Stage

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


def table(effects):
    """One line per effect: id, stage, family, parameters with units."""
    rows = [("id", "stage", "family", "parameters")]
    rows += [(e.id, e.stage.name.lower(), e.family, ", ".join(_with_unit(p) for p in e.parameters)) for e in effects.values()]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    return "\n".join("  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[3]]) for row in rows)


def page(effects):
    """Markdown: a user's own effect as an example, then every effect in the light's order with its parameters."""
    lines = ["# Physical effects", "", _INTRODUCTION.format(count=len(effects), example=EXAMPLE.strip())]
    for stage in Stage:
        chosen = [e for e in effects.values() if e.stage is stage]
        if chosen:
            lines += [f"## {_WHERE[stage]}", ""]
        for e in chosen:
            lines += _entry(e)
    return "\n".join(lines).rstrip() + "\n"


def _with_unit(parameter):
    return parameter.name if parameter.unit == "1" else f"{parameter.name} [{parameter.unit}]"


def _entry(e):
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

_INTRODUCTION = """\
What may make a real sensor differ from the base model: {count} effects, in the order of the light's way. Each is one file in
`python/activestereo/effects`. An effect's *neutral* parameters change nothing; *typical* is one prior deviation from there.
This page is made by `activestereo effect list --markdown`.

## Your own effect

```python
{example}
```

`activestereo effect check filter_haze.py` tries the laws that every effect obeys: neutral parameters are the identity, the same
seed gives the same bits, values stay finite, every parameter has an influence, the input is left alone. The lab then ranks it
beside the built-in ones. What the function gets and returns by stage is told in `python/activestereo/effects/core/descriptor.py`.
The same in C is a shared library with the descriptors of `ks/effect.h`, see [tinted_window.c](tinted_window.c).
"""
