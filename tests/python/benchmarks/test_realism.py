# SPDX-License-Identifier: Apache-2.0
"""Measures, noise models and rankings of simulated depth find what was put in."""

import json
import xml.etree.ElementTree as xml
from argparse import ArgumentTypeError
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from activestereo.benchmarks.noise_profiles import PROFILES, Distance, Views, distance, fitted
from activestereo.benchmarks.real_views import PATCH_PX, RealView, depth_measures, fitted_light
from activestereo.benchmarks.real_views import planar_patches, statistics
from activestereo.benchmarks.realism import DEVICE, HOLES, NOISE, Board, Figure, verdicts
from activestereo.benchmarks.sim_to_real import agreement, agreement_table, agreements, mean_gap, pearson
from activestereo.benchmarks.sim_to_real import read_scores, spearman
from activestereo.cli import main, model as command
from activestereo.cli.arguments import names_of
from command_line import refused

_FB_PX_M, _SIZE = 50.0, (192, 288)


def _view(truth_px, device_px):
    rig = SimpleNamespace(left=SimpleNamespace(K=np.diag([1000.0, 1000.0, 1.0])), baseline_m=_FB_PX_M / 1000.0)
    depths = [np.nan_to_num(_FB_PX_M / disparity).astype(np.float32) for disparity in (device_px, truth_px)]
    return RealView("v", SimpleNamespace(rig=rig), None, None, None, *depths, None)


def _measures(found_px, truth_px, device_px, again_px=None):
    view = _view(truth_px, device_px)
    patches = planar_patches(view.disparity(view.truth_m), _FB_PX_M)
    again_m = None if again_px is None else np.nan_to_num(_FB_PX_M / again_px).astype(np.float32)
    return depth_measures(view, np.nan_to_num(_FB_PX_M / found_px).astype(np.float32), again_m, patches)


def test_noise_bias_and_its_correlation_are_those_that_were_put_in():
    truth = np.full(_SIZE, 50.0, np.float32)
    random = np.random.default_rng(1)
    white = [0.1 * random.standard_normal(_SIZE) for _ in range(2)]
    found = _measures(truth + 0.3 + white[0], truth, truth, truth + 0.3 + white[1])
    assert found["bias, px: 0.8-1.2 m"] == pytest.approx(0.3, abs=0.01)
    assert found["spatial noise, px: 0.8-1.2 m"] == pytest.approx(0.1, rel=0.05)
    assert found["temporal noise, px: 0.8-1.2 m"] == pytest.approx(0.1, rel=0.05)
    assert np.isnan(found["spatial noise, px: 1.7-2.3 m"])
    smooth = gaussian_filter(white[0], 2.0)  # whose autocorrelation is exp(-lag^2 / 16): 1/e at 4
    wide = _measures(truth + smooth, truth, truth)
    assert wide["noise's correlation, px"] == pytest.approx(4.0, rel=0.15)
    assert found["noise's correlation, px"] < 1.0


def test_holes_edges_and_flying_pixels_are_counted():
    truth = np.full(_SIZE, 40.0, np.float32)
    truth[:, 150:220] = 60.0
    found, device = truth.copy(), truth.copy()
    found[:, :10] = np.nan
    device[:, :20] = np.nan
    found[:, 147:150] = 60.0  # three pixels fatter on the left
    found[:, 220] = 50.0  # one flying on the right
    own = _measures(found, truth, device)
    assert own["hole IoU"] == pytest.approx(0.5)
    assert own["invented, %"] == pytest.approx(400.0 / (_SIZE[1] - 10))
    assert own["dead band, px"] == 10
    assert own["edge width, px"] == pytest.approx(1.5, abs=0.6)
    assert own["flying pixels, %"] == pytest.approx(100.0 / 22, rel=0.1)
    assert _measures(device, truth, device)["hole IoU"] == 1.0


