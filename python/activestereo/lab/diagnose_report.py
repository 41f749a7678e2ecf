"""diagnose.json of a diagnosis, and its text."""

import json
from pathlib import Path

from activestereo.effects.core.surfaces import material_numbers
from activestereo.lab.diagnose_verdict import confidences, equivalents
from activestereo.lab.where_channels import material_names
from activestereo.output_files import replace_file

_SHOWN = 8


def ranking_json(ranking):
    """Every candidate, best first; those whose fit gained nothing have score 0."""
    confidence, name_of = confidences(ranking), material_names(ranking.evidence.capture.scene_path)
    out = []
    for e in ranking.entries:
        out.append(
            {
                "effect": e.id,
                "family": e.effect.family,
                "channel": e.channel,
                "score_nats": e.nats,
                "confidence": confidence[e.id],
                "explained_share": e.explained,
                "gain_floors": e.gain_floors,
                "frame_consistency": e.consistency,
                "parameters": {p.name: _named(p, e.parameters[p.name], name_of) for p in e.effect.parameters},
                "equivalent": equivalents(ranking, e) if e.nats > 0 else [],
            }
        )
    return out


def _named(parameter, told, name_of):
    """What is told of a parameter; of a choice of surfaces by their materials' names, none for all surfaces."""
    return told | {"materials": [name_of(k) for k in material_numbers(told["value"])]} if parameter.choice else told


def parameter_text(name, told):
    """One parameter of a ranking's entry for reading: a choice by its materials, else value, interval and unit."""
    if "materials" in told:
        return f"on {', '.join(told['materials']) or 'all surfaces'}"
    interval = "" if told["low"] is None or told["high"] is None else f" ({told['low']:.4g} to {told['high']:.4g})"
    return f"{name} {told['value']:.4g}{interval}" + ("" if told["unit"] in ("", "1") else f" {told['unit']}")


def write_diagnosis(diagnosis, folder):
    """Writes diagnose.json, model.json and, where an unknown effect was described, effect_stub.py; returns their paths."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    texts = {"diagnose.json": json.dumps(diagnosis.result, indent=1) + "\n", "model.json": json.dumps(diagnosis.result["model"], indent=1) + "\n"}
    if diagnosis.stub:
        texts["effect_stub.py"] = diagnosis.stub
    for name, text in texts.items():
        replace_file(folder / name, lambda file, text=text: file.write(text.encode()))
    return [folder / name for name in texts]


def diagnosis_text(result):
    """What a reader wants first."""
    lines = [f"verdict: {result['verdict']}" + (f" ({', '.join(result['added'])})" if result["added"] else "")]
    if result.get("reason"):
        lines.append(result["reason"])
    if result["ranking"]:
        lines.append(f"{'effect':26}{'family':20}{'nats':>12}{'explains':>10}{'confidence':>12}  parameters (90 %)")
    for entry in result["ranking"][:_SHOWN]:
        values = ", ".join(parameter_text(name, told) for name, told in entry["parameters"].items())
        share, confidence = f"{100 * entry['explained_share']:.0f} %", f"{entry['confidence']:.2f}"
        lines.append(f"{entry['effect']:26}{entry['family']:20}{entry['score_nats']:>12.1f}{share:>10}{confidence:>12}  {values}")
    first = result["ranking"][0] if result["ranking"] else None
    if first and first["equivalent"] and result["verdict"] in ("effect", "undetermined"):
        lines.append(f"this data cannot tell {first['effect']} from {', '.join(first['equivalent'])}")
    if result["heldout_ir_rmse_before"] is not None:
        figures = [result[f"heldout_{name}"] for name in ("ir_rmse_before", "ir_rmse_after", "noise_floor")]
        texts = ["unknown" if f is None else f"{f:.3f} DN" for f in figures]
        lines.append(f"held-out infrared RMSE: {texts[0]} before, {texts[1]} after, noise floor {texts[2]}")
    lines += [f"next measurement: {advice['text']}" for advice in result["next_measurement"]]
    if result.get("law"):
        lines.append(f"law of the residual ({result['law']['stage']}): {result['law']['text']}")
    return "\n".join(lines)
