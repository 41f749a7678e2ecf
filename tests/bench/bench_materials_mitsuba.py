# SPDX-License-Identifier: Apache-2.0
"""`calibrate materials` on things that another renderer, Mitsuba 3, made of its own materials: how far an unseen view
is then from Mitsuba's, and how much of it the depth engine fills.

    pip install mitsuba     # 3.9 was tried
    PYTHONPATH=build/python:tests/python/shared python3 tests/bench/bench_materials_mitsuba.py [--only ball-plastic ...]

Two poses are recorded (material_worlds.py); the view between them is unseen. Its residual, of the infrared image with
the projector on and with it off, is that of a recorded frame over the object's pixels, in deviations of the frame's own
noise; both renderers render twice, and the product of the two differences has no part of their noise. In brackets:
the model's squared error alone and its standard error, DN^2, which tells whether --unseen-spp is enough. With the
projector on a second figure has a D4xx's speckle in the floor, which no model of a sensor can predict. Both
renderers end the unseen view's paths at the second surface (--bounces): a path that comes back to the thing's gloss
meets the projector's dots so rarely and so brightly that no number of samples tells their mean. Asked: 1.3 deviations,
and fill within 3 points.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from bench_pairs import host_matcher
from material_worlds import (
    BASELINE_M, BLACK_DN, COLOR, DN, NOMINAL, READ_DN, SHOT_DN, camera_pose, counts, intrinsics, mesh_of, place_of,
    record, seen_of,
)  # fmt: skip
from material_worlds_mitsuba import MitsubaWorld
from numpy.typing import NDArray

import kuafu
import simsense
from activestereo.calibrate.material_fit import MaterialFit, MaterialScene, Picture, light_intensities
from activestereo.calibrate.materials import calibrate_materials
from activestereo.capture.capture import read_capture
from mitsuba_scene import grey, mitsuba

Image = NDArray[np.float64]
IR_ALBEDO = 0.5
METAL = "Cr"  # the indices of chromium
# A D4xx's speckle in one camera, of the dots' RMS: its cameras differ by 16 % of that at 1 m.
SPECKLE = 0.16 / 2**0.5
UNSEEN = 0.5  # pose between the recorded ones
OBJECTS = {
    f"{shape}-{kind}": (shape, kind, roughness)
    for shape in ("ball", "box", "cup")
    for kind, roughness in (("plastic", 0.35), ("metal", 0.3))
}


def bsdf_of(kind: str, roughness: float, own: dict[str, Any]) -> dict[str, Any]:
    gloss: dict[str, Any] = {"alpha": roughness**2, "distribution": "ggx"}
    if kind == "plastic":
        gloss |= {"type": "roughplastic", "int_ior": 1.5, "diffuse_reflectance": own}
    else:
        gloss |= {"type": "roughconductor", "material": METAL}
    return {"type": "twosided", "bsdf": gloss}


def world_of(shape: str, kind: str, roughness: float, spp: int) -> MitsubaWorld:
    """material_worlds.py's room with a roughplastic or roughconductor thing in it."""

    def bsdf(is_ir: bool, _: Image) -> tuple[dict[str, Any], dict[str, Any]]:
        own = grey(IR_ALBEDO) if is_ir else {"type": "rgb", "value": list(COLOR)}
        return bsdf_of(kind, roughness, own), {}

    return MitsubaWorld(mesh_of(shape), place_of(shape), bsdf, spp)


