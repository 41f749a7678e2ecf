# SPDX-License-Identifier: Apache-2.0
"""The pattern from walls that kuafu renders, whose dots and projector are known; at 424x240 a pixel wide."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from activestereo import StereoDepthSensorConfig
from activestereo.model.write import replace_sections
from activestereo.calibrate.pattern import _align_right_spots, _meeting_point, _variance_of_mean, calibrate_pattern
from activestereo.calibrate.wall import ProjectorView, Spots, find_spots, find_wall
from activestereo.capture.capture import read_capture
from activestereo.capture.images import write_gray
from activestereo.model import SensorModel, read_model
from wall_worlds import NOMINAL_POSITION_M, POSITION_M, WallWorld, seen_dots
from command_line import refused

_WALLS = ((1.0, 0.0), (1.7, 0.1))


@pytest.fixture(scope="module")
def world():
    return WallWorld.make(_WALLS, 0.5)


@pytest.fixture(scope="module")
def capture_path(world, device, tmp_path_factory):
    path = tmp_path_factory.mktemp("walls") / "walls"
    world.write(path, device, repeats=12, spp=16)
    return path


@pytest.fixture(scope="module")
def pattern(capture_path):
    return calibrate_pattern(capture_path)


def test_dots_are_found_where_they_are(world, pattern):
    """Asked: recall 99 %, false 0.3 %, median 0.02 px, 95th percentile 0.1 px."""
    for wall, view in zip(_WALLS, pattern.views, strict=True):
        assert view.wall.distance_m == pytest.approx(wall[0] * np.cos(wall[1]), rel=2e-3)
        for side, spots in view.spots.items():
            places = np.column_stack([spots.u, spots.v])
            numbers, true = seen_dots(world, wall, side)
            distance, nearest = cKDTree(true).query(places)
            hit = distance < 1.0
            assert len(np.unique(nearest[hit])) >= 0.99 * len(numbers)
            every = seen_dots(world, wall, side, -2.0)[1]
            assert np.mean(cKDTree(every).query(places)[0] > 1.0) <= 0.003
            assert np.median(distance[hit]) < 0.02 and np.quantile(distance[hit], 0.95) < 0.1


def test_the_pattern_holds_directions_and_powers(world, pattern):
    """Places in the pattern to 0.02 of a camera's pixel in the median; powers to 3 %."""
    true = world.true_dots()
    distance, nearest = cKDTree(true[:, :2]).query(pattern.dots[:, :2])
    pixel = world.projector_K[0, 0] / world.config.ir_intrinsic[0, 0]
    assert np.mean(distance < pixel) > 0.997
    assert np.median(distance) < 0.02 * pixel
    near = distance < pixel
    ratio = pattern.dots[near, 2] / true[nearest[near], 2]
    assert np.median(np.abs(ratio / np.median(ratio) - 1.0)) < 0.03
    seen_px2 = 2 * np.pi * world.config.pattern_design.dot_sigma_px**2  # of a dot whose peak is 1
    assert np.median(ratio) == pytest.approx(seen_px2, rel=0.03)
    left, right = (np.median(ratio[part]) for part in np.array_split(np.argsort(pattern.dots[near, 0]), 2))
    assert left / right == pytest.approx(1.0, abs=0.01)  # no falloff is left over the field
    assert pattern.dot_sigma_px == pytest.approx(world.config.pattern_design.dot_sigma_px, rel=0.02)


def test_dots_of_the_right_camera_alone_and_those_that_a_border_cuts_are_in_the_pattern(world, pattern):
    def seen(sides, border_px, walls=_WALLS):
        return np.concatenate([seen_dots(world, wall, side, border_px)[0] for wall in walls for side in sides])

    both = ("left", "right")
    beyond = np.setdiff1d(seen(["right"], 5.0, _WALLS[:1]), seen(["left"], 1.0))
    cut = np.setdiff1d(seen(both, 0.0), seen(both, 6.0))
    pixel = world.projector_K[0, 0] / world.config.ir_intrinsic[0, 0]
    for numbers, least, found, error in ((beyond, 50, 0.97, 0.05), (cut, 100, 0.95, 0.15)):
        assert len(numbers) > least
        off = cKDTree(pattern.dots[:, :2]).query(world.true_dots()[numbers, :2])[0]
        assert np.mean(off < pixel) >= found and np.median(off) < error * pixel


