# SPDX-License-Identifier: Apache-2.0
"""The tables of the public structs and what is made from them are one."""

import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def test_a_generated_file_says_so_below_the_licence():
    headers = ROOT.glob("capi/include/*/*.h")
    from_tables = [p for p in headers if "capi/generation/generate.py" in p.read_text().split("\n", 2)[1]]
    assert ROOT / "capi/include/simsense/parameters.h" in from_tables


def test_a_struct_that_ends_in_padding_is_refused(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "capi/generation"))
    import emit_abi
    import table

    tables = table.read_tables()
    tables.structs["ks_sync"].fields.append(table.Field("later", "uint32", default=0))
    with pytest.raises(table.TableError, match="ks_sync.toml: the struct ends in 4 bytes of padding after later"):
        emit_abi.check_no_padding(tables)
