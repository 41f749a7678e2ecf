# SPDX-License-Identifier: Apache-2.0
"""The renderer's lens is OpenCV's: where a ray of the image goes, cv2.projectPoints brings back to its pixel."""

import cv2
import numpy as np
import pytest

import kuafu

WIDTH, HEIGHT = 96, 72
K = np.array([[80.0, 0.0, 46.0], [0.0, 78.0, 37.0], [0.0, 0.0, 1.0]])
LENSES = {
    "barrel": [-0.28, 0.07, 0.0, 0.0, 0.0],
    "pincushion": [0.12, 0.02, 0.0, 0.0, 0.01],
    "decentred": [-0.05, 0.02, 3e-3, -2e-3, -0.001],
    "rational": [0.4, -0.1, 1e-3, 5e-4, 0.02, 0.6, -0.05, 0.01],
}


def slanted(device, slope):
    """A scene with the plane z = 2 + slope . (x, y)."""
    scene = kuafu.Scene(device)
    corners = np.array([[-9, -9], [9, -9], [9, 9], [-9, 9]], float)
    positions = np.column_stack([corners, 2 + corners @ slope]).astype(np.float32)
    scene.add_instance(scene.add_mesh(positions, [[0, 1, 2], [0, 2, 3]]))
    return scene


def ideal_rays(device, camera):
    """[height, width, 2] x/z and y/z of every pixel's ray, from its depths on two planes."""
    renderer = kuafu.Renderer(device)
    rays = []
    for axis in range(2):
        slope = np.zeros(2)
        slope[axis] = 0.2
        z = renderer.render(slanted(device, slope), camera, ("depth",))["depth"][0, ..., 0].astype(float)
        assert (z > 0).all()
        rays.append((1 - 2 / z) / 0.2)
    return np.stack(rays, axis=-1)


@pytest.mark.parametrize("lens", LENSES)
def test_rays_are_those_of_opencv(device, lens):
    distortion = np.array(LENSES[lens])
    camera = kuafu.Camera(WIDTH, HEIGHT, K, distortion=distortion)
    rays = ideal_rays(device, camera)
    points = np.concatenate([rays, np.ones((HEIGHT, WIDTH, 1))], axis=-1).reshape(-1, 3)
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, distortion)
    expected = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1).reshape(-1, 2)
    assert np.abs(pixels[:, 0] - expected).max() < 1e-3
    ideal, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.zeros(5))
    assert np.abs(ideal[:, 0] - expected).max() > 1.0  # else this lens says nothing


@pytest.mark.parametrize("lens", [[0.08, -0.03, 0.01, -0.002], [0.0] * 4], ids=["polynomial", "equidistant"])
def test_rays_of_a_fisheye_lens_are_those_of_opencv(device, lens):
    k = np.array([[60.0, 0.0, 46.0], [0.0, 59.0, 37.0], [0.0, 0.0, 1.0]])  # 1.0 rad in the corners
    camera = kuafu.Camera(WIDTH, HEIGHT, k, distortion=lens, lens_model="kannala_brandt")
    rays = ideal_rays(device, camera)
    pixels = cv2.fisheye.distortPoints(rays.reshape(-1, 1, 2), k, np.array(lens))
    expected = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1).reshape(-1, 2)
    assert np.abs(pixels[:, 0] - expected).max() < 2e-3
    assert np.hypot(*rays.reshape(-1, 2).T).max() > 1.3  # the corners look beyond 52 degrees


def test_a_fisheye_camera_that_would_look_behind_itself_is_refused(device):
    camera = kuafu.Camera(WIDTH, HEIGHT, [[20, 0, 48], [0, 20, 36], [0, 0, 1]], lens_model="kannala_brandt")
    with pytest.raises(ValueError, match="cannot be inverted over the image"):
        kuafu.Renderer(device).render(slanted(device, np.zeros(2)), camera, ("depth",))


def test_a_projector_s_fisheye_lens_is_opencv_s(device):
    scene, lens = slanted(device, np.zeros(2)), np.array([0.08, -0.03, 0.01, -0.002])
    pattern = scene.add_texture(np.ones((40, 60), np.float32))
    k = np.array([[25.0, 0, 30], [0, 26.0, 20], [0, 0, 1]])
    light = kuafu.Light(kind="projector", texture=pattern, k=k, distortion=lens, lens_model="kannala_brandt")
    scene.add_light(light)
    images = kuafu.Renderer(device).render(scene, kuafu.Camera(WIDTH, HEIGHT, K), ("projector_uv", "position"))
    uv, position = images["projector_uv"][0].reshape(-1, 2), images["position"][0].reshape(-1, 3).astype(float)
    seen = np.isfinite(uv).all(axis=1)
    rays = (position[:, :2] / position[:, 2:])[seen][:, None]
    assert seen.sum() > 1000
    np.testing.assert_allclose(uv[seen], cv2.fisheye.distortPoints(rays, k, lens)[:, 0], atol=1e-3)


def test_fields_go_in_and_come_out():
    camera = kuafu.Camera(
        4, 4, K, distortion=[0.1, 0.2, 0.3, 0.4, 0.5], shutter="rolling", readout="columns_left", line_time_s=1e-5
    )
    assert camera.distortion == (0.1, 0.2, 0.3, 0.4, 0.5, 0.0, 0.0, 0.0)
    assert (camera.shutter, camera.readout, camera.line_time_s) == ("rolling", "columns_left", 1e-5)
    assert camera.lens_model == "brown_conrady"
    with pytest.raises(ValueError, match="unknown lens_model 'telecentric'"):
        camera.lens_model = "telecentric"
    camera.distortion = [0.0] * 4
    assert camera.distortion == (0.0,) * 8
    with pytest.raises(ValueError, match="3 numbers"):
        camera.distortion = [0.0] * 3
    with pytest.raises(ValueError, match="rows_down, rows_up"):
        camera.readout = "sideways"
    with pytest.raises(TypeError, match="no field 'zoom'"):
        kuafu.Camera(4, 4, K, zoom=2)
