# SPDX-License-Identifier: Apache-2.0
"""A capture with an effect that neither you nor the model knows: compare, find it, add it, watch the error fall; then
let the found model drive a sensor in another scene.

    PYTHONPATH=build/python /usr/bin/python3 examples/hidden_effect/hidden_effect.py --out out/hidden_effect
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from another_scene import picture as errors_picture
from another_scene import true_and_simulated, without_effects

from activestereo.lab import Lab
from activestereo.report.diagnosis import error_text, parameter_text
from activestereo.common.output_files import replace_file
from activestereo.common.progress_bar import ProgressBar

HIDE = Path(__file__).resolve().parents[2] / "tests" / "benchmark_suite" / "hide.py"
INK, WARM, COOL = "#1f2933", "#c53030", "#2f855a"


def residuals(comparison, frame_id):
    frame = next(f for f in comparison.capture.frames if f.id == frame_id)
    return comparison.capture.ir(frame, "left").astype(np.float64) - comparison.predictions[frame_id, "left"]


def picture(before, after, result):
    """Measured, what the model leaves before and after, and error against effects added with the floor."""
    frame = [f for f in before.capture.frames if f.split == "test"][-1]
    images = [before.capture.ir(frame, "left"), residuals(before, frame.id), residuals(after, frame.id)]
    floor = result["heldout_noise_floor"]
    figure = Figure(figsize=(12, 6.4), layout="constrained", facecolor="white")
    parts = figure.subplots(2, 2)
    titles = (
        "measured: a frame that no fit has seen",
        "measured minus model, no effects",
        "measured minus model with what was found",
    )
    for axes, image, title in zip(parts.flat, images, titles, strict=False):
        style = {"cmap": "gray"} if image is images[0] else {"cmap": "RdBu_r", "vmin": -5 * floor, "vmax": 5 * floor}
        shown = axes.imshow(image, **style)
        figure.colorbar(shown, ax=axes, label="DN", shrink=0.8)
        axes.set_title(title, loc="left", fontsize=11, color=INK)
        axes.set(xticks=[], yticks=[])
    curve(parts[1, 1], result, floor)
    return figure


def curve(axes, result, floor):
    steps = result["curve"]
    names = ["none", *(f"+ {step['effects'][-1]}" for step in steps[1:])]
    errors = [step["heldout_ir_rmse"] for step in steps]
    axes.plot(names, errors, "o-", color=WARM, lw=2)
    for name, error in zip(names, errors, strict=True):
        axes.annotate(f"{error:.2f} DN", (name, error), textcoords="offset points", xytext=(10, 4), color=INK)
    axes.axhline(floor, color=COOL, ls="--")
    axes.annotate(
        f"noise floor {floor:.2f} DN",
        (0.02, floor),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        xytext=(0, 5),
        color=COOL,
    )
    axes.set_ylim(0, 1.15 * max(errors))
    axes.margins(x=0.25)
    axes.set_title("error on unseen frames against effects added", loc="left", fontsize=11, color=INK)
    axes.spines[["top", "right"]].set_visible(False)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/hidden_effect"))
    parser.add_argument("--seed", type=int, default=2, metavar="N", help="another world, another effect (default: 2)")
    args = parser.parse_args()
    capture, key = args.out / f"capture-{args.seed}", args.out / f"answer-{args.seed}.json"
    elsewhere = args.out / f"elsewhere-{args.seed}"
    if not (capture.is_dir() and key.is_file() and elsewhere.is_dir()):
        print("a virtual sensor that shares no code with activestereo takes its pictures ...", flush=True)
        subprocess.run([sys.executable, HIDE, str(args.seed), capture, key, elsewhere], check=True)
    with ProgressBar("comparing") as bar:
        lab = Lab(capture, progress=bar)
        before = lab.compare()
    with ProgressBar("which effect is missing?") as bar:
        lab = Lab(capture, progress=bar)
        result = lab.diagnose().result
    lab.model = lab.diagnosis.model
    with ProgressBar("comparing again") as bar:
        after = Lab(capture, lab.model, progress=bar).compare()
    lab.comparison = after
    lab.report(args.out / "report")
    save(picture(before, after, result), args.out / "hidden_effect.png")
    report(result, json.loads(key.read_text()), args.out)
    in_another_scene(
        elsewhere, lab.diagnosis.sensor_model, before.scores["fit"]["nuisances"], args.out / "another_scene.png"
    )
    return 0


def save(figure, path):
    replace_file(path, lambda file: figure.savefig(file, format="png", dpi=90))


def in_another_scene(capture, found, fit, path):
    """Depth errors of the true sensor and of a simulated one, before and after, in a scene that no fit has seen."""
    print("the same sensor, and the model's, in another scene ...", flush=True)
    true, (before, after) = true_and_simulated(capture, [without_effects(found, fit), found])
    save(errors_picture(true, before, after), path)
    for name, errors in (("without effects", before), ("with what was found", after)):
        print(
            f"depth errors in another scene, simulated {name}: {errors.away_from(true):.3f} px from the true sensor's; "
            f"{100 * errors.filled:.1f} % of the pixels measured, {100 * true.filled:.1f} % by the true sensor"
        )
    print(f"picture: {path}")


def report(result, answer, out):
    print(f"verdict: {result['verdict']}; added: {', '.join(result['added']) or 'nothing'}")
    for entry in result["ranking"][:3]:
        values = ", ".join(parameter_text(name, parameter) for name, parameter in entry["parameters"].items())
        share = f"explains {100 * entry['explained_share']:.0f} %"
        print(f"  {entry['effect']:24} {entry['score_nats']:9.0f} nats, {share}: {values}")
    floor = result["heldout_noise_floor"]
    before, after = (error_text(result[f"heldout_ir_rmse_{when}"], floor, 2) for when in ("before", "after"))
    print(f"error on frames that no fit has seen: {before} before, {after} after; noise alone gives {floor:.2f} DN")
    print(f"what was hidden: {', '.join(answer['hidden'])}")
    print(f"report: {out / 'report' / 'report.html'}, picture: {out / 'hidden_effect.png'}")


if __name__ == "__main__":
    sys.exit(main())
