# SPDX-License-Identifier: Apache-2.0
"""Light that glass bends in one environment has the same bits whatever is rendered beside it, and takes memory only
where an output asks for light."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import kuafu
from activestereo.scene_io import meshes
from activestereo.scene_io.bodies import add_mesh

SIDE_PX = 48


def placed(z_m: float) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[2, 3] = z_m
    return pose


def rendered(
    device: kuafu.Device, beside_m: list[float], neighbour_first: bool, output: str = "radiance", shadows: str = "bent"
) -> tuple[NDArray[np.float32], int]:
    """The image of an environment with a ball of 6 cm and a lamp, beside one with balls of these radii;
    and the bytes that the device holds."""
    scene = kuafu.Scene(device)
    scene.set_environment((0, 0, 0), 0.0)
    grey = scene.add_material(kuafu.Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0))
    glass = scene.add_material(kuafu.Material(transmission=1.0, roughness=0.0, ior=1.5, specular=1.0))
    scene.add_instance(add_mesh(scene, meshes.sheet((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))), [grey])

    def fill(environment: int, radius_m: float, z_m: float) -> None:
        ball = add_mesh(scene, meshes.sphere(radius_m))
        scene.add_instance(ball, [glass], local_to_world=placed(z_m), environment=environment)
        pose = np.diag([1.0, -1.0, -1.0, 1.0])
        pose[2, 3] = 1.4
        scene.add_light(kuafu.Light(kind="point", intensity=(1, 1, 1), light_to_world=pose, environment=environment))

    own, other = (1, 0) if neighbour_first else (0, 1)
    if not neighbour_first:
        fill(own, 0.06, 0.5)
    for radius_m in beside_m:
        fill(other, radius_m, 0.3)
    if neighbour_first:
        fill(own, 0.06, 0.5)
    k = np.array([[60.0, 0, (SIDE_PX - 1) / 2], [0, 60.0, (SIDE_PX - 1) / 2], [0, 0, 1]])
    look = np.diag([1.0, -1.0, -1.0, 1.0])
    look[2, 3] = 0.4
    cameras = [kuafu.Camera(SIDE_PX, SIDE_PX, k, look)] * 2
    renderer = kuafu.Renderer(device)
    options: dict[str, Any] = {"spp": 16, "max_bounces": 1, "glass_shadows": shadows}
    images = renderer.render(scene, cameras, [output], environments=[0, 1], **options)[output]
    return np.array(images[own]), device.allocated_bytes


@pytest.mark.parametrize("neighbour_first", [False, True])
def test_what_stands_in_another_environment_changes_no_bit(neighbour_first: bool) -> None:
    device = kuafu.Device("auto")
    large, _ = rendered(device, [0.08], neighbour_first)
    assert large.max() > 0
    assert np.array_equal(large, rendered(device, [0.002], neighbour_first)[0])
    assert np.array_equal(large, rendered(device, [0.03, 0.05], neighbour_first)[0])


def test_depth_alone_makes_no_room_for_light() -> None:
    device = kuafu.Device("auto")
    bent, straight = (rendered(device, [0.05], False, "depth", shadows)[1] for shadows in ("bent", "straight"))
    assert bent == straight
