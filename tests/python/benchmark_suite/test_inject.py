# SPDX-License-Identifier: Apache-2.0
"""Effects hidden in measured images follow their formulas; noise stays the sensor's; the answer says what was done."""

import itertools
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import hide_in_images
from inject import effects
from inject.effects import Light, View, resampled
from inject.inject import plan, write_injected
from inject.kinds import KINDS, STRENGTHS
from inject.noise import measured_noise_model
from activestereo.capture.capture import Camera, Capture, Frame, Projector, Rig, read_capture
from activestereo.capture.write import write_capture
from activestereo.common.pose import rigid_motion
from activestereo.effects import builtin

WIDTH, HEIGHT, FOCAL, BASELINE, DISTANCE = 96, 72, 80.0, 0.05, 1.0
K = np.array([[FOCAL, 0.0, 47.5], [0.0, FOCAL, 35.5], [0.0, 0.0, 1.0]])
BLACK, FLOOR, SLOPE = 4.0, 1.5, 0.06


def translation(x):
    return rigid_motion((x, 0, 0))


def write_wall(folder, level, repeats=6, groups=True, seed=3):
    """A wall that both cameras see as `level` DN above black ([height][width]), with noise of a known model."""
    (folder / "source").mkdir(parents=True)
    (folder / "source/scene.gltf").write_text("{}")
    camera, rng = Camera(WIDTH, HEIGHT, K), np.random.default_rng(seed)
    projector = Projector(folder / "source/pattern.png", K, translation(-BASELINE / 2))
    frames = tuple(
        Frame(i, Path(), Path(), 0.033 * i, 0.008, np.eye(4), ("train", "test")[i % 2],
              repeat_group=0 if groups else None, depth_path=Path(), depth_scale=0.001)
        for i in range(repeats)
    )  # fmt: skip
    rig = Rig(camera, camera, translation(-BASELINE), projector)
    capture = Capture(folder / "source", "wall", folder / "source/scene.gltf", rig, frames)
    images, noise = {}, np.sqrt(FLOOR + SLOPE * level)
    for key in itertools.product(range(repeats), ("left", "right")):
        dn = BLACK + level + noise * rng.standard_normal(level.shape)
        images[key] = np.clip(np.rint(dn), 0, 255).astype(np.uint8)
    depth = {f.id: np.full(level.shape, round(1000 * DISTANCE), np.uint16) for f in frames}
    write_capture(folder / "wall", capture, images, np.full((HEIGHT, WIDTH), 255, np.uint8), depth)
    return folder / "wall"


@pytest.fixture(scope="module")
def ramp(tmp_path_factory):
    return write_wall(tmp_path_factory.mktemp("ramp"), np.broadcast_to(np.linspace(20, 160, WIDTH), (HEIGHT, WIDTH)))


def view(shape=(HEIGHT, WIDTH), **changes):
    values = dict(
        K=K, is_right=False, time_s=0.4, row_time_s=2e-5, max_dn=250.0, depth=None,
        camera_to_projector=translation(-0.02), projector_K=K, projector_size=(WIDTH, HEIGHT),
        temporal=np.random.default_rng(1), static=np.random.default_rng(2),
    )  # fmt: skip
    return View(**(values | changes))


def even(level=100.0, shape=(HEIGHT, WIDTH)):
    return Light(np.full(shape, level), np.full(shape, 4.0))


def spot(u, v, sigma=1.2, shape=(HEIGHT, WIDTH)):
    rows, columns = np.indices(shape)
    value = 100.0 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * sigma**2))
    return Light(value, np.zeros(shape))


def centre(image):
    rows, columns = np.indices(image.shape)
    return np.array([(columns * image).sum(), (rows * image).sum()]) / image.sum()


@pytest.mark.parametrize("radius", [0.8, 1.4, 2.2, 5.0])
def test_blur_keeps_light_and_widens_a_point_by_the_disc(radius):
    point = Light(np.zeros((41, 41)), np.zeros((41, 41)))
    point.value[20, 20] = 1000.0
    out = effects.blur(point, view(), radius).value
    offset = np.arange(41) - 20.0
    assert out.sum() == pytest.approx(1000.0)
    # Second moments of a disc, R^2 / 4, and of a pixel, 1 / 12 (Sheppard's correction, near for a sharp rim).
    assert (out.sum(axis=0) * offset**2).sum() / 1000.0 == pytest.approx(radius**2 / 4 + 1 / 12, abs=0.04)


