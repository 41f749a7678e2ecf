# SPDX-License-Identifier: Apache-2.0
"""The figures of compare.json that a reader wants first, on a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from activestereo.report.error_words import what_is_missed
from activestereo.report.screen import Figure, Step, screen


def comparison_screen(scores: dict[str, Any], next_step: Step, page: Path, kept: str, verbose: bool) -> str:
    """The end of the command. kept: what the cache holds, for `verbose`."""
    sentence, *notes = what_is_missed(scores)
    figures = []
    for split, values in scores["ir"].items():
        figures.append(Figure(f"infrared error, {split}", f"{values['rmse_dn']:.2f} DN", values["rmse_dn"]))
    floor = next(reversed(scores["ir"].values()))["noise_floor_dn"]
    if floor is not None:
        figures.append(Figure("noise alone", f"{floor:.2f} DN", floor))
    details = f"{summary_table(scores)}\n{kept}"
    return screen(sentence, figures, [*notes, *_depth_line(scores["depth"])], [next_step], page, details, verbose)


def _depth_line(depth: dict[str, Any]) -> list[str]:
    """The distance of the model's depth from the camera's, of the last split."""
    values = next(reversed(depth.values()), None)
    if values is None or values["median_abs_px"] is None:
        return []
    noise = values["noise_floor_median_abs_px"]
    alone = "" if noise is None else f" (noise {noise:.2f} px)"
    fill = f"fill {100 * values['fill_model']:.0f} % (camera {100 * values['fill_measured']:.0f} %)"
    return [f"depth: {values['median_abs_px']:.2f} px apart in the median{alone}, {fill}"]


def summary_table(scores: dict[str, Any]) -> str:
    """The figures of compare.json that a reader wants first, as text."""
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
    for channel, region in scores["regions"].items():
        if head := region["headline"]:
            lines.append(f"{channel}: {100 * head['share']:.0f} % of the explainable error: {head['words']}")
    value, error = scores["fit"]["nuisances"], scores["fit"]["standard_errors"]
    names = (("projector scale", "projector_scale"), ("ambient scale", "ambient_scale"), ("black level", "black_dn"))
    lines.append("fit on train: " + ", ".join(f"{words} {value[k]:.6g} ± {error[k]:.2g}" for words, k in names))
    return "\n".join(lines)
