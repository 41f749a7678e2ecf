# SPDX-License-Identifier: Apache-2.0
"""The command cache: what is kept on disk, its limit, and that it can be removed."""

import json
import os

import numpy as np
import pytest

from activestereo.cli import main
from activestereo.compare.cache import LayerCache


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A cache of one render and one capture's fits, and a file that is not the cache's."""
    monkeypatch.setenv("ACTIVESTEREO_CACHE", str(tmp_path))
    cache = LayerCache()
    cache.put_arrays("render", {"ambient_0": np.zeros(500_000, np.uint8), "count": np.array(1)})
    cache.put_arrays("fits", {"key/values": np.zeros(250_000, np.uint8)})
    (tmp_path / "notes.txt").write_text("mine")
    return tmp_path


def test_the_list_tells_kinds_sizes_and_the_limit(kept, capsys):
    assert main(["cache", "list"]) == 0
    said = capsys.readouterr().out
    assert "0.5 MB" in said and "0.3 MB" in said and f"of 2 GB in {kept}" in said
    assert main(["cache", "list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {e["kind"]: e["file"] for e in found["entries"]} == {"renders": "render.npz", "fits": "fits.npz"}
    assert found["limit_bytes"] == 2_000_000_000
    assert found["used_bytes"] == sum(path.stat().st_size for path in kept.glob("*.npz"))


def test_clear_removes_entries_alone(kept, capsys):
    assert main(["cache", "clear"]) == 0
    assert "removed: 2 entries" in capsys.readouterr().out
    assert [path.name for path in kept.iterdir()] == ["notes.txt"]


def test_the_entry_unused_for_longest_goes_at_the_limit_of_the_environment(kept, monkeypatch):
    os.utime(kept / "render.npz", (1, 1))
    monkeypatch.setenv("ACTIVESTEREO_CACHE_GB", "0.0006")
    LayerCache().put_arrays("new", {"key/values": np.zeros(250_000, np.uint8)})
    assert sorted(path.name for path in kept.glob("*.npz")) == ["fits.npz", "new.npz"]


@pytest.mark.parametrize("text", ["much", "-1", "nan", "inf"])
def test_a_limit_that_is_none_is_refused_by_its_name(kept, monkeypatch, capsys, text):
    monkeypatch.setenv("ACTIVESTEREO_CACHE_GB", text)
    assert main(["cache", "list"]) == 2
    assert f"ACTIVESTEREO_CACHE_GB is '{text}'" in capsys.readouterr().err
