# SPDX-License-Identifier: Apache-2.0
"""Light of scene files: lamps' infrared shares, and environment maps."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import kuafu
from activestereo.common.pose import look_at
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.staging import INFRARED_SHARES, infrared_share, read_environment_map
from activestereo.scene_io.staging import set_environment_map, set_infrared_share

_WHITE_LED_LM_PER_W = 300.0
_NM = np.arange(380.0, 1100.0)
# CIE's V(lambda) by its usual Gaussian, and silicon whose quantum efficiency falls from 600 nm on.
_EYE = 1.019 * np.exp(-285.4 * (1e-3 * _NM - 0.559) ** 2)
_SILICON = np.where(_NM < 400.0, 0.0, np.clip((1050.0 - _NM) / 450.0, 0.0, 1.0) * _NM / 570.0)


@pytest.mark.parametrize(
    ("kind", "kelvin"), [("sun", 5778.0), ("halogen", 3000.0), ("incandescent", 2700.0), ("candle", 1900.0)]
)
def test_what_glows_follows_plancks_law(kind: str, kelvin: float) -> None:
    planck = _NM**-5 / np.expm1(1.4388e7 / (_NM * kelvin))
    counts_per_lm = (_SILICON * planck).sum() / (683.0 * (_EYE * planck).sum())
    assert INFRARED_SHARES[kind] == pytest.approx(_WHITE_LED_LM_PER_W * counts_per_lm, rel=0.03)


@pytest.mark.parametrize("text", ["neon", "-1", "nan", "inf"])
def test_what_is_no_kind_is_said(text: str) -> None:
    with pytest.raises(ValueError, match="lamp"):
        infrared_share(text)


def _written(path: Path, extras: dict[str, float]) -> kuafu.Scene:
    """A lamp of each kind that glTF has, of 2 W."""
    writer = GltfWriter()
    writer.add_mesh("ball", meshes.sphere(0.1), writer.add_material("paint"))
    writer.add_light("bulb", (0, 0, 1), (1, 0.5, 0.25), 2.0, **extras)
    writer.add_light("sun", np.eye(4), (1, 1, 1), 2.0, "directional", **extras)
    writer.add_light("spot", np.eye(4), (1, 1, 1), 2.0, "spot", (0.1, 0.4), **extras)
    writer.write(path / "a.gltf")
    written = json.loads((path / "a.gltf").read_text())["extensions"]["KHR_lights_punctual"]["lights"]
    assert [light["intensity"] for light in written] == pytest.approx(3 * [2.0 * 683.0])
    scene = kuafu.Scene(kuafu.Device("cpu"))
    scene.load(path / "a.gltf")
    return scene


def test_what_is_written_in_watts_is_read_in_watts(tmp_path: Path) -> None:
    scene = _written(tmp_path, {})
    assert scene.get_light(0).intensity == (2.0, 1.0, 0.5)
    assert all(scene.get_light(number).intensity == (2.0, 2.0, 2.0) for number in (1, 2))
    assert scene.get_light(2).outer_rad == 0.4


def _seen(scene: kuafu.Scene) -> float:
    """The infrared radiance of a white wall before the lamps."""
    wall = scene.add_material(kuafu.Material(base_color=(1, 1, 1, 1), ir_albedo=1.0, specular=0.0))
    sheet = scene.add_mesh([[-9, -9, -2], [9, -9, -2], [0, 9, -2]], [[0, 1, 2]])
    scene.add_instance(sheet, [wall])
    camera = kuafu.Camera(4, 4, [[100, 0, 1.5], [0, 100, 1.5], [0, 0, 1]], np.diag([1.0, -1.0, -1.0, 1.0]))
    options = {"spp": 4, "max_bounces": 0, "ir_ambient_scale": 0.5, "ir_ambient_radiance": 0.0}
    images = kuafu.Renderer(scene.device).render(scene, camera, ["radiance"], band="infrared", **options)
    return float(np.mean(images["radiance"]))


@pytest.mark.parametrize(
    ("extras", "option", "factor"),
    [
        ({}, None, 1.0),
        ({}, 2.9, 2.9),
        ({}, 0.0, 0.0),
        ({"ir_share": 3.0}, None, 3.0),
        ({"ir_share": 3.0}, 2.9, 3.0),  # what a file says of a lamp counts
        ({"ir_intensity": 4.0}, 2.9, 4.0),  # 2 W by an ir_ambient_scale of 0.5 are 1 W
    ],
)
def test_the_infrared_share(tmp_path: Path, extras: dict[str, float], option: float | None, factor: float) -> None:
    scene, plain = _written(tmp_path, extras), _written(tmp_path, {})
    if option is not None:
        set_infrared_share(scene, option)
    assert _seen(scene) == pytest.approx(factor * _seen(plain), rel=1e-5)


def written(path: Path, rgb: np.ndarray) -> Path:
    """The image in the file's format."""
    assert cv2.imwrite(str(path), np.ascontiguousarray(rgb[..., ::-1]))
    return path