def test_a_square_lattice_shows_its_pitch_and_equal_eyes_leave_nothing():
    y, x = np.mgrid[:PATCH_PX, : PATCH_PX + 20].astype(np.float32)
    wall = (20.0 + 8.0 * np.cos(2 * np.pi * x / 12.0) * np.cos(2 * np.pi * y / 12.0)).astype(np.float32)
    truth = np.full((PATCH_PX, PATCH_PX), 20.0, np.float32)
    patch = planar_patches(truth, _FB_PX_M)[0]
    left, right = np.pad(wall[:, :PATCH_PX], 0), np.roll(wall, -20, axis=1)[:, :PATCH_PX]
    found = statistics(left, right, patch, black_dn=0.0)
    assert found["side peak"] > 0.9
    assert found["its lag, px"] == pytest.approx(12.0 / np.sqrt(2.0), abs=0.8), "the lattice lies on its corner"
    assert found["dots' RMS, DN"] == pytest.approx(4.0, rel=0.05)
    assert found["dots' share of light, %"] == pytest.approx(20.0, rel=0.05)
    assert statistics(left * np.linspace(0.2, 2, PATCH_PX, dtype=np.float32), right, patch, 0.0) is None


def test_a_verdict_says_whether_intervals_lie_apart():
    def rows(low, high):
        others = {DEVICE: Figure(1.0, 1.0, 1.0), "clean": Figure(0.1, 0.0, 0.2)}
        return {name: others | {"calibrated": Figure(0.5, low, high)} for name in (HOLES, NOISE)}

    apart, noise = verdicts(Board(("a", "b"), rows(0.4, 0.6), {}))
    assert "calibrated is closest" in apart and apart.endswith("lie apart")
    assert "clean is closest" in noise, "of a factor less is better"
    assert verdicts(Board(("a", "b"), rows(0.15, 0.6), {}))[0].endswith("overlap")
    assert "one view has no interval" in verdicts(Board(("a",), rows(0.4, 0.6), {}))[0]


def test_the_light_s_levels_are_those_of_the_real_image():
    laser = np.random.default_rng(0).uniform(0.0, 1.0, (70, 70)).astype(np.float32)
    room = np.linspace(0.5, 1.0, 70, dtype=np.float32) * np.ones((70, 1), np.float32)
    settings = SimpleNamespace(
        ir_camera_exposure=0.01, ir_camera_gain=1.0, ir_responsivity_dn=100.0, ir_black_level_dn=4.0,
        samples_per_pixel=1,
    )  # fmt: skip
    pictures = {"projector_direct": laser, "projector_indirect": 0.0 * laser, "radiance": laser + room}
    taken = SimpleNamespace(get_config=lambda: settings, get_picture=lambda name, side: pictures[name][..., None])
    left = 4.0 + 30.0 * laser + 20.0 * room
    left[:7, :7] += 100.0  # which no light of the scene explains
    rig = SimpleNamespace(max_dn=255.0)
    depths = np.ones_like(laser), np.ones_like(laser)
    view = RealView("v", SimpleNamespace(rig=rig), None, left, left, *depths, None)
    light, own = fitted_light(view, taken)
    np.testing.assert_allclose(own[0], 30.0 * laser, rtol=0.01)
    np.testing.assert_allclose(light[1], 30.0 * laser + 20.0 * room, rtol=0.01)


_K = np.array([[430.0, 0.0, 79.5], [0.0, 430.0, 31.5], [0.0, 0.0, 1.0]])
_SIGMA_PX, _HOLES = 0.3, 0.1


@pytest.fixture(scope="module")
def views():
    """A sensor with Gaussian noise of disparity, and a tenth of the pixels without depth."""
    random = np.random.default_rng(3)
    truth = np.broadcast_to(np.linspace(1.0, 4.0, 160, dtype=np.float32), (2, 64, 160)).copy()
    px = 430.0 * 0.05 / truth + _SIGMA_PX * random.standard_normal(truth.shape)
    found = np.where(random.random(truth.shape) < _HOLES, 0.0, 430.0 * 0.05 / px).astype(np.float32)
    return Views(truth, found, random.random(truth.shape, np.float32), _K, 0.05, 0.2, 10.0)


@pytest.fixture(scope="module")
def profiles(views):
    return {name: fitted(kind, views) for name, kind in PROFILES.items()}