def test_blur_averages_noise_away_as_its_variance_says():
    noise = np.random.default_rng(5).normal(100.0, 3.0, (400, 400))
    out = effects.blur(Light(noise, np.full(noise.shape, 9.0)), view(), 1.4)
    assert out.value[9:-9, 9:-9].var() == pytest.approx(out.variance[200, 200], rel=0.03)
    assert out.variance[200, 200] < 2.0


def test_glare_keeps_the_mean_and_shrinks_contrast():
    before = spot(30, 30)
    after = effects.veiling_glare(before, view(), 0.2).value
    assert after.mean() == pytest.approx(before.value.mean())
    assert np.ptp(after) == pytest.approx(0.8 * np.ptp(before.value))


def test_a_ghost_stands_opposite_of_the_axis():
    before = spot(20.0, 25.0)
    added = effects.ghost(before, view(), 0.1).value - before.value
    assert centre(added) == pytest.approx([2 * 47.5 - 20.0, 2 * 35.5 - 25.0], abs=0.01)
    assert added.sum() == pytest.approx(0.1 * before.value.sum(), rel=1e-3)


def test_vignetting_is_a_power_of_the_cosine():
    out = effects.vignetting(even(), view(), 4.0)
    x, y = (80 - 47.5) / FOCAL, (10 - 35.5) / FOCAL
    factor = 1.0 / (1.0 + x * x + y * y) ** 2
    assert out.value[10, 80] == pytest.approx(100.0 * factor)
    assert out.variance[10, 80] == pytest.approx(4.0 * factor**2)


@pytest.mark.parametrize(
    "bend, numbers, k1, p1, p2",
    [
        (effects.radial_distortion, (0.05,), 0.05, 0.0, 0.0),
        (effects.tangential_distortion, (0.02, 0.6), 0.0, 0.02 * np.sin(0.6), 0.02 * np.cos(0.6)),
    ],
)
def test_distortion_moves_a_spot_to_where_brown_draws_it(bend, numbers, k1, p1, p2):
    at = np.array([76.0, 16.0])
    x, y = (at - K[:2, 2]) / FOCAL
    r2 = x * x + y * y
    dx = k1 * x * r2 + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    dy = k1 * y * r2 + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    assert centre(bend(spot(*at), view(), *numbers).value) == pytest.approx(at + FOCAL * np.array([dx, dy]), abs=0.05)
    assert np.hypot(dx, dy) * FOCAL > 0.3


def test_reading_between_pixels_shifts_a_spot_without_blur():
    rows, columns = np.indices((HEIGHT, WIDTH))
    out = resampled(spot(40.0, 30.0), columns + 0.37, rows - 0.21)
    np.testing.assert_allclose(out.value, spot(40.0 - 0.37, 30.21).value, atol=1.0)


def test_gain_multiplies_noise_and_black_level_adds_nothing_to_it():
    assert effects.gain(even(), view(), 0.2).value[0, 0] == pytest.approx(120.0)
    assert effects.gain(even(), view(), 0.2).variance[0, 0] == pytest.approx(4.0 * 1.44)
    assert effects.black_level(even(), view(), 1.5).value[0, 0] == pytest.approx(101.5)


def test_rows_share_their_noise():
    out = effects.row_noise(even(shape=(4000, 6)), view(), 2.0).value - 100.0
    assert np.ptp(out, axis=1).max() == 0.0
    assert out[:, 0].std() == pytest.approx(2.0, rel=0.05)


def test_the_response_keeps_black_and_full_scale_and_its_slope_is_that_of_the_noise():
    level = np.array([[-3.0, 0.0, 40.0, 40.001, 250.0]])
    out = effects.response(Light(level, np.ones_like(level)), view(), 1.0)
    assert out.value[0, [0, 1, 4]] == pytest.approx([-3.0, 0.0, 250.0])
    assert out.value[0, 2] == pytest.approx(250.0 * 0.16 * 2.0 / 1.16)
    assert np.sqrt(out.variance[0, 2]) == pytest.approx((out.value[0, 3] - out.value[0, 2]) / 0.001, rel=1e-3)


