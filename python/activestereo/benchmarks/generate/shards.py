# SPDX-License-Identifier: Apache-2.0
"""A BOP data set as WebDataset shards: tar files that training reads from front to end. All files of one frame stand
together and share the name up to the first dot.

    DIR/shards/000000.tar: 000000.rgb.png 000000.depth.png 000000.ir_left.png 000000.ir_right.png 000000.depth_true.png
                           000000.mask_0.png 000000.mask_visib_0.png ... 000000.json
"""

from __future__ import annotations

import io
import tarfile
from pathlib import Path
from typing import BinaryIO

from activestereo.benchmarks.generate import bop
from activestereo.common.input_files import read_bytes
from activestereo.common.output_files import replace_file

_KINDS = ("rgb", "depth", "ir_left", "ir_right", "depth_true")


def write_shards(out: Path, count: int, frames_per_shard: int) -> int:
    """Writes the shards of frames 0 to count - 1, the same bytes each time; returns how many."""
    (out / "shards").mkdir(exist_ok=True)
    starts = range(0, count, frames_per_shard)
    for shard, first in enumerate(starts):
        frames = range(first, min(first + frames_per_shard, count))

        def write(file: BinaryIO, frames: range = frames) -> None:
            with tarfile.open(fileobj=file, mode="w", format=tarfile.USTAR_FORMAT) as tar:
                for number in frames:
                    _add_frame(tar, out, number)

        replace_file(out / "shards" / f"{shard:06d}.tar", write)
    return len(starts)


def _add_frame(tar: tarfile.TarFile, out: Path, number: int) -> None:
    folder, name = bop.scene_folder(out, number), f"{number % bop.FRAMES_PER_SCENE:06d}"
    for kind in _KINDS:
        _add(tar, f"{number:06d}.{kind}.png", read_bytes(folder / kind / f"{name}.png"))
    for kind in ("mask", "mask_visib"):
        for order, path in enumerate(sorted((folder / kind).glob(f"{name}_*.png"))):
            _add(tar, f"{number:06d}.{kind}_{order}.png", read_bytes(path))
    _add(tar, f"{number:06d}.json", read_bytes(bop.record_path(out, number)))


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    about = tarfile.TarInfo(name)
    about.size = len(content)
    tar.addfile(about, io.BytesIO(content))
