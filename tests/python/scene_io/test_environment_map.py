# SPDX-License-Identifier: Apache-2.0
"""Environment maps: radiances as the file has them, and light from where the file says."""

from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo.scene_io.environment_map import EnvironmentMapError, read_environment_map, set_environment_map

cv2 = pytest.importorskip("cv2")


def written(path: Path, rgb: np.ndarray) -> Path:
    """The image in the file's format."""
    assert cv2.imwrite(str(path), np.ascontiguousarray(rgb[..., ::-1]))
    return path


def test_exr_keeps_radiances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENCV_IO_ENABLE_OPENEXR", "1")
    if not cv2.haveImageWriter("a.exr"):
        pytest.skip(f"this OpenCV {cv2.__version__} is built without OpenEXR")
    radiance = np.random.default_rng(1).uniform(0.5, 30, (4, 8, 3)).astype(np.float32)
    np.testing.assert_allclose(read_environment_map(written(tmp_path / "a.exr", radiance)), radiance, rtol=1e-3)


def test_radiance_hdr_keeps_radiances(tmp_path: Path) -> None:
    radiance = np.random.default_rng(1).uniform(0.5, 30, (4, 8, 3)).astype(np.float32)
    found = read_environment_map(written(tmp_path / "a.hdr", radiance))
    assert np.abs(found - radiance).max() < 30 / 128, "8 bits of mantissa shared by a pixel's channels"


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
        with pytest.raises(EnvironmentMapError, match=message):
            read_environment_map(path)


def test_the_sky_is_up_and_the_middle_is_before_a_gltf_camera(tmp_path: Path) -> None:
    rgb = np.zeros((8, 16, 3), np.float32)
    rgb[:2] = (4, 0, 0)  # the sky
    rgb[3:5, 7:9] = (0, 3, 0)  # the middle
    rgb[3:5, 11:13] = (0, 0, 2)  # a quarter to the right
    scene = kuafu.Scene(kuafu.Device("cpu"))
    set_environment_map(scene, written(tmp_path / "a.hdr", rgb), 0.5)
    looks = {"up": (0, 1, 0), "forward": (0, 0, -1), "right": (1, 0, 0)}
    seen = {name: look_at(scene, np.array(direction, float)) for name, direction in looks.items()}
    np.testing.assert_allclose(seen["up"], (2, 0, 0), atol=0.05)
    np.testing.assert_allclose(seen["forward"], (0, 1.5, 0), atol=0.05)
    np.testing.assert_allclose(seen["right"], (0, 0, 1), atol=0.05)


def look_at(scene: kuafu.Scene, forward: np.ndarray) -> np.ndarray:
    """The visible radiance in one direction."""
    right = np.cross(forward, [0.3, 0.2, 0.9])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    camera = kuafu.Camera(
        width=4, height=4, k=np.array([[4000.0, 0, 1.5], [0, 4000.0, 1.5], [0, 0, 1]]), camera_to_world=pose
    )
    image = kuafu.Renderer(scene.device).render(scene, camera, band="visible")
    return np.asarray(image["radiance"])[0].mean((0, 1))
