# SPDX-License-Identifier: Apache-2.0
"""The bindings: what they refuse, how failures look, memory without copies, progress, and stubs that tell the truth."""

import ast
import gc
import os
import shutil
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest

import kuafu
import simsense
from depth_engines import depth_engine
from activestereo.common.pose import rigid_motion

TRIANGLE = np.array([[-1, -1, 2], [1, -1, 2], [0, 1, 2]], np.float32), np.array([[0, 1, 2]], np.uint32)
CAMERA = kuafu.Camera(16, 12, [[10, 0, 7.5], [0, 10, 5.5], [0, 0, 1]])


@pytest.fixture
def scene(device):
    scene = kuafu.Scene(device)
    material = scene.add_material(kuafu.Material(name="grey", base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0))
    scene.add_instance(scene.add_mesh(*TRIANGLE), [material], name="triangle")
    scene.set_environment((1.0, 1.0, 1.0))
    return scene


@pytest.fixture(scope="module")
def renderer(device):
    return kuafu.Renderer(device)


# ---- failures ----


@pytest.mark.parametrize("library", [kuafu, simsense])
def test_error_types(library):
    assert issubclass(library.Error, RuntimeError)
    assert issubclass(library.ArgumentError, library.Error) and issubclass(library.ArgumentError, ValueError)
    assert issubclass(library.FileError, library.Error) and issubclass(library.FileError, OSError)
    assert issubclass(library.MissingFileError, FileNotFoundError)
    assert issubclass(library.MissingFileError, library.FileError)


@pytest.mark.parametrize("library", [kuafu, simsense])
def test_unknown_devices(library):
    with pytest.raises(ValueError, match="auto, cpu, host"):
        library.Device("best")
    with pytest.raises(library.NoDeviceError, match="9999"):
        library.Device(9999)
    with pytest.raises(ValueError, match="16 bytes"):
        library.Device(b"short")


def test_device_by_index_and_by_uuid_is_the_same(device):
    info = device.info
    assert kuafu.Device(info.index).info.device_uuid == info.device_uuid
    assert kuafu.Device(info.device_uuid).info.name == info.name


