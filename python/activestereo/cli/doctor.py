# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo doctor`: checks which devices, packages and libraries work on this machine. It names
remedies of a Vulkan set-up's known failures: a missing loader, driver, library or device, a container without graphics
capability, and a render node without permission."""

from __future__ import annotations

import argparse
import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from activestereo.cli import arguments as cli
from activestereo.common.input_files import read_json_object, read_text
from activestereo.common.shown import counted
from activestereo.report.screen import wrapped_lines

_TEXT = """\
Tells what this machine renders and matches on, what each Vulkan device can do or why it is
refused, which optional packages are there, which library multiplies matrices, where the
cache is and how large, and how much memory is free. Known failures of a Vulkan set-up are
named with the line that mends them.

A device's number is what --device takes. 'auto' takes the best usable one: discrete GPU,
integrated, virtual, then CPU. Debian's mesa-vulkan-drivers brings lavapipe, a Vulkan device
that computes on the CPU; it does everything here, only slower.

The exit status is 0 where all is well, else 1.
"""
# {optional module: the package's extra that installs it}
PACKAGES = {
    "cv2": "lab", "sapien": "sapien", "mani_skill": "mani_skill", "mujoco": "mujoco", "ray": "ray", "rosbags": "bags",
    "yaml": "yaml", "mitsuba": "mitsuba", "pxr": "usd", "trimesh": "meshes",
    "lerobot": "lerobot", "argcomplete": "completion",
}  # fmt: skip


_DEVICE = ("index", "name", "kind", "driver", "api_version", "memory_bytes", "usable", "refused")


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "doctor", "what this machine renders on, and what stands in the way", _TEXT, run)
    cli.add_shared(parser, json=True)


def run(args: argparse.Namespace) -> None:
    found = examine()
    cli.print_json(found) if args.json else print(_words(found))
    sys.stdout.flush()
    if found["problems"]:
        raise cli.Finding(f"{counted(len(found['problems']), 'problem')} with the Vulkan set-up")


def examine() -> dict[str, Any]:
    """Collects doctor's findings (devices, Vulkan problems, packages, BLAS, cache, free memory) as values for JSON."""
    import kuafu
    import simsense
    from activestereo.compare.cache import LayerCache

    try:
        devices = kuafu.Device.enumerate()
    except RuntimeError:  # some drivers fail if they find no device
        devices = []
    renders_on, matches_on = None, simsense.Device("host").info.name
    with suppress(RuntimeError):  # a device that cannot be opened
        if any(device.usable for device in devices):
            own = kuafu.Device()
            renders_on, matches_on = own.info.name, simsense.Device(own).info.name
    free_bytes = None
    with suppress(OSError, KeyError, ValueError):  # a system without /proc/meminfo
        fields = dict(line.split(":", 1) for line in read_text("/proc/meminfo").splitlines())
        free_bytes = 1024 * int(fields["MemAvailable"].split()[0])
    cache = LayerCache()
    return {
        "renders_on": renders_on,
        "matches_on": matches_on,
        "devices": [
            {name: getattr(device, name) for name in _DEVICE} | {"capabilities": list(device.capabilities)}
            for device in devices
        ],
        "problems": [asdict(problem) for problem in problems(len(devices))],
        "packages": {name: find_spec(name) is not None for name in PACKAGES},
        "blas": _blas(),
        "cache": {"folder": str(cache.folder), "used_bytes": cache.used_bytes(), "limit_bytes": cache.limit_bytes},
        "memory_free_bytes": free_bytes,
    }


def _words(found: dict[str, Any]) -> str:
    lines = [f"renders on: {found['renders_on'] or 'nothing: no Vulkan device can be used'}"]
    lines.append(f"matches on: {found['matches_on']}; recorded pairs on the CPU")
    for device in found["devices"]:
        state = "usable" if device["usable"] else f"refused: {device['refused']}"
        facts = f"{device['kind']}, Vulkan {device['api_version']}, {device['driver']}"
        lines.append(f"device [{device['index']}] {device['name']} ({facts}): {state}")
        can = ", ".join(name.replace("_", " ") for name in device["capabilities"]) or "nothing beyond compute"
        lines.append(f"  {device['memory_bytes'] / 2**30:.1f} GiB; can: {can}")
    for problem in found["problems"]:
        lines += [f"problem, {problem['name']}: {problem['seen']}", f"  mend it: {problem['remedy']}"]
    there = [name for name, is_there in found["packages"].items() if is_there]
    missing = [f"{name} (extra {PACKAGES[name]})" for name in found["packages"] if name not in there]
    lines.append(f"optional packages: {', '.join(there) or 'none'}; not there: {', '.join(missing) or 'none'}")
    slow = " (a reference, some ten times slower than OpenBLAS: apt install libopenblas0-pthread)"
    lines.append(f"matrices: {found['blas'] or 'not known'}{slow if is_reference(found['blas']) else ''}")
    cache, free = found["cache"], found["memory_free_bytes"]
    lines.append(f"cache: {cache['used_bytes'] / 1e9:.2f} of {cache['limit_bytes'] / 1e9:g} GB in {cache['folder']}")
    lines.append("free memory: " + ("not known" if free is None else f"{free / 1e9:.1f} GB"))
    if found["renders_on"]:
        lines.append("next: activestereo demo")
    return wrapped_lines(lines)


