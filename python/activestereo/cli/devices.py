# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo devices`: lists the Vulkan devices of this machine."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from activestereo.cli.arguments import CommandError, Commands, add_shared, print_json
from activestereo.report.screen import wrapped_lines

if TYPE_CHECKING:
    import kuafu

_TEXT = """\
Lists every Vulkan device, what it can do, and why it cannot be used where it cannot.

The number in front is what --device takes. 'auto' takes the best usable one: discrete
GPU, integrated, virtual, then CPU. Without a GPU, Debian's mesa-vulkan-drivers brings
lavapipe, a Vulkan device that computes on the CPU; it does everything here, only slower.
"""
_INSTALL = (
    "no Vulkan device here; install a GPU's Vulkan driver, or lavapipe: apt install libvulkan1 mesa-vulkan-drivers "
    "(activestereo doctor says what is wrong)"
)


def add_parser(commands: Commands) -> None:
    parser = commands.add_parser("devices", help="list Vulkan devices and what each can do", description=_TEXT)
    add_shared(parser, json=True)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    import kuafu

    try:
        infos = kuafu.Device.enumerate()
    except RuntimeError as error:  # some drivers fail if they find no device
        raise CommandError(f"{error}: activestereo doctor says what is wrong") from error
    if not infos:
        raise CommandError(_INSTALL)
    if args.json:
        print_json([as_json(info) for info in infos])
        return
    for info in infos:
        print(describe(info))


def as_json(info: kuafu.DeviceInfo) -> dict[str, Any]:
    """Returns one device's properties as a dictionary for JSON."""
    names = ("index", "name", "kind", "driver", "api_version", "memory_bytes", "usable", "refused")
    return {name: getattr(info, name) for name in names} | {"capabilities": list(info.capabilities)}


def describe(info: kuafu.DeviceInfo) -> str:
    """Returns a few lines of text about one device."""
    lines = [
        f"[{info.index}] {info.name}",
        f"    {info.kind}, Vulkan {info.api_version}, {info.driver}, {info.memory_bytes / 2**30:.1f} GiB",
        f"    can: {', '.join(name.replace('_', ' ') for name in info.capabilities) or 'nothing beyond compute'}",
        "    usable" if info.usable else f"    not usable: {info.refused}",
    ]
    return wrapped_lines(lines)
