# SPDX-License-Identifier: Apache-2.0
"""Whose light a picture has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import body_pose
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.staging import ALL_SIDES, ROOM_LUX, ROOM_WITHOUT_LAMPS, has_lamps, part_light
from activestereo.sensor.explain import light_share
from activestereo.sensor.sensor import StereoDepthSensor

# The camera looks along -z from the origin.
_POSE = body_pose(np.diag([1.0, -1.0, -1.0, 1.0]))


def _scene(path: Path, watts: float | None) -> kuafu.Scene:
    """A wall and a box before it; with a lamp of so many W/sr in the file, if any."""
    writer = GltfWriter()
    surface = {"baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": 0}
    grey = writer.add_material("grey", pbrMetallicRoughness=surface)
    writer.add_mesh("wall", meshes.sheet((-2, -1.5, -1.5), (4, 0, 0), (0, 3, 0)), grey)
    writer.add_mesh("box", meshes.box(0.4, 0.4, 0.2), grey, (0, -0.2, -1.1))
    if watts is not None:
        writer.add_light("lamp", (0.5, 1.5, 0.3), (1, 1, 1), watts)
    writer.write(path)
    scene = kuafu.Scene(kuafu.Device("cpu"))
    scene.load(path)
    part_light(scene)
    scene.set_environment((0.1, 0.1, 0.1), light_group=ALL_SIDES)
    return scene


def _sensor(scene: kuafu.Scene) -> StereoDepthSensor:
    config = StereoDepthSensorConfig("D435").scaled(0.25)
    config.samples_per_pixel = 4
    return StereoDepthSensor(config, scene, pose=_POSE)


# On a surface that faces both, the shares are as the irradiances: the projector's mean one, and I / d^2.
def test_the_share_follows_the_lamp(tmp_path: Path) -> None:
    shares = []
    for watts in (0.1, 1.0, 10.0):
        scene = _scene(tmp_path / "a.glb", watts)
        scene.remove_light(scene.add_light(kuafu.Light(kind="point", intensity=(1, 1, 1))))  # its number stays free
        found = light_share(_sensor(scene))
        assert found is not None
        shares.append(found)
    assert [round(share.distance_m, 1) for share in shares] == [1.0] * 3
    projector = [1 / share.projector - 1 for share in shares]  # others' light over the projector's
    assert projector[2] - projector[1] == pytest.approx(10 * (projector[1] - projector[0]), rel=0.05)
    assert shares[0].brightest == "the light from all sides"
    assert shares[2].brightest == "'lamp'" and shares[2].brightest_share > 0.6


def test_a_room_without_lamps_has_the_light_of_an_office(tmp_path: Path) -> None:
    scene = _scene(tmp_path / "a.glb", None)
    assert not has_lamps(scene)
    scene.set_environment((ROOM_WITHOUT_LAMPS,) * 3)
    camera = kuafu.Camera(8, 8, [[800, 0, 3.5], [0, 800, 3.5], [0, 0, 1]], np.diag([1.0, -1.0, -1.0, 1.0]))
    seen = kuafu.Renderer(scene.device).render(scene, camera, ["radiance", "albedo"], band="visible", spp=256)
    # Radiosity of a matt surface is its albedo times the irradiance; the box's front sees half of the world alone.
    lux = 683 * np.pi * float(np.mean(seen["radiance"])) / float(np.mean(seen["albedo"]))
    assert 300.0 <= ROOM_LUX <= 500.0
    assert lux == pytest.approx(ROOM_LUX, rel=0.1)
