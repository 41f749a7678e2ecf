# SPDX-License-Identifier: Apache-2.0
"""Names in messages end no line and give a terminal no orders."""

import io
from pathlib import Path

import pytest

from activestereo.cli import main
from activestereo.common.progress_bar import ProgressBar
from activestereo.common.shown import PlainStream, printable

NAMES = {"\x1b[31mred": "\\x1b[31mred", "bell\x07": "bell\\x07", "two\nlines": "two\\nlines", "\x9bm": "\\x9bm",
         "\ud800": "\\ud800", "\u202eright": "\\u202eright", "\r over": "\\r over", "日本": "日本"}  # fmt: skip


@pytest.mark.parametrize(("name", "shown"), NAMES.items())
def test_a_name_is_shown_with_escapes(name: str, shown: str) -> None:
    assert printable(name) == printable(Path(name)) == shown
    stream, bar = io.StringIO(), io.StringIO()
    print(f"a\tb {name}", file=PlainStream(stream))
    assert stream.getvalue() == f"a\tb {name if name == 'two' + chr(10) + 'lines' else shown}\n"
    with ProgressBar(name, bar):
        pass
    assert bar.getvalue().startswith(f"{shown}: 100 %") and bar.getvalue().count("\n") == 1


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("日本", "\ud800")])
def test_a_command_prints_no_raw_name(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / name
    (folder / "left").mkdir(parents=True)
    assert main(["compare", str(folder), "-o", str(tmp_path / "out")]) == 2
    assert main(["add", "haze", "-o", str(folder / "model.json")]) == 0
    out, err = capfd.readouterr()
    assert name not in out + err and printable(name) in out and printable(name) in err + out
