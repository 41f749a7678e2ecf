# SPDX-License-Identifier: Apache-2.0
"""Detects known failures of a Vulkan set-up and names the remedy. They are a missing loader, driver, library or device,
a container without graphics capability, and a render node without permission."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from activestereo.common.input_files import read_json_object

RENDER_NODES = Path("/dev/dri")
_LAVAPIPE = "apt install libvulkan1 mesa-vulkan-drivers"
_CONTAINER = "start the container with NVIDIA_DRIVER_CAPABILITIES=all (docker run --gpus all -e ...)"
# Debian's packages of libraries that drivers link to or open, by the library's name without its version.
_PACKAGES = {
    "libXext": "libxext6", "libX11": "libx11-6", "libX11-xcb": "libx11-xcb1", "libxcb": "libxcb1", "libdrm": "libdrm2",
    "libXau": "libxau6", "libXdmcp": "libxdmcp6", "libxshmfence": "libxshmfence1",
    "libwayland-client": "libwayland-client0",
    "libxcb-dri3": "libxcb-dri3-0", "libxcb-present": "libxcb-present0", "libxcb-randr": "libxcb-randr0",
    "libxcb-sync": "libxcb-sync1", "libGLdispatch": "libglvnd0", "libGLX": "libglx0", "libEGL": "libegl1",
    "libGL": "libgl1", "libOpenGL": "libopengl0", "libgbm": "libgbm1", "libexpat": "libexpat1", "libelf": "libelf1",
    "libz": "zlib1g", "libzstd": "libzstd1", "libstdc++": "libstdc++6",
}  # fmt: skip
# The loader's first call to a driver. NVIDIA's driver 580 refuses it if libglvnd's libEGL.so.1 is missing.
_NEGOTIATION = """
import ctypes, sys
print(ctypes.CDLL(sys.argv[1]).vk_icdNegotiateLoaderICDInterfaceVersion(ctypes.byref(ctypes.c_uint32(5))))
"""
_MOST_S = 20.0
_LIBRARY = r"(lib[\w+-]+?)\.so[\w.]*"


@dataclass(frozen=True)
class Problem:
    """Describes one failure of the set-up. seen: the evidence; remedy: a command or advice that mends it."""

    name: str
    seen: str
    remedy: str


def problems(device_count: int) -> list[Problem]:
    """Returns the failures of this machine's Vulkan set-up. device_count: the number of devices that the loader
    lists."""
    if (fault := load_fault("libvulkan.so.1")) is not None:
        return [Problem("no loader", f"the Vulkan loader cannot be opened: {fault}", _LAVAPIPE)]
    manifests = driver_manifests()
    found = [*_missing_libraries(manifests, device_count), *_without_permission()]
    if not manifests:
        variable = next((name for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES") if os.environ.get(name)), None)
        seen = "no driver's manifest is there" if variable is None else f"{variable} names no manifest that is there"
        found.append(Problem("no driver", seen, _LAVAPIPE if variable is None else f"unset {variable}"))
    elif not device_count and not found:
        names = ", ".join(path.name for path in manifests)
        found.append(Problem("no device", f"the drivers that are there ({names}) find no device", _LAVAPIPE))
    return found


def driver_manifests() -> list[Path]:
    """Returns the driver manifests (JSON files) that the Vulkan loader reads: those that VK_DRIVER_FILES or
    VK_ICD_FILENAMES name, else those in the usual folders."""
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return [path for path in map(Path, named.split(":")) if path.is_file()]
    config, data = (
        os.environ.get(name) or default
        for name, default in (("XDG_CONFIG_DIRS", "/etc/xdg"), ("XDG_DATA_DIRS", "/usr/local/share:/usr/share"))
    )
    home = os.environ.get("XDG_DATA_HOME") or str(Path.home() / ".local/share")
    folders = dict.fromkeys([*config.split(":"), "/etc", home, *data.split(":")])
    return [path for folder in folders for path in sorted(Path(folder, "vulkan/icd.d").glob("*.json"))]


def load_fault(library: str) -> str | None:
    """Returns the dynamic loader's error if a library cannot be opened, else None."""
    try:
        ctypes.CDLL(library)
    except OSError as error:
        return str(error)
    return None


