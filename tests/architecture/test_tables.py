"""The tables of the public structs and what is made from them are one."""

import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def test_generated_files_are_what_the_tables_say():
    result = subprocess.run([sys.executable, ROOT / "capi/tables/generate.py", "--check"], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def test_a_generated_file_says_so_in_its_first_line():
    from_tables = [p for p in ROOT.glob("capi/include/*/*.h") if "capi/tables/generate.py" in p.read_text().split("\n", 1)[0]]
    assert ROOT / "capi/include/simsense/parameters.h" in from_tables