def _blas() -> str | None:
    """Returns the path of the BLAS library that NumPy has loaded, or None if the kernel does not list it."""
    import numpy.linalg  # noqa: F401 -- loads it

    try:
        mapped = [line.split(maxsplit=5)[5:] for line in read_text("/proc/self/maps").splitlines()]
    except OSError:
        return None
    return min((path for (path,) in filter(None, mapped) if "blas" in Path(path).name), default=None)


def is_reference(blas: str | None) -> bool:
    """Returns whether a BLAS library's path is that of Debian's reference build, which is slow."""
    return blas is not None and Path(blas).parent.name == "blas"


RENDER_NODES = Path("/dev/dri")
_LAVAPIPE = "apt install libvulkan1 mesa-vulkan-drivers"
_CONTAINER = "start the container with NVIDIA_DRIVER_CAPABILITIES=all (docker run --gpus all -e ...)"
# Debian's packages of libraries that drivers link to or open, by the library's name without its version.
_DEBIAN_PACKAGES = {
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
    """A failure of the set-up. seen: the evidence for it. remedy: a command or advice that mends it."""

    name: str
    seen: str
    remedy: str


def problems(device_count: int) -> list[Problem]:
    """Returns the failures of this machine's Vulkan set-up. device_count: how many devices the Vulkan loader lists."""
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
    """Returns the libraries that a library is linked to and the dynamic loader cannot find. fault: the loader's error
    on opening the library. If it is None or has another cause, the list is empty."""
    first = re.match(rf"{_LIBRARY}: cannot open shared object file", fault or "")
    if first is None or first[0].split(":")[0] == library:
        return []  # the library opens, is for another architecture, or does not exist
    # The dynamic loader's own list of what a library brings with it (ld.so(8), LD_TRACE_LOADED_OBJECTS).
    tracing = os.environ | {"LD_TRACE_LOADED_OBJECTS": "1", "LD_PRELOAD": library}
    traced = subprocess.run(["/bin/true"], env=tracing, capture_output=True, text=True, check=False)
    return list(dict.fromkeys([first[0].split(":")[0], *re.findall(r"(\S+) => not found", traced.stdout)]))


def _opened_and_missing(library: str) -> list[str]:
    """Returns the libraries that a driver opens at run time and cannot find; an empty list if the driver works."""
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
    packages = {name: _DEBIAN_PACKAGES.get(name.split(".so")[0]) for name in missing}
    known = " ".join(dict.fromkeys(package for package in packages.values() if package))
    others = ", ".join(name for name, package in packages.items() if not package)
    lines = [f"apt install {known}"] if known else []
    return "; ".join([*lines, *([f"install the package that has {others}"] if others else [])])


def _without_permission() -> Iterator[Problem]:
    """Yields problems of access: a container that has NVIDIA's driver without its graphics part, and render nodes that
    this user may not open."""
    computes = any(load_fault(name) is None for name in ("libcuda.so.1", "libnvidia-ml.so.1"))
    if computes and load_fault("libGLX_nvidia.so.0") is not None:
        seen = "NVIDIA's driver is there for computing, without its part for graphics (libGLX_nvidia.so.0)"
        yield Problem("no graphics capability", seen, _CONTAINER)
    for node in sorted(RENDER_NODES.glob("renderD*")):
        if not os.access(node, os.R_OK | os.W_OK):
            remedy = "sudo usermod -aG render $USER, then log in again (docker run: --group-add of the node's group)"
            yield Problem("no permission", f"{node} may not be opened by this user", remedy)
