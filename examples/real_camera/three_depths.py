# SPDX-License-Identifier: Apache-2.0
"""Is simulated depth like a camera's own? Both against the depth of a laser or a mesh, in one picture and one sentence.

    PYTHONPATH=build/python python3 examples/real_camera/three_depths.py CAPTURE OWN OUT

CAPTURE has the true depth, and a scene (`activestereo calibrate world` makes one). OWN holds the camera's own depth, an
image for each frame in the frames' order, on the left infrared camera's pixels: a folder of PNG files, or a pattern
such as 'views/*/img_depth_rs.png'. Pixels without a truth, or beyond the scene, count nowhere.
OUT gets three_depths.png and three_depths.json.
"""

from __future__ import annotations

import argparse
import glob
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from activestereo.capture.capture import read_capture
from activestereo.capture.images import read_gray
from activestereo.common.output_files import write_json
from activestereo.compare.compare import Comparison, compare
from activestereo.effects.core.surfaces import surface_text
from activestereo.report.lettering import write_figure

CAMERA, SIMULATED = "your camera", "simulated"
_MAD_TO_SIGMA = 1.4826  # of a normal distribution
_LEAST_SHARE = 0.02  # of the pixels: smaller materials are not told


def figures(truth: NDArray[Any], found: NDArray[Any], focal_baseline: float) -> dict[str, float]:
    """Depth in metres against the truth where there is one: share measured, and median, bias and noise in px."""
    error = focal_baseline / found[found > 0] - focal_baseline / truth[found > 0]
    median = float(np.median(error)) if error.size else np.nan
    return {
        "measured": float(np.mean(found > 0)),
        "error_px": float(np.median(np.abs(error))) if error.size else np.nan,
        "bias_px": median,
        "noise_px": _MAD_TO_SIGMA * float(np.median(np.abs(error - median))) if error.size else np.nan,
    }


def gathered(comparison: Comparison, own: list[NDArray[Any]]) -> dict[str, Any]:
    """The figures of both sources: as a whole, by distance, and by material. holes_in_common: intersection over union
    of the pixels without depth."""
    ids = [frame.id for frame in comparison.capture.frames]
    parts = []
    for depth in comparison.depths:
        there = (depth.measured > 0) & (depth.truth > 0)
        material = comparison.layers[depth.frame.id]["left"].material
        images = depth.measured, own[ids.index(depth.frame.id)], depth.model[0], material
        parts.append([image[there] for image in images])
    truth, camera, simulated, material = (np.concatenate(column) for column in zip(*parts, strict=True))
    name_of, edges = surface_text(comparison.capture.scene_path), np.quantile(truth, (0.0, 1 / 3, 2 / 3, 1.0))
    places = {"all": np.ones(truth.shape, bool)}
    for near, far in zip(edges, edges[1:], strict=False):
        places[f"{near:.2f} to {far:.2f} m"] = (truth >= near) & (truth <= far)
    surfaces, counts = np.unique(material, return_counts=True)
    if len(surfaces) > 1:
        places |= {name_of(int(s)): material == s for s, n in zip(surfaces, counts, strict=True)
                   if n > _LEAST_SHARE * truth.size}  # fmt: skip
    focal_baseline = comparison.depths[0].focal_baseline
    both, either = (camera <= 0) & (simulated <= 0), (camera <= 0) | (simulated <= 0)
    return {
        name: {source: figures(truth[part], z[part], focal_baseline)
               for source, z in ((CAMERA, camera), (SIMULATED, simulated))}
        | {"holes_in_common": float(both[part].sum() / max(either[part].sum(), 1))}
        for name, part in places.items()
    }  # fmt: skip


def sentence(found: dict[str, Any]) -> str:
    whole = found["all"]
    ratio = whole[SIMULATED]["error_px"] / whole[CAMERA]["error_px"]
    return (
        f"Simulated depth errs {ratio:.1f} times as much as your camera's ({whole[SIMULATED]['error_px']:.2f} and "
        f"{whole[CAMERA]['error_px']:.2f} px in the median); holes agree to {100 * whole['holes_in_common']:.0f} %."
    )


