# SPDX-License-Identifier: Apache-2.0
"""Captures: what is written is read, what is wrong is told, blocks of pixels."""

import json
import random
import shutil
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import activestereo
import numpy as np
import pytest
from activestereo.capture.capture import Camera, CaptureError, CaptureWarning, binned, capture_from, read_capture
from activestereo.capture.capture import unbinned, usual_binning, usual_samples
from activestereo.capture.capture_json import JsonObject
from activestereo.capture.images import block_means, read_gray, write_gray
from activestereo.capture.write import write_capture
from activestereo.common.own_files import outside_allowed
from activestereo.effects import Light, Model, builtin
from activestereo.effects.core.laws import example_view
from schema_check import schema_of, violations
from scipy.ndimage import gaussian_filter
from virtual_sensor.world import make_world

CAPTURE = "capture.json"
SCHEMA = Path(activestereo.__file__).parent / "capture" / "schema"


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    return make_world(tmp_path_factory.mktemp("world"), size=(32, 20), grid=1, bounces=0)


@pytest.fixture
def folder(pristine, tmp_path):
    return Path(shutil.copytree(pristine.capture_path, tmp_path / "capture"))


def edit(folder, change):
    path = folder / "capture.json"
    values = json.loads(path.read_text())
    change(values)
    path.write_text(json.dumps(values))


def expect_error(folder, *words):
    with pytest.raises(CaptureError) as caught:
        read_capture(folder)
    for word in ("capture.json", *words):
        assert word in str(caught.value)


def test_what_is_written_is_read_back_without_a_warning(pristine, tmp_path, recwarn):
    first = read_capture(pristine.capture_path)
    images = {(f.id, side): first.ir(f, side).astype(np.uint8) for f in first.frames for side in ("left", "right")}
    pattern = np.rint(first.rig.projector.pattern() * 255).astype(np.uint8)
    (tmp_path / "copy.partial" / "left").mkdir(parents=True)
    (tmp_path / "copy.partial" / "left" / "000099.png").touch()  # of a call that failed
    write_capture(tmp_path / "copy", first, images, pattern)
    assert not (tmp_path / "copy" / "left" / "000099.png").exists()
    second = read_capture(tmp_path / "copy")
    before, after = (json.loads((capture.path / CAPTURE).read_text()) for capture in (first, second))
    assert before == after
    assert second.scene_path.read_bytes() == first.scene_path.read_bytes()
    np.testing.assert_array_equal(second.ir(second.frames[4], "right"), first.ir(first.frames[4], "right"))
    np.testing.assert_array_equal(second.rig.projector.pattern(), first.rig.projector.pattern())
    assert not recwarn.list
    with pytest.raises(FileExistsError):
        write_capture(tmp_path / "copy", first, images, pattern)


def test_repeats_are_grouped_by_split(pristine):
    capture = read_capture(pristine.capture_path)
    ids = [[frame.id for frame in frames] for frames in capture.repeats()]
    assert [[frame.id for frame in frames] for frames in capture.repeats("train")] == ids[:2] and len(ids) == 3
    assert [[frame.id for frame in frames] for frames in capture.repeats("test")] == [[4, 5]]


@pytest.mark.parametrize("key", ["exposure_s", "gain", "projector_power"])
def test_frames_of_another_exposure_or_light_are_no_repeats(folder, key):
    edit(folder, lambda c: c["frames"][1].update({key: 0.5 * c["frames"][1][key]}))
    assert [[frame.id for frame in frames] for frames in read_capture(folder).repeats()] == [[2, 3], [4, 5]]


def test_exposures_that_jitter_are_repeats(folder):
    def jitter(root):
        for frame, share in zip(root["frames"], (1.0, 1.0005, 0.9995, 1.01)):
            frame |= {"exposure_s": 0.0085 * share, "repeat_group": 7}

    edit(folder, jitter)
    assert [[frame.id for frame in frames] for frames in read_capture(folder).repeats()] == [[0, 1, 2], [4, 5]]


