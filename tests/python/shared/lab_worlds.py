# SPDX-License-Identifier: Apache-2.0
"""Shared by the lab's tests: the analytic worlds, and a renderer that asks them instead of kuafu."""

import json
import shutil
from pathlib import Path

import numpy as np

from activestereo.capture.capture import read_capture
from activestereo.capture.images import read_gray, write_gray
from activestereo.effects.engines.layers import request_key
from activestereo.compare.depth_compare import DepthModel
from activestereo.effects.core.view import Layers
from virtual_sensor.sensor import expected
from virtual_sensor.view import PatternSource, look

DEPTH_SCALE_M = 1e-4
BLACK_DN = 4.0  # what the worlds' imagers add to every pixel


class WorldRenderer:
    """Renders a world's solids by closed form, grid x grid rays a pixel, with noise by request. Counts its calls."""

    def __init__(self, world, grid=4, bounces=1):
        self._world, self._grid, self._bounces = world, grid, bounces
        self.version = f"analytic worlds 1, {grid} x {grid} rays, {bounces} bounces"
        self.calls = 0

    def __call__(self, request, progress=None):
        self.calls += 1
        seed = int(request_key(request, self.version)[:8], 16)
        return tuple(self._layers(camera, request, seed + i) for i, camera in enumerate(request.cameras))

    def _layers(self, camera, request, seed):
        pose, size = request.projector.light_to_world, (camera.width, camera.height)
        source = PatternSource(pose[:3, 3], pose[:3, :3], request.projector.k, request.pattern.astype(np.float64))
        solids, grid, bounces = self._world.solids, self._grid, self._bounces
        view = look(solids, size, camera.k, camera.camera_to_world, source, seed, grid, bounces)
        images = (view.direct, view.indirect, view.sky, view.flat, view.depth, view.normal)
        return Layers(*(image.astype(np.float32) for image in images), view.index.astype(np.uint32))


class RememberingRenderer:
    """Renders each pose once, whatever the seed and samples: a renderer without noise, whose images are the truth."""

    def __init__(self, renderer):
        self._renderer, self._known = renderer, {}
        self.version = f"{renderer.version}, remembered"

    def __call__(self, request, progress=None):
        key = tuple((camera.camera_to_world.tobytes(), camera.k.tobytes()) for camera in request.cameras)
        if key not in self._known:
            self._known[key] = self._renderer(request)
        return self._known[key]


def with_device_depth(world, folder, ids, stretch=1.0):
    """A copy of the world's capture, whose device matched the measured pairs and stretches depth."""
    copy = Path(shutil.copytree(world.capture_path, folder))
    values = json.loads((copy / "capture.json").read_text())
    values["depth_engine"] = {"max_disparity": 32, "notes": "as the model's"}
    capture = read_capture(copy)
    engine = DepthModel(capture)
    (copy / "depth").mkdir(exist_ok=True)
    for entry, frame in zip(values["frames"], capture.frames, strict=True):
        if frame.id in ids:
            depth = stretch * engine.depth(capture.ir(frame, "left"), capture.ir(frame, "right"))
            write_gray(copy / "depth" / f"{frame.id}.png", np.rint(depth / DEPTH_SCALE_M).astype(np.uint16))
            entry |= {"depth": f"depth/{frame.id}.png", "depth_scale": DEPTH_SCALE_M}
    (copy / "capture.json").write_text(json.dumps(values))
    return copy


def altered(world, folder, change):
    """A copy of the world's capture with every image changed: change(DN, side)."""
    copy = shutil.copytree(world.capture_path, folder)
    for side in ("left", "right"):
        for path in (copy / side).iterdir():
            image = change(read_gray(path).astype(np.float64), side)
            write_gray(path, np.clip(np.rint(image), 0, 255).astype(np.uint8))
    return copy


def error_of_truth(world, capture, split):
    """Root mean square of what the world's own noise-free images leave, DN."""
    squares = [
        np.mean(
            (capture.ir(f, s) - expected(world.sensor, world.views[f.id, s], f.exposure_gain, f.projector_power)) ** 2
        )
        for f in capture.split(split)
        for s in ("left", "right")
    ]
    return np.sqrt(np.mean(squares))
