# SPDX-License-Identifier: Apache-2.0
"""GBufferStereo: the path tracer as the truth, environments, causes, and bad input."""

import sys
from functools import cache
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import kuafu
from activestereo import GBufferStereo, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.common.pose import body_pose, look_at
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.sensor.gbuffer.cause import CAUSES
from activestereo.sensor.gbuffer.stereo import InputImages
from cuda_stub import seen_by_host, stub_for
from sensor_scenes import light_of, with_depth

FACING = np.array([0.0, 0.0, -1.0])


def small():
    config = StereoDepthSensorConfig("D435").resized(160, 120)
    config.ir_exposure_mode = "fixed"
    return config


@pytest.fixture
def config():
    return small()


@pytest.fixture(scope="module")
def made():
    """A function: the sensor of small() of that many environments. Software renderers compile for a second each."""
    return cache(lambda environments: GBufferStereo(small(), environments))


@pytest.fixture
def sensor(made, config):
    made(1).restart(config.noise_seed)
    return made(1)


def wall(config, depth_m, environments=1):
    """Depth, normal and albedo of walls that face the camera."""
    width, height = config.ir_resolution
    depth = np.broadcast_to(np.reshape(depth_m, (-1, 1, 1)), (environments, height, width)).astype(np.float32)
    return {"depth": depth, "normal": np.broadcast_to(FACING, (*depth.shape, 3)), "albedo": np.full(depth.shape, 0.5)}


def test_depth_of_walls_is_right_in_every_environment_and_again_under_the_same_seed(config):
    truth = np.array([0.4, 0.7, 1.1])
    config.subpixel = "equiangular"  # the D435's own draws disparities of dots below a pixel to whole pixels
    sensor = GBufferStereo(config, environments=3)
    given = wall(config, truth, 3)
    out = sensor(**given)
    for n, depth in enumerate(truth):
        assert out["valid"][n].mean() > 0.6
        disparity = config.focal_baseline_px_m / depth
        assert np.median(out["disparity"][n][out["valid"][n]]) == pytest.approx(disparity, abs=0.2)
    assert out["ir_left"].shape == out["cause"].shape == (3, 120, 160)
    sensor(**given)
    sensor.restart(config.noise_seed)
    again = sensor(**given)
    for name, image in out.items():
        np.testing.assert_array_equal(image, again[name], err_msg=name)


def test_an_environment_has_the_same_bits_at_any_place_under_its_seed(config, made):
    given, first = wall(config, [0.4, 0.7], 2), made(2)
    first.restart([5, 9])
    outs = [first(**given)]
    first.restart([9, 5])
    outs.append(first(**{name: image[::-1] for name, image in given.items()}))
    for name, image in outs[0].items():
        np.testing.assert_array_equal(image, outs[1][name][::-1], err_msg=name)
    first.restart([5, 6])
    again = first(**given)["ir_left"]
    np.testing.assert_array_equal(again[0], outs[0]["ir_left"][0])
    assert (again[1] != outs[0]["ir_left"][1]).mean() > 0.1
    with pytest.raises(ValueError, match="3 seeds for 2 environments"):
        first.restart([1, 2, 3])


@pytest.mark.parametrize("seed", [np.int64(5), np.uint8(5), np.array(5), [5], (np.int64(5),), np.array([5])])
def test_a_seed_of_numpy_is_a_seed(config, sensor, seed):
    given, found = wall(config, 0.6), []
    for one in (5, seed):
        sensor.restart(one)
        found.append(sensor(**given, outputs=("ir_left",))["ir_left"])
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("seed", [2**64, -1, 1.5, "5", None, True, np.int64(-3), [2**64], [None]])
def test_a_seed_that_is_none_is_told_with_seeds_that_are(sensor, seed):
    with pytest.raises(ValueError, match=f"the seed .*expected .*0 to {2**64 - 1}"):
        sensor.restart(seed)
    sensor.restart(2**64 - 1)


@pytest.mark.parametrize("right", [3, "depth", np.zeros((1, 120, 160)), [np.zeros((1, 120, 160))]])
def test_images_of_the_right_camera_are_a_mapping(config, sensor, right):
    with pytest.raises(ValueError, match="right is .*, expected a mapping of its images: depth"):
        sensor(**wall(config, 0.6), right=right)


def test_a_misspelt_right_image_is_refused(config, sensor):
    given = wall(config, 0.6)
    with pytest.raises(ValueError, match="unknown right image 'normals' .*did you mean 'normal'"):
        sensor(**given, right=given | {"normals": given["depth"]})