def test_depth_is_scaled_to_metres_and_absent_depth_is_none(folder):
    raw = np.arange(640, dtype=np.uint16).reshape(20, 32)
    write_gray(folder / "depth" / "000000.png", raw)
    edit(folder, lambda c: c["frames"][0].update(depth="depth/000000.png", depth_scale=0.0005))
    capture = read_capture(folder)
    np.testing.assert_allclose(capture.depth(capture.frames[0]), raw * 0.0005, rtol=1e-6)
    assert capture.depth(capture.frames[1]) is None


def test_unknown_keys_warn_and_are_ignored(folder):
    edit(folder, lambda c: c.update(owner="me"))
    edit(folder, lambda c: (c["frames"][2].update(weather="fine"), c["rig"]["left"].update(lens="x")))
    edit(folder, lambda c: [frame.update(who="me") for frame in c["frames"]])
    with pytest.warns(CaptureWarning) as caught:
        capture = read_capture(folder)
    said = " ".join(str(w.message) for w in caught)
    assert all(key in said for key in ("owner", "frames[id=2].weather", "rig.left.lens"))
    assert len(caught) == 4 and "key frames[id=0].who is ignored, and 7 others like it" in said
    assert len(capture.frames) == 8


@pytest.mark.parametrize("where", ["/etc/passwd", "../outside.png", "left/../../outside.png", "link.png"])
@pytest.mark.parametrize("key", ["scene", "rig.projector.pattern", "frames[id=0].left"])
def test_files_stay_in_the_folder_unless_the_user_says_otherwise(folder, where, key):
    shutil.copy(folder / "left/000000.png", folder.parent / "outside.png")
    (folder / "link.png").symlink_to(folder.parent / "outside.png")

    def change(root):
        projector, frame = root["rig"]["projector"], root["frames"][0]
        owner = {"scene": root, "rig.projector.pattern": projector, "frames[id=0].left": frame}
        owner[key][key.rpartition(".")[2]] = where

    edit(folder, change)
    expect_error(folder, key, where, "lies outside of", "--allow-outside")
    if where != "/etc/passwd":
        with outside_allowed():
            read_capture(folder)


def test_rounding_of_a_poses_last_row_is_taken_away(folder):
    edit(folder, lambda root: root["frames"][0]["camera_to_world"].__setitem__(14, 1e-10))
    assert read_capture(folder).frames[0].camera_to_world[3].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_every_number_has_a_finite_range(folder):
    edit(folder, lambda root: root.update(lights=[{"name": "lamp", "position_m": [0, 0, 0], "radius_m": 0.1}]))
    edit(folder, lambda root: root["rig"]["readout"].update(line_time_s=1e-5))
    edit(folder, lambda root: root["frames"][0].update(ambient=1.0, temperature_c=20.0, depth_scale=0.001))
    text, tried = (folder / "capture.json").read_text(), set()
    for place in numbers_in(json.loads(text)):
        key = next(part for part in reversed(place) if isinstance(part, str))
        for value in (1e300, -1e300, 1e31, 10**400, float("nan")):
            root = json.loads(text)
            container = root
            for part in place[:-1]:
                container = container[part]
            container[place[-1]] = value
            (folder / "capture.json").write_text(json.dumps(root))
            expect_error(folder, key)
        tried.add(key)
    assert {"K", "distortion", "camera_velocity", "exposure_s", "depth_scale", "position_m", "line_time_s"} <= tried