def test_missing_file_is_file_not_found(scene, tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere.gltf"):
        scene.load(tmp_path / "nowhere.gltf")


@pytest.mark.parametrize("content", [b'{"asset": {', b"\xff\xfe\0" * 9], ids=["cut", "no text"])
def test_damaged_file_is_an_os_error_that_names_it(scene, tmp_path, content):
    path = tmp_path / "damaged.gltf"
    path.write_bytes(content)
    with pytest.raises(OSError, match="damaged.gltf") as caught:
        scene.load(path)
    assert isinstance(caught.value, kuafu.Error) and caught.value.status < 0
    assert scene.summary.instance_count == 1


def test_none_is_no_device():
    for make in (
        lambda: kuafu.Scene(None),
        lambda: kuafu.Renderer(None),
        lambda: kuafu.Buffer(None, 64),
        lambda: simsense.Buffer(None, 64),
        lambda: depth_engine((64, 48), 60, None),
    ):
        with pytest.raises((TypeError, ValueError)):
            make()


def test_wrong_arrays_are_refused(scene):
    positions, indices = TRIANGLE
    with pytest.raises(ValueError, match=r"\(3, 2\)"):
        scene.add_mesh(positions[:, :2], indices)
    with pytest.raises(ValueError):
        scene.add_mesh(positions, indices + 1)
    with pytest.raises(ValueError):
        scene.add_mesh(positions, indices, normals=positions[:2])
    with pytest.raises(ValueError):
        scene.add_texture(np.zeros((4, 4), np.complex64))


def test_unknown_names_are_refused(scene, renderer):
    with pytest.raises(TypeError, match="shininess"):
        kuafu.Material(shininess=1.0)
    with pytest.raises(ValueError, match="radiance, projector_direct"):
        renderer.render(scene, CAMERA, ["colour"])
    with pytest.raises(ValueError, match="infrared, visible"):
        renderer.render(scene, CAMERA, band="x-ray")
    with pytest.raises(ValueError, match="sequence of names"):
        renderer.render(scene, CAMERA, "radiance")


def test_engine_parameters_by_name():
    engine = depth_engine((64, 48), 60, p1=5, max_disparity=32)
    assert engine.parameters["p1"] == 5 and engine.parameters["p2"] == simsense.default_parameters()["p2"] == 32
    with pytest.raises(TypeError, match="p3"):
        engine.set_parameters(p3=1)
    with pytest.raises(ValueError, match="p1"):
        engine.set_parameters(p1=-1)
    with pytest.raises(ValueError, match="p1"):
        engine.set_parameters(p1=90)
    assert engine.parameters["p1"] == 5


# ---- records ----


def test_records_come_back_as_they_went_in(scene):
    told = {
        "name": "m", "base_color": (0.1, 0.2, 0.3, 1.0), "metallic": 0.25, "roughness": 0.5, "ior": 1.25,
        "ir_albedo": 0.75, "emission": (1, 2, 3), "thin_walled": True, "clearcoat": 0.5, "diffuse_transmission": 0.25,
        "diffuse_transmission_color": (0.5, 1, 0.75), "ir_diffuse_transmission_color": 0.875, "anisotropy": 0.5,
        "anisotropy_rotation_rad": 0.25, "sheen_color": (0.25, 0.5, 1), "sheen_roughness": 0.75, "iridescence": 1,
        "iridescence_thickness_nm": 300, "dispersion": 2,
        "sheen_color_texture": scene.add_texture(np.zeros((1, 1, 3), np.uint8)),
    }  # fmt: skip
    material = kuafu.Material(**told)
    untold = (
        "ir_ior subsurface_radius_m ior_texture clearcoat_roughness sheen_roughness_texture iridescence_ior specular"
    )
    back = scene.get_material(scene.add_material(material))
    for name in (*told, *untold.split(), "base_color_texture"):
        assert getattr(back, name) == getattr(material, name), name
    assert kuafu.Material().ir_albedo is None and kuafu.Material().normal_texture is None
    pose = rigid_motion((1, 2, 3))
    light = scene.get_light(scene.add_light(kuafu.Light(name="l", intensity=(1, 2, 3), light_to_world=pose)))
    assert light.kind == "point" and light.ir_intensity is None and light.environment is None and light.name == "l"
    np.testing.assert_array_equal(light.light_to_world, pose)


def test_dots_make_a_pattern_and_come_back(scene):
    dots = np.array([[3, 4, 1], [5.5, 6, 0.5]], np.float32)
    light = kuafu.Light(
        kind="projector", dots=dots, pattern_width=16, pattern_height=12, dot_sigma_px=0.8, pattern_scale=1.01
    )
    back = scene.get_light(scene.add_light(light))
    np.testing.assert_array_equal(back.dots, dots)
    assert (back.pattern_width, back.pattern_height, back.pattern_scale) == (16, 12, 1.01) and back.texture is None
    with pytest.raises(ValueError, match=r"need \(n, 3\)"):
        kuafu.Light(dots=np.zeros((4, 2)))


def test_fog_can_be_set_and_taken_away(device, scene, renderer):
    clear = renderer.render(scene, CAMERA, ["radiance"], band="visible", spp=4)["radiance"].mean()
    scene.set_medium(kuafu.Medium(extinction_per_m=(2.0,) * 3, bounds_min_m=(-9,) * 3, bounds_max_m=(9,) * 3))
    assert renderer.render(scene, CAMERA, ["radiance"], band="visible", spp=4)["radiance"].mean() < 0.1 * clear
    scene.set_medium(None)
    assert renderer.render(scene, CAMERA, ["radiance"], band="visible", spp=4)["radiance"].mean() == clear
    with pytest.raises(ValueError, match="phase_g is 2"):
        scene.set_medium(kuafu.Medium(extinction_per_m=(1,) * 3, phase_g=2))


def test_a_texture_can_be_set_again(scene):
    texture = scene.add_texture(np.zeros((4, 4), np.uint8))
    scene.set_texture(texture, np.ones((2, 3, 3), np.float32), srgb=True)
    with pytest.raises(ValueError, match="no texture 8"):  # as C counts
        scene.set_texture(7, np.zeros((4, 4), np.uint8))


# ---- rendering and memory ----


def test_what_is_removed_is_gone(scene, renderer, device):
    before = device.allocated_bytes
    texture = scene.add_texture(np.zeros((512, 512), np.uint8))
    material = scene.add_material(kuafu.Material(base_color_texture=texture))
    renderer.render(scene, CAMERA, spp=1)
    assert device.allocated_bytes > before + 512 * 512
    scene.remove_material(material)
    scene.remove_texture(texture)
    with pytest.raises(ValueError, match="was removed"):
        scene.get_material(material)
    with pytest.raises(ValueError, match="was removed"):
        scene.remove_texture(texture)


def test_render_gives_named_arrays(scene, renderer):
    images = renderer.render(
        scene, [CAMERA, CAMERA], ["radiance", "depth", "normal", "instance_id"], band="visible", spp=4
    )
    assert {name: (image.shape, image.dtype.name) for name, image in images.items()} == {
        "radiance": ((2, 12, 16, 3), "float32"),
        "depth": ((2, 12, 16, 1), "float32"),
        "normal": ((2, 12, 16, 3), "float32"),
        "instance_id": ((2, 12, 16, 1), "uint32"),
    }
    assert images["depth"][0, 6, 8, 0] == pytest.approx(2.0, rel=1e-6)
    assert images["radiance"][0, 6, 8] == pytest.approx([0.5] * 3, rel=0.01)
    assert scene.instance_name(int(images["instance_id"][0, 6, 8, 0])) == "triangle"
    assert renderer.stage_times and all(time >= 0 for time in renderer.stage_times.values())


def test_a_deformed_mesh_is_seen_where_it_went(scene, renderer):
    scene.update_mesh(0, TRIANGLE[0] * [1, 1, 1.5])
    assert renderer.render(scene, CAMERA, ["depth"], spp=1)["depth"][0, 6, 8, 0] == pytest.approx(3.0, rel=1e-6)
    with pytest.raises(ValueError):
        scene.update_mesh(0, TRIANGLE[0][:2])


def test_same_seed_same_bits(scene, renderer):
    first, again, other = (renderer.render(scene, CAMERA, spp=2, seed=seed)["radiance"].copy() for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_render_fills_a_given_buffer(scene, renderer, device):
    buffer = kuafu.Buffer(device, 2 * 16 * 12 * 4)
    image = buffer.image(np.float32, (1, 12, 16, 1), offset_bytes=16 * 12 * 4)
    result = renderer.render(scene, CAMERA, {"depth": image}, spp=1)["depth"]
    assert np.shares_memory(result, np.asarray(buffer))
    assert np.asarray(buffer).view(np.float32)[: 16 * 12].max() == 0.0
    assert result[0, 6, 8, 0] == pytest.approx(2.0, rel=1e-6)


def test_buffer_is_seen_without_a_copy(device):
    before = device.copied_bytes
    buffer = kuafu.Buffer(device, 64)
    np.asarray(buffer)[:4] = 1, 2, 3, 4
    assert list(buffer.image(np.uint8, (4,)).array()) == [1, 2, 3, 4]
    assert device.copied_bytes == before
    assert list(buffer.read(3)) == [1, 2, 3]
    buffer.write(np.array([9], np.uint8), 1)
    assert np.asarray(buffer)[1] == 9
    assert device.copied_bytes == before + 4


@pytest.mark.parametrize(
    "shape, offset", [((65,), 0), ((64,), 1), ((2**62, 4), 0), ((0,), 0), ((1,) * 6, 0), ((8,), 2**64 - 4)]
)
def test_image_outside_its_buffer_is_refused(device, shape, offset):
    with pytest.raises(ValueError):
        kuafu.Buffer(device, 64).image(np.uint8, shape, offset)


def test_descriptor_closes_its_file(device):
    if "export_opaque_fd" not in device.info.capabilities:
        pytest.skip(f"{device.info.name} cannot export memory as a file descriptor")
    buffer = kuafu.Buffer(device, 4096, exportable=True)
    with buffer.export("opaque_fd") as desc:
        handle = desc.handle
        os.fstat(handle)
    with pytest.raises(OSError):
        os.fstat(handle)
    open_before = len(os.listdir("/proc/self/fd"))
    for _ in range(10):
        buffer.export("opaque_fd")
    gc.collect()
    assert len(os.listdir("/proc/self/fd")) == open_before


# ---- progress ----


def test_progress_never_falls_and_its_exceptions_come_through(scene, renderer):
    seen = []
    renderer.render(scene, CAMERA, spp=8, progress=seen.append)
    assert seen and seen == sorted(seen) and 0.0 <= seen[0] and seen[-1] <= 1.0

    class Stop(Exception):
        pass

    def stop(fraction):
        raise Stop

    with pytest.raises(Stop):
        renderer.render(scene, CAMERA, spp=8, progress=stop)
    with pytest.raises(kuafu.CancelledError):
        renderer.render(scene, CAMERA, spp=8, progress=lambda fraction: True)
    renderer.render(scene, CAMERA, spp=1)


def test_a_scene_being_rendered_is_not_changed(scene, renderer):
    caught = []

    def meddle(fraction):
        try:
            scene.set_environment((0, 0, 0))
        except kuafu.Error as error:
            caught.append(error)

    renderer.render(scene, CAMERA, spp=4, progress=meddle)
    assert caught and "one thread at a time" in str(caught[0])
    scene.set_environment((0, 0, 0))


def test_objects_go_away(device):
    scene = kuafu.Scene(device)
    gone = weakref.ref(scene)
    del scene
    gc.collect()
    assert gone() is None


# ---- stubs ----


def native(library):
    """The extension module under a package."""
    return sys.modules[f"{library.__name__}._{library.__name__}"]


def test_stubs_and_modules_agree():
    mypy = shutil.which("stubtest")
    if mypy is None:
        pytest.skip("mypy is not installed: apt-get install mypy")
    if Path(mypy).parent != Path(sys.executable).parent:
        pytest.skip(f"{mypy} is another Python's than {sys.executable}, whose packages it cannot read")
    packages = str(Path(kuafu.__file__).parents[1])
    names = [native(library).__name__ for library in (kuafu, simsense)]
    known = ("--allowlist", Path(__file__).with_name("stubtest_allowlist.txt"), "--ignore-unused-allowlist")
    paths = {"PYTHONPATH": packages, "MYPYPATH": packages}
    result = subprocess.run([mypy, *names, "--concise", *known], capture_output=True, text=True, env=os.environ | paths)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("library", [kuafu, simsense])
def test_stub_names_what_the_module_has(library):
    folder = Path(library.__file__).parent
    assert (folder / "py.typed").exists()
    tree = ast.parse((folder / f"_{library.__name__}.pyi").read_text())
    typing_alone = "type_check_only"
    classes = {
        node.name: node
        for node in tree.body
        if isinstance(node, ast.ClassDef) and typing_alone not in map(ast.unparse, node.decorator_list)
    }
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    constants = {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)} - {"__version__"}
    in_python = {
        name
        for name in library.__all__
        if getattr(getattr(library, name), "__module__", "").count(".") and not hasattr(native(library), name)
    }
    assert set(classes) | functions | constants == set(library.__all__) - in_python
    for name, node in classes.items():
        kind = getattr(library, name)
        if issubclass(kind, Exception):
            continue
        stated = {n.name for n in node.body if isinstance(n, ast.FunctionDef)} | {
            n.target.id for n in node.body if isinstance(n, ast.AnnAssign)
        }
        present = {member for member in vars(kind) if not member.startswith("_")}
        assert {member for member in stated if not member.startswith("_")} == present, name


def test_activestereo_stub():
    import activestereo

    tree = ast.parse((Path(activestereo.__file__).parent / "__init__.pyi").read_text())
    imported = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    assert {alias.name for node in imported for alias in node.names} == set(activestereo.__all__)
    assert all(getattr(activestereo, name).__name__ == name for name in activestereo.__all__)
    assert set(activestereo.__all__) <= set(dir(activestereo))


def test_depth_can_be_stopped_within_a_pair():
    engine = depth_engine((320, 240), 300, simsense.Device("host", worker_count=1), max_disparity=64)
    image = np.random.default_rng(1).integers(0, 256, (240, 320), dtype=np.uint8)
    fractions = []

    def stop(fraction):
        fractions.append(fraction)
        if 0.3 < fraction < 1:
            raise KeyboardInterrupt

    expected = engine.compute(image, image)["depth"]
    with pytest.raises(KeyboardInterrupt):
        engine.compute(image, image, progress=stop)
    assert 0 <= min(fractions) < 0.3 and fractions == sorted(fractions)
    np.testing.assert_array_equal(engine.compute(image, image)["depth"], expected)


def test_cancel_reaches_a_compute_of_another_thread():
    pairs, shape = 400, (240, 320)
    engine = depth_engine(shape[::-1], 300, batch_count=pairs)
    images = np.random.default_rng(2).integers(0, 255, (pairs, *shape), dtype=np.uint8)
    begun, ended = threading.Event(), []

    def work():
        with pytest.raises(simsense.CancelledError):
            engine.compute(images, images, ["disparity"], progress=lambda _: begun.set())
        ended.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    assert begun.wait(60)
    engine.cancel()
    thread.join(60)
    assert ended


def test_a_submission_gives_what_compute_gives():
    """On the CPU device, by either back end, from and into device buffers."""
    device, size = simsense.Device("cpu"), (64, 48)
    light = np.random.default_rng(2).integers(0, 256, (48, 68), dtype=np.uint8)
    sides = np.ascontiguousarray(np.stack([light[:, :64], light[:, 4:]]))
    buffer = simsense.Buffer(device, sides.nbytes + 4 * 48 * 64)
    buffer.write(sides.tobytes())
    left, right, depth = (
        buffer.image(t, (48, 64), n * 48 * 64) for n, t in enumerate((np.uint8, np.uint8, np.float32))
    )
    for back_end in ("cpu", "vulkan"):
        engine = depth_engine(size, 60, device, max_disparity=16, back_end=back_end)
        expected = engine.compute(sides[0], sides[1])["depth"]
        submission = engine.submit(left, right, {"depth": depth})
        with pytest.raises(ValueError, match="timeout_s"):
            submission.wait(timeout_s=-1)
        if back_end == "vulkan":
            with pytest.raises(TimeoutError, match="goes on"):
                submission.wait(timeout_s=0)
        assert submission.wait()["depth"] is depth is submission.wait(timeout_s=0)["depth"]
        np.testing.assert_array_equal(depth.array(), expected)
        assert (expected > 0).mean() > 0.5
    with pytest.raises(ValueError, match="known: auto, cpu, vulkan"):
        depth_engine(size, 60, device, back_end="gpu")
    with pytest.raises(simsense.Error, match="back_end is vulkan"):
        depth_engine(size, 60, "host", back_end="vulkan")
