# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo overlay`: draws the rendered scene's contours over camera pictures."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Camera, Frame, read_capture
from activestereo.capture.images import read_color
from activestereo.cli import arguments as cli
from activestereo.common.output_files import write_png
from activestereo.report.screen import command, screen

_TEXT = """\
Lays a scene over the pictures of a real camera: contours of what is rendered in
orange, so that the eye sees whether things stand where the scene says. SOURCE is a
capture (all its poses), one PNG file, or a folder of PNG files.

Of files the scene's first camera says from where they look. The pictures are shown
in a window (q ends it), or saved with --out.

examples:
  activestereo overlay captures/desk --scene desk.gltf --out out/overlay
  activestereo overlay picture.png --scene desk.gltf
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "overlay", "lay the rendered scene over a camera's pictures", _TEXT, run)
    parser.add_argument("source", type=Path, metavar="SOURCE", help="capture, PNG file, or folder of PNG files")
    parser.add_argument("--scene", type=Path, metavar="FILE", help="glTF scene (default: the capture's own)")
    parser.add_argument("-o", "--out", type=Path, metavar="DIR", help="folder for PNG files; without it a window opens")
    cli.add_shared(parser, device=True)


def run(args: argparse.Namespace) -> None:
    from activestereo.report.overlay import can_show_windows, show_window

    is_capture = (args.source / "capture.json").is_file() or args.source.name == "capture.json"
    if args.scene is None and not is_capture:
        raise cli.CommandError("--scene is needed for files")
    pictures = _overlay_capture(args) if is_capture else _overlay_files(args)
    if args.out is None:
        if not can_show_windows():
            raise cli.CommandError("no window can be opened here: save the pictures by --out DIR")
        show_window(picture for _, picture in pictures)
        return
    cli.make_folder(args.out)
    names = []
    for name, picture in pictures:
        write_png(args.out / f"{name}.png", picture)
        names.append(name)
    sentence = f"{len(names)} pictures in {args.out}, {names[0]}.png first: edges of the scene lie over the camera's."
    leads = []
    if is_capture and args.scene is None:
        leads = [command("compare", args.source, *cli.carried(args, "device"), "-o", args.out / "compare")]
    print(screen(sentence, (), (), leads))


def _overlay_capture(args: argparse.Namespace) -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yields (name, RGB picture with contours) for each pose of a capture: its colour image, and its infrared ones
    without dots, averaged over repeats. A capture with neither yields the left image of every frame."""
    from activestereo.report.overlay import Overlay

    capture = read_capture(args.source)
    rig, poses = capture.rig, dict[bytes, list[Frame]]()
    overlay = Overlay(args.scene or capture.scene_path, args.device)
    for frame in capture.frames:
        poses.setdefault(np.round(frame.camera_to_world, 7).tobytes(), []).append(frame)

    def laid(frames: list[Frame], which: str, camera: Camera, left_to: NDArray[np.float64]) -> NDArray[np.uint8]:
        if which == "color":
            image = np.mean(np.array([capture.color(f) for f in frames]), axis=0) / 255.0
        else:
            image = np.mean([capture.ir(f, which) for f in frames], axis=0)[..., None] / rig.max_dn
        picture = np.rint(255 * np.clip(_undistorted(image, camera), 0, 1)).astype(np.uint8)
        return overlay.draw(picture, camera.K, frames[0].camera_to_world @ np.linalg.inv(left_to))

    is_empty = True
    for frames in poses.values():
        colored = [f for f in frames if f.color_path is not None]
        dark = [f for f in frames if f.projector_power == 0 and f.has_infrared]
        is_empty = is_empty and not (dark or (colored and rig.color))
        if colored and rig.color is not None:
            yield f"{colored[0].id}_color", laid(colored, "color", rig.color, rig.color.left_to_color)
        for side, left_to in zip(SIDES, (np.eye(4), rig.left_to_right), strict=True) if dark else ():
            yield f"{dark[0].id}_{side}", laid(dark, side, rig.camera(side), left_to)
    for frame in capture.frames if is_empty else ():
        yield f"{frame.id}_left", laid([frame], "left", rig.left, np.eye(4))


def _undistorted(image: NDArray[np.floating], camera: Camera) -> NDArray[np.floating]:
    import cv2

    if camera.is_pinhole:
        return image
    if len(camera.distortion) == 4:
        return cv2.fisheye.undistortImage(image, camera.K, camera.distortion, Knew=camera.K).reshape(image.shape)
    return cv2.undistort(image, camera.K, camera.distortion).reshape(image.shape)


def _overlay_files(args: argparse.Namespace) -> Iterator[tuple[str, NDArray[np.uint8]]]:
    from activestereo.report.overlay import Overlay

    overlay = Overlay(args.scene, args.device)
    files = [args.source] if args.source.is_file() else sorted(args.source.glob("*.png"))
    if not files:
        raise cli.CommandError(f"{args.source}: is no capture, no PNG file, and no folder of PNG files")
    for file in files:
        yield file.stem, overlay.draw(read_color(file), None, None)
