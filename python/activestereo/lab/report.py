"""Writes a comparison: compare.json, its picture compare.png, and report.html, one self-contained page that shows a diagnosis too where there is one.

Files appear whole or not at all: written aside, then renamed.
"""

import json
from pathlib import Path

from activestereo.lab.html import page, text
from activestereo.lab.report_compare import cards, comparison_sections, settings_section, summary_line
from activestereo.lab.report_diagnosis import diagnosis_sections
from activestereo.lab.report_sheet import comparison_figure
from activestereo.output_files import replace_file


def write_report(comparison, folder, diagnosis=None):
    """Writes compare.json, compare.png and report.html into `folder` (made where absent); returns the paths of the first and the last.

    diagnosis: what diagnose.json holds, a dict; None for the folder's own diagnose.json, if there is one of this capture.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if diagnosis is None:
        diagnosis = _stored_diagnosis(folder, comparison.capture.name)
    json_text = json.dumps(comparison.scores, indent=1, allow_nan=False) + "\n"
    html_text = report_page(comparison, diagnosis)
    replace_file(folder / "compare.json", lambda file: file.write(json_text.encode()))
    figure = comparison_figure(comparison)
    replace_file(folder / "compare.png", lambda file: figure.savefig(file, format="png", dpi=110))
    replace_file(folder / "report.html", lambda file: file.write(html_text.encode()))
    return folder / "compare.json", folder / "report.html"


def report_page(comparison, diagnosis=None):
    """The page's text."""
    scores = comparison.scores
    head = f'<h1>{text(scores["capture"])}: the model against the measurement</h1><p class="muted">{text(summary_line(scores))}</p>'
    found = diagnosis_sections(diagnosis) if diagnosis else []
    body = [head, cards(scores), *found, *comparison_sections(comparison), settings_section(scores)]
    return page(f"{scores['capture']}: comparison", body)


def summary_table(scores):
    """The figures of compare.json that a reader wants first, as text."""
    lines = [f"{'':8}{'IR RMSE':>10}{'floor':>10}{'explainable':>14}   floor from"]
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
    return "\n".join([*lines, _fit_line(scores["fit"])])


def _fit_line(fit):
    value, error = fit["nuisances"], fit["standard_errors"]
    names = (("projector scale", "projector_scale"), ("ambient scale", "ambient_scale"), ("black level", "black_dn"))
    return "fit on train: " + ", ".join(f"{words} {value[k]:.6g} ± {error[k]:.2g}" for words, k in names)


def _stored_diagnosis(folder, capture):
    """The folder's diagnose.json if it is of this capture; one that cannot be read is as good as none."""
    try:
        diagnosis = json.loads((folder / "diagnose.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return diagnosis if isinstance(diagnosis, dict) and diagnosis.get("capture", capture) == capture else None