def test_what_is_found_on_cuda_has_the_bits_of_the_hosts(config, monkeypatch, stub_cuda):
    device = kuafu.Device("cpu")
    stub_for(device, stub_cuda, monkeypatch)
    given, names = wall(config, [0.4, 0.7], 2), ("depth", "disparity", "ir_left", "ir_right")
    host = GBufferStereo(config, 2, device=device)(**given)
    sensor = GBufferStereo(config, 2, device=device, on_cuda=True)
    out = sensor(**given)
    assert tuple(out) == names
    for name in names:
        np.testing.assert_array_equal(seen_by_host(out[name]), host[name], err_msg=name)
    with pytest.raises(ValueError, match="unknown output 'cause'"):
        sensor(**given, outputs=("cause",))


def test_a_call_inside_of_a_captured_cuda_graph_is_refused(config, monkeypatch):
    """A stand-in of torch tells of a capture; nothing was copied or computed then."""

    class Torch(ModuleType):
        cuda = SimpleNamespace(is_available=lambda: True, is_current_stream_capturing=lambda: True)

    class Tensor(np.ndarray):
        is_cuda = True

    monkeypatch.setitem(sys.modules, "torch", Torch("torch"))
    monkeypatch.setattr(InputImages, "put", lambda *_: pytest.fail("copied"))
    given = wall(config, 0.7)
    with pytest.raises(RuntimeError, match="a CUDA graph is being captured.*before or after the graph's replay"):
        GBufferStereo(config)(**given | {"depth": given["depth"].view(Tensor)})


def test_depth_along_rays_is_what_planar_depth_is(config, sensor):
    given = wall(config, 0.8)
    v, u = np.indices(given["depth"].shape[1:])
    k = sensor.k
    along = np.sqrt(((u - k[0, 2]) / k[0, 0]) ** 2 + ((v - k[1, 2]) / k[1, 1]) ** 2 + 1.0)
    ray = given | {"depth": given["depth"] * along}
    a = sensor(**given)
    sensor.restart(config.noise_seed)
    b = sensor(**ray, depth_kind="ray")
    np.testing.assert_allclose(a["disparity"], b["disparity"], atol=1e-3)


@pytest.fixture(scope="module")
def traced():
    """(sensor, its left camera's G-buffers, materials, GBufferStereo's result): matt things and steel on a table."""
    config = StereoDepthSensorConfig("D435").scaled(0.4)
    config.samples_per_pixel, config.ir_exposure_mode = 16, "fixed"
    scene = kuafu.Scene(kuafu.Device())
    bodies, materials = Bodies(scene, 1), {}

    def put(name, mesh, half_m, place, **looks):
        number = scene.add_material(kuafu.Material(**looks))
        materials[number] = scene.get_material(number)
        bodies.add(name, [Shape(mesh, [number], np.diag([*half_m, 1.0]))], pose=[*place, 1, 0, 0, 0])

    matt = {"specular": 0.0, "roughness": 1.0}
    box, ball = add_mesh(scene, solids.box()), add_mesh(scene, solids.sphere())
    put("table", box, (1, 1, 0.02), (0, 0, -0.02), base_color=(0.3, 0.3, 0.3, 1), **matt)
    put("box", box, (0.06, 0.06, 0.1), (0, 0.15, 0.1), base_color=(0.6, 0.6, 0.6, 1), **matt)
    put("steel", ball, (0.08,) * 3, (0, -0.12, 0.08), base_color=(0.7, 0.7, 0.7, 1), metallic=1.0, roughness=0.2)
    pose = body_pose(look_at((-0.6, 0, 0.6), (0, 0, 0), (0, 0, 1)))
    sensor = with_depth(StereoDepthSensor(config, scene, pose=pose), infrared_only=True)
    images = {name: sensor.get_picture(name, "left") for name in ("depth", "normal", "albedo", "material_id")}
    to_camera = np.linalg.inv(np.array(sensor.ir_cameras()[0].camera_to_world))[:3, :3]
    number = images["material_id"][..., 0].astype(np.int64)
    number[images["depth"][..., 0] == 0.0] = min(materials)
    given = {"depth": images["depth"][..., 0], "normal": images["normal"] @ to_camera.T, "material": number}
    return sensor, given, materials, GBufferStereo(sensor.get_config(), materials=materials)(**given)


def test_matt_things_are_measured_as_the_path_tracer_measures_them(traced):
    """In units of what two pictures of the same light with other noise differ by."""
    sensor, given, materials, out = traced
    pair, lasers = light_of(sensor)
    other = sensor.compute_depth_from(*pair, *lasers, frame_index=9)["disparity"]
    truth, found = sensor.get_disparity(), out["disparity"][0]
    matt = np.isin(given["material"], sorted(materials)[:2]) & (given["depth"] > 0)
    valid = matt & (truth > 0) & (found > 0) & (other > 0)
    assert valid.sum() > 0.8 * matt.sum()
    assert np.median(np.abs(found - truth)[valid]) < 1.5 * np.median(np.abs(other - truth)[valid])
    assert abs(np.median((found - truth)[valid])) < 0.03
    own, light = (np.asarray(image, float)[matt].mean() for image in (out["ir_left"][0], sensor.get_ir_measured()[0]))
    assert own == pytest.approx(light, rel=0.15)  # what things reflect onto one another is missing


