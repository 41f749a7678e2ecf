# SPDX-License-Identifier: Apache-2.0
"""Describes a sensor model as text."""

from __future__ import annotations

from collections.abc import Mapping

from activestereo.common.lens import is_distorting
from activestereo.model.model import NOISE_TERMS, Quantity, SensorModel

_NUISANCE_WORDS = {
    "projector_scale": "projector's scale",
    "ambient_scale": "ambient light's scale",
    "black_dn": "black level",
    "focal_left": "left focal length's relative error",
    "focal_right": "right focal length's relative error",
}


def show(model: SensorModel) -> str:
    """Describes the model's sections as text, with a line for each value."""
    lines = [f"a sensor model from {model.source}" if model.source else "a sensor model"]
    if model.rig is not None:
        lines.append(f"rig (engine), {model.rig.source}" if model.rig.source else "rig (engine)")
        for name, side in (("left", model.rig.left), ("right", model.rig.right)):
            k = side.K
            lens = f", lens {' '.join(f'{c:g}' for c in side.distortion)}" if is_distorting(side.distortion) else ""
            lines.append(
                f"  {name}: {side.width}x{side.height}, focal {k[0, 0]:.2f} {k[1, 1]:.2f} px,"
                f" centre {k[0, 2]:.2f} {k[1, 2]:.2f} px{lens}"
            )
        baseline_m = float((model.rig.left_to_right[:3, 3] ** 2).sum()) ** 0.5
        lines.append(f"  baseline {1000 * baseline_m:.3f} mm, {model.rig.bit_depth} bit")
    if (pattern := model.pattern) is not None:
        if pattern.dots is not None:
            drawn = f"{len(pattern.dots)} dots" + (" with light between them" if pattern.background > 0.0 else "")
        else:
            drawn = f"image {pattern.file.name}" if pattern.file else "nothing"
        source = f", {pattern.source}" if pattern.source else ""
        lines.append(f"pattern (engine): {drawn}, focal {pattern.K[0, 0]:.1f} px{source}")
    if model.imager is not None:
        offset, shot, relative = (getattr(model.imager, name).value for name in NOISE_TERMS)
        terms = f"{offset:.4g} DN^2 + {shot:.4g} DN x gain x signal + {relative:.4g} x signal^2"
        lines.append(f"imager (engine): variance = {terms}")
    lines.append("effects" if model.effects else "effects: none")
    for entry in model.effects:
        effect, on = entry.effect, f" on {', '.join(entry.surfaces)}" if entry.surfaces else ""
        first = " ".join(effect.summary.split()).partition(". ")[0].rstrip(".") + "."
        lines += [f"  {effect.id}{on}: {_list(entry.parameters)}", f"    {first}"]
        if effect.engine:
            lines.append(f"    engine: {', '.join(effect.engine_fields)}")
        else:
            lines.append(f"    image only: {effect.image_only or 'it brings no engine fields'}")
    if model.materials:
        lines.append("materials (engine)")
        lines += [f"  {name}: {_list(fields)}" for name, fields in model.materials.items()]
    if model.nuisances:
        lines.append("left over by the fit (engine)")
        lines += [f"  {_NUISANCE_WORDS[name]}: {quantity_text(q)}" for name, q in model.nuisances.items()]
    return "\n".join(lines)


def quantity_text(q: Quantity) -> str:
    """Formats a value with its interval and unit."""
    interval = "" if q.low is None or q.high is None else f" ({q.low:.4g} to {q.high:.4g})"
    return f"{q.value:.5g}{interval}" + ("" if q.unit in ("", "1") else f" {q.unit}")


def _list(quantities: Mapping[str, Quantity]) -> str:
    return (
        ", ".join(f"{name} = {quantity_text(q)}" for name, q in quantities.items()) or "as the effect's neutral values"
    )
