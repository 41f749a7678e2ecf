# SPDX-License-Identifier: Apache-2.0
"""Describes a comparison in sentences: the error and where it lies, the families of effects that cause such errors, and
the change of infrared and depth errors. Formats the final screen of `compare`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from activestereo.common.shown import listed
from activestereo.effects.core.descriptor import GEOMETRY_FAMILIES
from activestereo.report.screen import Figure, Step, screen

_KINDS = {
    "brightness": ("The measured images are smoothly {} than the model's", ("darker", "brighter")),
    "dots": ("The measured dots stand out {} than the model's", ("less", "more")),
    "sharpness": ("The measured dots are {} than the model's", ("sharper", "softer")),
    "place": ("The measured dots lie elsewhere than the model's, by some {:.2g} px", ()),
    "other": ("The measured images differ from the model's dot by dot", ()),
}
# Families of effects by the error's kind and the covariate that it depends on; "" for all other covariates. A kind
# without "material" does not depend on materials: they only happen to lie where the error is.
_FAMILIES: dict[str, dict[str, tuple[str, ...]]] = {
    "brightness": {
        "radius": ("lens shading", "projector shading"), "time": ("projector power",),
        "temperature": ("projector power",), "depth": ("medium", "ambient light"),
        "material": ("surface", "ambient light", "tone"), "": ("surface", "ambient light", "tone"),
    },
    "dots": {
        "radius": ("projector shading", "lens shading"), "time": ("projector power",),
        "temperature": ("projector power",), "depth": ("tone", "medium", "projector blur"),
        "material": ("surface", "tone"), "": ("pattern strength", "surface", "tone"),
    },
    "sharpness": {
        "velocity": ("motion",), "radius": ("camera blur",), "depth": ("projector blur", "camera blur"),
        "material": ("surface", "projector blur"), "": ("projector blur", "camera blur", "surface"),
    },
    "place": {
        "velocity": ("motion",), "time": GEOMETRY_FAMILIES[::-1],
        "temperature": GEOMETRY_FAMILIES[::-1], "": (*GEOMETRY_FAMILIES, "motion"),
    },
    "other": {
        "velocity": ("motion",), "material": ("surface",),
        "": (GEOMETRY_FAMILIES[0], "surface", "speckle", "fixed pattern"),
    },
}  # fmt: skip
# Words for pixels with a covariate below or above a value. Other covariates only follow the image's brightness.
_PLACES = {
    "radius": ("within {:.2g} of the way to the corners", "beyond {:.2g} of the way to the corners"),
    "depth": ("nearer than {:.2g} m", "further than {:.2g} m"),
    "column": ("left of column {:.0f}", "right of column {:.0f}"),
    "row": ("above row {:.0f}", "below row {:.0f}"),
    "incidence": ("on surfaces less than {:.0f}° aslant", "on surfaces more than {:.0f}° aslant"),
    "edge_distance": ("within {:.0f} px of edges in depth", "more than {:.0f} px away from edges in depth"),
    "velocity": ("where the image moves slower than {:.2g} px/s", "where the image moves faster than {:.2g} px/s"),
    "time": ("before {:.3g} s", "after {:.3g} s"),
    "temperature": ("below {:.3g} °C", "above {:.3g} °C"),
}  # fmt: skip
_LEAST_CONCENTRATION = 0.1
# An error that depends on the time of few frames may as well come from the objects in those frames.
_OF_FRAMES, _LEAST_FRAMES = ("time", "temperature"), 5
_MOST_MATERIALS, _MOST_FAMILIES = 3, 4
# A region with this share of the first region's gain may be the true place of the error.
_ALIKE = 0.7
# A mean error that changes its sign is reported if it makes this share of the error.
_LEAST_TURN = 0.5
# An error that falls by less than this share did not fall.
_SAME = 0.02
# An error above the noise by less than this share of it is nearly all noise.
_NEAR_NOISE = 0.05


def is_near_noise(scores: Mapping[str, Any]) -> bool:
    """Returns whether the infrared error of the last split is within 5 % of its noise floor. scores: compare.json's
    contents."""
    values = next(reversed(scores["ir"].values()))
    return values["noise_floor_dn"] is not None and values["rmse_dn"] < (1.0 + _NEAR_NOISE) * values["noise_floor_dn"]


def what_is_missed(scores: Mapping[str, Any]) -> list[str]:
    """Returns sentences, most important first. They state warnings, the kind and the place of the infrared error, its
    change by the model's effects, and the families of effects that cause such an error."""
    said = [f"Warning: {text}." for text in scores["warnings"]]
    shape = scores["shape"]
    if shape is None or not scores["channels"].get("infrared", {}).get("is_explainable", True):
        # Beside a warning the noise floor means little.
        nothing = ["The model's infrared images are at the noise floor: nothing is missing there."] * (not said)
        return [*said, *nothing, *depth_sentences(scores)]
    suspects = _FAMILIES[shape["kind"]]
    places = [one for one in error_places(scores["where"]) if one["covariate"] != "material" or "material" in suspects]
    place = places[0] if places else None
    words, ways = _KINDS[shape["kind"]]
    amount = place["mean"] if place is not None and shape["kind"] == "brightness" else shape["amount"]
    where, near_noise = "", is_near_noise(scores)
    error = "the small rest" if near_noise else "the error"
    if place is not None and place["turns"]:
        where = f" {place['words']} and {ways[amount <= 0]} beyond: {_percent(place['share'])} of {error}"
    elif place is not None:
        where = f": {_percent(place['share'])} of {error} lies {place['words']}"
        where += f", in {_percent(place['pixel_share'])} of the pixels"
    if near_noise:
        said += [f"Little is missing: the infrared error is within {_percent(_NEAR_NOISE)} of noise alone."]
    said.append(f"{words.format(ways[amount > 0] if ways else abs(amount))}{where}.")
    alike = [one["covariate"] for one in places if _gain(one) > _ALIKE * _gain(places[0])] or [""]
    names = [*dict.fromkeys(name for one in alike for name in suspects.get(one, suspects[""]))][:_MOST_FAMILIES]
    return [*said, *depth_sentences(scores), f"Effects that do this: {', '.join(names)}. diagnose tells which."]