def numbers_in(value, place=()):
    """Where the numbers are, of the first frame alone."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        yield place
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        if place + (key,) != ("depth_engine",) and not (place == ("frames",) and key > 0):
            yield from numbers_in(inner, (*place, key))


def test_a_rational_lens_is_read(folder):
    lens = [0.1, -0.05, 1e-3, -1e-3, 0.01, 0.2, -0.03, 0.01]
    edit(folder, lambda root: root["rig"]["left"].update(distortion=lens))
    assert read_capture(folder).rig.left.distortion.tolist() == lens
    edit(folder, lambda root: root["rig"]["left"].update(distortion=lens[:7]))
    expect_error(folder, "distortion", "7 entries", "5 numbers, 8 of")
    edit(folder, lambda root: root["rig"]["left"].update(distortion=lens[:4]))
    left = read_capture(folder).rig.left
    assert left.distortion.tolist() == lens[:4] and not left.is_pinhole


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.update(format="other"), ["format", "active-stereo-capture"]),
        (lambda c: c.update(version=2), ["version", "2"]),
        (lambda c: c.pop("name"), ["name", "missing"]),
        (lambda c: c.update(scene="nowhere.gltf"), ["scene", "nowhere.gltf"]),
        (lambda c: c.update(frames=[]), ["frames", "empty"]),
        (lambda c: c["rig"]["left"].update(K=[1, 2, 3]), ["rig.left.K", "3 entries", "9"]),
        (lambda c: c["rig"]["left"]["K"].__setitem__(0, -5), ["rig.left.K", "focal"]),
        (lambda c: c["rig"]["right"].update(width=33), ["frames[id=0].right", "32x20", "33x20"]),
        (lambda c: c["rig"].update(left_to_right=[2] * 16), ["rig.left_to_right", "rigid"]),
        (lambda c: c["rig"].update(bit_depth=20), ["rig.bit_depth", "20"]),
        (lambda c: c["rig"]["projector"].update(pattern="none.png"), ["rig.projector.pattern", "none.png"]),
        (lambda c: c["frames"][1].update(split="both"), ["frames[id=1].split", "both"]),
        (lambda c: c["frames"][1].update(id=0), ["frames", "id 0", "more than once"]),
        (lambda c: c["frames"][3].pop("exposure_s"), ["frames[id=3].exposure_s", "missing"]),
        (lambda c: c["frames"][3].update(exposure_s=0), ["frames[id=3].exposure_s", "1e-09 to 2 s"]),
        (lambda c: c["frames"][3].update(gain="high"), ["frames[id=3].gain", "high"]),
        (lambda c: c["frames"][3].update(exposure_s=float("nan")), ["frames[id=3].exposure_s", "finite"]),
        (lambda c: c["frames"][3].update(gain=10**400), ["frames[id=3].gain", "finite"]),
        (lambda c: c["frames"][3].update(camera_velocity=[0] * 5), ["frames[id=3].camera_velocity", "6"]),
        (lambda c: c["frames"][3].update(left="left/none.png"), ["frames[id=3].left", "none.png"]),
        (lambda c: c["frames"][3].update(depth="left/000000.png"), ["frames[id=3].depth_scale", "missing"]),
        (lambda c: c["frames"].__setitem__(0, 5), ["frames[0]", "not an object"]),
        (lambda c: c["frames"][0].update(id=2**63), ["id", "expected"]),
        (lambda c: c["frames"][0].update(temperature_c=298), ["temperature_c: is 298", "from kelvin"]),
        (lambda c: c["frames"][0].update(exposure_s=8.5), ["exposure_s: is 8.5", "milliseconds"]),
        (lambda c: c["frames"][0].update(camera_velocity=[300] + [0] * 5), ["camera_velocity[0]", "mm/s"]),
        (lambda c: c["frames"][0].update(temperature_c=-300.0), ["temperature_c", "expected"]),
        (lambda c: c["frames"][0].update(repeat_group=-(2**80)), ["repeat_group", "expected"]),
        (lambda c: c.update(depth_engine={"max_disparity": 40.5}), ["depth_engine.max_disparity", "40.5", "16..1024"]),
        (lambda c: c.update(depth_engine={"p1": "many"}), ["depth_engine.p1", "is 'many', expected a number"]),
        (lambda c: c.update(depth_engine={"path_count": True}), ["depth_engine.path_count", "True, expected 4 or 8"]),
        (lambda c: c.update(scene="a" * 5000), ["scene", "does not exist"]),
        (lambda c: c.update(name="\ud800"), ["name", "is '\\ud800', which is no Unicode text"]),
    ],
)
def test_a_wrong_value_is_an_error_with_file_and_key(folder, change, words):
    edit(folder, change)
    expect_error(folder, *words)


def test_a_file_that_is_not_json_or_absent_is_an_error(folder, tmp_path):
    (folder / "capture.json").write_text("{oops")
    expect_error(folder, "not JSON")
    (folder / "capture.json").write_text('{"rig": {"left": 1, "left": 2}}')
    expect_error(folder, "'left' is there twice")
    (folder / "capture.json").write_text("[" * 100_000)
    expect_error(folder, "nested deeper than 100")
    expect_error(tmp_path / "nowhere", "cannot be read")


def test_a_pattern_of_16_bits_is_an_error(folder):
    capture = read_capture(folder)
    write_gray(capture.rig.projector.pattern_path, np.full((20, 32), 40000, np.uint16))
    with pytest.raises(CaptureError, match=r"rig\.projector\.pattern: is a 16-bit image"):
        capture.rig.projector.pattern()


def test_a_damaged_or_coloured_image_is_an_error(folder):
    image = folder / "left" / "000000.png"
    whole = image.read_bytes()
    capture = read_capture(folder)
    image.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(CaptureError, match=r"000000\.png.*frames\[id=0\]\.left.*damaged"):
        capture.ir(capture.frames[0], "left")
    image.write_bytes(b"not an image")
    with pytest.raises(CaptureError, match=r"000000\.png.*left"):
        read_capture(folder)
    from PIL import Image

    Image.new("RGB", (32, 20), (9, 9, 8)).save(image)  # equal channels would be a gray image
    with pytest.raises(CaptureError, match="gray"):
        capture.ir(capture.frames[0], "left")


def test_every_damaged_byte_of_an_image_is_an_error_that_names_it(folder):
    # Some of Pillow's own errors are ValueErrors without a file, such as that of a header's chunk that is too short.
    path = folder / "left" / "000000.png"
    whole = path.read_bytes()
    for place in range(8, 41):  # the signature is whole: both of the first chunks' lengths, names and sums
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x0F]) + whole[place + 1 :])
        try:
            read_gray(path, key="left")
        except CaptureError as error:
            assert "000000.png: left: " in str(error)


def test_the_schema_has_every_key_that_is_read_and_its_example_is_a_capture(pristine, tmp_path):
    example = json.loads((SCHEMA / "example.json").read_text())
    written = json.loads((pristine.capture_path / CAPTURE).read_text())
    assert violations(example, "capture") == [] and violations(written, "capture") == []
    assert violations(example | {"frames": [{"id": 0}]}, "capture")
    for name in ("scene.gltf", "pattern.png", *(f"{kind}/000000.png" for kind in ("left", "right", "depth"))):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("{}")
        if name.endswith(".png"):
            write_gray(tmp_path / name, np.zeros((240, 424), np.uint16 if "depth" in name else np.uint8))
    example["rig"] |= {"black_dn": [4, 0.1], "readout": {}}
    example["rig"] |= {"color": example["rig"]["left"] | {"left_to_color": np.eye(4).ravel().tolist()}}
    example |= {"lights": [{"name": "lamp", "position_m": [0, 1, 0]}], "uncertainty": {}}
    example["frames"][0]["gripper_to_base"] = np.eye(4).ravel().tolist()
    (tmp_path / CAPTURE).write_text(json.dumps(example))
    root = JsonObject.read(tmp_path / CAPTURE)
    assert capture_from(root).name == "desk"

    def compared(entry, described):
        own = described.get("items", described).get("properties", {})
        assert entry._known == set(own), entry.name
        for child in entry._children:
            key = child.name.rpartition(".")[2].partition("[")[0]
            compared(child, own[key])

    compared(root, schema_of("capture"))


ODD = [
    None, True, -1, 0, 2**63, 1e308, -1e308, 0.5, "", "x", "../x.png", "/dev/zero", "a\nb", [], {}, [[]],
    [1e300] * 16, {"a": 1}, "\udcff",
]  # fmt: skip


def places(value: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """(container, key) of every value inside."""
    for key in list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        found.append((value, key))
        places(value[key], found)
    return found


def test_changed_values(folder):
    text = (folder / "capture.json").read_text()
    dice = random.Random(1)
    refused = 0
    for _ in range(300):
        root = json.loads(text)
        for _ in range(dice.randint(1, 3)):
            container, key = dice.choice(places(root, []))
            if isinstance(container, dict) and dice.random() < 0.2:
                container.pop(key, None)
            else:
                container[key] = dice.choice(ODD)
        refused += not _reads(folder, json.dumps(root))
    assert refused > 100, "the changes reach nothing that is checked"


def test_changed_bytes(folder):
    text = (folder / "capture.json").read_text()
    dice = random.Random(2)
    for _ in range(200):
        characters = list(text)
        for _ in range(dice.randint(1, 4)):
            characters[dice.randrange(len(characters))] = dice.choice('{}[]",:0-9e.\\ \x00')
        if dice.random() < 0.2:
            del characters[dice.randrange(len(characters)) :]
        _reads(folder, "".join(characters))


def _reads(folder: Path, text: str) -> bool:
    (folder / "capture.json").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            read_capture(folder)
        except CaptureError as error:
            assert "capture.json" in str(error)
            return False
    return True


SIZE = 3


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("world")
    capture = read_capture(make_world(folder, size=(98, 60), grid=1, bounces=0).capture_path)
    known = np.full((60, 98), 255, np.uint8)
    known[10, 20] = 0
    write_gray(folder / "known.png", known)
    frames = (replace(capture.frames[0], left_mask_path=folder / "known.png"), *capture.frames[1:])
    return replace(capture, frames=frames)


def test_a_block_sees_what_its_pixels_see(whole):
    small = binned(whole, SIZE)
    frame = small.frames[0]
    image, blocks = whole.ir(frame, "left"), small.ir(frame, "left")
    assert blocks.shape == (small.rig.left.height, small.rig.left.width) == (20, 32)
    assert blocks[7, 5] == pytest.approx(image[21:24, 15:18].mean())
    middle = np.linalg.inv(whole.rig.left.K) @ (16.0, 22.0, 1.0)
    np.testing.assert_allclose(np.linalg.inv(small.rig.left.K) @ (5.0, 7.0, 1.0), middle, atol=1e-12)
    assert np.argwhere(~small.known(frame, "left")).tolist() == [[3, 6]]


def test_what_is_found_on_blocks_is_told_of_the_whole(whole):
    small = binned(whole, SIZE)
    np.testing.assert_array_equal(unbinned(small).rig.left.K, whole.rig.left.K)
    longer = small.rig.left.K.copy()
    longer[:2, :2] *= 1.01
    moved = small.frames[0].camera_to_world + np.eye(4)[3] * 0.01
    found = unbinned(replace(
        small, rig=replace(small.rig, left=replace(small.rig.left, K=longer)),
        frames=(replace(small.frames[0], camera_to_world=moved), *small.frames[1:]),
    ))  # fmt: skip
    assert found.rig.left.K[0, 0] == pytest.approx(1.01 * whole.rig.left.K[0, 0])
    assert found.rig.left.K[0, 2] == whole.rig.left.K[0, 2]
    np.testing.assert_array_equal(found.frames[0].camera_to_world, moved)
    assert found.frames[0].depth_path == whole.frames[0].depth_path


def test_lengths_in_pixels_are_those_of_whole_images():
    image = gaussian_filter(np.random.default_rng(1).normal(100.0, 20.0, (120, 120)), 2.0)
    psf = Model().with_effect(builtin()["lens_psf"], sigma_px=3.0)

    def blur(pixels, size):
        view = replace(example_view(), binning=size, depth_m=np.ones(pixels.shape))
        return psf.light(Light.of_images([pixels] * 4), view).ambient

    fine, coarse = block_means(blur(image, 1), 2), blur(block_means(image, 2), 2)
    assert np.std(coarse - fine) < 0.1 * np.std(block_means(image, 2) - fine)


def test_large_images_are_averaged_and_small_ones_are_not(whole):
    sized = [
        replace(whole, rig=replace(whole.rig, left=Camera(width, height, np.eye(3))))
        for width, height in ((424, 240), (848, 480), (1280, 720))
    ]
    assert [usual_binning(capture) for capture in sized] == [1, 2, 3]
    assert [usual_samples(capture) for capture in sized] == [64, 64, 28]  # as many for a whole image
    with pytest.raises(CaptureError, match="cannot be averaged over 9: give 1 to 3"):
        binned(whole, 9)
