# SPDX-License-Identifier: Apache-2.0
"""The pose of a pattern projector that stands in the room is found from its dots on the surfaces."""

from dataclasses import replace

import numpy as np
import pytest

from activestereo.effects import View, builtin
from activestereo.effects.core import room_unit
from activestereo.effects.core.descriptor import StartImage
from activestereo.effects.core.room_unit import angles, axes
from activestereo.effects.core.room_unit import room_unit_starts
from activestereo.effects.core.room_unit import SeenPoints
from activestereo.effects.core.room_unit import SphereMatch
from effect_worlds import CAMERA_K, PATTERN, POSE, PROJECTOR_K, SIZE, seen, view_of
from virtual_sensor.view import PatternSource, look
from virtual_sensor.world import look_at, table_top

UNIT = look_at((0.45, 0.5, 0.45), (0.0, 0.05, -0.25))
AMBIENT_DN, INTENSITY_M2 = 50.0, 6.0


def image_of(pose, noise_share):
    """The image of the unit alone that a rig at a pose sees, as the residual, with noise of a share of the dots'
    deviation."""
    light, geometry = seen("left", left_to_world=pose, bounces=0)
    view: View = view_of(geometry, "left")
    view = replace(view, frame=replace(view.frame, camera_to_world=pose, projector_power=0.0))
    source = PatternSource(UNIT[:3, 3], UNIT[:3, :3], PROJECTOR_K, PATTERN)
    added = AMBIENT_DN * INTENSITY_M2 * look(table_top(), SIZE, CAMERA_K, pose, source, seed=3, grid=4).direct
    noise_dn = noise_share * added.std()
    noise = np.random.default_rng(1).normal(0.0, noise_dn, added.shape)
    weight = np.full(added.shape, noise_dn**-2)
    ambient = AMBIENT_DN * light.ambient
    return StartImage(view, light, weight, added + noise, ambient, AMBIENT_DN, ambient), noise


@pytest.fixture(scope="module")
def images():
    poses = [POSE, look_at((-0.15, 0.45, 0.5), (0.0, 0.06, -0.2)), look_at((0.3, 0.35, 0.45), (0.0, 0.06, -0.2))]
    return [image_of(pose, 0.5) for pose in poses]


def test_a_place_shows_which_way_a_unit_there_points(images):
    chosen = [image for image, _ in images]
    seen = SeenPoints.of(chosen, 6000)
    match = SphereMatch(chosen[0].view, *room_unit.COARSE)
    (gain, pose), (beside, _) = match.best(seen, np.stack([UNIT[:3, 3], UNIT[:3, 3] + (0.2, 0.0, 0.0)]))
    np.testing.assert_allclose(pose[3:5], angles(UNIT[:3, 2]), atol=0.03)
    assert gain > 3 * beside


def test_the_pose_is_found_from_the_dots(images, monkeypatch):
    # This unit lights most of the picture: few places are likelier than its own.
    monkeypatch.setattr(room_unit, "_PLACES", 250)
    found = room_unit_starts([image for image, _ in images])[0]
    np.testing.assert_allclose([found[name] for name in ("x_m", "y_m", "z_m")], UNIT[:3, 3], atol=0.05)
    turn = axes(found["azimuth_rad"], found["elevation_rad"], found["roll_rad"])
    assert turn[:, 2] @ UNIT[:3, 2] > np.cos(0.06)
    assert found["intensity_m2"] == pytest.approx(INTENSITY_M2, rel=0.4)


def test_nothing_is_searched_in_noise_alone(images):
    assert room_unit_starts([replace(image, residual=noise) for image, noise in images]) == [{}]


def test_the_axes_are_those_of_a_pose_that_looks_along_the_beam():
    np.testing.assert_allclose(axes(*angles(UNIT[:3, 2]), 0.0), UNIT[:3, :3], atol=1e-12)


def test_the_formula_draws_the_dots_where_a_source_there_throws_them(images):
    image, noise = images[0]
    azimuth, elevation = angles(UNIT[:3, 2])
    x, y, z = UNIT[:3, 3]
    lit = builtin()["room_projector"](
        image.light, image.view, intensity_m2=INTENSITY_M2, x_m=x, y_m=y, z_m=z, azimuth_rad=azimuth,
        elevation_rad=elevation, roll_rad=0.0,
    )  # fmt: skip
    added, truth = AMBIENT_DN * (lit.ambient - image.light.ambient), image.residual - noise
    here = (truth > 0) & (image.light.flat > 0)
    assert np.corrcoef(added[here], truth[here])[0, 1] > 0.9
