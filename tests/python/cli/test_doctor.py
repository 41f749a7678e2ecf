# SPDX-License-Identifier: Apache-2.0
"""The command doctor: the failures of a Vulkan set-up are provoked, named, and told with the line that mends them."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import kuafu
import pytest
import simsense

from activestereo.cli import doctor as doctor_module, main

DEVICELESS = Path("/usr/share/vulkan/icd.d/intel_icd.x86_64.json")


def doctor(**changes):
    """(exit status, what it says in JSON) under changed variables of the environment."""
    command = [sys.executable, "-m", "activestereo", "doctor", "--json"]
    environment = {name: value for name, value in os.environ.items() if name not in ("VK_DRIVER_FILES",)}
    environment |= {name: str(value) for name, value in changes.items()}
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    assert "Traceback" not in result.stderr, result.stderr
    return result.returncode, json.loads(result.stdout)


def assert_named(told, name, seen, remedy):
    status, found = told
    (problem,) = (p for p in found["problems"] if p["name"] == name)
    assert status == 1 and seen in problem["seen"] and remedy in problem["remedy"], problem


def test_a_machine_that_renders(device, capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(doctor_module, "RENDER_NODES", tmp_path)
    monkeypatch.setenv("ACTIVESTEREO_CACHE", str(tmp_path))
    main(["doctor"])
    said = " ".join(capsys.readouterr().out.split())  # lines break where a path's length has it
    assert f"matches on: {simsense.Device(device).info.name}; recorded pairs on the CPU" in said
    assert f"renders on: {device.info.name}" in said and "GiB; can: " in said and f"of 2 GB in {tmp_path}" in said
    _, found = doctor(ACTIVESTEREO_CACHE=tmp_path)
    assert found["renders_on"] == device.info.name and found["memory_free_bytes"] > 1e8
    assert any(entry["usable"] for entry in found["devices"])
    assert Path(found["blas"]).is_file() and f"matrices: {found['blas']}" in said
    assert set(found["packages"]) >= {"cv2", "mujoco", "pxr"} and found["cache"]["used_bytes"] == 0


def test_each_optional_package_has_its_extra():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    assert set(doctor_module.PACKAGES.values()) <= set(project["optional-dependencies"])
    assert {"mujoco", "trimesh"} <= set(doctor_module.PACKAGES)


def test_a_slow_reference_of_matrix_products_is_told():
    assert doctor_module.is_reference("/usr/lib/x86_64-linux-gnu/blas/libblas.so.3.11.0")
    assert not any(map(doctor_module.is_reference, ("/usr/lib/libopenblasp-r0.3.21.so", None)))


def test_no_loader(tmp_path):
    for name in ("libvulkan.so.1", "libvulkan.so"):
        (tmp_path / name).write_bytes(b"no library")
    told = doctor(LD_LIBRARY_PATH=tmp_path)
    assert_named(told, "no loader", "libvulkan.so.1", "apt install libvulkan1")
    assert told[1]["renders_on"] is None and told[1]["devices"] == [] and "host" in told[1]["matches_on"]


def test_no_driver(tmp_path):
    assert_named(doctor(VK_DRIVER_FILES="/none.json"), "no driver", "VK_DRIVER_FILES", "unset VK_DRIVER_FILES")


@pytest.mark.skipif(any(Path("/dev/dri").glob("renderD*")), reason="a GPU is there, which the driver may find")
@pytest.mark.skipif(not DEVICELESS.is_file(), reason="Debian's mesa-vulkan-drivers is not installed")
def test_a_driver_without_a_device():
    told = doctor(VK_DRIVER_FILES=DEVICELESS, VK_ICD_FILENAMES=DEVICELESS)
    assert_named(told, "no device", DEVICELESS.name, "apt install")


def test_a_device_that_is_listed_and_cannot_be_opened(device, monkeypatch, capsys):
    class Lost:
        enumerate = kuafu.Device.enumerate

        def __init__(self):
            raise RuntimeError("lost")

    monkeypatch.setattr("kuafu.Device", Lost)
    main(["doctor", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["renders_on"] is None and found["devices"][0]["name"] == device.info.name


# A driver that opens libraries itself, and refuses to work without them.
OPENING = """#include <dlfcn.h>
int vk_icdNegotiateLoaderICDInterfaceVersion(unsigned *version) {
  void *a = dlopen("libEGL.so.99", RTLD_LAZY), *b = dlopen("libother.so.99", RTLD_LAZY);
  return a && b ? 0 : -3;
}"""


def made_driver(folder, links=(), source=""):
    """The manifest of a driver whose libraries vanish. links: {name: libraries gone behind it, None: gone itself}."""

    def compiled(output, *more, text=""):
        (folder / "source.c").write_text(text)
        linked = f"-Wl,-soname,{output},--no-as-needed,-rpath,$ORIGIN,--allow-shlib-undefined"
        command = ["cc", "-shared", "-fPIC", linked, "source.c", "-o", output, *more]
        subprocess.run(command, cwd=folder, check=True)

    for name in links:
        for other in links[name] or ():
            compiled(other)
        compiled(name, *(links[name] or ()))
    compiled("driver.so", *links, text=source)
    for name, others in dict(links).items():
        for gone in others or [name]:
            (folder / gone).unlink()
    manifest = folder / "icd.json"
    manifest.write_text(json.dumps({"ICD": {"library_path": "./driver.so", "api_version": "1.3.0"}}))
    return manifest


@pytest.mark.parametrize(
    ("links", "source", "seen", "remedy"),
    [
        ({"libXext.so.99": None}, "", "icd.json needs libXext.so.99, which is not there", "apt install libxext6"),
        ({"libX11.so.99": None, "libGLdispatch.so.99": None}, "",
         "needs libX11.so.99, libGLdispatch.so.99, which are not", "apt install libx11-6 libglvnd0"),
        ({"libmiddle.so.1": ["libxcb.so.99", "libunknown.so.99"]}, "",
         "needs libxcb.so.99, libunknown.so.99, which are not there",
         "apt install libxcb1; install the package that has libunknown.so.99"),
        ({}, OPENING, "needs libEGL.so.99, libother.so.99, which are not there",
         "apt install libegl1; install the package that has libother.so.99"),
    ],
    ids=["one", "two", "behind another", "opened by the driver itself"],
)  # fmt: skip
def test_all_libraries_that_a_driver_needs_and_misses_are_named(tmp_path, links, source, seen, remedy):
    manifest = made_driver(tmp_path, links, source)
    told = doctor(VK_DRIVER_FILES=manifest, VK_ICD_FILENAMES=manifest)
    assert_named(told, "library missing", seen, remedy)


def test_a_driver_that_is_not_there(tmp_path):
    manifest = made_driver(tmp_path)
    (tmp_path / "driver.so").unlink()
    told = doctor(VK_DRIVER_FILES=manifest, VK_ICD_FILENAMES=manifest)
    assert_named(told, "driver missing", "driver.so: cannot open", "apt install --reinstall mesa-vulkan-drivers")


def test_a_container_without_the_graphics_capability(stub_cuda, tmp_path):
    (tmp_path / "libcuda.so.1").symlink_to(stub_cuda)
    (tmp_path / "libGLX_nvidia.so.0").write_bytes(b"no library")
    told = doctor(LD_LIBRARY_PATH=tmp_path)
    assert_named(told, "no graphics capability", "libGLX_nvidia.so.0", "NVIDIA_DRIVER_CAPABILITIES=all")


def test_no_permission_on_the_render_node(tmp_path, monkeypatch, capsys):
    node = tmp_path / "renderD128"
    node.touch()
    may_open = os.access
    monkeypatch.setattr(doctor_module, "RENDER_NODES", tmp_path)
    monkeypatch.setattr("os.access", lambda path, mode: path != node and may_open(path, mode))  # root may open any file
    status = main(["doctor", "--json"])
    told = status, json.loads(capsys.readouterr().out)
    assert_named(told, "no permission", "renderD128", "usermod -aG render")