def error_places(tables: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Returns regions of pixels that hold much of the infrared error, each bounded by one covariate. The first region
    holds most error for its size. The list is empty if the error is even everywhere.

    A region is {words, covariate, table, mean (DN), share (of the error beyond noise), pixel_share, turns}. If `turns`
    is true, the mean error has the opposite sign beyond the region, and `share` is the part of the error that the mean
    makes.
    """
    known = [t for t in tables if t["channel"] == "infrared" and t["is_finding"]]
    told = [t for t in known if t["covariate"] in (*_PLACES, "material") and t["concentration"] >= _LEAST_CONCENTRATION]
    told = [t for t in told if t["covariate"] not in _OF_FRAMES or len(t["bins"]) >= _LEAST_FRAMES]
    places = [_materials(t) if t["covariate"] == "material" else _turn(t) or _tail(t) for t in told]
    return sorted(places, key=_gain, reverse=True)


def _gain(place: Mapping[str, Any]) -> float:
    return float(place["share"] - place["pixel_share"])


def _turn(table: Mapping[str, Any]) -> dict[str, Any] | None:
    """Returns the region of pixels where the covariate is below the value at which the mean error changes its sign.
    Returns None if the sign does not change, or the mean makes less than half of the error. table: one covariate's
    bins."""
    bins, low = table["bins"], _PLACES[table["covariate"]][0]
    sums = [b["pixels"] * b["mean"] for b in bins]
    parts = [(sum(sums[:i]), sum(sums[i:]), i) for i in range(1, len(bins))]
    below, above, i = max(parts, key=lambda part: abs(part[0] - part[1]), default=(0.0, 0.0, 0))
    if (table["mean_share"] or 0.0) < _LEAST_TURN or below * above >= 0.0:
        return None
    place = _place(table, bins[:i], low.format(bins[i]["low"]))
    return place | {"share": table["mean_share"], "pixel_share": 0.0, "turns": True}


def _tail(table: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the region of pixels where the covariate is below or above a bound. The bound is chosen for the largest
    share of the error minus share of the pixels. table: one covariate's bins."""
    bins, low, high = table["bins"], *_PLACES[table["covariate"]]
    ends = [(bins[: i + 1], low.format(bins[i]["high"])) for i in range(len(bins) - 1)]
    ends += [(bins[i:], high.format(bins[i]["low"])) for i in range(1, len(bins))]
    return max((_place(table, own, words) for own, words in ends), key=_gain)


def _materials(table: Mapping[str, Any]) -> dict[str, Any]:
    bins = table["bins"]
    mean = float(sum(b["pixels"] * b["excess"] for b in bins) / sum(b["pixels"] for b in bins))
    worst = sorted(bins, key=lambda b: -b["pixels"] * (b["excess"] - mean))[:_MOST_MATERIALS]
    worst = [b for b in worst if b["excess"] > mean]
    return _place(table, worst, f"on {listed([b['label'] for b in worst])}")


def _place(table: Mapping[str, Any], own: Sequence[Mapping[str, Any]], words: str) -> dict[str, Any]:
    all_bins = table["bins"]
    held, whole = (sum(b["pixels"] * max(b["excess"], 0.0) for b in bins) for bins in (own, all_bins))
    share, pixels = held / max(whole, 1e-12), sum(b["pixels"] for b in own) / sum(b["pixels"] for b in all_bins)
    mean = sum(b["pixels"] * b["mean"] for b in own) / max(sum(b["pixels"] for b in own), 1)
    told = {"words": words, "covariate": table["covariate"], "table": table, "mean": mean, "turns": False}
    return told | {"share": share, "pixel_share": pixels}


def depth_sentences(scores: Mapping[str, Any]) -> list[str]:
    """Returns sentences on how the model's effects change the infrared and disparity errors. If infrared alone
    improves, the last sentence says where to look next. The list is empty for a model without effects."""
    before = scores["without_effects"]
    if before is None:
        return []
    split = "test" if "test" in before["ir"] else "train"
    infrared = before["ir"][split], scores["ir"][split]["rmse_dn"]
    said = [f"With the model's effects the infrared error goes from {infrared[0]:.2f} to {infrared[1]:.2f} DN"]
    depth = before["depth"].get(split), scores["depth"].get(split, {}).get("rmse_px")
    if depth[0] is None or depth[1] is None:
        return [f"{said[0]}."]
    said.append(f"that of disparity from {depth[0]:.3f} to {depth[1]:.3f} px")
    if infrared[1] < (1.0 - _SAME) * infrared[0] and depth[1] > (1.0 - _SAME) * depth[0]:
        left = "What is left in depth is no matter of these images: look at the matcher, the calibration and the scene."
        return [f"{', '.join(said)}: infrared improves and depth does not.", left]
    return [f"{', '.join(said)}."]


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def comparison_screen(scores: dict[str, Any], next_step: Step, page: Path, kept: str, verbose: bool) -> str:
    """Returns the final screen of `compare`. page: the report's path; kept: text on the cache, printed if `verbose`."""
    sentence, *notes = what_is_missed(scores)
    figures = []
    for split, values in scores["ir"].items():
        figures.append(Figure(f"infrared error, {split}", f"{values['rmse_dn']:.2f} DN", values["rmse_dn"]))
    for split, values in scores["ir"].items():
        if (floor := values["noise_floor_dn"]) is not None:
            figures.append(Figure(f"noise alone, {split}", f"{floor:.2f} DN", floor))
    details = f"{summary_table(scores)}\n{kept}"
    return screen(sentence, figures, [*notes, *_depth_line(scores["depth"])], [next_step], page, details, verbose)


def _depth_line(depth: dict[str, Any]) -> list[str]:
    """Returns a line on the median difference of the model's and the camera's disparity in the last split; an empty
    list without depth."""
    values = next(reversed(depth.values()), None)
    if values is None or values["median_abs_px"] is None:
        return []
    noise = values["noise_floor_median_abs_px"]
    alone = "" if noise is None else f" (noise {noise:.2f} px)"
    fill = f"fill {100 * values['fill_model']:.0f} % (camera {100 * values['fill_measured']:.0f} %)"
    return [f"depth: {values['median_abs_px']:.2f} px apart in the median{alone}, {fill}"]


def summary_table(scores: dict[str, Any]) -> str:
    """Returns the main figures of compare.json as a text table."""
    lines = [f"warning: {text}" for text in scores["warnings"]]
    lines.append(f"{'':8}{'IR RMSE':>10}{'floor':>10}{'explainable':>14}   floor from")
    for split, values in scores["ir"].items():
        floor, excess = values["noise_floor_dn"], values["explainable_rmse_dn"]
        numbers = f"{values['rmse_dn']:>7.3f} DN"
        if floor is None:
            lines.append(f"{split:8}{numbers}   no repeated frames: the noise floor is unknown")
        else:
            source = " and ".join(values["noise_floor_from"])
            lines.append(f"{split:8}{numbers}{floor:>7.3f} DN{excess:>11.3f} DN   {source}")
    if scores["depth"]:
        lines.append(f"{'':8}{'depth RMSE':>13}{'floor':>11}{'fill device':>13}{'model':>9}{'IoU':>8}")
    for split, v in scores["depth"].items():
        error, floor = ("-" if x is None else f"{x:.3f} px" for x in (v["rmse_px"], v["noise_floor_px"]))
        fill = f"{100 * v['fill_measured']:>11.1f} %{100 * v['fill_model']:>7.1f} %"
        lines.append(f"{split:8}{error:>13}{floor:>11}{fill}{v['validity_iou']:>8.3f}")
    value, spread = scores["fit"]["nuisances"], scores["fit"]["standard_errors"]
    names = (("projector scale", "projector_scale"), ("ambient scale", "ambient_scale"), ("black level", "black_dn"))
    lines.append("fit on train: " + ", ".join(f"{words} {value[k]:.6g} ± {spread[k]:.2g}" for words, k in names))
    return "\n".join(lines)
