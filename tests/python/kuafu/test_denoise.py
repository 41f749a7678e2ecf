# SPDX-License-Identifier: Apache-2.0
"""Denoising from Python, and the sensor's denoiser and optics."""

import numpy as np
import pytest

import kuafu
from activestereo import StereoDepthSensor
from activestereo.common.pose import body_pose

CAMERA = kuafu.Camera(48, 36, [[40, 0, 23.5], [0, 40, 17.5], [0, 0, 1]])


def test_what_is_not_there_is_named(device):
    scene = kuafu.Scene(device)
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
