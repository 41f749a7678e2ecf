# SPDX-License-Identifier: Apache-2.0
"""A diagnosis that Ctrl-C ends says how to go on, and going on skips the renders and fits that were done."""

import pytest

from activestereo.cli import main
from activestereo.compare import model_file
from activestereo.common.phases import Phases
from activestereo.diagnose.settings import DEPTH, FITTING
from activestereo.diagnose.fitter import Fitter
from activestereo.effects import builtin, engines
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world


@pytest.fixture
def work(monkeypatch):
    """Renders and fits that are made."""
    done = []
    own = Fitter._refined
    monkeypatch.setattr(Fitter, "_refined", lambda *given: (done.append("fit"), own(*given))[1])
    return done


def test_going_on_after_ctrl_c_repeats_nothing(tmp_path, monkeypatch, capsys, work):
    world = make_world(tmp_path / "world", size=(80, 45), grid=1)

    class Counted(WorldRenderer):
        def __call__(self, *given):
            work.append("render")
            return super().__call__(*given)

    monkeypatch.setattr(engines, "CaptureRenderer", lambda device: Counted(world, grid=1))
    few = {name: builtin()[name] for name in ("vignetting", "gain_mismatch")}
    monkeypatch.setattr(model_file, "library", lambda *files: few)
    monkeypatch.setenv("ACTIVESTEREO_CACHE", str(tmp_path / "cache"))
    command = ["diagnose", str(world.capture_path), "--no-refine", "--workers", "1", "-o", str(tmp_path / "out")]

    def stopped_in(phase):
        """The work that is done until then."""

        def begin(phases, name, own=Phases.begin):
            own(phases, name)
            if name == phase:
                raise KeyboardInterrupt

        with monkeypatch.context() as stopping:
            stopping.setattr(Phases, "begin", begin)
            assert main(command) == 130
        said = (tmp_path / "out/stopped.txt").read_text()
        assert capsys.readouterr().err.endswith(f"activestereo: {said}")
        assert phase in said and str(tmp_path / "cache") in said and "the same command goes on" in said
        made = set(work)
        work.clear()
        return made

    assert [stopped_in(phase) for phase in (FITTING, DEPTH, DEPTH)] == [{"render", "fit"}, {"fit"}, set()]
    assert main(command) == 0 and "fit" not in work
    assert {"report.html", "diagnose.json"} <= {p.name for p in (tmp_path / "out").iterdir()} - {"stopped.txt"}
    assert not (tmp_path / "out/stopped.txt").exists()