def test_the_light_between_dots_is_measured(pattern):
    """The projected image has 5 of 255 there; in the room's light and above the black level, which are not told."""
    image = pattern.rig.projector.pattern()
    true = image.min() / image.max()
    value, error = pattern.background
    peak = np.max(pattern.dots[:, 2]) / (2 * np.pi * pattern.dot_sigma_px**2)
    assert true == pytest.approx(5 / 255, rel=0.01)
    assert value / image.max() == pytest.approx(true, rel=0.1) and error < 0.1 * value
    assert f"{100 * value / peak:.2f} % of the brightest" in pattern.summary()


def test_two_distances_tell_the_projectors_place(pattern):
    assert pattern.position_m == pytest.approx(POSITION_M, abs=1e-4)
    error_m = np.abs(pattern.position_m - POSITION_M)
    assert np.all(error_m < 5.0 * pattern.position_error_m + 2e-5)
    assert np.linalg.norm(POSITION_M - NOMINAL_POSITION_M) > 1e-3  # the nominal one is more than a millimetre off


def test_the_sensor_takes_what_was_measured(pattern, tmp_path):
    """Through the file into the sensor's configuration: the dots, and the projector's place beside the left camera."""
    out = tmp_path / "model.json"
    replace_sections(out, pattern.model())
    config = StereoDepthSensorConfig.from_model(read_model(out))
    assert np.allclose(config.light_dots, pattern.dots, rtol=1e-5)
    assert config.light_dot_background == pytest.approx(pattern.background[0])
    left, projector = (pose.to_transformation_matrix() for pose in (config.trans_pose_l, config.pose_rgb_irproj))
    x, y, z = (np.linalg.inv(left) @ projector)[:3, 3]  # body axes: x forward, y left, z up
    assert (-y, -z, x) == pytest.approx(tuple(pattern.position_m), abs=1e-6)
    model = json.loads(out.read_text())
    model["rig"] |= {"gain": 2.0, "left_to_projector": np.eye(4).ravel().tolist()}
    out.write_text(json.dumps(model))
    replace_sections(out, pattern.model(), keep_rig=True)  # the projector's place alone is replaced
    again = read_model(out).rig
    assert again.gain == 2.0 and np.allclose(again.left_to_projector[:3, 3], -pattern.position_m)


def test_one_distance_leaves_it_nominal_and_says_so(capture_path, pattern, tmp_path, monkeypatch):
    def first_pose(root):
        root["frames"] = [frame for frame in root["frames"] if frame["repeat_group"] == 0]

    monkeypatch.setattr("activestereo.calibrate.pattern._wall_view", lambda *_: pattern.views[0])
    pattern = calibrate_pattern(_copied(capture_path, tmp_path / "one", first_pose))
    assert pattern.position_m == pytest.approx(NOMINAL_POSITION_M) and pattern.position_error_m is None
    assert pattern.background is None and "NOT MEASURED" in pattern.summary()
    assert "NOMINAL" in pattern.summary() and "is nominal" in pattern.model().pattern.source


def test_a_turned_right_camera_is_set_straight(pattern):
    """A calibration's right camera is turned by a part of a degree, and its spots lie in rows of their own."""
    rig, rng = pattern.rig, np.random.default_rng(0)
    points = rng.uniform([-0.4, -0.25, 0.8], [0.4, 0.25, 1.5], (50, 3))
    left_to_right = rig.left_to_right.copy()
    left_to_right[:3, :3] = Rotation.from_rotvec([0.002, -0.001, 0.003]).as_matrix()
    left_to_right[:3, 3] = left_to_right[:3, :3] @ rig.left_to_right[:3, 3]  # the camera stays where it is
    seen = (points @ left_to_right[:3, :3].T + left_to_right[:3, 3]) @ rig.right.K.T
    spots = Spots(seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2], np.ones(50), 1.0, np.zeros((240, 424)))
    straight = _align_right_spots(spots, replace(rig, left_to_right=left_to_right))
    true = (points + rig.left_to_right[:3, 3]) @ rig.right.K.T
    assert np.abs(straight.v - true[:, 1] / true[:, 2]).max() < 1e-9
    assert np.abs(straight.u - true[:, 0] / true[:, 2]).max() < 1e-9
    assert np.abs(spots.v - straight.v).max() > 0.3