def test_a_distance_is_what_was_put_in(views):
    assert distance(views, views.found_m) == Distance(0.0, 0.0)
    moved = np.where(views.found_m > 0, 21.5 / (21.5 / np.maximum(views.found_m, 0.1) + 0.1), 0.0)
    assert distance(views, moved).error_px == pytest.approx(0.1, rel=0.01)
    half = np.where(np.arange(64)[:, None] < 32, views.found_m, 0.0)
    assert distance(views, half).holes == pytest.approx(0.5 * (1.0 - _HOLES), abs=0.01)


def test_noise_of_disparity_is_found_again(profiles):
    isaac = profiles["isaac"]
    assert np.hypot(isaac.sigma_px, isaac.step_px / np.sqrt(12.0)) == pytest.approx(_SIGMA_PX, rel=0.1)
    mapping = profiles["elevation_mapping"]
    for depth_m in (1.5, 3.5):  # z^2 sigma / (f B)
        sigma_m = mapping.a + mapping.b * (depth_m - mapping.c) ** 2
        assert sigma_m == pytest.approx(depth_m**2 * _SIGMA_PX / 21.5, rel=0.25)
    assert profiles["gazebo"].stddev_m == pytest.approx(0.07, rel=0.5)  # of sigmas from 0.014 to 0.22 m


def test_a_fit_is_nearer_than_the_default(views, profiles):
    for name, profile in profiles.items():
        default = type(profile)()
        far = [distance(views, one.apply(views, np.random.default_rng(5))) for one in (default, profile)]
        least = 0.75 if name == "gazebo" else 0.5  # one sigma in metres for depths from 1 to 4 m
        assert far[1].error_px <= least * far[0].error_px, profile
        assert sum(far[1]) < sum(far[0])


def test_files_say_what_was_found(views, profiles):
    texts = {name: profile.file_text(views) for name, profile in profiles.items()}
    noise = xml.fromstring(texts["gazebo"]).find(".//camera/noise")
    assert float(noise.find("stddev").text) == pytest.approx(profiles["gazebo"].stddev_m, rel=1e-4)
    assert f"noiseSigma = {profiles['isaac'].sigma_px:.6g}" in texts["isaac"]
    pairs = dict(line.split(": ") for line in texts["elevation_mapping"].splitlines())
    assert float(pairs["sensor_processor/normal_factor_b"]) == pytest.approx(profiles["elevation_mapping"].b)


def test_the_command_knows_all_formats_and_refuses_others():
    assert tuple(PROFILES) == command.EXPORTS
    with pytest.raises(ArgumentTypeError, match="unknown system 'gazeb'.*gazebo"):
        names_of("system", command.EXPORTS)("isaac,gazeb")


VIEWS, RATES = 8, {"clean": 1.0, "full": 0.5, "real": 0.25}


def per_view(method: str = "LearnAug") -> str:
    lines = ["criterion,method,world,view,found"]
    for world, rate in RATES.items():
        lines += [f"10 mm,{method},{world},{view},{int(view < rate * VIEWS)}" for view in range(VIEWS)]
    return "\n".join(lines) + "\n"


def shares(method: str, scale: float) -> str:
    lines = [f"10 mm,{method},{world},{scale * rate}" for world, rate in RATES.items()]
    return "\n".join(["criterion,method,world,score", *lines]) + "\n"