# HDR has 8 bits of mantissa, which a pixel's channels share.
@pytest.mark.parametrize(("name", "error"), [("a.exr", 30e-3), ("a.hdr", 30 / 128)])
def test_radiances_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, error: float) -> None:
    monkeypatch.setenv("OPENCV_IO_ENABLE_OPENEXR", "1")
    if not cv2.haveImageWriter(name):
        pytest.skip(f"this OpenCV {cv2.__version__} is built without OpenEXR")
    radiance = np.random.default_rng(1).uniform(0.5, 30, (4, 8, 3)).astype(np.float32)
    found = read_environment_map(written(tmp_path / name, radiance))
    np.testing.assert_allclose(found, radiance, atol=error)


def test_png_of_8_and_16_bits_is_decoded(tmp_path: Path) -> None:
    rgb = np.zeros((1, 2, 3), np.uint8)
    rgb[0, 1] = (255, 128, 0)
    found = read_environment_map(written(tmp_path / "a.png", rgb))
    np.testing.assert_allclose(found[0, 1], (1, 0.21586, 0), atol=1e-4)
    deep = rgb.astype(np.uint16) * 257
    np.testing.assert_allclose(read_environment_map(written(tmp_path / "b.png", deep)), found, atol=1e-6)


def test_what_is_no_map_is_refused(tmp_path: Path) -> None:
    square = written(tmp_path / "square.png", np.zeros((4, 4, 3), np.uint8))
    text = tmp_path / "text.hdr"
    text.write_text("no image")
    for path, message in ((square, "twice as wide"), (text, "no image that can be read"), (tmp_path / "x", "no such")):
        with pytest.raises(ValueError, match=message):
            read_environment_map(path)


def test_the_sky_is_up_and_the_middle_is_before_a_gltf_camera(tmp_path: Path) -> None:
    rgb = np.zeros((8, 16, 3), np.float32)
    rgb[:2] = (4, 0, 0)  # the sky
    rgb[3:5, 7:9] = (0, 3, 0)  # the middle
    rgb[3:5, 11:13] = (0, 0, 2)  # a quarter to the right
    scene = kuafu.Scene(kuafu.Device("cpu"))
    set_environment_map(scene, written(tmp_path / "a.hdr", rgb), 0.5)
    looks = {"up": (0, 1, 0), "forward": (0, 0, -1), "right": (1, 0, 0)}
    seen = {name: radiance_of(scene, np.array(direction, float)) for name, direction in looks.items()}
    np.testing.assert_allclose(seen["up"], (2, 0, 0), atol=0.05)
    np.testing.assert_allclose(seen["forward"], (0, 1.5, 0), atol=0.05)
    np.testing.assert_allclose(seen["right"], (0, 0, 1), atol=0.05)


def radiance_of(scene: kuafu.Scene, forward: np.ndarray) -> np.ndarray:
    """The visible radiance in one direction."""
    pose = look_at((0, 0, 0), forward, (0.3, 0.2, 0.9))
    camera = kuafu.Camera(4, 4, np.array([[4000.0, 0, 1.5], [0, 4000.0, 1.5], [0, 0, 1]]), pose)
    image = kuafu.Renderer(scene.device).render(scene, camera, band="visible")
    return np.asarray(image["radiance"])[0].mean((0, 1))
