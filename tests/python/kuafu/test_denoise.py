# SPDX-License-Identifier: Apache-2.0
"""Denoising from Python, and the sensor's denoiser and optics."""

import numpy as np
import pytest

import kuafu
from activestereo import StereoDepthSensor
from activestereo.common.pose import body_pose

CAMERA = kuafu.Camera(48, 36, [[40, 0, 23.5], [0, 40, 17.5], [0, 0, 1]])


@pytest.fixture(scope="module")
def scene(device):
    scene = kuafu.Scene(device)
    corners = np.array([[-2, -2, 2], [2, -2, 2], [2, 2, 2], [-2, 2, 2]], np.float32)
    wall = scene.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    scene.add_instance(wall, [scene.add_material(kuafu.Material(base_color=(0.5, 0.5, 0.5, 1), specular=0.0))])
    lamp = np.array([[1, 0, 0, 0.5], [0, 0, 1, -1.5], [0, -1, 0, 1], [0, 0, 0, 1.0]])
    scene.add_light(
        kuafu.Light(kind="rectangle", intensity=(4, 4, 4), ir_intensity=4.0, size_m=(0.5, 0.5), light_to_world=lamp)
    )
    return scene


def test_atrous_takes_noise(device, scene):
    renderer = kuafu.Renderer(device)
    plain, clean = (
        renderer.render(scene, CAMERA, ["ambient"], spp=2, denoise=d)["ambient"][0, ..., 0] for d in ("none", "atrous")
    )
    roughness = [np.abs(np.diff(image, 2)).mean() for image in (plain, clean)]
    assert roughness[1] < 0.1 * roughness[0]
    assert clean.mean() == pytest.approx(plain.mean(), rel=0.02)


def test_what_is_not_there_is_named(device, scene):
    with pytest.raises(kuafu.ArgumentError, match=r"unknown denoise 'svgf' \(known: none, atrous, oidn\)"):
        kuafu.Renderer(device).render(scene, CAMERA, denoise="svgf")
    with pytest.raises(kuafu.Error, match="KUAFU_OIDN_LIBRARY.*no/such/library"):
        kuafu.Renderer(device, oidn_library="/no/such/library.so").render(scene, CAMERA, denoise="oidn")


def test_sensor_denoises_and_has_optics(device, table_top, small_config):
    scene = kuafu.Scene(device)
    scene.load(table_top)
    pose = body_pose(scene.camera(0).camera_to_world)

    def infrared(**changes):
        for name, value in changes.items():
            setattr(small_config, name, value)
        sensor = StereoDepthSensor(small_config, scene, pose=pose)
        sensor.take_picture(infrared_only=True)
        image = sensor.get_ir()[0].copy()
        sensor.close()
        return image

    plain, clean = infrared(), infrared(denoise="atrous")
    dim = infrared(ir_optics={"vignetting_exponent": 4.0})
    assert np.abs(np.diff(clean, 2)).mean() < np.abs(np.diff(plain, 2)).mean()
    assert clean.mean() == pytest.approx(plain.mean(), rel=0.02)
    assert dim[:20, :20].mean() < 0.8 * clean[:20, :20].mean()
    assert dim[110:130, 200:220].mean() == pytest.approx(clean[110:130, 200:220].mean(), rel=0.02)
