# SPDX-License-Identifier: Apache-2.0
"""kuafu's optics beside the effects of the same name: one definition, wherever it runs. And its denoiser."""

from dataclasses import replace

import numpy as np
import pytest

import kuafu
from activestereo import StereoDepthSensor
from activestereo.common.pose import body_pose
from activestereo.effects import Light, Stage, builtin
from activestereo.effects.core.laws import example_view

WIDTH, HEIGHT, K = 60, 44, np.array([[50.0, 0, 28.0], [0, 52.0, 23.0], [0, 0, 1]])


@pytest.fixture(scope="module")
def render(device):
    rng = np.random.default_rng(1)
    scene = kuafu.Scene(device)
    cells = scene.add_texture(rng.random((12, 16, 3)).astype(np.float32))
    wall = kuafu.Material(base_color=(0, 0, 0, 1), specular=0.0, emission=(1, 1, 1), emission_texture=cells)
    corners = np.array([[-2, -2, 2], [2, -2, 2], [2, 2, 2], [-2, 2, 2]], np.float32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    mesh = scene.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), uvs=uvs)
    scene.add_instance(mesh, [scene.add_material(wall)])
    renderer, camera = kuafu.Renderer(device), kuafu.Camera(WIDTH, HEIGHT, K)

    def image(optics=None):
        options = {"band": "visible", "spp": 4, "max_bounces": 0, "optics": optics}
        return renderer.render(scene, camera, ["radiance"], **options)["radiance"][0].astype(np.float64)

    return image


def by_effect(image, name, **values):
    view = replace(example_view(), K=K, depth_m=np.full((HEIGHT, WIDTH), 2.0), distortion=(0.0,) * 5)
    effect, stack = builtin()[name], np.moveaxis(image, -1, 0)
    if effect.stage is Stage.CAMERA:
        lights = [effect(Light(one, one, one, one), view, **values).direct for one in stack]
        return np.stack(lights, axis=-1)
    return np.moveaxis(effect(stack, view, **values), 0, -1)


@pytest.mark.parametrize(
    ("name", "parameter", "value", "rtol"),
    [("vignetting", "exponent", 3.0, 2e-6), ("veiling_glare", "fraction", 0.3, 2e-5)],
)
def test_a_lenss_light_is_the_effect_s(render, name, parameter, value, rtol):
    for optics in ({f"{name}_{parameter}": value}, kuafu.Optics(**{f"{name}_{parameter}": value})):
        np.testing.assert_allclose(render(optics), by_effect(render(), name, **{parameter: value}), rtol=rtol)


@pytest.mark.parametrize("sigma, corner, tolerance", [(1.5, 0.0, 0.008), (1.2, 1.5, 0.025)])
def test_lens_psf_is_the_effect_s(render, sigma, corner, tolerance):
    """But for the kernel on the pixels, and for who tells a varying blur's width."""
    seen = render(kuafu.Optics(psf_sigma_px=sigma, psf_corner_sigma_px=corner))
    other = by_effect(render(), "lens_psf", sigma_px=sigma, corner_sigma_px=corner)
    assert np.abs(seen - other).max() < tolerance
    assert np.abs(seen - render()).max() > 5 * tolerance


def test_one_optics_for_each_camera_or_for_all(render, device):
    scene = kuafu.Scene(device)
    scene.set_environment((1.0, 1.0, 1.0), 1.0)
    camera, renderer = kuafu.Camera(9, 9, [[9, 0, 4], [0, 9, 4], [0, 0, 1]]), kuafu.Renderer(device)
    optics = [kuafu.Optics(), {"vignetting_exponent": 4}]
    images = renderer.render(scene, [camera, camera], spp=1, optics=optics)["radiance"]
    assert (images[0] == 1.0).all() and images[1, 0, 0, 0] < 0.8
    with pytest.raises(ValueError, match="1 optics for 2 cameras"):
        renderer.render(scene, [camera, camera], optics=[kuafu.Optics()])
    with pytest.raises(TypeError, match="no field 'sigma'"):
        renderer.render(scene, camera, optics={"sigma": 1})
    with pytest.raises(kuafu.ArgumentError, match="psf_sigma_px is -1"):
        renderer.render(scene, camera, optics=kuafu.Optics(psf_sigma_px=-1))


@pytest.mark.parametrize("blur_px", [0.0, 0.5, 1.0])
def test_a_blurred_pixel_sees_beyond_its_square(device, blur_px):
    """An edge between two pixels: the integral of the blurred square from half a pixel on is an eighth of its blur."""
    scene = kuafu.Scene(device)
    wall = scene.add_material(kuafu.Material(base_color=(0, 0, 0, 1), specular=0.0, emission=(1, 1, 1)))
    corners = np.array([[0.5, -90, 9], [90, -90, 9], [90, 90, 9], [0.5, 90, 9]], np.float32)
    scene.add_instance(scene.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)), [wall])
    camera = kuafu.Camera(9, 9, [[9, 0, 4], [0, 9, 4], [0, 0, 1]])
    options = {"band": "visible", "spp": 1024, "max_bounces": 0, "pixel_blur_px": blur_px}
    row = kuafu.Renderer(device).render(scene, camera, ["radiance"], **options)["radiance"][0, 4, :, 0]
    beside = blur_px / 8
    np.testing.assert_allclose(row, [0, 0, 0, 0, beside, 1 - beside, 1, 1, 1], atol=0.02)


def test_a_denoiser_that_is_not_there_is_named(device):
    scene, camera = kuafu.Scene(device), kuafu.Camera(WIDTH, HEIGHT, K)
    with pytest.raises(kuafu.ArgumentError, match=r"unknown denoise 'svgf' \(known: none, atrous, oidn\)"):
        kuafu.Renderer(device).render(scene, camera, denoise="svgf")
    with pytest.raises(kuafu.Error, match="KUAFU_OIDN_LIBRARY.*no/such/library"):
        kuafu.Renderer(device, oidn_library="/no/such/library.so").render(scene, camera, denoise="oidn")


def test_sensor_denoises_and_has_optics(device, table_top, small_config):
    scene = kuafu.Scene(device)
    scene.load(table_top)
    pose = body_pose(scene.camera(0).camera_to_world)

    def infrared(**changes):
        for name, value in changes.items():
            setattr(small_config, name, value)
        sensor = StereoDepthSensor(small_config, scene, pose=pose)
        sensor.take_picture(infrared_only=True)
        image = sensor.get_ir()[0].copy()
        sensor.close()
        return image

    plain, clean = infrared(), infrared(denoise="atrous")
    dim = infrared(ir_optics={"vignetting_exponent": 4.0})
    assert np.abs(np.diff(clean, 2)).mean() < np.abs(np.diff(plain, 2)).mean()
    assert clean.mean() == pytest.approx(plain.mean(), rel=0.02)
    assert dim[:20, :20].mean() < 0.8 * clean[:20, :20].mean()
    assert dim[110:130, 200:220].mean() == pytest.approx(clean[110:130, 200:220].mean(), rel=0.02)
