# SPDX-License-Identifier: Apache-2.0
"""The entries of the page: one file or folder, or all captures, scenes and pictures below a folder. It reads nothing
outside."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from activestereo.report.view.pictures import is_pictures

SCENE_ENDINGS = (".gltf", ".glb", ".obj", ".dae", ".stl", ".ply", ".usd", ".usda", ".usdc", ".usdz")
CAPTURE_FILE = "capture.json"
# A folder is searched so deep and no further, and so many are listed.
_DEEPEST, _MOST = 3, 500


class Library:
    """Entries below `root` by their names there, "." for itself. make: makes the source of a path; raises ValueError or
    OSError if it cannot."""

    def __init__(self, root: Path, make: Callable[[Path], Any]) -> None:
        if not root.exists():
            raise ValueError(f"{root}: there is no such file or folder")
        self.root, self._make = root, make
        self._open: dict[str, Any] = {}
        self._one_at_a_time = threading.Lock()
        self.names = [str(path.relative_to(root)) for path in _entries(root)]
        if not self.names:
            scenes = " ".join(SCENE_ENDINGS)
            raise ValueError(f"{root}: holds neither a capture ({CAPTURE_FILE}) nor a scene ({scenes})")

    def source(self, name: Any) -> Any:
        """The source of an entry, opened once. Raises ValueError for a name that is not listed."""
        if not isinstance(name, str) or name not in self.names:
            raise ValueError("there is no such entry, or it lies outside of the folder that is shown")
        with self._one_at_a_time:
            if name not in self._open:
                self._open = {name: self._make(self.root / name)}  # one at a time is kept: scenes take memory
            return self._open[name]


def is_capture(path: Path) -> bool:
    return (path / CAPTURE_FILE).is_file()


def is_scene(path: Path) -> bool:
    return path.suffix.lower() in SCENE_ENDINGS and path.is_file()


def _entries(root: Path) -> list[Path]:
    if is_capture(root) or is_scene(root) or is_pictures(root):
        return [root]
    found: list[Path] = []
    for path in _below(root, _DEEPEST):
        found.append(path)
        if len(found) == _MOST:
            break
    # Otherwise it is a recording's folder, or its error names the missing part.
    return found if found or not root.is_dir() else [root]


def _below(folder: Path, depth: int) -> Iterator[Path]:
    """Captures, scenes and pictures in the order of their names; neither links nor captures are looked into."""
    if depth == 0 or not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        if path.is_symlink() or path.name.startswith("."):
            continue
        if is_capture(path) or is_scene(path) or is_pictures(path):
            yield path
        elif path.is_dir():
            yield from _below(path, depth - 1)
