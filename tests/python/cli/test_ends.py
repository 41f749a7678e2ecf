# SPDX-License-Identifier: Apache-2.0
"""How commands end where the world around them is not as they would have it, or Ctrl-C or SIGTERM ends them."""

import os
import subprocess
import sys

import numpy as np
import pytest

from activestereo.capture.images import write_gray
from activestereo.cli import main
from activestereo.common.phases import Phases
from activestereo.model import library as model_library
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.settings import BOTH, DEPTH, FITTING
from activestereo.effects import builtin, engines
from activestereo.effects.core.load import load_effects
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world
from command_line import refused

COMMAND = [sys.executable, "-m", "activestereo"]


def test_an_effect_file_that_exits_is_an_error_with_its_line(tmp_path):
    (tmp_path / "mine.py").write_text("import sys\nsys.exit(0)\n")
    with pytest.raises(ValueError, match="mine.py, line 2: SystemExit: 0"):
        load_effects(tmp_path / "mine.py")


def test_an_effect_that_exits_when_it_is_used_is_an_error(monkeypatch, capsys):
    monkeypatch.setattr("activestereo.cli.presets.run", lambda args: sys.exit(0))
    assert main(["presets"]) == 2
    assert "test_ends.py, line" in (said := capsys.readouterr().err) and "sys.exit(0) was called" in said


def test_a_closed_standard_output_is_said_before_any_work():
    result = subprocess.run(
        [*COMMAND, "presets"], stderr=subprocess.PIPE, text=True, preexec_fn=lambda: os.close(1), timeout=60
    )
    assert result.returncode == 2
    assert result.stderr == "activestereo: standard output is closed: send it to a file or to /dev/null\n"


def test_depth_on_a_full_disk_leaves_no_file(tmp_path):
    """A file-size limit stands for the disk: the larger files do not fit."""
    rng = np.random.default_rng(0)
    right = rng.integers(0, 255, (64, 160), np.uint8)
    write_gray(tmp_path / "right.png", right)
    write_gray(tmp_path / "left.png", np.roll(right, 8, axis=1))
    out = tmp_path / "out"
    limited = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000));"
        "from activestereo.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    result = subprocess.run(
        [sys.executable, "-c", limited, "depth", tmp_path / "left.png", tmp_path / "right.png", "--k", "100,100,80,32",
         "--baseline", "0.05", "--max-disparity", "32", "--out", out],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert result.returncode == 2 and str(out / "depth.npy") in result.stderr, result.stderr
    assert not out.exists()


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_a_refused_command_leaves_no_folder(command, tmp_path, capsys):
    (tmp_path / "there").mkdir()
    for out in (tmp_path / "there", tmp_path / "there/new", tmp_path / "new/below"):
        assert f"{tmp_path / 'none'}" in refused([command, tmp_path / "none", "--out", out], capsys)
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_sigterm_leaves_no_folder_and_ends_the_workers_as_ctrl_c_does(command, tmp_path):
    """The command's work is a minute's sleep of two processes."""
    code = """
import os, signal, sys, threading, time
from activestereo.cli import arguments, main
from activestereo.common.processes import forked

def work(out, own=arguments.make_folder):
    own(out)
    threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGTERM)).start()
    list(forked(time.sleep, [60, 60], 2))

arguments.make_folder = work
sys.exit(main(sys.argv[1:]))
"""
    words = [sys.executable, "-c", code, command, tmp_path / "none", "--out", tmp_path / "new/below"]
    result = subprocess.run(words, capture_output=True, text=True, timeout=30)
    assert (result.returncode, result.stderr) == (143, "activestereo: stopped\n")
    assert not list(tmp_path.iterdir())


def test_compare_refuses_a_capture_before_it_loads_what_renders(tmp_path):
    code = "import sys; from activestereo.cli import main; main(sys.argv[1:]);"
    code += "print({'scipy', 'activestereo.compare.compare'} & set(sys.modules))"
    arguments = ["compare", tmp_path / "none", "--out", tmp_path / "out"]
    result = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60)
    assert "capture.json" in result.stderr and result.stdout == "set()\n"


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
    monkeypatch.setattr(model_library, "library", lambda *files: few)
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

    stops = (FITTING, {"render", "fit"}), (BOTH, {"fit"}), (BOTH, set()), (DEPTH, {"render"}), (DEPTH, set())
    assert [stopped_in(phase) for phase, _ in stops] == [made for _, made in stops]
    assert main(command) == 0 and "fit" not in work
    assert {"report.html", "diagnose.json"} <= {p.name for p in (tmp_path / "out").iterdir()} - {"stopped.txt"}
    assert not (tmp_path / "out/stopped.txt").exists()
