# SPDX-License-Identifier: Apache-2.0
"""How a camera's preset errs beside the real camera: what was measured on recordings of D415 and D435, next to the same
of the simulated one.

    PYTHONPATH=build/python python3 tests/bench/bench_camera.py [D415 ...] [--spp 16] [--texture 0.03]

A wall of albedo 0.5 in even light is looked at from 0.5 to 4 m, and the example's table-top once. The light is such
that the dots have the share of it that they have on recordings' patches at that distance; where no share is known it
has a radiance of 0.25. Automatic exposure does the rest. --texture: relative standard deviation of the
wall's albedo in grains of 4 mm and more, 0 is a wall that shows the dots alone. Each figure's definition:

    plane noise     root mean square distance of disparities from their own plane on 96 x 96 px, the median patch, px;
                    mean over four fractions of a pixel by which the right camera's light is moved, for it changes by
                    half with the fraction, and a wall has one where a recording's surfaces have all
    dot RMS         of the left image less its Gaussian blur (6 px), the median patch of 96 x 96 px, DN
    residual        the same of left less right at the true disparity, over sqrt 2, as a share of the dot RMS
    side peak       the autocorrelation's largest value from 4 to 30 px
    temporal noise  standard deviation over 8 frames where the mean is 20 to 40 DN above zero, DN
    background      median count over the table-top, DN
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from bench_pairs import PATCH, plane_residual, tiles
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates, shift

import kuafu
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.benchmarks.real_views import STATISTICS, planar_patches, statistics
from activestereo.common.pose import body_pose
from activestereo.scene_io.example_scene import write_table_top
from activestereo.scene_io.staging import ROOM_RADIANCE

Field = NDArray[np.float32]

DISTANCES_M = (0.5, 0.65, 1.0, 1.45, 2.0, 2.75, 4.0)
FRAMES = 8
FRACTIONS_PX = (0.0, 0.25, 0.5, 0.75)
TILE_M = 2.0

# What was measured on real cameras; the D415's are of its ASIC.
REAL = {
    "D415": {
        "dot RMS 0.65 m": "5.45", "residual 0.65 m": "18.5 %", "side peak 0.65 m": "0.62",
        "dot RMS 1 m": "3.89", "residual 1 m": "21.1 %", "side peak 1 m": "0.60",
        "dot RMS 1.45 m": "3.12", "residual 1.45 m": "21.8 %", "side peak 1.45 m": "0.60",
        "dot RMS 2 m": "1.78", "residual 2 m": "27.4 %", "side peak 2 m": "0.59",
        "dot RMS 2.75 m": "1.57", "residual 2.75 m": "29.4 %", "side peak 2.75 m": "0.59",
        "temporal noise": "0.46-0.55",
    },
    "D435": {
        "plane noise 0.5 m": "0.06-0.09", "plane noise 2 m": "0.06-0.09", "temporal noise": "0.46-0.55",
    },
}  # fmt: skip


# Dots' RMS over the light on flat, even patches of 12 D415 recordings with laser depth (UD31415/Fast-FoundationStereo).
SHARE = {"D415": {0.65: 0.279, 1.0: 0.196, 1.45: 0.155, 2.0: 0.0965, 2.75: 0.0656}}
ROOM_RADIANCE_OF_WALL = 0.25
DOTS_BLUR_PX = 6.0


def wall(distance_m: float, texture: float, radiance: float = ROOM_RADIANCE_OF_WALL) -> kuafu.Scene:
    """A wall across the view, in SAPIEN's axes: x forward. radiance: of the light from all sides."""
    scene = kuafu.Scene(kuafu.Device())
    half = 1.2 * distance_m
    corners = np.array([[distance_m, y, z] for y in (-half, half) for z in (-half, half)], np.float32)
    uv = corners[:, 1:] / TILE_M
    material = kuafu.Material(base_color=(1.0, 1.0, 1.0, 1.0), specular=0.0)
    material.base_color_texture = scene.add_texture(paint(texture), name="paint")
    mesh = scene.add_mesh(corners, [[0, 1, 3], [0, 3, 2]], uvs=uv)
    scene.add_instance(mesh, [scene.add_material(material)])
    scene.set_environment((radiance,) * 3)
    return scene