def test_the_models_rig_is_believed(capture_path, pattern, tmp_path, monkeypatch):
    """Dots are directions from the cameras of the rig that `calibrate rig` wrote into the same file."""
    own = pattern.model().rig
    out = tmp_path / "model.json"
    left, right = (replace(side, K=side.K * [[1.01], [1.01], [1.0]]) for side in (own.left, own.right))
    replace_sections(out, SensorModel(rig=replace(own, left=left, right=right)))

    def stop(capture, *_):
        raise ValueError(f"f {capture.rig.left.K[0, 0] / own.left.K[0, 0]:.4f} {capture.rig.right.K[0, 0]:.4f}")

    monkeypatch.setattr("activestereo.calibrate.pattern._wall_view", stop)
    with pytest.raises(ValueError, match=f"f 1.0100 {1.01 * own.right.K[0, 0]:.4f}"):
        calibrate_pattern(capture_path, model=read_model(out))
    # What is wrong with the model's rig is not said of the capture.
    for side in ("left", "right"):
        bent = replace(getattr(own, side), distortion=(0.01, 0.0, 0.0, 0.0, 0.0))
        with pytest.raises(ValueError, match=f"^the model: rig.{side}.distortion: .* largest 0.01; .* --rectified"):
            calibrate_pattern(capture_path, model=SensorModel(rig=replace(own, **{side: bent})))
    for turn, told in ((0.01, "turns the right camera by 0.57 degrees"), (0.0, "0.50 mm beside")):
        place = own.left_to_right.copy()
        place[:3, :3] = Rotation.from_rotvec([0.0, turn, 0.0]).as_matrix()
        place[1, 3] = 0.0005
        with pytest.raises(ValueError, match=f"^the model: rig.left_to_right: .*{told}"):
            calibrate_pattern(capture_path, model=SensorModel(rig=replace(own, left_to_right=place)))


def spots_among(u, v, sigma):
    """(spots found in an image of dots of 60 DN, the distance of each from its own dot)."""
    rng, (height, width) = np.random.default_rng(0), (120, 160)
    y, x = np.mgrid[:height, :width]
    image = 8.0 + sum(60.0 * np.exp(-0.5 * ((x - a) ** 2 + (y - b) ** 2) / sigma**2) for a, b in zip(u, v, strict=True))
    spots = find_spots(image + rng.normal(0, 0.2, image.shape), np.full(image.shape, 0.04))
    distance, nearest = cKDTree(np.column_stack([u, v])).query(np.column_stack([spots.u, spots.v]))
    assert len(spots) == len(u) == len(np.unique(nearest))
    return spots, distance


def test_merged_spots_are_told_apart():
    """Two dots at 2.6 sigma, which show one peak, and one alone, in a grid of others."""
    rng, sigma = np.random.default_rng(1), 1.3
    grid = np.meshgrid(np.arange(12, 150, 12.0), np.arange(12, 110, 12.0))
    u, v = (part.ravel() + rng.uniform(-0.5, 0.5, part.size) for part in grid)
    spots, distance = spots_among(np.append(u, u[40] + 2.6 * sigma), np.append(v, v[40]), sigma)
    assert distance.max() < 0.1
    assert spots.sigma_px == pytest.approx(sigma, rel=0.01)
    assert np.median(spots.flux) == pytest.approx(2 * np.pi * sigma**2 * 60.0, rel=0.01)


def test_spots_whose_middles_lie_outside_are_found():
    sigma, grid = 1.5, np.meshgrid(np.linspace(-1.0, 160, 14), np.linspace(-1.0, 120, 11))
    spots, distance = spots_among(*(part.ravel() for part in grid), sigma)
    assert distance.max() < 0.3
    whole = spots.is_whole
    assert whole.sum() == 12 * 9 and distance[whole].max() < 0.03
    assert np.abs(spots.flux / (2 * np.pi * sigma**2 * 60.0) - 1.0).max() < 0.3