class Rendered:
    """The unseen view as kuafu sees it under the materials that were found."""

    def __init__(self, capture_path: Path, shape: str, found: Any, spp: int, bounces: int) -> None:
        scene, seen, self.surfaces = seen_of(capture_path, shape)
        self._spp = spp
        fit = MaterialFit(scene, seen, self.surfaces)
        theta = fit.start()
        (fields,), (color,) = found.found.values(), (*found.colors.values(), None)[:1]
        for k, (_, name) in enumerate(fit.parameters):
            if name in fields:
                theta[k] = fields[name].value
            elif color is not None and name in ("red", "green", "blue"):
                theta[k] = color[("red", "green", "blue").index(name)]
        fit.set(theta)
        infrared = [p for p in seen if p.band == "infrared"]
        halves = [[scene.lights(p, spp // 2, seed) for p in infrared] for seed in (3, 4)]
        self._intensities = light_intensities(list(zip(infrared, *halves)))
        self.scene = MaterialScene(read_capture(capture_path), max_bounces=bounces)
        MaterialFit(self.scene, seen, self.surfaces).set(theta)

    def see(
        self, pose: NDArray, lit: bool, projector_pose: NDArray, seed: int = 9, spp: int | None = None
    ) -> tuple[Image, NDArray[np.bool_]]:
        """(counts without noise, where the object is)"""
        width, height, K = intrinsics()
        camera = kuafu.Camera(width, height, K, pose)
        none = np.zeros((height, width, 1), np.float32)
        where = np.isin(self.scene.material_ids(camera), self.surfaces)
        view = Picture("unseen", "infrared", lit, none, where, none, camera, projector_pose, np.zeros_like(where, int))
        return np.einsum("yxcl,cl->yx", self.scene.lights(view, spp or self._spp, seed), self._intensities), where


def fill(left: Image, right: Image, where: NDArray[np.bool_], rng: np.random.Generator) -> float:
    """Share of the object's pixels with a measurement, percent; left, right: light."""
    width, height, K = intrinsics()
    match = host_matcher(simsense.Camera(width, height, K.tolist()), BASELINE_M, max_disparity=32)
    pair = (np.clip(np.rint(counts(image, rng)), 0, 255).astype(np.uint8) for image in (left, right))
    return 100.0 * float(np.isfinite(match(*pair)[where]).mean())


def measured(name: str, spp: int, unseen_spp: int, bounces: int) -> str:
    shape, kind, roughness = OBJECTS[name]
    world = world_of(shape, kind, roughness, spp)
    with tempfile.TemporaryDirectory() as folder:
        nominal_color = (1.0, 1.0, 1.0)
        path = record(Path(folder) / "world", NOMINAL, shape=shape, nominal_color=nominal_color, see=world.see)
        begin = time.process_time()
        found = calibrate_materials(path, shape)
        cpu = time.process_time() - begin
        ours = Rendered(path, shape, found, spp, bounces)
    left_pose = camera_pose(UNSEEN)
    right_pose = left_pose.copy()
    right_pose[:3, 3] += BASELINE_M * left_pose[:3, 0]
    residuals = []
    for lit in (True, False):
        (image, where), (other, _) = (ours.see(left_pose, lit, left_pose, seed, unseen_spp) for seed in (9, 11))
        v, u = np.nonzero(where)
        box = int(u.min()), int(v.min()), int(np.ptp(u)) + 1, int(np.ptp(v)) + 1
        theirs, again = (world.see(left_pose, lit, "infrared", seed, None, bounces, box, unseen_spp) for seed in (5, 7))
        gray = BLACK_DN + DN * theirs
        where &= gray < 250.0
        floor2 = float(np.mean(SHOT_DN * gray[where] + READ_DN**2))
        errors = (image - gray)[where] * (other - BLACK_DN - DN * again)[where]
        error2, unsure = float(errors.mean()), float(errors.std() / np.sqrt(errors.size))
        # A frame errs by the model's error and its own noise together.
        deviations = [np.sqrt(1.0 + max(error2, 0.0) / floor2)]
        if lit:
            deviations.append(np.sqrt(1.0 + max(error2, 0.0) / (floor2 + (SPECKLE * gray[where].std()) ** 2)))
        residuals.append(f"{', '.join(f'{f:.2f}' for f in deviations)} ({error2:.2f} ± {unsure:.2f} DN²)")
    rng = np.random.default_rng(1)
    places = left_pose, right_pose
    where = ours.see(left_pose, True, left_pose)[1]
    pairs = (
        [world.see(place, True, "infrared", seed, left_pose, bounces) for seed, place in zip((5, 6), places)],
        [(ours.see(place, True, left_pose)[0] - BLACK_DN) / DN for place in places],
    )
    fills = [fill(left, right, where, rng) for left, right in pairs]
    (fields,), (open_names,) = found.found.values(), found.undetermined.values()
    told = ", ".join(f"{key} {quantity.value:.2f}" for key, quantity in fields.items())
    return (
        f"| {name} | {told}; open: {', '.join(open_names) or 'none'} | {' | '.join(residuals)} "
        f"| {fills[0]:.1f} / {fills[1]:.1f} % | {cpu:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=list(OBJECTS), choices=list(OBJECTS), metavar="NAME")
    parser.add_argument("--spp", type=int, default=512)
    parser.add_argument("--unseen-spp", type=int, default=4096, help="for the residual of the unseen view")
    parser.add_argument("--bounces", type=int, default=1, help="of the unseen view")
    args = parser.parse_args()
    try:
        mitsuba()
    except ValueError as error:
        raise SystemExit(f"skipped: {error}") from None
    print("| object | found | on, sigma, with speckle | off, sigma | fill, Mitsuba / ours | CPU s |\n|" + "--|" * 6)
    for name in args.only:
        print(measured(name, args.spp, args.unseen_spp, args.bounces), flush=True)


if __name__ == "__main__":
    main()
