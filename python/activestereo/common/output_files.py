# SPDX-License-Identifier: Apache-2.0
"""Writes files whole or not at all: each is written under a temporary name in the same folder and then renamed."""

import errno
import io
import json
import math
import os
import platform
import secrets
import shutil
import stat
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from PIL import Image

_UNFINISHED = ".unfinished-"
_OF_PROCESS = f"process_{platform.node()}_"  # of this machine: process numbers of other machines are unrelated


def write_text(path: str | Path, text: str) -> None:
    """Writes a text as UTF-8, in place of any older file, as replace_file() does."""
    write_bytes(path, text.encode())


def write_json(path: str | Path, content: Any, **options: Any) -> None:
    """Writes a value as JSON, in place of any older file, as replace_file() does. options: for json.dumps()."""
    write_text(path, json.dumps(content, indent=1, **options) + "\n")


def flat(array: Any) -> list[float]:
    """Returns an array's numbers as a flat list in row-major order, for JSON files."""
    return np.asarray(array, dtype=float).ravel().tolist()


def write_bytes(path: str | Path, content: bytes) -> None:
    """Writes bytes, in place of any older file, as replace_file() does."""
    replace_file(path, lambda file: file.write(content))


def finite(value: Any) -> Any:
    """Returns the nested value with None in place of NaN and infinities, which JSON cannot express. Tuples become
    lists."""
    if isinstance(value, dict):
        return {name: finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def replace_file(path: str | Path, write: Callable[[BinaryIO], object]) -> None:
    """Calls write(file) on a new binary file, which then replaces `path`. If the write fails, the old file stays.
    Raises OSError with filename `path`, because the system's error for a full disk names no file."""
    path = Path(path)
    check_target(path)
    # Threads may write the same file; a name of the longest allowed length has room for no more.
    temporary = path.with_name(f".{path.name[:40]}.{os.getpid()}-{secrets.token_hex(4)}")
    try:
        with open(temporary, "wb") as file:
            write(file)
        os.replace(temporary, path)
    except OSError as error:
        if error.errno is None:  # NumPy's error, which says how many bytes it could not write
            raise OSError(errno.ENOSPC, f"{os.strerror(errno.ENOSPC)}: {error}", str(path)) from error
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        with suppress(OSError):  # a read-only file system refuses this, too
            temporary.unlink()


def left_over(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yields (name, path) of the temporary folders in `folder` that written_together() could not remove because its
    process was killed."""
    for path in folder.glob(f"{_UNFINISHED}*"):
        yield path.name.removeprefix(_UNFINISHED).rpartition("-")[0], path


def check_target(path: Path) -> None:
    """Raises OSError if `path` is a folder, a device, a pipe or a loop of links, which no file may replace. Call it
    before long work."""
    try:
        is_file = stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return
    if not is_file:
        raise OSError(errno.EINVAL, "exists and is no regular file: give another name", str(path))


@contextmanager
def written_together(folder: Path, name: str = "", last: Path = Path()) -> Iterator[Path]:
    """Yields a temporary folder for files that belong together. When the block ends, they move to the same relative
    paths below `folder`; if the block fails, none moves. Raises OSError with the file's final path. name: under which
    left_over() lists the folder of a killed process. Without a name, the next call removes such a folder. last:
    relative path of the file that moves last and so marks a complete set."""
    aside = _new_aside(folder, name)
    try:
        with _named_by_place(aside, folder):
            yield aside
            _move(aside, folder, last)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _new_aside(folder: Path, name: str = "") -> Path:
    """Makes a temporary folder in `folder`, named after `name` or, without one, after this process. Without a name, it
    first removes the folders of this machine's ended processes."""
    if not name:
        for owner, path in left_over(folder):
            if owner.startswith(_OF_PROCESS) and not Path("/proc", owner.removeprefix(_OF_PROCESS)).exists():
                shutil.rmtree(path, ignore_errors=True)
    aside = folder / f"{_UNFINISHED}{name or f'{_OF_PROCESS}{os.getpid()}'}-{secrets.token_hex(4)}"
    aside.mkdir(parents=True)
    return aside


def _move(aside: Path, folder: Path, last: Path) -> None:
    """Moves all files below `aside` to the same relative paths below `folder`, the file `last` at the end. If one move
    fails, the others are undone."""
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
                # Keep the old file by a hard link, not a move, so that a killed process loses nothing.
                try:
                    os.link(place, before)
                except OSError:  # a file system without links
                    shutil.copy2(place, before)
            moved.append((place, before))
            os.replace(path, place)
    except BaseException:  # an interrupt, too
        for place, before in reversed(moved):
            place.unlink(missing_ok=True) if before is None else os.replace(before, place)
        raise


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yields a temporary folder, which is renamed to `path` when the block ends. A failed block leaves nothing. Raises
    FileExistsError if `path` exists. An OSError of the block carries the file's final path."""
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
    """Re-raises the block's OSErrors about files below the temporary folder `aside`, with their final names below
    `place`."""
    try:
        yield
    except OSError as error:
        named = str(error.filename or "")
        if not named.startswith(str(aside)):
            raise
        raise OSError(error.errno, error.strerror, str(place / Path(named).relative_to(aside))) from error


def write_png(path: str | Path, pixels: np.ndarray) -> None:
    """Writes a PNG file. pixels: uint8 [height, width] or [height, width, 3], or uint16 [height, width]."""
    image = Image.fromarray(np.ascontiguousarray(pixels))
    # Run-length compression: a dictionary search takes three times as long and finds nothing in noisy images.
    replace_file(path, lambda file: image.save(file, format="png", compress_type=zlib.Z_RLE))


def png_bytes(pixels: np.ndarray | Image.Image) -> bytes:
    """Returns the bytes of a PNG file. pixels: an array as for write_png(), or a Pillow image."""
    file = io.BytesIO()
    (pixels if isinstance(pixels, Image.Image) else Image.fromarray(pixels)).save(file, format="png")
    return file.getvalue()


def write_depth_png(path: str | Path, depth_m: np.ndarray) -> None:
    """Writes depth in metres as a PNG of uint16 millimetres, 0 = no measurement. Depths beyond 65.535 m are clipped."""
    write_png(path, np.clip(np.rint(np.nan_to_num(depth_m) * 1000.0), 0, 65535).astype(np.uint16))


def write_ply(path: str | Path, points: np.ndarray, colors: np.ndarray | None = None) -> None:
    """Writes a point cloud as binary PLY. points: float32 [n, 3], metres. colors: [n, 3], 0..1, or None."""
    fields, columns = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")], [*points.T]
    if colors is not None:
        fields += [("red", "u1"), ("green", "u1"), ("blue", "u1")]
        columns += [*np.rint(np.clip(colors, 0.0, 1.0) * 255.0).T]
    table = np.rec.fromarrays(columns, dtype=fields)
    types = {"<f4": "float", "u1": "uchar"}
    header = "ply\nformat binary_little_endian 1.0\n" + f"element vertex {len(table)}\n"
    header += "".join(f"property {types[t]} {name}\n" for name, t in fields) + "end_header\n"
    replace_file(path, lambda file: file.writelines((header.encode(), table.tobytes())))