def test_bands_repeat_with_the_mains_and_roll_with_time():
    first = effects.bands(even(), view(), 0.2, 100.0, 0.3).value
    period = effects.bands(even(), view(time_s=0.41), 0.2, 100.0, 0.3).value
    half = effects.bands(even(), view(time_s=0.405), 0.2, 100.0, 0.3).value
    np.testing.assert_allclose(period, first)
    np.testing.assert_allclose(half + first, 200.0)
    rows = 35.5 + np.array([-20, 20])
    expected = 100.0 * (1 + 0.2 * np.cos(2 * np.pi * 100.0 * (0.4 + (rows - 35.5) * 2e-5) + 0.3))
    slow = effects.bands(even(shape=(72, 2)), view(), 0.2, 100.0, 0.3).value[:, 0]
    assert np.interp(rows, np.arange(72), slow) == pytest.approx(expected, rel=1e-3)


def test_dead_dots_follow_the_projector_from_camera_to_camera():
    dotted = np.full((HEIGHT, WIDTH), 20.0)
    dotted[::3, ::3] = 90.0
    light, depth = Light(dotted, np.ones_like(dotted)), np.full(dotted.shape, DISTANCE)
    changed = {}
    for side, shift in (("left", 0.0), ("right", BASELINE)):
        seen = view(depth=depth, camera_to_projector=translation(shift - 0.02), static=np.random.default_rng(2))
        out = effects.dead_dots(light, seen, 0.1).value
        changed[side] = out != dotted
        assert set(np.unique(out[changed[side]])) == {20.0}
    # A wall at 1 m: the right camera sees each direction of the projector by the disparity, 4 px, further left.
    disparity = round(FOCAL * BASELINE / DISTANCE)
    dead = effects.dead_directions(view(), 0.1)
    assert dead.mean() == pytest.approx(0.1, abs=0.005)
    columns = np.arange(8, WIDTH - 8)
    for side, offset in (("left", round(-FOCAL * 0.02)), ("right", round(-FOCAL * 0.02) + disparity)):
        is_dead = dead[:, columns + offset] & (dotted[:, columns] > 20.0)
        assert is_dead.any()
        np.testing.assert_array_equal(changed[side][:, columns], is_dead)


def test_depth_of_the_other_camera_lies_at_its_own_pixels():
    depth = np.full((HEIGHT, WIDTH), 2.0)
    depth[20:40, 40:60] = 1.0
    out = effects.moved_depth(depth, K, translation(-BASELINE), K)
    assert (out[22:38, 38:54] == 1.0).all() and (out[22:38, 60:80] == 2.0).all()


def test_the_noise_model_of_repeats_is_found(ramp):
    noise_model = measured_noise_model(read_capture(ramp), BLACK)
    assert noise_model.measured == "repeats"
    assert noise_model.slope_dn == pytest.approx(SLOPE, rel=0.1)
    assert noise_model.floor_dn2 == pytest.approx(FLOOR + 1 / 12, rel=0.3)


def test_without_repeats_quiet_places_tell_the_noise(tmp_path):
    level = np.broadcast_to(np.linspace(20, 160, WIDTH), (HEIGHT, WIDTH))
    noise_model = measured_noise_model(read_capture(write_wall(tmp_path, level, repeats=12, groups=False)), BLACK)
    assert noise_model.measured == "quietest places"
    assert noise_model.variance(np.array(90.0)) == pytest.approx(FLOOR + 1 / 12 + SLOPE * 90.0, rel=0.2)


@pytest.mark.parametrize("name", ["blur", "veiling_glare", "vignetting", "radial_distortion"])
def test_repeats_with_an_effect_of_the_lens_have_the_sensors_noise(ramp, name):
    injection = plan(read_capture(ramp), name, "strong", seed=1, black_dn=BLACK)
    images = np.stack([injection.changed(i, injection.sides[0]) for i in range(6)])
    expected = FLOOR + 1 / 12 + SLOPE * np.maximum(images.mean(axis=0) - BLACK, 0.0)
    assert (images.var(axis=0, ddof=1) / expected).mean() == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("name", KINDS)
def test_stronger_changes_more_and_the_answer_says_how_much(ramp, tmp_path, name):
    capture = read_capture(ramp)
    changes = []
    for strength in STRENGTHS:
        out = tmp_path / strength
        answer = write_injected(plan(capture, name, strength, seed=2, black_dn=BLACK), out)
        assert json.loads((out / "answer.json").read_text()) == answer
        injected = read_capture(out)
        squares = {"train": [], "test": []}
        for before, after in zip(capture.frames, injected.frames):
            for side in ("left", "right"):
                difference = injected.ir(after, side) - capture.ir(before, side)
                squares[before.split].append(np.mean(difference**2))
                changes_it = side in answer["cameras"]
                assert (difference == 0.0).all() if not changes_it else strength != "strong" or difference.any()
        for split, values in squares.items():
            assert answer["changed_rms_dn"][split] == pytest.approx(np.sqrt(np.mean(values)))
        changes.append(answer["changed_rms_dn"]["test"])
        assert (out / "capture.json").read_bytes() == (ramp / "capture.json").read_bytes()
        assert (out / "depth/000000.png").read_bytes() == (ramp / "depth/000000.png").read_bytes()
    assert changes == sorted(changes) and changes[-1] > max(0.0, changes[0])


