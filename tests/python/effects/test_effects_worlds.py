# SPDX-License-Identifier: Apache-2.0
"""Effects in whole worlds, and the wider library."""

from dataclasses import replace

import numpy as np
import pytest
from activestereo.effects import Light, builtin
from activestereo.effects.core.descriptor import Stage
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.laws import example_value, example_view
from activestereo.effects.core.resample import Pattern, disc_sampler
from effect_worlds import PATTERN, POSE, PROJECTOR_K, TWIST, seen, smooth_places, view_of
from scipy.ndimage import map_coordinates
from virtual_sensor.held_out.rig import moved

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
    axes = ((1, np.sin(azimuth)), (0, np.cos(azimuth)))
    places = [radius * way * PROJECTOR_K[i, i] + PROJECTOR_K[i, 2] for i, way in axes]
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


@pytest.mark.parametrize("delay_s", [0.01, -0.01])
def test_exposure_desync_is_the_view_of_the_moved_rig(nominal, delay_s):
    light, view = nominal
    truth, _ = seen(left_to_world=moved(POSE, TWIST, delay_s)[0])
    modelled = EFFECTS["exposure_desync"](light, view, delay_s=delay_s)
    smooth = smooth_places(view.depth_m)
    assert unexplained(light, truth, modelled, "direct", smooth) < 0.25
    assert unexplained(light, truth, modelled, "flat", smooth) < 0.2
    assert unexplained(light, truth, modelled, "flat") < 0.4
    wrong = EFFECTS["exposure_desync"](light, view, delay_s=-delay_s)
    assert unexplained(light, truth, wrong, "flat") > 1.2


def test_a_left_camera_is_never_touched_by_errors_of_the_right_nor_a_still_rig_by_motion(nominal):
    light, geometry = seen(side="left", bounces=0)
    view = view_of(geometry, "left")
    for name in ("baseline_drift", "stereo_pitch", "stereo_roll", "principal_point_offset", "exposure_desync"):
        e = EFFECTS[name]
        assert e(light, view, **e.typical_values) is light
    light, view = nominal
    still = replace(view, frame=replace(view.frame, camera_velocity=np.zeros(6)))
    for name in ("rolling_shutter", "motion_blur", "exposure_desync"):
        e = EFFECTS[name]
        assert e(light, still, **e.typical_values) is light


def positions(effect, view, **parameters):
    """(x, y) in focal lengths that an effect of the camera's geometry shows at every pixel: of images that hold their
    own pixels' positions."""
    u, v = view.pixels()
    seen = EFFECTS[effect](Light(u, v, u, v), view, **parameters)
    inside = np.s_[8:-8, 8:-8]
    x = (seen.direct - view.K[0, 2]) / view.K[0, 0]
    y = (seen.indirect - view.K[1, 2]) / view.K[1, 1]
    return x[inside], y[inside], view.rays()[0][inside], view.rays()[1][inside]


def test_decentred_lenses_draw_by_browns_formula():
    x, y, drawn_x, drawn_y = positions("tangential_distortion", example_view(), p1=0.004, p2=-0.003)
    r2 = x * x + y * y
    assert x + 2 * 0.004 * x * y - 0.003 * (r2 + 2 * x * x) == pytest.approx(drawn_x, abs=2e-4)
    assert y + 0.004 * (r2 + 2 * y * y) - 2 * 0.003 * x * y == pytest.approx(drawn_y, abs=2e-4)


def test_a_wedge_moves_by_the_squared_radius():
    x, y, drawn_x, drawn_y = positions("thin_prism", example_view(), s1=0.01, s3=-0.006)
    assert x + 0.01 * (x * x + y * y) == pytest.approx(drawn_x, abs=2e-4)
    assert y - 0.006 * (x * x + y * y) == pytest.approx(drawn_y, abs=2e-4)


def test_an_askew_imager_keeps_lines_straight_and_the_middle_in_its_place():
    view = example_view()
    x, y, drawn_x, drawn_y = positions("imager_tilt", view, tau_x_rad=0.05, tau_y_rad=-0.08)
    for a, b in ((x[3], y[3]), (x[:, 5], y[:, 5]), (np.diagonal(x), np.diagonal(y))):
        area = (a[-1] - a[0]) * (b - b[0]) - (b[-1] - b[0]) * (a - a[0])
        assert np.abs(area).max() < 3e-4
    moved = np.hypot(x - drawn_x, y - drawn_y)
    assert moved[moved.shape[0] // 2, moved.shape[1] // 2] < 1e-3 < moved.max()
    # A point on the side that comes nearer to the lens is seen under a larger angle: x / (1 - x sin(tau_y)).
    x, _, drawn_x, _ = positions("imager_tilt", view, tau_x_rad=0.0, tau_y_rad=0.08)
    assert x == pytest.approx(drawn_x * np.cos(0.08) / (1.0 - drawn_x * np.sin(0.08)), abs=3e-4)


def test_one_camera_alone_is_out_of_focus():
    for side, sigma in (("left", -0.8), ("right", 0.8)):
        view = example_view(side)
        light = example_value(Stage.CAMERA, view)
        focus = EFFECTS["focus_mismatch"]
        assert focus(light, view, sigma_px=-sigma) is light
        blurred = focus(light, view, sigma_px=sigma).direct
        assert blurred == pytest.approx(EFFECTS["lens_psf"](light, view, sigma_px=abs(sigma)).direct)
        assert blurred.std() < 0.9 * light.direct.std()


def test_ghosts_lie_where_their_light_goes():
    view = replace(example_view(), K=np.array([[60.0, 0, 45.0], [0, 60.0, 36.0], [0, 0, 1]]))
    image = np.zeros((2, *view.shape))
    image[:, 20, 30] = 10.0
    ghost = EFFECTS["lens_ghost"](image, view, fraction=0.1) - image
    assert np.argwhere(ghost[0] > 0.5).tolist() == [[72 - 20, 90 - 30]] and ghost[1, 52, 60] == pytest.approx(1.0)
    double = EFFECTS["double_image"](image, view, fraction=0.2, shift_u_px=4.5, shift_v_px=-3.0) - image
    assert double[0, 17, 34:36].tolist() == pytest.approx([1.0, 1.0]) and double.sum() == pytest.approx(4.0)


def test_dots_are_dim_around_their_place_and_dimmer_where_it_is_warm():
    warm = example_view()
    cold = replace(warm, frame=replace(warm.frame, temperature_c=25.0))
    light, dots = example_value(Stage.PROJECTOR, cold), EFFECTS["dim_dots"]
    points = cold.projector_points()
    x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
    place = {"place_x": float(x[30, 40]), "place_y": float(y[30, 40]), "radius": 0.1}
    for view, lost in ((cold, 0.3), (warm, 0.3 + 20 * 0.02)):
        seen = dots(light, view, depth=0.3, per_k=0.02, **place)
        assert seen.direct[30, 40] == pytest.approx((1.0 - lost) * light.direct[30, 40])
        apart = np.hypot(x - place["place_x"], y - place["place_y"]) > 0.5
        assert seen.direct[apart] == pytest.approx(light.direct[apart], rel=1e-4)
        assert (seen.ambient == light.ambient).all()
