# SPDX-License-Identifier: Apache-2.0
"""`acquire materials` on things that another renderer, Mitsuba 3, made of its own materials: how far an unseen view is
then from Mitsuba's, and how much of it the depth engine fills.

    pip install mitsuba     # 3.9 was tried
    PYTHONPATH=build/python:tests/python/shared python3 tests/bench/bench_materials_mitsuba.py [--only ball-plastic ...]

Two poses are recorded (material_worlds.py); the view between them is unseen. Its residual, of the infrared image with
the projector on and with it off, is that of a recorded frame over the object's pixels, in floors of the frame's own
noise; both renderers render twice, and the product of the two differences has no part of their noise. In brackets:
the model's squared error alone and its standard error, DN^2, which tells whether --unseen-spp is enough. With the
projector on a second figure has a D4xx's speckle in the floor, which no model of a sensor can foretell. Both
renderers end the unseen view's paths at the second surface (--bounces): a path that comes back to the thing's gloss
meets the projector's dots so rarely and so brightly that no number of samples tells their mean. Asked: 1.3 floors, and
fill within 3 points.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from material_worlds import (
    BASELINE_M, BLACK_DN, COLOR, DN, IR_ROOM, LAMPS, LEFT_TO_PROJECTOR, NOMINAL, PATTERN_K, READ_DN, ROOM,
    SHOT_DN, TABLE_ALBEDO, TABLE_COLOR, counts, eye_pose, intrinsics, mesh_of, pattern, place_of, record, seen_of,
)  # fmt: skip
from numpy.typing import NDArray

import kuafu
import simsense
from activestereo import meshes
from activestereo.acquire.material_fit import MaterialFit, light_intensities
from activestereo.acquire.material_views import MaterialScene, Picture
from activestereo.acquire.materials import acquire_materials
from activestereo.capture import read_capture

Image = NDArray[np.float64]
IR_ALBEDO = 0.5
PROJECTOR = 1.0  # W/sr at the brightest: dots as strong as those of a D435 at this distance
METAL = "Cr"  # the indices of chromium
# A D4xx's speckle in one eye, of the dots' RMS: its eyes differ by 16 % of that at 1 m.
SPECKLE = 0.16 / 2**0.5
UNSEEN = 0.5  # pose between the recorded ones
OBJECTS = {
    f"{shape}-{kind}": (shape, kind, roughness)
    for shape in ("ball", "box", "cup")
    for kind, roughness in (("plastic", 0.35), ("metal", 0.3))
}


def mitsuba() -> Any:
    try:
        import mitsuba as mi
    except ImportError:
        raise SystemExit("skipped: Mitsuba is not installed (pip install mitsuba)") from None
    mi.set_variant("scalar_rgb")  # needs no LLVM library
    return mi


class MitsubaWorld:
    """material_worlds.py's room with a roughplastic or roughconductor thing in it."""

    def __init__(self, mi: Any, shape: str, kind: str, roughness: float, spp: int) -> None:
        self._mi, self._shape, self._kind, self._roughness, self._spp = mi, shape, kind, roughness, spp

    def see(
        self,
        pose: NDArray,
        lit: bool,
        band: str,
        seed: int,
        projector_pose: NDArray | None = None,
        bounces: int = 6,
        box: tuple[int, int, int, int] | None = None,
        spp: int | None = None,
    ) -> Image:
        """Radiance from `pose`; projector_pose: of the left eye, where the picture is the right one's; bounces:
        surfaces after the first; box: left, top, width and height of what is rendered, all else is 0."""
        is_ir = band == "infrared"
        scene = self._room(is_ir)
        # Theirs counts the way from the light and the one to the camera.
        scene["integrator"] = {"type": "path", "max_depth": bounces + 2, "rr_depth": 100}
        width, height, K = intrinsics()
        fov = float(np.rad2deg(2 * np.arctan(0.5 * width / K[0, 0])))
        scene["sensor"] = {
            "type": "perspective", "fov": fov, "to_world": self._pose(pose), "near_clip": 1e-3,
            "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
        }  # fmt: skip
        if lit and is_ir:
            left = pose if projector_pose is None else projector_pose
            scene["projector"] = self._projector(left @ np.linalg.inv(LEFT_TO_PROJECTOR))
        left, top, columns, rows = box or (0, 0, width, height)
        scene["sensor"]["film"] |= {
            "crop_offset_x": left, "crop_offset_y": top, "crop_width": columns, "crop_height": rows,
        }  # fmt: skip
        image = np.zeros((height, width, 3))
        rendered = self._mi.render(self._mi.load_dict(scene), spp=spp or self._spp, seed=seed)
        image[top : top + rows, left : left + columns] = np.array(rendered, np.float64)[..., :3]
        return image.mean(axis=-1) if is_ir else image

    def _rgb(self, *value: float) -> dict[str, Any]:
        return {"type": "rgb", "value": list(value) * (1 if len(value) == 3 else 3)}

    def _pose(self, pose: NDArray) -> Any:
        """Mitsuba: x left, y up, z forward."""
        return self._mi.ScalarTransform4f((pose @ np.diag([-1.0, -1.0, 1.0, 1.0])).tolist())

    def _mesh(self, mesh: meshes.Mesh, bsdf: dict[str, Any], place: NDArray) -> Any:
        props = self._mi.Properties()
        props["mesh_bsdf"] = self._mi.load_dict(bsdf)
        out = self._mi.Mesh("", len(mesh.positions), len(mesh.indices.reshape(-1, 3)), props, True)
        parameters = self._mi.traverse(out)
        turned, there = mesh.normals @ place[:3, :3].T, mesh.positions @ place[:3, :3].T + place[:3, 3]
        parameters["vertex_positions"] = np.ascontiguousarray(there, np.float32).ravel()
        parameters["faces"] = mesh.indices.astype(np.uint32).ravel()
        parameters["vertex_normals"] = np.ascontiguousarray(turned, np.float32).ravel()
        parameters.update()
        return out

    def _room(self, is_ir: bool) -> dict[str, Any]:
        table = self._rgb(TABLE_ALBEDO) if is_ir else self._rgb(*TABLE_COLOR)
        own = self._rgb(IR_ALBEDO) if is_ir else self._rgb(*COLOR)
        gloss: dict[str, Any] = {"alpha": self._roughness**2, "distribution": "ggx"}
        if self._kind == "plastic":
            gloss |= {"type": "roughplastic", "int_ior": 1.5, "diffuse_reflectance": own}
        else:
            gloss |= {"type": "roughconductor", "material": METAL}
        there = np.eye(4)
        there[1, 3] = -0.02
        matt = {"type": "diffuse", "reflectance": table}
        scene = {
            "type": "scene",
            "table": self._mesh(meshes.box(1.2, 0.02, 1.2), {"type": "twosided", "bsdf": matt}, there),
            "thing": self._mesh(mesh_of(self._shape), {"type": "twosided", "bsdf": gloss}, place_of(self._shape)),
            "room": {"type": "constant", "radiance": self._rgb(IR_ROOM if is_ir else ROOM)},
        }  # fmt: skip
        if not is_ir:
            for k, (where, color, light) in enumerate(LAMPS):
                scene[f"lamp{k}"] = {
                    "type": "point", "position": list(where), "intensity": self._rgb(*(light * c for c in color)),
                }  # fmt: skip
        return scene

    def _projector(self, pose: NDArray) -> dict[str, Any]:
        image = pattern().astype(np.float32) / 255.0
        height, width = image.shape
        x = (np.arange(width) - PATTERN_K[0, 2]) / PATTERN_K[0, 0]
        y = (np.arange(height) - PATTERN_K[1, 2]) / PATTERN_K[1, 1]
        # Theirs is of the image plane and pi times as bright, as walls show; ours is of directions.
        image = PROJECTOR / np.pi * image * (1.0 + x[None] ** 2 + y[:, None] ** 2) ** -1.5
        return {
            "type": "projector", "to_world": self._pose(pose),
            "fov": float(np.rad2deg(2 * np.arctan(0.5 * width / PATTERN_K[0, 0]))),
            "irradiance": {
                "type": "bitmap", "bitmap": self._mi.Bitmap(np.repeat(image.astype(np.float32)[..., None], 3, -1)),
                "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp",
            },
        }  # fmt: skip


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
    camera = simsense.Camera(width, height, K.tolist())
    shift = np.eye(4)
    shift[0, 3] = -BASELINE_M
    engine = simsense.Engine(simsense.Device("host"), camera, camera, shift, rectified=True, max_disparity=32)
    pair = (np.clip(np.rint(counts(image, rng)), 0, 255).astype(np.uint8) for image in (left, right))
    return 100.0 * float((engine.compute(*pair, ("disparity",))["disparity"][where] >= 0).mean())