def _missing_libraries(manifests: list[Path], device_count: int) -> Iterator[Problem]:
    for manifest in manifests:
        try:
            name = str(read_json_object(manifest)["ICD"]["library_path"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            yield Problem("broken manifest", f"{manifest} cannot be read: {error}", _LAVAPIPE)
            continue
        library = str(manifest.parent / name) if "/" in name else name
        fault = load_fault(library)
        missing = (
            _opened_and_missing(library) if fault is None and not device_count else _needed_and_missing(library, fault)
        )
        if missing:
            are = "is" if len(missing) == 1 else "are"
            seen = f"the driver {manifest.name} needs {', '.join(missing)}, which {are} not there"
            yield Problem("library missing", seen, _installing(missing))
        elif fault is not None and not device_count and "ELFCLASS" not in fault:  # not another architecture
            remedy = _CONTAINER if "nvidia" in name else "apt install --reinstall mesa-vulkan-drivers"
            yield Problem("driver missing", f"the driver {manifest.name} cannot be opened: {fault}", remedy)


def _needed_and_missing(library: str, fault: str | None) -> list[str]:
    """Returns the linked libraries of an unusable library that the dynamic loader cannot find. fault: the loader's
    error for it, or None."""
    first = re.match(rf"{_LIBRARY}: cannot open shared object file", fault or "")
    if first is None or first[0].split(":")[0] == library:
        return []  # the library opens, is for another architecture, or does not exist
    # The dynamic loader's own list of what a library brings with it (ld.so(8), LD_TRACE_LOADED_OBJECTS).
    tracing = os.environ | {"LD_TRACE_LOADED_OBJECTS": "1", "LD_PRELOAD": library}
    traced = subprocess.run(["/bin/true"], env=tracing, capture_output=True, text=True, check=False)
    return list(dict.fromkeys([first[0].split(":")[0], *re.findall(r"(\S+) => not found", traced.stdout)]))


def _opened_and_missing(library: str) -> list[str]:
    """Returns the libraries that a driver opens by itself and cannot find; an empty list if the driver works."""
    searched = os.environ | {"LD_DEBUG": "libs"}
    asked = [sys.executable, "-c", _NEGOTIATION, library]
    try:
        said = subprocess.run(asked, env=searched, capture_output=True, text=True, check=False, timeout=_MOST_S)
    except subprocess.TimeoutExpired:
        return []
    if said.stdout.strip() == "0":
        return []
    return [
        name for name in dict.fromkeys(re.findall(r"find library=(\S+)", said.stderr)) if load_fault(name) is not None
    ]


def _installing(missing: list[str]) -> str:
    """Returns the command that installs the missing libraries' packages."""
    packages = {name: _PACKAGES.get(name.split(".so")[0]) for name in missing}
    known = " ".join(dict.fromkeys(package for package in packages.values() if package))
    others = ", ".join(name for name, package in packages.items() if not package)
    lines = [f"apt install {known}"] if known else []
    return "; ".join([*lines, *([f"install the package that has {others}"] if others else [])])


def _without_permission() -> Iterator[Problem]:
    """Yields problems of access: an NVIDIA driver without its graphics part in a container, and render nodes that this
    user may not open."""
    computes = any(load_fault(name) is None for name in ("libcuda.so.1", "libnvidia-ml.so.1"))
    if computes and load_fault("libGLX_nvidia.so.0") is not None:
        seen = "NVIDIA's driver is there for computing, without its part for graphics (libGLX_nvidia.so.0)"
        yield Problem("no graphics capability", seen, _CONTAINER)
    for node in sorted(RENDER_NODES.glob("renderD*")):
        if not os.access(node, os.R_OK | os.W_OK):
            remedy = "sudo usermod -aG render $USER, then log in again (docker run: --group-add of the node's group)"
            yield Problem("no permission", f"{node} may not be opened by this user", remedy)
