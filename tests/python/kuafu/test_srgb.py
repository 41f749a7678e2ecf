# SPDX-License-Identifier: Apache-2.0
"""The output srgb through the bindings: the curve's bytes, in double precision, of the radiance of the same call."""

import numpy as np
import pytest

import kuafu
from activestereo.camera.auto_exposure import rgb_exposure

CAMERA = kuafu.Camera(31, 23, [[20, 0, 15], [0, 20, 11], [0, 0, 1]])


@pytest.fixture(scope="module")
def scene(device):
    """A tilted coloured wall under a lamp, and nothing beside it."""
    scene = kuafu.Scene(device)
    wall = np.array([[-1, -9, 3], [9, -9, 1], [9, 9, 1], [-1, 9, 3]], np.float32)
    mesh = scene.add_mesh(wall, np.array([[0, 2, 1], [0, 3, 2]], np.uint32))
    scene.add_instance(mesh, [scene.add_material(kuafu.Material(base_color=(0.8, 0.4, 0.1, 1.0), specular=0.0))])
    scene.add_light(kuafu.Light(kind="point", intensity=(8.0, 8.0, 8.0)))
    return scene


@pytest.fixture(scope="module", params=["embree", "compute"])
def renderer(request, device):
    if request.param == "embree" and device.info.kind != "cpu":
        pytest.skip(f"Embree needs a CPU device, this is {device.info.name}")
    return kuafu.Renderer(device, tracer=request.param)


def encoded(radiance, exposure):
    light = np.clip((radiance * np.float32(exposure)).astype(np.float64), 0.0, 1.0)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.floor(255.0 * curve + 0.5).astype(np.uint8)


@pytest.mark.parametrize("exposure", [0.0, 0.7])
def test_bytes_are_the_curves(renderer, scene, exposure):
    images = renderer.render(
        scene, [CAMERA] * 2, ["srgb", "radiance"], band="visible", spp=2, scales={"srgb": exposure},
        optics={"psf_sigma_px": 0.6},
    )  # fmt: skip
    lit = images["radiance"] > 0
    assert lit.any() and not lit.all()
    assert images["srgb"].shape == (2, 23, 31, 4) and (images["srgb"][..., 3] == 255).all()
    chosen = exposure or rgb_exposure(images["radiance"])
    np.testing.assert_array_equal(images["srgb"][..., :3], encoded(images["radiance"], chosen))
    if not exposure:
        green = images["radiance"][:, ::2, ::2, 1]
        assert chosen * np.median(green[green > 0]) == pytest.approx(0.25, rel=0.01)


@pytest.mark.parametrize("light", [1e37, 3e37])
def test_light_near_the_largest_float_is_exposed_alike(renderer, device, light):
    """Above 2e37 by a factor that could be no smaller, so brighter than a quarter of white."""
    scene = kuafu.Scene(device)
    scene.set_environment((light, light, light), 0.0)
    images = renderer.render(scene, CAMERA, ["srgb", "radiance"], band="visible", spp=1, scales={"srgb": 0.0})
    assert images["radiance"].min() > 0.9 * light
    found = encoded(images["radiance"], rgb_exposure(images["radiance"]))
    np.testing.assert_array_equal(images["srgb"][..., :3], found)


@pytest.mark.parametrize("optics", [None, {"firefly_factor": 1.5, "vignetting_exponent": 4.0}])
def test_alone_it_is_the_same(renderer, scene, optics):
    """Where no radiance is asked for."""
    options = {"band": "visible", "spp": 2, "optics": optics}
    beside = renderer.render(scene, CAMERA, ["srgb", "radiance"], **options)["srgb"].copy()
    np.testing.assert_array_equal(renderer.render(scene, CAMERA, ["srgb"], **options)["srgb"], beside)


def test_what_it_is_not(renderer, scene):
    with pytest.raises(ValueError, match="KUAFU_OUTPUT_SRGB is of visible views"):
        renderer.render(scene, CAMERA, ["srgb"], spp=1)
    with pytest.raises(ValueError, match="must be KS_FORMAT_U8"):
        renderer.render(scene, CAMERA, {"srgb": np.float32}, band="visible", spp=1)
    buffer = kuafu.Buffer(scene.device, 31 * 23 * 4 + 2, host_visible=True)
    with pytest.raises(ValueError, match="multiples of 4"):
        renderer.render(scene, CAMERA, {"srgb": buffer.image(np.uint8, (1, 23, 31, 4), 2)}, band="visible", spp=1)