def measured(name: str, spp: int, unseen_spp: int, bounces: int) -> str:
    shape, kind, roughness = OBJECTS[name]
    world = MitsubaWorld(mitsuba(), shape, kind, roughness, spp)
    with tempfile.TemporaryDirectory() as folder:
        nominal_color = (1.0, 1.0, 1.0)
        path = record(Path(folder) / "world", NOMINAL, shape=shape, nominal_color=nominal_color, see=world.see)
        begin = time.process_time()
        found = acquire_materials(path, shape)
        cpu = time.process_time() - begin
        ours = Rendered(path, shape, found, spp, bounces)
    left_pose = eye_pose(UNSEEN)
    right_pose = left_pose.copy()
    right_pose[:3, 3] += BASELINE_M * left_pose[:3, 0]
    residuals = []
    for lit in (True, False):
        (image, where), (other, _) = (ours.see(left_pose, lit, left_pose, seed, unseen_spp) for seed in (9, 11))
        v, u = np.nonzero(where)
        box = int(u.min()), int(v.min()), int(np.ptp(u)) + 1, int(np.ptp(v)) + 1
        theirs, again = (
            world.see(left_pose, lit, "infrared", seed, None, bounces, box, unseen_spp) for seed in (5, 7)
        )
        gray = BLACK_DN + DN * theirs
        where &= gray < 250.0
        floor2 = float(np.mean(SHOT_DN * gray[where] + READ_DN**2))
        errors = (image - gray)[where] * (other - BLACK_DN - DN * again)[where]
        error2, unsure = float(errors.mean()), float(errors.std() / np.sqrt(errors.size))
        # A frame errs by the model's error and its own noise together.
        floors = [np.sqrt(1.0 + max(error2, 0.0) / floor2)]
        if lit:
            floors.append(np.sqrt(1.0 + max(error2, 0.0) / (floor2 + (SPECKLE * gray[where].std()) ** 2)))
        residuals.append(f"{', '.join(f'{f:.2f}' for f in floors)} ({error2:.2f} ± {unsure:.2f} DN²)")
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
    mitsuba()
    print("| object | found | on, floors, with speckle | off, floors | fill, Mitsuba / ours | CPU s |\n|" + "--|" * 6)
    for name in args.only:
        print(measured(name, args.spp, args.unseen_spp, args.bounces), flush=True)


if __name__ == "__main__":
    main()
