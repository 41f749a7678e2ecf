# SPDX-License-Identifier: Apache-2.0
"""The cache of renders: what was put is got, and a folder that cannot be written or read harms nobody."""

import gc
import json
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest

from activestereo.compare.cache import CacheWarning, LayerCache
from activestereo.effects.engines.layers import scene_digest

ARRAYS = {"a": np.arange(6.0).reshape(2, 3)}


def test_what_was_put_is_got_and_nothing_else(tmp_path: Path) -> None:
    cache = LayerCache(tmp_path / "new" / "folder")
    assert cache.get_arrays("key") is None
    cache.put_arrays("key", ARRAYS)
    stored = cache.get_arrays("key")
    assert stored is not None
    np.testing.assert_array_equal(stored["a"], ARRAYS["a"])


def test_a_damaged_entry_is_dropped_and_said(tmp_path: Path) -> None:
    """Whatever byte is wrong: the arrays are as they were put, or there are none and the next put makes the entry."""
    cache, entry = LayerCache(tmp_path), tmp_path / "key.npz"
    cache.put_arrays("key", ARRAYS)
    whole = entry.read_bytes()
    damaged = [whole[:i] + bytes([whole[i] ^ mask]) + whole[i + 1 :] for i in range(len(whole)) for mask in (1, 0x80)]
    dropped = 0
    for content in [b"", b"no archive", whole[:-30], *damaged]:
        entry.write_bytes(content)
        assert cache.used_bytes() == len(content)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            stored = cache.get_arrays("key")
        if stored is None:
            dropped += 1
            assert "key.npz: cannot be read" in str(said[0].message) and not entry.exists()
        elif "a" in stored:
            np.testing.assert_array_equal(stored["a"], ARRAYS["a"])
    assert dropped > len(damaged) // 2
    entry.unlink(missing_ok=True)
    os.mkfifo(entry)
    with pytest.warns(CacheWarning, match="key.npz: cannot be read"):
        assert cache.get_arrays("key") is None


def test_the_entry_unused_for_longest_goes_at_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ACTIVESTEREO_CACHE", str(tmp_path))
    cache = LayerCache()
    for key, size in (("old", 500_000), ("used", 250_000)):
        cache.put_arrays(key, {"a": np.zeros(size, np.uint8)})
    (tmp_path / "notes.txt").write_text("no entry")
    used = sum(path.stat().st_size for path in tmp_path.glob("*.npz"))
    assert cache.used_bytes() == used and f"0.00 of 2 GB in {tmp_path}" in cache.usage_text()
    os.utime(tmp_path / "old.npz", (1, 1))
    monkeypatch.setenv("ACTIVESTEREO_CACHE_GB", "0.0006")
    LayerCache().put_arrays("new", {"a": np.zeros(250_000, np.uint8)})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new.npz", "notes.txt", "used.npz"]


@pytest.mark.parametrize("text", ["much", "-1", "nan", "inf"])
def test_a_limit_that_is_none_is_refused_by_its_name(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ACTIVESTEREO_CACHE_GB", text)
    with pytest.raises(ValueError, match=f"ACTIVESTEREO_CACHE_GB is '{text}'"):
        LayerCache()


def test_a_folder_that_cannot_be_made_is_one_warning(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the folder's place")
    cache = LayerCache(tmp_path / "file" / "cache")
    with pytest.warns(CacheWarning, match="not kept.*ACTIVESTEREO_CACHE"):
        cache.put_arrays("key", ARRAYS)
    assert cache.get_arrays("key") is None


def test_a_full_disk_is_one_warning_that_names_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def replace(path: Path, write: Callable[[BinaryIO], object]) -> None:
        with open("/dev/full", "wb") as full:
            write(full)

    unraisable: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", unraisable.append)
    monkeypatch.setattr("activestereo.compare.cache.replace_file", replace)
    with pytest.warns(CacheWarning, match=f"{tmp_path}: No space left on device; ACTIVESTEREO_CACHE"):
        LayerCache(tmp_path).put_arrays("key", ARRAYS)
    gc.collect()
    assert list(tmp_path.iterdir()) == [] and not unraisable


def test_a_read_only_folder_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache = LayerCache(tmp_path)
    cache.put_arrays("key", ARRAYS)

    def refuse(*arguments: object) -> None:
        raise PermissionError(30, "Read-only file system")

    monkeypatch.setattr(os, "utime", refuse)  # root may write into any folder: the mode would refuse nothing
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cache.get_arrays("key") is not None


def test_a_scene_changes_with_the_files_that_it_names(tmp_path: Path) -> None:
    scene, values = tmp_path / "scene.gltf", tmp_path / "some values.bin"
    scene.write_text(json.dumps({"buffers": [{"uri": "some%20values.bin"}], "images": [{"uri": "data:,"}]}))
    values.write_bytes(b"1")
    first = scene_digest(scene)
    values.write_bytes(b"2")
    assert scene_digest(scene) != first


@pytest.mark.parametrize("document", [[], {"buffers": 0.5}, {"images": [3, None, {"uri": 7}, {}]}])
def test_what_is_no_gltf_is_left_to_the_importer(tmp_path: Path, document: object) -> None:
    (tmp_path / "scene.gltf").write_text(json.dumps(document))
    assert scene_digest(tmp_path / "scene.gltf")
