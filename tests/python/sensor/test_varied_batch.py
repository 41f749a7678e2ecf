# SPDX-License-Identifier: Apache-2.0
"""Sensors of a batch that differ in laser power, exposure and the right camera's place."""

import numpy as np
import pytest

from activestereo import Mounts, StereoDepthSensorBatch, StereoDepthSensorConfig
from sensor_scenes import walls

ENVIRONMENTS = 3


@pytest.fixture
def batch():
    """Each environment's sensor sees a wall at 0.8 m and nothing else, in the projector's light alone."""
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel, config.max_bounces, config.ir_ambient_radiance = 2, 1, 0.0
    scene = walls([0.8] * ENVIRONMENTS, ENVIRONMENTS)
    with StereoDepthSensorBatch(config, Mounts(scene, [[0, 0, 0, 1, 0, 0, 0]] * ENVIRONMENTS)) as batch:
        yield batch


def look(batch):
    """(mean infrared light [E], disparity)."""
    batch.restart(0)
    batch.take_picture(infrared_only=True)
    batch.compute_depth()
    return batch.get_ir_radiance()[0].mean(axis=(1, 2)), batch.get_disparity().copy()


def test_a_sensors_laser_and_exposure_scale_its_light_and_what_is_not_named_stays(batch):
    light = look(batch)[0]
    batch.vary(1, laser_power=[0.5])
    np.testing.assert_allclose(look(batch)[0], light * [1.0, 0.5, 1.0], rtol=2e-3)
    batch.vary(exposure=[1.0, 1.0, 2.0])
    np.testing.assert_allclose(look(batch)[0], light * [1.0, 0.5, 2.0], rtol=2e-3)


def test_a_right_eye_that_has_turned_shifts_the_disparity(batch):
    """A turn about the camera's y axis by an angle a shifts the disparity by f tan a at the middle of the image: here
    two pixels, which the matcher's pull towards whole ones does not change."""
    turn = np.arctan(2.0 / batch.get_config().ir_intrinsic[0, 0])
    before = np.median(look(batch)[1][:, 50:70, 90:120], axis=(1, 2))
    rotation = np.array([[[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]])
    batch.vary(1, right_turn=rotation)
    shift = np.median(look(batch)[1][:, 50:70, 90:120], axis=(1, 2)) - before
    assert shift[1] == pytest.approx(2.0, abs=0.12)  # two samples a pixel: other roundings of a pose draw other noise
    assert shift[0] == shift[2] == 0.0
