# SPDX-License-Identifier: Apache-2.0
"""Caches rendered layers and other arrays on disk as `<key>.npz`. The key is a hash of everything that decides the
arrays, so a second run on a capture renders nothing.

A file is complete or absent (written under another name, then renamed), so parallel runs may share one folder.
"""

import io
import os
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.common.input_files import checked_file
from activestereo.common.output_files import replace_file
from activestereo.effects.core.view import Layers

_LIMIT_GB = 2.0
_LIMIT_VARIABLE = "ACTIVESTEREO_CACHE_GB"


def default_cache_folder() -> Path:
    """Returns the folder named by ACTIVESTEREO_CACHE, else `activestereo/layers` in the user's cache folder."""
    own = os.environ.get("ACTIVESTEREO_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "activestereo" / "layers"


class CacheWarning(UserWarning):
    """Warns that renders cannot be stored, or that a stored entry cannot be read."""


class LayerCache:
    """A folder of cache files `<key>.npz`, each with named arrays: the rendered layers of one rig pose, images, or the
    fits to a capture. If the files exceed ACTIVESTEREO_CACHE_GB, else 2 GB, the least recently used are removed. Raises
    ValueError if that is no number of at least 0."""

    def __init__(self, folder: str | Path | None = None) -> None:
        self.folder = Path(folder) if folder else default_cache_folder()
        text = os.environ.get(_LIMIT_VARIABLE)
        try:
            gigabytes = float(text) if text else _LIMIT_GB
        except ValueError:
            gigabytes = -1.0
        if not 0.0 <= gigabytes < 1e6:
            raise ValueError(f"{_LIMIT_VARIABLE} is '{text}', expected gigabytes: a number of at least 0")
        self.limit_bytes = int(gigabytes * 1e9)

    def get(self, key: str) -> tuple[Layers, ...] | None:
        """Returns the stored layers, one Layers per camera, or None."""
        stored, names = self.get_arrays(key) or {}, [field.name for field in fields(Layers)]
        cameras: list[dict[str, Any]] = [
            {name: stored[at] for name in names if (at := f"{name}_{i}") in stored}
            for i in range(int(stored.get("count", 0)))
        ]
        try:
            return tuple(Layers(**camera) for camera in cameras) or None
        except TypeError:  # an entry of another format
            return None

    def put(self, key: str, layers: tuple[Layers, ...]) -> None:
        """Stores the layers, one Layers per camera. Their `supersampled` must be None."""
        arrays = {f"{f.name}_{i}": getattr(view, f.name) for i, view in enumerate(layers) for f in fields(Layers)}
        arrays = {name: array for name, array in arrays.items() if array is not None}
        self.put_arrays(key, arrays | {"count": np.array(len(layers))})

    def get_arrays(self, key: str) -> dict[str, np.ndarray] | None:
        """Returns the stored arrays by name, or None. An entry that cannot be read is removed, with a CacheWarning."""
        path = self.folder / f"{key}.npz"
        try:
            with np.load(checked_file(path)) as stored:
                arrays = {name: stored[name] for name in stored.files}
        except (FileNotFoundError, NotADirectoryError):
            return None
        except Exception as error:  # zipfile, zlib and numpy raise some ten kinds of errors on damaged files
            text = f"{path}: cannot be read ({error!r:.200}); it is removed and made again"
            warnings.warn(text, CacheWarning, stacklevel=2)
            with suppress(OSError):
                path.unlink(missing_ok=True)
            return None
        with suppress(OSError):  # another run may forget it at any time, and a folder may be read-only
            os.utime(path)
        return arrays

    def put_arrays(self, key: str, arrays: Mapping[str, np.ndarray]) -> None:
        """Stores arrays under a key. If the folder cannot be written (read-only, full), it only warns, with a
        CacheWarning."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            content = io.BytesIO()  # on a full disk, NumPy would leave an archive that Python cannot close
            np.savez(content, **arrays)
            replace_file(self.folder / f"{key}.npz", lambda file: file.write(content.getbuffer()))
        except OSError as error:
            reason = f"{self.folder}: {error.strerror}"
            text = f"renders are not kept for a second look: {reason}; ACTIVESTEREO_CACHE names another folder"
            warnings.warn(text, CacheWarning, stacklevel=2)
            return
        used = 0
        for _, size, path in self._entries():
            used += size
            if used > self.limit_bytes:
                with suppress(OSError):
                    path.unlink(missing_ok=True)

    def used_bytes(self) -> int:
        return sum(size for _, size, _ in self._entries())

    def usage_text(self) -> str:
        """Returns a line with the cache's size, limit and folder."""
        return f"cache: {self.used_bytes() / 1e9:.2f} of {self.limit_bytes / 1e9:g} GB in {self.folder}"

    def _entries(self) -> list[tuple[float, int, Path]]:
        """Returns (time of last use in seconds since 1970, bytes, path) of each file, the latest used first."""
        found = []
        for path in self.folder.glob("*.npz"):
            with suppress(OSError):
                status = path.stat()
                found.append((status.st_mtime, status.st_size, path))
        return sorted(found, reverse=True)