def before_table_top(
    config: StereoDepthSensorConfig, radiance: float = ROOM_RADIANCE, infrared_only: bool = True
) -> StereoDepthSensor:
    """A sensor that has pictured and measured the example's table-top, by default as 'activestereo simulate' has it."""
    scene = kuafu.Scene(kuafu.Device())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table_top.gltf"
        write_table_top(path)
        scene.load(path)
    scene.set_environment((radiance,) * 3)
    sensor = StereoDepthSensor(config, scene, pose=body_pose(scene.camera(0).camera_to_world))
    sensor.take_picture(infrared_only=infrared_only)
    sensor.compute_depth()
    return sensor


def paint(texture: float) -> NDArray[np.float32]:
    """Albedo 0.5 with grains whose size doubles from 4 mm on, each octave as strong as the others."""
    random = np.random.default_rng(7)
    size = int(TILE_M / 0.002)
    image = np.zeros((size, size), np.float32)
    octaves = range(5)
    for octave in octaves:
        grain = 2 * 2**octave
        coarse = random.standard_normal((size // grain + 4, size // grain + 4)).astype(np.float32)
        y, x = (np.arange(size, dtype=np.float32) / grain + 1 for _ in range(2))
        image += map_coordinates(coarse, np.meshgrid(y, x, indexing="ij"), order=1)
    image *= texture / image.std() if image.std() > 0 else 0.0
    return np.repeat(np.clip(0.5 * (1.0 + image), 0.0, 1.0)[..., None], 3, axis=2).astype(np.float32)


class Camera:
    """A preset, and what its pictures show."""

    def __init__(self, name: str, spp: int, texture: float, dots_only: bool) -> None:
        self.config = StereoDepthSensorConfig(name)
        self.config.samples_per_pixel, self.config.max_bounces = spp, 0
        if name in SHARE:
            self.config.ir_ambient_radiance = 0.0  # the wall's light is told as a whole
        self.texture, self.dots_only = texture, dots_only
        self.rows: dict[str, float] = {}

    def look(self, distance_m: float) -> None:
        sensor = StereoDepthSensor(self.config, wall(distance_m, self.texture, self._room(distance_m)))
        sensor.take_picture(infrared_only=True)
        sensor.compute_depth()
        left, right = (image.astype(float) for image in sensor.get_ir_measured())
        self._dots(left, right, distance_m)
        if not self.dots_only:
            matched = (self._matched(sensor, part) for part in FRACTIONS_PX)
            self.rows[f"plane noise {distance_m:g} m"] = float(
                np.mean([self._plane(one, distance_m) for one in matched])
            )
            if distance_m == 1.0:
                self._repeats(sensor)
        settings = sensor.get_config()
        self.rows[f"exposure {distance_m:g} m, ms"] = 1e3 * settings.ir_camera_exposure * settings.ir_camera_gain

    def _room(self, distance_m: float) -> float:
        """Radiance in which the dots have the recordings' share of the wall's light."""
        share = SHARE.get(self.config.model, {}).get(distance_m)
        if share is None:
            return ROOM_RADIANCE_OF_WALL
        laser, lit = (self._patches(distance_m, radiance) for radiance in (0.0, ROOM_RADIANCE_OF_WALL))
        of_room = [both.mean() - alone.mean() for alone, both in zip(laser, lit, strict=True)]
        dots = [float((one - gaussian_filter(one, DOTS_BLUR_PX)).std()) for one in laser]
        wanted = [fine / share - one.mean() for fine, one in zip(dots, laser, strict=True)]
        return ROOM_RADIANCE_OF_WALL * max(0.0, float(np.median(np.divide(wanted, of_room))))

    def _patches(self, distance_m: float, radiance: float) -> list[Field]:
        """The left image's light on an even wall."""
        sensor = StereoDepthSensor(self.config, wall(distance_m, 0.0, radiance))
        sensor.take_picture(infrared_only=True)
        light = np.array(sensor.get_picture("radiance", "left")[..., 0])
        return [light[patch] for patch in tiles(light.shape, PATCH)]

    def _plane(self, disparity: NDArray[np.float32], distance_m: float) -> float:
        border = int(self.config.focal_baseline_px_m / distance_m) + 8
        inside = np.where(disparity > 0, disparity, np.nan)[8:-8, border:-8]
        values = [plane_residual(inside[patch]) for patch in tiles(inside.shape, PATCH)]
        return float(np.nanmedian(values)) if np.isfinite(values).any() else np.nan

    def _dots(self, left: NDArray[np.float64], right: NDArray[np.float64], distance_m: float) -> None:
        truth = np.full(left.shape, self.config.focal_baseline_px_m / distance_m, np.float32)
        truth[:, : int(truth[0, 0]) + 8] = np.nan  # the right camera does not see it
        black_dn, pair = self.config.ir_black_level_dn, (left.astype(np.float32), right.astype(np.float32))
        patches = planar_patches(truth, self.config.focal_baseline_px_m)
        found = [one for patch in patches if (one := statistics(*pair, patch, black_dn)) is not None]
        rms, _, residual, peak, _ = (float(np.median([one[name] for one in found])) for name in STATISTICS)
        for name, value in (("dot RMS", rms), ("residual", residual), ("side peak", peak)):
            self.rows[f"{name} {distance_m:g} m"] = value

    def _light(self, sensor: StereoDepthSensor) -> tuple[list[Field], list[Field] | list[None]]:
        """(radiance, the laser's part of it), left and right."""
        light, direct, indirect = (
            [np.ascontiguousarray(sensor.get_picture(name, side)[..., 0]) for side in ("left", "right")]
            for name in ("radiance", "projector_direct", "projector_indirect")
        )
        if not self.config.ir_speckle_of_laser:
            return light, [None, None]
        return light, [a + b for a, b in zip(direct, indirect, strict=True)]

    def _matched(self, sensor: StereoDepthSensor, part_px: float) -> Field:
        """Disparity of what the cameras see, the right one's light moved to the left by part of a pixel."""
        light, laser = self._light(sensor)
        light[1] = moved(light[1], part_px)
        found = sensor.engine.compute(
            *light,
            ("disparity",),
            left_laser=laser[0],
            right_laser=None if laser[1] is None else moved(laser[1], part_px),
        )
        return np.array(found["disparity"])

    def _repeats(self, sensor: StereoDepthSensor) -> None:
        """Repeats under one and the same light: the samples' noise is none of the camera's."""
        light, laser = self._light(sensor)
        stack = []
        for frame in range(FRAMES):
            sensor.engine.set_parameters(frame_index=frame)
            seen = sensor.engine.compute(*light, ("ir_left",), left_laser=laser[0], right_laser=laser[1])["ir_left"]
            stack.append(seen.astype(float))
        mean, deviation = np.mean(stack, axis=0), np.std(stack, axis=0, ddof=1)
        seen = (mean > 20) & (mean < 40)
        self.rows["temporal noise"] = float(np.sqrt((deviation[seen] ** 2).mean())) if seen.any() else np.nan

    def table(self) -> None:
        config = StereoDepthSensorConfig(self.config.model)
        config.samples_per_pixel = self.config.samples_per_pixel
        sensor = before_table_top(config)
        self.rows["background"] = float(np.median(sensor.get_ir_measured()[0]))


def moved(image: Field, part_px: float) -> Field:
    if part_px == 0.0:
        return image
    return np.maximum(shift(image, (0.0, -part_px), order=3, mode="nearest"), 0.0).astype(np.float32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=["D415", "D435"], help="cameras (default: D415 D435)")
    parser.add_argument("--spp", type=int, default=16, help="samples per pixel (default: 16)")
    parser.add_argument("--texture", type=float, default=0.03, help="of the wall's albedo (default: 0.03)")
    parser.add_argument("--distances", type=float, nargs="*", default=DISTANCES_M, help="of the wall, m")
    parser.add_argument("--dots-only", action="store_true", help="a wall without texture at the recordings' distances")
    args = parser.parse_args()
    for name in args.names:
        camera = Camera(name, args.spp, 0.0 if args.dots_only else args.texture, args.dots_only)
        for distance_m in SHARE.get(name, args.distances) if args.dots_only else args.distances:
            camera.look(distance_m)
        if not args.dots_only:
            camera.table()
        real = REAL.get(camera.config.model.removeprefix("sapien-"), {})
        print(f"\n| {camera.config.model} | real | simulated |\n|--|--|--|")
        for row, value in camera.rows.items():
            print(
                f"| {row} | {real.get(row, '')} | {value:.3g}{' %' if row[:4] == 'resi' else ''} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
