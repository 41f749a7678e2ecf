# SPDX-License-Identifier: Apache-2.0
"""The tables of the public structs and what is made from them are one."""

import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def test_generated_files_are_what_the_tables_say():
    result = subprocess.run(
        [sys.executable, ROOT / "capi/generation/generate.py", "--check"], capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr


def test_a_generated_file_says_so_below_the_licence():
    from_tables = [
        p for p in ROOT.glob("capi/include/*/*.h") if "capi/generation/generate.py" in p.read_text().split("\n", 2)[1]
    ]
    assert ROOT / "capi/include/simsense/parameters.h" in from_tables


def test_a_moved_field_and_one_without_a_neutral_zero_are_refused(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "capi/generation"))
    import emit_abi
    import table

    tables = table.read_tables()
    released = (ROOT / "capi/packaging/structs-0.1.txt").read_text()
    assert emit_abi.check_baseline(tables, released) == []
    sync = tables.structs["ks_sync"]
    sync.fields.append(table.Field("later", "uint64", default=5, neutral=5))
    assert emit_abi.check_baseline(tables, released) == [
        "ks_sync.later is younger than the baseline: its neutral value must be 0"
    ]
    sync.fields[-1].neutral = 0
    sync["reserved"].name = "priority"  # of the same size, and its neutral value is 0
    assert emit_abi.check_baseline(tables, released) == []
    sync.fields.insert(0, sync.fields.pop())
    assert any(text.startswith("ks_sync.kind was at") for text in emit_abi.check_baseline(tables, released))
    camera = tables.structs["kuafu_camera_desc"]
    camera.fields.append(table.Field("later", "uint64", default=0, neutral=0))
    assert any(
        "kuafu_camera_desc stands inside other structs" in text for text in emit_abi.check_baseline(tables, released)
    )


def test_a_struct_that_ends_in_padding_is_refused(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "capi/generation"))
    import emit_abi
    import table

    tables = table.read_tables()
    tables.structs["ks_sync"].fields.append(table.Field("later", "uint32", default=0, neutral=0))
    with pytest.raises(table.TableError, match="ks_sync.toml: the struct ends in 4 bytes of padding after later"):
        emit_abi.check_no_padding(tables)