def picture(comparison: Comparison, own: list[NDArray[Any]], said: str) -> Figure:
    """The truth and both depths of the frame that is held out, and their errors."""
    depth = next((d for d in comparison.depths if d.frame.split == "test"), comparison.depths[0])
    camera = own[[frame.id for frame in comparison.capture.frames].index(depth.frame.id)]
    sources = {CAMERA: camera, SIMULATED: np.where(depth.truth > 0, depth.model[0], 0.0)}
    there, holes = (depth.measured > 0) & (depth.truth > 0), [z <= 0 for z in sources.values()]
    figure = Figure(figsize=(12.8, 5.6), layout="constrained")
    figure.suptitle(said, size=12)
    axes = figure.subplots(2, 3)
    low, high = np.quantile(depth.measured[depth.measured > 0], (0.01, 0.99))
    for axis, (name, z) in zip(axes[0], ({"true": depth.measured} | sources).items(), strict=True):
        shown = axis.imshow(np.where(z > 0, z, np.nan), cmap="viridis", vmin=low, vmax=high)
        axis.set_title(f"depth, {name} (white: none)", size=10, loc="left")
    figure.colorbar(shown, ax=axes[0], label="m")
    for axis, (name, z) in zip(axes[1, 1:], sources.items(), strict=True):
        error, both = depth.disparity_error(z, np.where(there, depth.measured, 0.0))
        shown = axis.imshow(np.where(both, error, np.nan), cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        axis.set_title(f"disparity, {name} less true", size=10, loc="left")
    figure.colorbar(shown, ax=axes[1], label="px")
    colours = np.ones((*there.shape, 3))
    orange, blue, black = (0.9, 0.5, 0.1), (0.2, 0.4, 0.8), (0.1, 0.1, 0.1)
    for colour, part in ((orange, holes[0]), (blue, holes[1]), (black, holes[0] & holes[1])):
        colours[there & part] = colour
    axes[1, 0].imshow(colours)
    axes[1, 0].set_title("holes: orange camera's, blue simulated, black both", size=10, loc="left")
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[])
    return figure


def table(found: dict[str, Any]) -> str:
    lines = [f"{'':24}{'':12}{'measured':>10}{'error':>10}{'bias':>11}{'noise':>10}{'holes in common':>17}"]
    for place, row in found.items():
        for source in (CAMERA, SIMULATED):
            f = row[source]
            shared = f"{100 * row['holes_in_common']:.0f} %" if source == CAMERA else ""
            name = place if source == CAMERA else ""
            lines.append(
                f"{name:24}{source:12}{100 * f['measured']:>8.1f} %{f['error_px']:>7.3f} px"
                f"{f['bias_px']:>+8.3f} px{f['noise_px']:>7.3f} px{shared:>17}"
            )
    return "\n".join(lines)


def three_depths(capture: Path, own: str, out: Path, samples: int, scale_m: float) -> str:
    """Writes the picture and the figures; returns the table and the sentence."""
    files, known = sorted(glob.glob(f"{own}/*.png" if Path(own).is_dir() else own)), read_capture(capture)
    if len(files) != len(known.frames):
        raise SystemExit(f"{own}: {len(files)} images for {len(known.frames)} frames: one each is needed")
    depths = [read_gray(Path(file)).astype(np.float64) * scale_m for file in files]
    truths = [known.depth(frame) for frame in known.frames]
    both = [(z, true) for z, true in zip(depths, truths, strict=True) if true is not None]
    if any(z.shape != true.shape for z, true in both):
        raise SystemExit(f"{own}: its images have another size than the left infrared camera's")
    times = np.median(np.concatenate([z[there] / true[there] for z, true in both for there in [(z > 0) & (true > 0)]]))
    if not 0.5 < times < 2.0:
        raise SystemExit(f"{own}: {times:.3g} times as deep as the capture in the median: --depth-scale is its unit")
    comparison = compare(capture, samples_per_pixel=samples)
    found = gathered(comparison, depths)
    said = sentence(found)
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "three_depths.json", {"sentence": said, "figures": found})
    write_figure(out / "three_depths.png", picture(comparison, depths, said))
    return f"{table(found)}\n{said}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("own")
    parser.add_argument("out", type=Path)
    parser.add_argument("--spp", type=int, default=16, help="samples per pixel (default: 16)")
    parser.add_argument("--depth-scale", type=float, default=0.001, help="metres per unit of OWN (default: 0.001)")
    args = parser.parse_args()
    print(three_depths(args.capture, args.own, args.out, args.spp, args.depth_scale))


if __name__ == "__main__":
    main()
