# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo doctor`: checks which devices, packages and libraries work on this machine, and names
remedies."""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from activestereo.cli.arguments import Commands, Finding, add_shared, print_json
from activestereo.common.input_files import read_text
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
    "yaml": "yaml", "mitsuba": "mitsuba", "pxr": "usd", "onnxruntime": "onnx",
    "lerobot": "lerobot", "h5py": "resense", "argcomplete": "completion",
}  # fmt: skip


_DEVICE = ("index", "name", "kind", "driver", "api_version", "memory_bytes", "usable", "refused")


def add_parser(commands: Commands) -> None:
    parser = commands.add_parser(
        "doctor", help="what this machine renders on, and what stands in the way", description=_TEXT
    )
    add_shared(parser, json=True)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    found = examine()
    print_json(found) if args.json else print(_words(found))
    sys.stdout.flush()
    count = len(found["problems"])
    if count:
        raise Finding(f"{count} problem{'s' if count > 1 else ''} with the Vulkan set-up")


def examine() -> dict[str, Any]:
    """Collects doctor's findings (devices, Vulkan problems, packages, BLAS, cache, free memory) as values for JSON."""
    import kuafu
    from activestereo.cli.vulkan_setup import problems
    from activestereo.compare.cache import LayerCache

    try:
        devices = kuafu.Device.enumerate()
    except RuntimeError:  # some drivers fail if they find no device
        devices = []
    renders_on = None
    with suppress(RuntimeError):  # a device that cannot be opened
        renders_on = kuafu.Device().info.name if any(device.usable for device in devices) else None
    free_bytes = None
    with suppress(OSError, KeyError, ValueError):  # a system without /proc/meminfo
        fields = dict(line.split(":", 1) for line in read_text("/proc/meminfo").splitlines())
        free_bytes = 1024 * int(fields["MemAvailable"].split()[0])
    cache = LayerCache()
    return {
        "renders_on": renders_on,
        "matches_on": "the device that renders, or the CPU",
        "devices": [
            {name: getattr(device, name) for name in _DEVICE} | {"capabilities": list(device.capabilities)}
            for device in devices
        ],
        "problems": [asdict(problem) for problem in problems(len(devices))],
        "packages": {name: find_spec(name) is not None for name in PACKAGES},
        "blas": _blas(),
        "cache": {
            "folder": str(cache.folder),
            "used_bytes": cache.used_bytes(),
            "limit_bytes": cache.limit_bytes,
        },
        "memory_free_bytes": free_bytes,
    }


def _words(found: dict[str, Any]) -> str:
    lines = [f"renders on: {found['renders_on'] or 'nothing: no Vulkan device can be used'}"]
    lines.append(f"matches on: {found['matches_on'] if found['renders_on'] else 'the CPU'}")
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
    """Returns whether a BLAS library's path is that of Debian's reference build, which lacks fast kernels for the
    processor."""
    return blas is not None and Path(blas).parent.name == "blas"