def test_methods_with_views_and_with_scores_count_alike(tmp_path, capsys):
    (tmp_path / "a.csv").write_text(per_view(), encoding="utf-8-sig")  # with a mark, as Excel writes it
    (tmp_path / "b.csv").write_text(shares("DDS", 0.5))
    paths = [tmp_path / name for name in ("a.csv", "b.csv")]
    found = agreements(read_scores(paths), "real")["10 mm"]
    assert found["full"].gap.value == pytest.approx((0.25 + 0.125) / 2)
    assert found["full"].pearson.value == pytest.approx(1.0) and list(found) == ["clean", "full"]
    assert len(agreement_table({"10 mm": found})) == 4
    words = ["benchmark", "sim-to-real", *map(str, paths)]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["10 mm"]["full"]["gap"][0] == pytest.approx(0.1875)
    assert main([*words, "--verbose"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("clean ranks the methods most as real does")
    assert all(word in told for word in ("full may do as well", "█"))
    assert "Spearman" in told and max(map(len, told.split("\n\n")[0].splitlines())) <= 80
    for more, message in ((["--real", "lab"], "of the world 'lab' (known: clean, full, real)"), ([], "two methods")):
        assert message in refused([*words[: 4 if more else 3], *more], capsys)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("world", "place", 1), "the first line is 'criterion,method,place"),
        (lambda t: t.replace(",0,1", ",0,0.5", 1), "line 2: found is 0.5, expected 0 or 1"),
        (lambda t: t.replace(",0,1", ",0,yes", 1), "line 2: found is yes, expected 0 or 1"),
        (lambda t: t.replace(",1,1", ",0,1", 1), "line 3: LearnAug has this line twice"),
        (lambda t: t.replace("10 mm,LearnAug,clean,0,1\n", "", 1), "no line of view 0 in clean, criterion 10 mm"),
        (lambda t: t.replace("mm,LearnAug", "mm,", 1), "line 2: has 4 values, expected 5"),
        (lambda t: t.replace(",0,1", ",0", 1), "line 2: has 4 values, expected 5"),
        (lambda t: t[: t.index("\n")], "and then scores"),
        (lambda _: "", "the first line is ''"),
        (lambda _: shares("DDS", 1.5), "line 2: score is 1.5, expected 0 to 1"),
        (lambda t: t + "x" * 140_000, "is not a table of text: field larger than field limit"),
    ],
)
def test_errors_in_a_table_are_told(tmp_path, change, message):
    (tmp_path / "a.csv").write_text(change(per_view()))
    with pytest.raises(ValueError) as error:
        read_scores([tmp_path / "a.csv"])
    assert message in str(error.value) and "\n" not in str(error.value)


def test_correlations_have_their_closed_forms():
    a = np.array([0.1, 0.2, 0.4, 0.9])
    assert pearson(a, 3.0 * a + 1.0) == pytest.approx(1.0) and pearson(a, -a) == pytest.approx(-1.0)
    assert np.isnan(pearson(a, np.full(4, 0.5)))
    assert pearson(np.array([1.0, 2.0, 3.0]), np.array([1.0, 3.0, 2.0])) == pytest.approx(0.5)
    assert spearman(a, a**5) == pytest.approx(1.0) and pearson(a, a**5) < 0.95
    # 1 - 6 sum d^2 / (n (n^2 - 1)) without ties, and middle ranks with them.
    assert spearman(a, np.array([0.2, 0.1, 0.9, 0.4])) == pytest.approx(1.0 - 6.0 * 4.0 / 60.0)
    assert spearman(np.array([1.0, 1.0, 2.0]), np.array([1.0, 2.0, 3.0])) == pytest.approx(np.sqrt(0.75))
    assert mean_gap(a, a + 0.25) == pytest.approx(0.25)


def test_intervals_are_as_wide_as_the_binomial_law_says():
    views, random = 400, np.random.default_rng(0)
    real = np.ones((1, views), bool)
    own = np.arange(views)[None] % 2 == 0
    gap = agreement(own, real).gap
    assert gap.value == 0.5
    assert gap.high - gap.low == pytest.approx(2.0 * 1.96 * np.sqrt(0.25 / views), rel=0.1)
    same = random.random((9, views)) < np.linspace(0.1, 0.9, 9)[:, None]
    found = agreement(same, same)
    assert (found.gap.value, found.gap.high) == (0.0, 0.0)
    assert found.pearson.value == pytest.approx(1.0) and found.spearman.low == pytest.approx(1.0)
    assert np.isnan(agreement(own, real).pearson.value)
    with pytest.raises(ValueError, match="of both worlds"):
        agreement(own, real[:, :3])
    fixed = agreement(same[:1], same[:1], known=([0.5], [0.1])).gap  # known scores are not drawn again
    assert (fixed.value, fixed.low, fixed.high) == pytest.approx((0.2, 0.2, 0.2))
