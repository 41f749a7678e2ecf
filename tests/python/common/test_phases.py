# SPDX-License-Identifier: Apache-2.0
"""Phases of long work: each is named with its number, what is left follows what earlier runs took, and nothing is told
to be done before it is."""

import io
import json

import pytest

from activestereo.common.phases import Phases
from activestereo.common.progress_bar import ProgressBar
from activestereo.common.progress_bar import UsualTime
from activestereo.compare.phase_times import PhaseTimes

USUAL_S = {"render": 10.0, "fit": 30.0, "write": 20.0}
USUAL = {phase: UsualTime(runs=[(1.0, seconds)]) for phase, seconds in USUAL_S.items()}


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def _told(phase_lengths, reports=10):
    """[(true fraction of the time, fraction told)] of a run whose phases last so long."""
    clock, out = Clock(), []
    total = sum(phase_lengths.values())
    phases = Phases(lambda fraction: out.append((clock.now / total, fraction)), USUAL, clock=clock)
    for name, seconds in phase_lengths.items():
        phases.begin(name)
        for i in range(1, reports + 1):
            clock.now += seconds / reports
            phases(i / reports)
    phases.end()
    assert phases.taken_s == pytest.approx(phase_lengths)
    return out


def test_a_run_like_those_before_is_told_exactly():
    for true, told in _told(USUAL_S):
        assert told == pytest.approx(true, abs=1e-9)


@pytest.mark.parametrize("changed", [{"render": 0.1}, {"fit": 90.0}, {"write": 60.0}])
def test_a_run_unlike_those_before_never_seems_done_too_early(changed):
    told = _told(USUAL_S | changed)
    assert [b for _, b in told] == sorted(b for _, b in told)
    early = [true for true, fraction in told if fraction >= 0.99 and true < 0.9]
    assert not early and told[-1][1] == pytest.approx(1.0)


def test_a_silent_phase_that_takes_longer_has_time_left():
    """The last phase takes five times as long as it used to and says nothing of its share."""
    clock, told = Clock(), []
    phases = Phases(told.append, USUAL, clock=clock)
    for name in USUAL_S:
        phases.begin(name)
        clock.now += USUAL_S[name]
    clock.now += 80.0
    phases(0.0)
    assert told[-1] == pytest.approx(140.0 / 150.0)


def test_a_part_that_was_kept_on_disk_does_not_stand_for_the_rest():
    """Half of the last phase passes at once: its other half may take its time."""
    clock, told = Clock(), []
    phases = Phases(told.append, USUAL, clock=clock)
    for name in USUAL_S:
        phases.begin(name)
        clock.now += 0.0 if name == "write" else USUAL_S[name]
    phases(0.5)
    assert told[-1] == pytest.approx(40.0 / 50.0)


def _said(usual, seconds, work=1.0, reports=8):
    """[(true seconds left, fewest told, most told)] of a run whose phases last so long."""
    clock, out = Clock(), []

    class Bar(ProgressBar):
        def show(self, fraction, left_s, at_once=False):
            out.append((sum(seconds.values()) - clock.now, *left_s))

    phases = Phases(Bar("work", io.StringIO()), usual, work, clock)
    for name, lasts in seconds.items():
        phases.begin(name)
        for i in range(1, reports + 1):
            clock.now += lasts / reports
            phases(i / reports)
    return out


def test_where_nothing_changed_the_time_left_falls_steadily():
    said = _said(USUAL, USUAL_S)
    assert all(low <= true + 1e-9 and true <= high + 1e-9 for true, low, high in said)
    for told in zip(*said, strict=True):
        assert list(told) == sorted(told, reverse=True)


def test_a_busy_machine_is_busy_in_the_phases_to_come_too():
    """Once a tenth of the run is over, at 5 times its usual pace, what is told is never far from what comes."""
    said = _said(USUAL, {name: 5.0 * seconds for name, seconds in USUAL_S.items()})
    assert all(0.6 * true <= high and low <= true for true, low, high in said if 30.0 < true < 270.0)
    assert all(high <= 1.6 * true for true, _, high in said)