def test_holes_have_causes_and_only_holes_of_g_buffers_and_of_the_traced_sensor(traced):
    """Both say the same of all that both measure or both miss."""
    sensor, given, _, out = traced
    other, measured = out["cause"][0], CAUSES.index("measured")
    np.testing.assert_array_equal(other == measured, out["valid"][0])
    holes = (given["depth"] > 0) & ~out["valid"][0]
    assert holes.sum() > 300 and (other[holes] != CAUSES.index("checks")).mean() > 0.95
    cause, valid = sensor.get_depth_map("cause"), sensor.get_disparity() > 0
    assert cause.shape == valid.shape and cause.dtype == np.uint8 and measured not in cause[~valid]
    assert (cause == measured)[valid].mean() > 0.99  # a disparity may be of no depth in range
    both = ~valid & (other != measured)
    assert both.sum() > 300 and (cause == other)[both].mean() > 0.8


def test_what_removes_a_cause_restores_the_pixel(config, made):
    """A wall too near, one without light and one that is not there."""
    given, sensor = wall(config, [0.05, 0.8, 0.0], 3), made(3)
    cause = sensor(**given, laser_power=[1.0, 0.0, 1.0], ambient=0.0)["cause"][:, 60, 100]
    assert [CAUSES[n] for n in cause] == ["out_of_range", "too_dark", "nothing"]
    given["depth"] = np.full_like(given["depth"], 0.8)
    assert sensor(**given)["valid"][:, 60, 100].all()


def test_the_band_that_the_other_camera_does_not_see_whole_is_outside(config, sensor):
    """A wall's point lies f B / z further left in the right image; half a census window beside it has to be there."""
    depth_m = 0.7
    cause = sensor(**wall(config, depth_m))["cause"][0]
    border = config.focal_baseline_px_m / depth_m + config.census_width // 2
    holes = cause != CAUSES.index("measured")
    band = holes & (np.arange(cause.shape[1]) < border)
    assert band.sum() > 0.4 * border * len(cause)
    assert (cause[band] == CAUSES.index("outside")).all()
    assert not (cause[:, int(np.ceil(border)) :] == CAUSES.index("outside")).any()


def test_holes_about_a_thing_are_named_by_it_and_go_with_it(config):
    """A plate at 0.45 m before a wall at 0.9 m: what is missing of the wall is hidden, shaded or beside the plate."""
    config.projector_intensity *= 2.0  # in small images the wall is close to noise
    given, sensor = wall(config, 0.9), GBufferStereo(config)
    alone = sensor(**given)["valid"][0]
    given["depth"] = given["depth"].copy()
    given["depth"][:, 45:75, 70:110] = 0.45
    sensor.restart(config.noise_seed)
    out = sensor(**given)
    cause, is_wall = out["cause"][0], given["depth"][0] == np.float32(0.9)
    named = is_wall & np.isin(cause, [CAUSES.index(name) for name in ("occluded", "shadow", "edge")])
    caused = is_wall & alone & ~out["valid"][0]
    caused[:30] = caused[90:] = False  # where the image is dark, the plate's light decides
    assert caused.sum() > 100 and named[caused].mean() > 0.9
    assert alone[named].mean() > 0.9


def test_supersampled_images_are_of_input_shape_with_k(config):
    sensor = GBufferStereo(config, supersampling=2)
    assert (sensor.shape, sensor.input_shape) == ((1, 120, 160), (1, 240, 320))
    fine = GBufferStereo(config.scaled(2))
    np.testing.assert_allclose(sensor.k, fine.k)
    out = sensor(**wall(config.scaled(2), 0.6))
    assert all(image.shape == sensor.shape for image in out.values())
    assert np.median(out["depth"][out["valid"]]) == pytest.approx(0.6, rel=0.01)
    with pytest.raises(
        ValueError, match=r"depth is \[1, 120, 160\], expected \[1, 240, 320\]: input_shape of the sensor"
    ):
        sensor(**wall(config, 0.6))
    with pytest.raises(ValueError, match="supersampling is 5, expected .*1 to 4"):
        GBufferStereo(config, supersampling=5)


