# SPDX-License-Identifier: Apache-2.0
"""Image-space effects against worlds that were ray-cast with the effect in them: at least most of the change is
reproduced."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.ndimage import map_coordinates

from effect_worlds import PATTERN, POSE, PROJECTOR_K, TWIST, seen, smooth_places, view_of
from activestereo.effects import builtin
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.resample import Pattern, disc_sampler

EFFECTS = builtin()


@pytest.fixture(scope="module")
def nominal():
    light, geometry = seen()
    return light, view_of(geometry)


def unexplained(nominal, changed, modelled, name="direct", where=...):
    """Residual of the model over the change that the effect made, both root mean square."""
    residual, change = (getattr(changed, name) - getattr(light, name) for light in (modelled, nominal))
    return np.sqrt(np.mean(residual[where] ** 2) / np.mean(change[where] ** 2))


def test_flat_light_times_pattern_is_the_direct_light(nominal):
    light, view = nominal
    dots = DotView(view)
    error = light.flat * dots.mean(view.pattern) - light.direct
    assert np.sqrt(np.mean(error**2)) < 0.05 * light.direct.std()


def test_pattern_scale_drift_spreads_the_diffraction_orders(nominal):
    """Truth: each pattern pixel shows the order whose angle from the axis had a sine 1 % smaller."""
    light, view = nominal
    rows, columns = np.mgrid[0:200, 0:320].astype(float)
    x, y = (columns - PROJECTOR_K[0, 2]) / PROJECTOR_K[0, 0], (rows - PROJECTOR_K[1, 2]) / PROJECTOR_K[1, 1]
    angle, azimuth = np.arctan(np.hypot(x, y)), np.arctan2(y, x)
    radius = np.tan(np.arcsin(np.sin(angle) / 1.01))
    places = [
        radius * np.sin(azimuth) * PROJECTOR_K[1, 1] + PROJECTOR_K[1, 2],
        radius * np.cos(azimuth) * PROJECTOR_K[0, 0] + PROJECTOR_K[0, 2],
    ]
    truth, _ = seen(pattern=map_coordinates(PATTERN, places, order=1))
    assert unexplained(light, truth, EFFECTS["pattern_scale_drift"](light, view, scale=0.01)) < 0.12


def test_projector_defocus_blurs_by_depth(nominal):
    """Truth: the pattern blurred by one disc, cast into the world; compared where the effect's disc has that size."""
    light, view = nominal
    sampler = disc_sampler(Pattern(PATTERN), 5.0)
    columns, rows = np.meshgrid(np.arange(320.0), np.arange(200.0))
    blurred = sampler(columns, rows, np.ones((200, 320)), np.ones((200, 320)))
    truth, _ = seen(pattern=blurred)
    modelled = EFFECTS["projector_defocus"](light, view, aperture_px_m=1.5, focus_m=0.4)
    diameter = 3.0 * np.abs(1 / np.where(view.depth_m > 0, view.depth_m, 0.4) - 1 / 0.4)
    here = np.abs(diameter - 5.0) < 0.25
    assert here.sum() > 100
    change = np.mean((truth.direct - light.direct)[here] ** 2)
    assert np.mean((truth.direct - modelled.direct)[here] ** 2) < 0.03 * change


def test_baseline_drift_is_another_baseline(nominal):
    light, view = nominal
    truth, _ = seen(baseline_m=0.052)
    # Linear resampling of pixel means and new occlusions leave the rest.
    modelled = EFFECTS["baseline_drift"](light, view, offset_m=0.002)
    assert unexplained(light, truth, modelled) < 0.35


@pytest.mark.parametrize("delay_s", [0.01, -0.01])
def test_exposure_desync_is_the_view_of_the_moved_rig(nominal, delay_s):
    light, view = nominal
    generator = np.zeros((4, 4))
    v, w = TWIST[:3], TWIST[3:]
    generator[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    generator[:3, 3] = v
    truth, _ = seen(left_to_world=POSE @ expm(delay_s * generator))
    modelled = EFFECTS["exposure_desync"](light, view, delay_s=delay_s)
    smooth = smooth_places(view.depth_m)
    assert unexplained(light, truth, modelled, "direct", smooth) < 0.25
    assert unexplained(light, truth, modelled, "flat", smooth) < 0.2
    assert unexplained(light, truth, modelled, "flat") < 0.4
    wrong = EFFECTS["exposure_desync"](light, view, delay_s=-delay_s)
    assert unexplained(light, truth, wrong, "flat") > 1.2


def test_a_left_camera_is_never_touched_by_errors_of_the_right():
    light, geometry = seen(side="left", bounces=0)
    view = view_of(geometry, "left")
    for name in ("baseline_drift", "stereo_pitch", "stereo_roll", "principal_point_offset", "exposure_desync"):
        e = EFFECTS[name]
        assert e(light, view, **e.typical_values) is light


def test_motion_needs_a_moving_rig(nominal):
    light, view = nominal
    still = replace(view, frame=replace(view.frame, camera_velocity=np.zeros(6)))
    for name in ("rolling_shutter", "motion_blur", "exposure_desync"):
        e = EFFECTS[name]
        assert e(light, still, **e.typical_values) is light
