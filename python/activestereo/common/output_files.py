# SPDX-License-Identifier: Apache-2.0
"""Files appear whole or not at all: each is written under a temporary name beside its place and then renamed."""

import errno
import os
import platform
import secrets
import shutil
import stat
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image

_UNFINISHED = ".unfinished-"
_OF_PROCESS = f"process_{platform.node()}_"  # of this machine: other machines' numbers say nothing here


def write_text(path: str | Path, text: str) -> None:
    """replace_file() of a text in UTF-8."""
    write_bytes(path, text.encode())


def write_bytes(path: str | Path, content: bytes) -> None:
    """replace_file() of these."""
    replace_file(path, lambda file: file.write(content))


def replace_file(path: str | Path, write: Callable[[BinaryIO], object]) -> None:
    """write(binary file) fills it. A failed write leaves what was there before. Raises OSError whose filename is
    `path`: a full disk alone does not say what it had no room for."""
    path = Path(path)
    check_target(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}")  # threads may write the same file
    try:
        with open(temporary, "wb") as file:
            write(file)
        os.replace(temporary, path)
    except OSError as error:
        if error.errno is None:  # NumPy's, which says how much it could not write
            raise OSError(errno.ENOSPC, f"{os.strerror(errno.ENOSPC)}: {error}", str(path)) from error
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def left_over(folder: Path) -> Iterator[tuple[str, Path]]:
    """(name, folder) of what written_together() could not remove, for its process was killed."""
    for path in folder.glob(f"{_UNFINISHED}*"):
        yield path.name.removeprefix(_UNFINISHED).rpartition("-")[0], path


def check_target(path: Path) -> None:
    """OSError where a rename would put a file in the place of a folder, a device, a pipe or links in a loop: asked
    before long work, too."""
    try:
        is_file = stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return
    if not is_file:
        raise OSError(errno.EINVAL, "is there and no regular file: give another name", str(path))


@contextmanager
def written_together(folder: Path, name: str = "", last: Path = Path()) -> Iterator[Path]:
    """A folder for files that go with one another, by their places below `folder`. They move there when the block ends;
    a block that fails, on a full disk perhaps, leaves none of them. OSError names a file by its place. name: what
    left_over() tells the folder by that a killed process leaves; without one, the next call removes that. last: the
    file that moves behind the others, for who looks whether all are there."""
    aside = _new_aside(folder, name)
    try:
        with _named_by_place(aside, folder):
            yield aside
            _move(aside, folder, last)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _new_aside(folder: Path, name: str = "") -> Path:
    """A new folder below `folder`, named for this process where there is no name; those of processes of this machine
    that have ended go."""
    if not name:
        for owner, path in left_over(folder):
            if owner.startswith(_OF_PROCESS) and not Path("/proc", owner.removeprefix(_OF_PROCESS)).exists():
                shutil.rmtree(path, ignore_errors=True)
    aside = folder / f"{_UNFINISHED}{name or f'{_OF_PROCESS}{os.getpid()}'}-{secrets.token_hex(4)}"
    aside.mkdir(parents=True)
    return aside


def _move(aside: Path, folder: Path, last: Path) -> None:
    """Puts the files into their places; where one cannot go, those that went before are taken back."""
    found = (path for path in aside.rglob("*") if path.is_file())
    files = sorted(found, key=lambda path: (path == aside / last, path))
    for path in files:
        place = folder / path.relative_to(aside)
        place.parent.mkdir(parents=True, exist_ok=True)
        check_target(place)
    kept = _new_aside(aside, "kept")
    moved: list[tuple[Path, Path | None]] = []
    try:
        for number, path in enumerate(files):
            place = folder / path.relative_to(aside)
            before = kept / str(number) if place.exists() else None
            if before is not None:
                _keep(place, before)
            moved.append((place, before))
            os.replace(path, place)
    except BaseException:  # an interrupt, too
        for place, before in reversed(moved):
            place.unlink(missing_ok=True) if before is None else os.replace(before, place)
        raise


def _keep(place: Path, before: Path) -> None:
    """A second name of the file, which stays in its place: a process that is killed here loses nothing."""
    try:
        os.link(place, before)
    except OSError:  # a file system without links
        shutil.copy2(place, before)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A folder to fill, which has the name `path` when the block ends; a block that fails leaves nothing. OSError names
    a file by its place, FileExistsError `path` where it is there already."""
    if path.exists():
        raise FileExistsError(errno.EEXIST, "exists already: give another name", str(path))
    aside = _new_aside(path.parent)
    try:
        with _named_by_place(aside, path):
            yield aside
            aside.rename(path)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


@contextmanager
def _named_by_place(aside: Path, place: Path) -> Iterator[None]:
    """OSErrors of files below `aside` have the names that they would have had below `place`."""
    try:
        yield
    except OSError as error:
        named = str(error.filename or "")
        if not named.startswith(str(aside)):
            raise
        raise OSError(error.errno, error.strerror, str(place / Path(named).relative_to(aside))) from error


def write_png(path: str | Path, pixels: np.ndarray) -> None:
    """uint8 [h, w] or [h, w, 3], or uint16 [h, w]."""
    image = Image.fromarray(np.ascontiguousarray(pixels))
    # Run lengths in place of a search for what has been before, which takes three times as long and finds nothing in
    # images with noise.
    replace_file(path, lambda file: image.save(file, format="png", compress_type=zlib.Z_RLE))


def write_depth_png(path: str | Path, depth_m: np.ndarray) -> None:
    """Depth in metres as uint16 millimetres, 0 = no measurement; 65.535 m is the farthest."""
    write_png(path, np.clip(np.rint(np.nan_to_num(depth_m) * 1000.0), 0, 65535).astype(np.uint16))


def write_ply(path: str | Path, points: np.ndarray, colors: np.ndarray | None = None) -> None:
    """Points float32 [n, 3] in metres, with colours 0..1 [n, 3] or without, as binary PLY."""
    fields = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
    if colors is not None:
        fields += [("red", "u1"), ("green", "u1"), ("blue", "u1")]
    table = np.empty(len(points), dtype=fields)
    table["x"], table["y"], table["z"] = points.T
    if colors is not None:
        table["red"], table["green"], table["blue"] = np.rint(np.clip(colors, 0.0, 1.0) * 255.0).astype(np.uint8).T
    types = {"<f4": "float", "u1": "uchar"}
    header = "ply\nformat binary_little_endian 1.0\n" + f"element vertex {len(table)}\n"
    header += "".join(f"property {types[t]} {name}\n" for name, t in fields) + "end_header\n"

    def write(file: BinaryIO) -> None:
        file.write(header.encode())
        file.write(table.tobytes())

    replace_file(path, write)