def test_a_seed_gives_the_same_files_and_another_does_not(ramp, tmp_path):
    capture = read_capture(ramp)
    for out, seed in (("a", 4), ("b", 4), ("c", 5)):
        write_injected(plan(capture, "bands", "strong", seed), tmp_path / out)
    image = "left/000003.png"
    assert (tmp_path / "a" / image).read_bytes() == (tmp_path / "b" / image).read_bytes()
    assert (tmp_path / "a" / image).read_bytes() != (tmp_path / "c" / image).read_bytes()


def test_what_was_hidden_before_is_kept(ramp, tmp_path):
    write_injected(plan(read_capture(ramp), "gain", "weak", 0), tmp_path / "one")
    second = write_injected(plan(read_capture(tmp_path / "one"), "row_noise", "weak", 0), tmp_path / "two")
    assert second["hidden_before"]["effect"] == "gain"


def test_accepted_names_are_the_librarys():
    accepted = {name for kind in KINDS.values() for name in kind.accepted}
    assert len(KINDS) == 12 and accepted and accepted <= set(builtin())


def test_nothing_of_the_lab_is_used():
    text = "".join(path.read_text() for path in Path(effects.__file__).parent.glob("*.py"))
    assert set(re.findall(r"(?:from|import) activestereo\.(\w+)", text)) == {"capture", "common"}


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["smoke", "-o", "{out}"], "invalid choice: 'smoke' (choose from 'blur', "),
        (["blur", "--strength", "huge", "-o", "{out}"], "the strength of blur is 'huge', expected weak, medium"),
        (["blur", "--strength", "40", "-o", "{out}"], "the strength of blur is 40, expected 0 to 10 px and not 0"),
        (["blur", "-o", "{ramp}/inside"], "lies in the capture"),
        (["blur", "--black-level", "300", "-o", "{out}"], "the black level is 300, expected 0 to below 255 DN"),
    ],
)
def test_wrong_input_is_told_in_one_line(ramp, tmp_path, monkeypatch, capsys, arguments, said):
    given = [part.format(out=tmp_path / "out", ramp=ramp) for part in arguments]
    monkeypatch.setattr(sys, "argv", ["hide_in_images", str(ramp), *given])
    with pytest.raises(SystemExit) as ended:
        hide_in_images.main()
    assert said in f"{ended.value.code} {capsys.readouterr().err}"
    assert list(tmp_path.iterdir()) == []


def test_repeats_share_their_depth_and_a_frame_without_any_is_told(ramp, tmp_path):
    capture = read_capture(ramp)
    whole = plan(capture, "dead_dots", "strong", 0, BLACK)
    for group, is_refused in ((0, False), (1, True)):
        last = Frame(**{**capture.frames[1].__dict__, "depth_path": None, "repeat_group": group})
        frames = (capture.frames[0], last, *capture.frames[2:])
        injection = plan(Capture(**{**capture.__dict__, "frames": frames}), "dead_dots", "strong", 0, BLACK)
        if is_refused:
            with pytest.raises(ValueError, match=r"frames\[id=1\] has no depth"):
                injection.changed(1, "left")
        else:
            assert (injection.changed(1, "right") != capture.ir(last, "right")).any()
            np.testing.assert_array_equal(injection.changed(1, "right"), whole.changed(1, "right"))
    frames = tuple(Frame(**{**frame.__dict__, "depth_path": None}) for frame in capture.frames)
    without_depth = Capture(**{**capture.__dict__, "frames": frames})
    with pytest.raises(ValueError, match=r"frames\[id=0\] has no depth"):
        write_injected(plan(without_depth, "dead_dots", "weak", 0), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_a_capture_and_its_answer(ramp, tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    arguments = [str(ramp), "vignetting", "--strength", "2.5", "-o", str(out)]
    monkeypatch.setattr(sys, "argv", ["hide_in_images", *arguments])
    hide_in_images.main()
    assert "vignetting {'exponent': 2.5}" in capsys.readouterr().out
    assert json.loads((out / "answer.json").read_text())["parameters"] == {"exponent": 2.5}
