# SPDX-License-Identifier: Apache-2.0
"""Interpreters and threads end in any order; values that make no image are refused; scenes hold what was added."""

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import kuafu
from sensor_scenes import lit_triangle

K = np.array([[60, 0, 32], [0, 60, 32], [0, 0, 1.0]])
TRIANGLE = np.array([[-9, -9, 2], [9, -9, 2], [0, 9, 2]], np.float32)
PROGRAM = """
import sys, threading, time
import numpy as np
import kuafu
device = kuafu.Device("cpu")
scene = kuafu.Scene(device)
mesh = scene.add_mesh(np.array([[-9, -9, 2], [9, -9, 2], [0, 9, 2]], np.float32), np.array([[0, 1, 2]]))
scene.add_instance(mesh)
scene.set_environment((1, 1, 1))
camera = kuafu.Camera(64, 64, np.array([[60, 0, 32], [0, 60, 32], [0, 0, 1.0]]))
renderer = kuafu.Renderer(device, tracer=sys.argv[1])
renderer.render(scene, camera, spp=1)
threading.Thread(target=lambda: renderer.render(scene, camera, spp=10**8, progress=lambda f: None), daemon=True).start()
time.sleep(0.5)
"""


@pytest.mark.parametrize("tracer", ["embree", "compute"])
def test_a_daemon_thread_that_renders_ends_in_silence(tracer):
    command = [sys.executable, "-c", PROGRAM, tracer]
    result = subprocess.run(command, capture_output=True, text=True, timeout=200)
    assert (result.returncode, result.stderr) == (0, "")


def test_what_a_file_has_and_kuafu_ignores_is_said(device, tmp_path, caplog):
    path = tmp_path / "a.obj"
    path.write_text("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with caplog.at_level(logging.WARNING):
        kuafu.Scene(kuafu.Device("cpu")).load(path)
    assert [r.name for r in caplog.records] == ["kuafu"] * len(caplog.records)
    assert any("gone.mtl" in r.getMessage() for r in caplog.records)
    heard = []
    kuafu.Scene(kuafu.Device("cpu", log=lambda level, text: heard.append((level, text)))).load(path)
    assert any(level == 1 and "gone.mtl" in text for level, text in heard), "a log of one's own hears it instead"


@pytest.mark.parametrize(
    "wrong", [[[0, 1, 2**32]], [[0.5, 1, 2]], [[-1, 1, 2]], [[0, 1, float("nan")]], [[2**64, 0, 0]]]
)
def test_indices_are_not_cut_or_wrapped(device, wrong):
    with pytest.raises(ValueError):
        kuafu.Scene(device).add_mesh(TRIANGLE, wrong)


def test_indices_of_any_whole_type_are_taken(device):
    for kind in (np.int8, np.uint16, np.int64, np.uint64):
        kuafu.Scene(device).add_mesh(TRIANGLE, np.array([[0, 1, 2]], kind))


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("distortion", {"distortion": (1e7, 0, 0, 0, 0, 0, 0, 0)}),
        ("distortion", {"distortion": (1e300, 0, 0, 0, 0, 0, 0, 0)}),
        ("psf_corner_sigma_px", {"optics": {"psf_corner_sigma_px": 1e-20}}),
        ("psf_sigma_px", {"optics": {"psf_sigma_px": 9e-7}}),
    ],
)
def test_values_that_made_images_of_nan_are_refused(device, what, change):
    optics = change.pop("optics", None)
    camera = kuafu.Camera(64, 64, K, **change)
    with pytest.raises(ValueError, match=what):
        kuafu.Renderer(device).render(lit_triangle(device), camera, spp=1, optics=optics)


@pytest.mark.parametrize("bound", [1e12, 1e300])
def test_a_medium_beyond_all_measure_is_refused(device, bound):
    with pytest.raises(ValueError, match="bound"):
        medium = kuafu.Medium(extinction_per_m=(1,) * 3, bounds_min_m=(-bound,) * 3, bounds_max_m=(bound,) * 3)
        lit_triangle(device).set_medium(medium)


def test_the_least_and_largest_values_give_finite_images(device):
    scene = lit_triangle(device)
    scene.set_medium(kuafu.Medium(extinction_per_m=(1e-12,) * 3, bounds_min_m=(-1e9,) * 3, bounds_max_m=(1e9,) * 3))
    optics = {"psf_sigma_px": 1e-6, "psf_corner_sigma_px": 1e-6}
    image = kuafu.Renderer(device).render(scene, kuafu.Camera(64, 64, K), spp=1, optics=optics)["radiance"]
    assert np.isfinite(image).all()
    assert image.max() > 0


def sleeping_helper(folder: Path) -> Path:
    """A folder with a program in the place of kuafu's reader, which never answers, and a scene file."""
    program = folder / "kuafu-import-gltf"
    program.write_text("#!/bin/sh\nexec sleep 600\n")
    program.chmod(0o755)
    (folder / "a.gltf").write_text("{}")
    return folder


def test_ctrl_c_ends_a_load(tmp_path: Path) -> None:
    folder = sleeping_helper(tmp_path)
    program = f"""
import os, signal, threading, kuafu
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells let background jobs ignore it
os.environ["KUAFU_HELPERS"] = {str(folder)!r}
scene = kuafu.Scene(kuafu.Device("cpu"))
threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    scene.load({str(folder / "a.gltf")!r})
except KeyboardInterrupt:
    scene.set_environment((1, 1, 1))
    print("interrupted")
"""
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=200)
    assert (said.returncode, said.stdout, said.stderr) == (0, "interrupted\n", "")


def test_meshes_textures_and_instances_come_back_as_they_were_added(device):
    scene = kuafu.Scene(device)
    mesh = {
        "positions": np.arange(12, dtype=np.float32).reshape(4, 3),
        "indices": np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        "normals": np.tile(np.float32([0, 0, 1]), (4, 1)),
        "uvs": np.arange(8, dtype=np.float32).reshape(4, 2),
        "slots": np.array([0, 1], np.uint32),
        "name": "m",
        "uvs_1": None,
        "colors": np.full((4, 4), 0.5, np.float32),
    }
    texture = {"texels": np.arange(12, dtype=np.uint16).reshape(2, 2, 3), "srgb": False, "name": "t"}
    texture |= {"wrap": ("clamp", "mirror"), "filter": "nearest", "uv_set": 1}
    texture["uv_transform"] = np.float32([[1, 0, 0.5], [0, 2, 0]])
    pose = np.diag([1.0, 2.0, 3.0, 1.0])
    number = scene.add_mesh(**mesh)
    instance = {"mesh": number, "materials": [scene.add_material(kuafu.Material())], "local_to_world": pose}
    instance |= {"environment": 3, "semantic_id": 5, "name": "i"}
    for back, given in (
        (scene.get_mesh(number), mesh),
        (scene.get_texture(scene.add_texture(**texture)), texture),
        (scene.get_instance(scene.add_instance(**instance)), instance),
    ):
        assert back.keys() == given.keys()
        for key, value in given.items():
            np.testing.assert_array_equal(back[key], value, err_msg=key)
            assert getattr(back[key], "dtype", None) == getattr(value, "dtype", None), key
    with pytest.raises(kuafu.ArgumentError, match="there is no mesh"):
        scene.get_mesh(99)