def test_a_second_pass_of_a_phase_does_not_begin_it_again():
    clock, out = Clock(), []

    class Bar(ProgressBar):
        def show(self, fraction, left_s, at_once=False):
            out.append(left_s[1])

    phases = Phases(Bar("work", io.StringIO()), USUAL, clock=clock)
    phases.begin("render")
    for fraction in (0.5, 1.0, 0.01, 0.5, 1.0):
        clock.now += 5.0
        phases(fraction)
    assert max(out) < 2.0 * out[0]


def test_an_unsure_time_is_told_as_a_range_that_closes():
    guess = {name: UsualTime(0.0, seconds) for name, seconds in USUAL_S.items()}
    said = _said(guess, USUAL_S)
    assert said[0][1:] == pytest.approx((30.0, 120.0)) and all(low <= true <= high for true, low, high in said)
    widths = [high - low for _, low, high in said]
    assert widths == sorted(widths, reverse=True) and widths[-1] == pytest.approx(0.0)


def test_the_time_of_larger_work_is_between_that_of_a_run_and_that_in_proportion():
    small = UsualTime(1.0, 1.0, [(1.0, 10.0)])
    assert small.span_s(4.0) == pytest.approx((10.0, 20.0, 40.0))
    assert small.span_s(0.25) == pytest.approx((2.5, 5.0, 10.0))
    assert UsualTime(1.0, 1.0, [(1.0, 10.0), (4.0, 25.0), (3.5, 29.0)]).span_s(4.0) == (20.0, 27.0, 36.25)


def test_the_bar_names_the_phase_and_its_number():
    stream, clock = io.StringIO(), Clock()
    usual = {name: UsualTime(runs=[(2.0, 2.0 * lasts)]) for name, lasts in USUAL_S.items()}
    with ProgressBar("work", stream, clock=clock) as bar:
        phases = Phases(bar, usual | {"fit": UsualTime(runs=[(2.0, 50.0), (2.0, 70.0)])}, work=2.0, clock=clock)
        phases.begin("render")
        clock.now += 20.0
        phases.begin("fit")
        clock.now += 30.0
        phases(0.5)
        phases.end()
    assert stream.getvalue().splitlines() == [
        "work: render 1/3, 0 %, about 2 min left",
        "work: fit 2/3, 17 %, about 2 min left",
        "work: fit 2/3, 42 %, about 1 min left",
        "work: 100 %, done in 50 s",
    ]


def test_a_wide_range_is_told_by_both_ends():
    stream = io.StringIO()
    bar = ProgressBar("work", stream, clock=Clock())
    bar.show(0.1, (30.0, 120.0), at_once=True)
    bar.show(0.1, (30.0, 38.0), at_once=True)
    bar.show(0.1, (30.0, 1700.0), at_once=True)
    told = ("about 1 min", "34 s", "perhaps 4 min")
    assert stream.getvalue() == "".join(f"work: 10 %, {words} left\n" for words in told)


def test_the_last_runs_are_kept_with_their_work(tmp_path):
    times = PhaseTimes("diagnose", tmp_path / "cache")
    assert times.usual(USUAL) == {phase: UsualTime() for phase in USUAL}
    for seconds in (100.0, 1.0, 2.0, 3.0, 4.0, 5.0):
        times.keep({"fit": seconds}, 2.0)
    assert times.usual({"fit": UsualTime(1.0, 2.0)})["fit"].span_s(2.0) == pytest.approx((1.0 / 1.1, 3.0, 5.5))
    assert PhaseTimes("compare", tmp_path / "cache").usual({"fit": UsualTime(1.0)}) == {"fit": UsualTime(1.0)}


@pytest.mark.parametrize("content", ["{", "[]", '{"diagnose": 3}', '{"diagnose": {"fit": "soon"}}',
                                     '{"diagnose": {"fit": [-1, null, [0, 1], [1, "a"], [1, 1e9], [1]]}}'])  # fmt: skip
def test_a_damaged_file_of_times_is_none(tmp_path, content):
    (tmp_path / "phase_times.json").write_text(content)
    times = PhaseTimes("diagnose", tmp_path)
    assert times.usual({"fit": UsualTime(1.0)}) == {"fit": UsualTime(1.0)}
    times.keep({"fit": 1.0}, 1.0)
    assert json.loads((tmp_path / "phase_times.json").read_text())["diagnose"]["fit"] == [[1.0, 1.0]]


def test_a_folder_that_cannot_be_written_stops_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    PhaseTimes("diagnose", tmp_path / "file" / "cache").keep({"fit": 1.0}, 1.0)
