# SPDX-License-Identifier: Apache-2.0
"""For programs run by hand: material_worlds.py's room as Mitsuba 3 renders it, with its own materials."""

from collections.abc import Callable
from typing import Any

import numpy as np
from material_worlds import (
    IR_ROOM, LAMPS, LEFT_TO_PROJECTOR, PATTERN_K, ROOM, TABLE_ALBEDO, TABLE_COLOR, intrinsics, pattern,
)  # fmt: skip
from numpy.typing import NDArray

from activestereo.common.pose import rigid_motion
from activestereo.scene_io import meshes
from mitsuba_scene import grey, mesh, mitsuba, pose, projector

PROJECTOR = 1.0  # W/sr at the brightest: dots as strong as those of a D435 at this distance
Image = NDArray[np.float64]
# Of (is it infrared, the camera's place in the thing's frame): a surface and the values at the mesh's corners it needs.
Bsdf = Callable[[bool, Image], tuple[dict[str, Any], dict[str, Any]]]


def _rgb(value: tuple[float, ...]) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}


class MitsubaWorld:
    """place: of the thing, 4x4, y up. ValueError without Mitsuba."""

    def __init__(self, thing: meshes.Mesh, place: Image, bsdf: Bsdf, spp: int) -> None:
        self._mi, self._thing, self._place, self._bsdf, self._spp = mitsuba(), thing, place, bsdf, spp

    def see(
        self, camera_to_world: Image, lit: bool, band: str, seed: int, projector_pose: Image | None = None,
        bounces: int = 6, box: tuple[int, int, int, int] | None = None, spp: int | None = None,
    ) -> Image:  # fmt: skip
        """Radiance from there; projector_pose: of the left camera, where the picture is the right one's; bounces:
        surfaces after the first; box: left, top, width and height of what is rendered, all else is 0."""
        is_ir = band == "infrared"
        scene = self._room(is_ir, camera_to_world)
        # Theirs counts the way from the light and the one to the camera.
        scene["integrator"] = {"type": "volpath", "max_depth": bounces + 2, "rr_depth": 100}
        width, height, K = intrinsics()
        fov = float(np.rad2deg(2 * np.arctan(0.5 * width / K[0, 0])))
        scene["sensor"] = {
            "type": "perspective", "fov": fov, "to_world": pose(self._mi, camera_to_world), "near_clip": 1e-3,
            "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
        }  # fmt: skip
        if lit and is_ir:
            left = camera_to_world if projector_pose is None else projector_pose
            own = left @ np.linalg.inv(LEFT_TO_PROJECTOR)
            scene["projector"] = projector(self._mi, pattern() / 255.0, PATTERN_K, PROJECTOR, own)
        left, top, columns, rows = box or (0, 0, width, height)
        scene["sensor"]["film"] |= {
            "crop_offset_x": left, "crop_offset_y": top, "crop_width": columns, "crop_height": rows,
        }  # fmt: skip
        image = np.zeros((height, width, 3))
        rendered = self._mi.render(self._mi.load_dict(scene), spp=spp or self._spp, seed=seed)
        image[top : top + rows, left : left + columns] = np.array(rendered, np.float64)[..., :3]
        return image.mean(axis=-1) if is_ir else image

    def _room(self, is_ir: bool, camera_to_world: Image) -> dict[str, Any]:
        there = rigid_motion((0, -0.02, 0))
        matt = {"type": "diffuse", "reflectance": grey(TABLE_ALBEDO) if is_ir else _rgb(TABLE_COLOR)}
        table = mesh(self._mi, meshes.box(1.2, 0.02, 1.2), {"type": "twosided", "bsdf": matt}, there)
        bsdf, corners = self._bsdf(is_ir, (np.linalg.inv(self._place) @ camera_to_world)[:3, 3])
        thing = mesh(self._mi, self._thing, bsdf, self._place, **corners)
        room = {"type": "constant", "radiance": grey(IR_ROOM if is_ir else ROOM)}
        scene = {"type": "scene", "table": table, "thing": thing, "room": room}
        if not is_ir:
            for k, (where, color, light) in enumerate(LAMPS):
                scene[f"lamp{k}"] = {
                    "type": "point", "position": list(where), "intensity": _rgb(tuple(light * c for c in color)),
                }  # fmt: skip
        return scene