def test_intervals_of_dim_walls_hold_the_truth():
    """Dots of 2 to 12 DN under the noise of 12 repeats, of which the far wall's weakest are lost. 12 intervals of 90 %
    hold 11 truths on average, below 8 by chance in less than one run of 200."""
    left_K = np.array([[213.5, 0, 79.5], [0, 213.5, 59.5], [0, 0, 1.0]])
    dots_K = np.array([[400.0, 0, 250], [0, 400.0, 200], [0, 0, 1]])
    place, baseline_m, scores = np.array([0.0293, 0.0004, -0.0012]), 0.05, []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        grid = np.meshgrid(np.arange(80, 420, 12.0), np.arange(80, 320, 12.0))
        u, v = (part.ravel() + rng.uniform(-5, 5, part.size) for part in grid)
        power, walls = rng.uniform(0.4, 1.6, u.size), []
        for distance_m, peak_dn in ((1.0, 8.0), (1.8, 3.0)):
            x, y = (u - dots_K[0, 2]) / dots_K[0, 0], (v - dots_K[1, 2]) / dots_K[1, 1]
            ray = np.column_stack([x, y, np.ones(u.size)])
            points = place + (distance_m - place[2]) * ray
            seen = [_spots_of(points - [shift, 0, 0], peak_dn * power, left_K, rng) for shift in (0.0, baseline_m)]
            walls.append(find_wall(*seen, left_K, left_K, baseline_m, "wall"))
        nominal = ProjectorView(NOMINAL_POSITION_M, np.eye(3), dots_K, (500, 400))
        found, error, pairs = _meeting_point(*walls, nominal)
        assert len(pairs) > 200
        scores.append((found.position_m - place) / error)
    scores = np.array(scores)
    assert np.sum(np.abs(scores) < 1.6449) >= 8
    assert 0.5 < np.sqrt(np.mean(scores**2)) < 1.5  # nor are they wide for nothing


def _spots_of(points, peak_dn, K, rng, size=(120, 160), sigma=0.9, repeats=12):
    """Spots that find_spots sees of dots at points [n][3] in a camera's frame."""
    y, x = np.mgrid[: size[0], : size[1]]
    light = np.zeros(size)
    for (px, py, pz), peak in zip(points, peak_dn, strict=True):
        u, v = K[0, 0] * px / pz + K[0, 2], K[1, 1] * py / pz + K[1, 2]
        if -4 < u < size[1] + 3 and -4 < v < size[0] + 3:
            part = np.s_[max(int(v) - 4, 0) : int(v) + 6, max(int(u) - 4, 0) : int(u) + 6]
            light[part] += peak * np.exp(-0.5 * ((x[part] - u) ** 2 + (y[part] - v) ** 2) / sigma**2)
    counts = np.rint(light + 5.0 + rng.normal(size=(repeats, *size)) * np.sqrt(0.25 + 0.02 * light))
    return find_spots(counts.mean(axis=0), _variance_of_mean(counts))


def _copied(path, to, change):
    """A copy of a capture whose capture.json is changed."""
    shutil.copytree(path, to)
    root = json.loads((path / "capture.json").read_text())
    change(root)
    (to / "capture.json").write_text(json.dumps(root))
    return to


def test_bad_walls_are_refused_in_one_line(capture_path, tmp_path, capsys):
    out = tmp_path / "model.json"

    def refusal(name, change):
        return refused(["calibrate", "pattern", _copied(capture_path, tmp_path / name, change), "-o", out], capsys)

    def few(root):
        root["frames"] = root["frames"][:9]

    def alone(root):
        for frame in root["frames"]:
            frame["repeat_group"] = None

    def swapped(root):
        root["frames"] = [frame | {"left": frame["right"], "right": frame["left"]} for frame in root["frames"]]

    def wrong_sign(root):
        root["rig"]["left_to_right"][3] *= -1.0

    assert "9 repeats, at least 10" in refusal("few", few)
    assert "no frames share a repeat_group" in refusal("alone", alone)
    assert "swapped" in refusal("swapped", swapped)
    assert "rig.left_to_right: x is" in refusal("sign", wrong_sign)
    bright = _copied(capture_path, tmp_path / "bright", lambda root: None)
    capture = read_capture(capture_path)
    for side in ("left", "right"):
        for frame in capture.frames[:12]:  # of the wall that is looked at first
            image = np.minimum(5.0 * capture.ir(frame, side), 255).astype(np.uint8)
            write_gray(bright / side / frame.path(side).name, image)
    assert "the wall saturates" in refused(["calibrate", "pattern", bright, "-o", out], capsys)
    assert not out.exists()