def test_what_does_not_go_together_is_told(config, made):
    sensor, given = made(2), wall(config, [0.5, 0.5], 2)
    with pytest.raises(ValueError, match=r"depth is \[2, 120\], expected \[2, 120, 160\]"):
        sensor(**given | {"depth": given["depth"][..., 0]})
    with pytest.raises(ValueError, match="unknown depth_kind 'planer'.*did you mean 'planar'"):
        sensor(**given, depth_kind="planer")
    with pytest.raises(ValueError, match="depth is missing: give it in metres"):
        sensor(**given | {"depth": None})
    with pytest.raises(ValueError, match="material is missing: give each pixel's number, here of 7, or make"):
        GBufferStereo(config, 2, materials={7: kuafu.Material()})(**given)
    for key in ("wood", 1.5):
        with pytest.raises(TypeError, match=f"materials has the key '?{key}'?: the materials' numbers are whole"):
            GBufferStereo(config, materials={key: kuafu.Material()})
    with pytest.raises(TypeError, match="output is 'depth', expected a sequence of names"):
        sensor(**given, outputs="depth")
    with pytest.raises(ValueError, match="made without materials="):
        sensor(**given, material=np.zeros((2, 120, 160), int))
    with pytest.raises(ValueError, match="laser_power of environment 1 is -1"):
        sensor(**given, laser_power=[1.0, -1.0])
    with pytest.raises(ValueError, match="environment 0, pixel .*: material is 3, expected a number of materials"):
        GBufferStereo(config, 2, materials=[kuafu.Material()])(**given, material=np.full((2, 120, 160), 3))
    config.ir_distortion = (0.1, 0, 0, 0, 0)
    with pytest.raises(ValueError, match="pinhole"):
        GBufferStereo(config)


@pytest.mark.parametrize(("bad", "is_refused"), [(0.4, False), (0.75, True)])
def test_normals_in_other_axes_are_refused(config, sensor, bad, is_refused):
    """They are in OpenGL's axes. Where the camera sees a part of the surfaces from behind, kuafu turns the normals."""
    given = {name: np.array(image) for name, image in wall(config, 0.6).items()}
    given["normal"][:, : int(bad * 120), :, 1:] *= -1.0
    if not is_refused:
        assert sensor(**given, outputs=("valid",))["valid"].any()
        return
    with pytest.raises(ValueError, match="normal faces away from the camera at 75 % .*OpenGL"):
        sensor(**given)
    with pytest.raises(ValueError, match="right normal faces away"):
        sensor(**wall(config, 0.6), right=given)


def test_views_and_what_speaks_dlpack_give_the_bits_of_arrays(config, made):
    class Foreign:
        """An array of a package that shares memory by DLPack alone."""

        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **asked):
            return self.array.__dlpack__(**asked)

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    given = {name: np.array(image) for name, image in wall(config, [0.4, 0.7], 2).items()}
    strided = {name: np.repeat(image, 2, axis=2)[:, :, ::2] for name, image in given.items()}
    sensor, found = made(2), []
    for same in (given, strided, {name: Foreign(image) for name, image in strided.items()}):
        sensor.restart(1)
        found.append(sensor(**same, outputs=("ir_left",))["ir_left"])
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_array_equal(found[2], found[0])


def test_a_refused_call_takes_no_frame(config, sensor):
    given = wall(config, 0.6)
    with pytest.raises(ValueError, match=r"environment 0, pixel \(0, 0\): depth is nan"):
        sensor(**given | {"depth": np.full(sensor.shape, np.nan)})
    slope = np.broadcast_to(np.linspace(800.0, 900.0, sensor.shape[2]), sensor.shape)
    with pytest.raises(ValueError, match="depth begins at 800 m: is it in millimetres"):
        sensor(**given | {"depth": slope.astype(np.uint16)})
    with pytest.raises(ValueError, match="projector begins at 800 m: is it in millimetres"):
        sensor(**given, projector=slope)
    with pytest.raises(TypeError, match="depth is of object, expected numbers"):
        sensor(**given | {"depth": given["depth"].astype(object)})
    out = sensor(**given, outputs=("ir_left",))["ir_left"]
    sensor.restart(config.noise_seed)
    np.testing.assert_array_equal(out, sensor(**given, outputs=("ir_left",))["ir_left"])


def test_what_has_no_surface_needs_no_material(config):
    """A simulator's number of nothing, as -1, is none of the materials."""
    sensor = GBufferStereo(config, materials={3: kuafu.Material(ir_albedo=0.5)})
    depth, material = np.full(sensor.shape, 0.8), np.full(sensor.shape, 3)
    depth[:, :20], material[:, :20] = 0.0, -1
    out = sensor(depth=depth, material=material)
    assert out["valid"][:, 40:].mean() > 0.5
    with pytest.raises(ValueError, match=r"pixel \(0, 0\): material is -1, expected a number of materials \[3\]"):
        sensor(depth=np.full(sensor.shape, 0.8), material=material)
