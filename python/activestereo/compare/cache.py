# SPDX-License-Identifier: Apache-2.0
"""Rendered layers kept on disk by a hash of their causes: a second look at a capture traces no ray.

Entries are whole or absent (written aside, then renamed), so that parallel runs may share one folder.
"""

import hashlib
import os
import warnings
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from activestereo.common.input_files import checked_file, read_bytes, read_json
from activestereo.common.output_files import replace_file
from activestereo.compare.layers import Layers, RenderRequest

# Raised when the meaning of a cached array changes.
_FORMAT = 4
_LIMIT_GB = 2.0
_LIMIT_VARIABLE = "ACTIVESTEREO_CACHE_GB"


def default_cache_folder() -> Path:
    """ACTIVESTEREO_CACHE, else the user's cache folder."""
    own = os.environ.get("ACTIVESTEREO_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "activestereo" / "layers"


def default_limit_bytes() -> int:
    """ACTIVESTEREO_CACHE_GB in bytes, else 2 GB. Raises ValueError for anything but a number of at least 0."""
    text = os.environ.get(_LIMIT_VARIABLE)
    try:
        gigabytes = float(text) if text else _LIMIT_GB
    except ValueError:
        gigabytes = -1.0
    if not 0.0 <= gigabytes < 1e6:
        raise ValueError(f"{_LIMIT_VARIABLE} is '{text}', expected gigabytes: a number of at least 0")
    return int(gigabytes * 1e9)


def scene_digest(scene_path: str | Path) -> str:
    """Content hash of a glTF scene and every file it refers to."""
    digest = hashlib.sha256()
    path = Path(scene_path)
    digest.update(read_bytes(path))
    if path.suffix == ".gltf":
        document = read_json(path)
        for kind in ("buffers", "images"):  # entries without the right shape are the importer's to refuse
            entries = document.get(kind) if isinstance(document, dict) else None
            for entry in entries if isinstance(entries, list) else ():
                uri = entry.get("uri") if isinstance(entry, dict) else None
                if isinstance(uri, str) and uri and not uri.startswith("data:"):
                    digest.update(read_bytes(path.parent / unquote(uri)))
    return digest.hexdigest()


def request_key(request: RenderRequest, renderer_version: str) -> str:
    """Hash of all that decides the pixels: equal keys mean equal layers."""
    digest = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype.str}{value.shape}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, tuple):
            for camera in value:
                for field in fields(camera):
                    add(getattr(camera, field.name))
        else:
            digest.update(repr(value).encode())

    add(repr((_FORMAT, renderer_version)))
    for field in fields(request):
        value = getattr(request, field.name)
        add(scene_digest(value) if field.name == "scene_path" else value)
    return digest.hexdigest()


class CacheWarning(UserWarning):
    """Renders cannot be kept, or an entry that was kept cannot be read."""


@dataclass(frozen=True)
class CacheEntry:
    """One file of the cache. used_s: when it was last written or read, seconds since 1970."""

    path: Path
    size_bytes: int
    used_s: float

    def kind(self) -> str:
        """Its content: "renders" (layers or images), "fits", or "damaged" if it is no array file."""
        try:
            with zipfile.ZipFile(checked_file(self.path)) as stored:
                return "fits" if any("/" in name for name in stored.namelist()) else "renders"
        except Exception:  # zipfile has no class of its own for what a damaged file does to it
            return "damaged"


class LayerCache:
    """Folder of `<key>.npz`, one rig pose, one set of images or the fits to one capture each. The entries that were not
    used for longest go when it grows over its limit, by default default_limit_bytes()."""

    def __init__(self, folder: str | Path | None = None, limit_bytes: int | None = None) -> None:
        self.folder = Path(folder) if folder else default_cache_folder()
        self.limit_bytes = default_limit_bytes() if limit_bytes is None else limit_bytes

    def get(self, key: str) -> tuple[Layers, ...] | None:
        """The stored layers, one entry per camera, or None."""
        stored = self.get_arrays(key) or {}
        names = [field.name for field in fields(Layers)]
        present = {f.name for f in fields(Layers) if f.default is MISSING or f"{f.name}_0" in (stored or {})}
        try:
            count = int(stored["count"])
            return tuple(Layers(**{n: stored[f"{n}_{i}"] for n in names if n in present}) for i in range(count))
        except (KeyError, ValueError):  # no such entry
            return None

    def put(self, key: str, layers: tuple[Layers, ...]) -> None:
        arrays = {f"{f.name}_{i}": getattr(view, f.name) for i, view in enumerate(layers) for f in fields(Layers)}
        arrays = {name: array for name, array in arrays.items() if array is not None}
        self.put_arrays(key, arrays | {"count": np.array(len(layers))})

    def get_arrays(self, key: str) -> dict[str, np.ndarray] | None:
        """The stored arrays by name, or None. One that cannot be read costs a CacheWarning and is removed."""
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
        """A folder that cannot be written (read-only, full) costs a CacheWarning and the time to render again, not the
        caller's work."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / f"{key}.npz", lambda file: np.savez(file, **arrays))
        except OSError as error:
            text = f"renders are not kept for a second look: {error}; ACTIVESTEREO_CACHE names another folder"
            warnings.warn(text, CacheWarning, stacklevel=2)
            return
        used = 0
        for entry in self.entries():
            used += entry.size_bytes
            if used > self.limit_bytes:
                with suppress(OSError):
                    entry.path.unlink(missing_ok=True)

    def entries(self) -> list[CacheEntry]:
        """All entries, the last used one first."""
        found = []
        for path in self.folder.glob("*.npz"):
            with suppress(OSError):
                status = path.stat()
                found.append(CacheEntry(path, status.st_size, status.st_mtime))
        return sorted(found, key=lambda entry: entry.used_s, reverse=True)

    def clear(self) -> list[CacheEntry]:
        """Removes all entries, and returns those that are gone. Raises OSError if one cannot be removed."""
        gone = self.entries()
        for entry in gone:
            entry.path.unlink(missing_ok=True)
        return gone

    def usage_text(self) -> str:
        """Its size, its limit and its folder, in a line."""
        used = sum(entry.size_bytes for entry in self.entries())
        return f"cache: {used / 1e9:.2f} of {self.limit_bytes / 1e9:g} GB in {self.folder}"
