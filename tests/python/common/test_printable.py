# SPDX-License-Identifier: Apache-2.0
"""Names in messages end no line and give a terminal no orders; phases are told by number, none too early."""

import io
from pathlib import Path

import pytest

from activestereo.cli import main
from activestereo.common.phases import Phases
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


USUAL_S = {"render": 10.0, "fit": 30.0, "write": 20.0}


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.mark.parametrize("slow", [{}, {"render": 0.1}, {"fit": 90.0}, {"write": 60.0}])
def test_a_run_is_told_by_its_phases_shares(slow):
    clock, told = Clock(), []
    phases = Phases(told.append, USUAL_S, clock=clock)
    for name, seconds in (USUAL_S | slow).items():
        phases.begin(name)
        for i in range(1, 11):
            clock.now += seconds / 10
            phases(i / 10)
    phases.end()
    assert phases.taken_s == pytest.approx(USUAL_S | slow)
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)
    assert told[10] == pytest.approx(10 / 60) and told[21] == pytest.approx(40 / 60)


def test_a_second_pass_of_a_phase_does_not_begin_it_again():
    told = []
    phases = Phases(told.append, USUAL_S)
    phases.begin("render")
    for fraction in (0.5, 1.0, 0.01, 0.5, 1.0):
        phases(fraction)
    assert told == sorted(told)


def test_the_bar_names_the_phase_and_its_number():
    stream, clock = io.StringIO(), Clock()
    with ProgressBar("work", stream, clock=clock) as bar:
        phases = Phases(bar, USUAL_S, clock=clock)
        phases.begin("render")
        clock.now += 20.0
        phases.begin("fit")
        clock.now += 30.0
        phases(0.5)
        phases.end()
    assert stream.getvalue().splitlines() == [
        "work: render 1/3, 0 %, ...",
        "work: fit 2/3, 17 %, 1 min 40 s left",
        "work: fit 2/3, 42 %, 1 min 10 s left",
        "work: 100 %, done in 50 s",
    ]
