# SPDX-License-Identifier: Apache-2.0
"""Does simulated depth rank methods as a foreign world does: poses are found on clean points, scores have their closed
forms, runs go on where they were, and worlds differ where they should."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from activestereo.benchmarks.sim_to_real import agreements, read_scores
from bench_sim_to_real import main
from sim_to_real import methods
from sim_to_real.clouds import Cloud, cloud
from sim_to_real.features import histograms
from sim_to_real.files import RunFolder
from sim_to_real.icp import Icp, IcpSetting, best_motion
from sim_to_real.objects import objects, surface
from sim_to_real.pose_error import pose_error, successes
from sim_to_real.ppf import Ppf, PpfSetting
from sim_to_real.report import results
from sim_to_real.stage import CameraSettings, Stage
from sim_to_real.template import Template, TemplateSetting
from sim_to_real.tuning import every_candidate, tuned
from sim_to_real.views import rotation, round_of_views
from sim_to_real.worlds import WORLDS

BY_NAME = {thing.name: thing for thing in objects()}
SMALL = CameraSettings(samples=4)


def turn(axis: tuple[float, float, float], degrees: float) -> NDArray[np.float64]:
    out = np.eye(4)
    out[:3, :3] = rotation(np.deg2rad(degrees) * np.array(axis))
    return out


def seen_from_above(name: str, pose: NDArray[np.float64]) -> Cloud:
    """Points of an object's surface that face a camera above it: no renderer, no noise."""
    whole = surface(BY_NAME[name].mesh, 3000, seed=5)
    points, normals = whole.points @ pose[:3, :3].T + pose[:3, 3], whole.normals @ pose[:3, :3].T
    facing = normals @ np.array([0.3, -0.5, 0.8]) > 0.2
    return Cloud(points[facing][:400], normals[facing][:400])


# ---- methods ----


@pytest.mark.parametrize("loss", ["point", "plane", "cauchy"])
def test_icp_finds_the_pose_from_near_by(loss: str) -> None:
    thing, true = BY_NAME["lacquered stairs"], turn((0.0, 0.0, 1.0), 40.0)
    true[:3, 3] = 0.02, -0.01, 0.045
    start = true @ turn((0.6, 0.0, 0.8), 7.0)
    start[:3, 3] += 0.005, -0.004, 0.003
    found = Icp(surface(thing.mesh, 3000), IcpSetting(0.01, loss)).find(seen_from_above(thing.name, true), start)
    mm, degrees = pose_error(found, true, thing)
    assert pose_error(start, true, thing) > (5.0, 5.0)
    assert mm < 2.0 and degrees < 2.0


@pytest.mark.parametrize(
    "name, kind, setting",
    [
        ("lacquered stairs", Template, TemplateSetting(0.03, 0.006)),
        ("glazed vase", Template, TemplateSetting(0.03, 0.006)),
        ("steel block", Ppf, PpfSetting(0.012)),
    ],
)
def test_the_pose_is_found_without_a_guess(name: str, kind: type, setting: object) -> None:
    thing, true = BY_NAME[name], turn((0.0, 0.0, 1.0), 130.0)
    true[:3, 3] = -0.02, 0.01, thing.rest_m
    far = turn((1.0, 0.0, 0.0), 90.0)
    found = kind(surface(thing.mesh, 3000), setting).find(seen_from_above(name, true), far)
    mm, degrees = pose_error(found, true, thing)
    assert mm < 3.0 and degrees < 3.0


@pytest.mark.parametrize("kind", list(methods.METHODS.values()))
def test_too_few_points_are_no_pose(kind: type) -> None:
    method = kind(surface(BY_NAME["clay block"].mesh, 300), kind.SETTINGS[0])
    assert method.find(Cloud(np.zeros((5, 3)), np.zeros((5, 3))), np.eye(4)) is None


def test_features_do_not_change_with_the_pose() -> None:
    still = seen_from_above("lacquered stairs", np.eye(4))
    pose = turn((0.0, 0.6, 0.8), 70.0)
    moved = Cloud(still.points @ pose[:3, :3].T + 0.3, still.normals @ pose[:3, :3].T)
    a, b = (histograms(c.points, c.normals, 0.02) for c in (still, moved))
    assert a == pytest.approx(b, abs=0.1) and np.abs(a - b).mean() < 1e-3
    assert a.reshape(len(a), 3, 11).sum(axis=2) == pytest.approx(1.0)
    assert np.abs(a[0] - a).max() > 0.3  # they differ from place to place


def test_best_motion_is_the_one_that_was_made() -> None:
    random = np.random.default_rng(1)
    points, made = random.standard_normal((5, 4, 3)), turn((0.0, 0.6, 0.8), 100.0)
    made[:3, 3] = 1.0, 2.0, 3.0
    moved = points @ made[:3, :3].T + made[:3, 3]
    assert best_motion(points, moved) == pytest.approx(np.broadcast_to(made, (5, 4, 4)))
    mirrored = best_motion(points[0], points[0] * [1.0, 1.0, -1.0])
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(1.0)


# ---- errors and scores ----


def test_pose_errors_are_up_to_symmetry() -> None:
    block, can, vase, mug = (BY_NAME[name] for name in ("clay block", "brass can", "glazed vase", "plastic mug"))
    half = turn((1.0, 0.0, 0.0), 180.0)
    about = turn((0.0, 0.0, 1.0), 77.0)
    assert pose_error(half, np.eye(4), block)[1] == pytest.approx(0.0, abs=1e-4)
    assert pose_error(turn((0.0, 0.0, 1.0), 90.0), np.eye(4), block)[1] == pytest.approx(90.0)
    assert pose_error(half @ about, np.eye(4), can)[1] == pytest.approx(0.0, abs=1e-4)
    assert pose_error(half @ about, np.eye(4), vase)[1] == pytest.approx(180.0)
    assert pose_error(about, np.eye(4), mug)[1] == pytest.approx(77.0)
    shifted = np.eye(4)
    shifted[0, 3] = 0.003
    assert pose_error(shifted, np.eye(4), mug) == pytest.approx((3.0, 0.0))
    assert pose_error(None, np.eye(4), mug) == (np.inf, np.inf)
    errors = np.array([[9.0, 9.0], [11.0, 1.0], [1.0, 11.0], [np.inf, np.inf]])
    assert successes(errors, (10.0, 10.0)).tolist() == [True, False, False, False]


def test_tuning_takes_the_setting_with_the_most_successes() -> None:
    candidates = [(name, number) for name in methods.METHODS for number in range(2)]
    good, bad, near = (np.tile([[float(v), float(v)]], (4, 1)) for v in (1, 50, 5))
    errors = np.stack([bad, good, good, bad, near, good])
    assert [m.setting for m in tuned({"clean": errors}, candidates)] == [1, 0, 1]


# ---- worlds ----


def test_points_of_clean_depth_lie_on_the_object() -> None:
    things = objects()
    views = round_of_views(things, 0, "test", 0)
    stage = Stage(things, "clean", SMALL)
    for view, depth in zip(views, stage.take_depth(views, 0), strict=True):
        thing = things[view.object_index]
        seen = cloud(depth, stage.config.rgb_intrinsic, view.camera_to_world, view.start[:3, 3])
        assert len(seen.points) > 100
        own = (seen.points - view.object_to_world[:3, 3]) @ view.object_to_world[:3, :3]
        known = surface(thing.mesh, 60000)
        distance = np.linalg.norm(own[::20, None] - known.points[None], axis=2)
        nearest = distance.argmin(axis=1)
        assert np.median(distance.min(axis=1)) < 0.001
        normals = (seen.normals @ view.object_to_world[:3, :3])[::20]
        assert np.median(np.einsum("ij,ij->i", normals, known.normals[nearest])) > 0.95, thing.name
    assert len(cloud(np.zeros_like(depth), stage.config.rgb_intrinsic, np.eye(4), np.zeros(3)).points) == 0


def test_views_of_the_two_splits_differ_and_rounds_do_not_depend_on_others() -> None:
    a, b, c = (round_of_views(objects(), 1, split, n)[3] for split, n in (("test", 4), ("tuning", 4), ("test", 4)))
    assert np.array_equal(a.start, c.start) and not np.array_equal(a.start, b.start)


# ---- runs ----


def read_all(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def options(out: Path, views: int = 8) -> list[str]:
    return ["run", str(out), "--views", str(views), "--tuning-views", "8", "--samples-per-pixel", "1",
            "--foreign-samples", "1"]  # fmt: skip


def test_a_run_goes_on_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for slow in ("PPF", "template"):
        monkeypatch.delitem(methods.METHODS, slow)
    monkeypatch.setattr("activestereo.benchmarks.sim_to_real._DRAWS", 20)
    three = [(name, number) for name, number in every_candidate() if number % 3 == 1]  # of ICP's nine
    for user in ("tuning", "run"):
        monkeypatch.setattr(f"sim_to_real.{user}.every_candidate", lambda: three)
    out = tmp_path / "run"
    main(options(out))
    assert "| 10 mm 10° | `full` |" in capsys.readouterr().out
    whole = read_all(out)
    assert {"gap.json", "gap.png", "depth/foreign/test-0000.npz", "errors/full/test-0000.npz"} <= set(whole)
    (out / "depth/full/test-0000.npz").unlink()
    (out / "errors/full/test-0000.npz").unlink()
    (out / "errors/clean/tuning-0000.npz").unlink()
    main(options(out))
    assert read_all(out) == whole
    written, report = agreements(read_scores([out / "scores.csv"]), "foreign"), results(RunFolder(out)).agreements()
    assert repr(written) == repr(report)  # NaN, which equals nothing, included
    for world in WORLDS:  # of a larger run that was ended before it looked for poses
        (out / f"depth/{world}/test-0001.npz").write_bytes(whole[f"depth/{world}/test-0000.npz"])
    main(["score", str(out)])
    for world in WORLDS:
        (out / f"depth/{world}/test-0001.npz").unlink()
    assert read_all(out) == whole

    with pytest.raises(ValueError, match="results of other settings: seed was 0 and is 3"):
        main([*options(out), "--seed", "3"])
    (out / "errors/full/test-0000.npz").write_bytes(b"half a file")
    with pytest.raises(ValueError, match="errors/full/test-0000.npz: cannot be read"):
        main(["score", str(out)])
    (out / "errors/full/test-0000.npz").unlink()
    with pytest.raises(ValueError, match="errors/full/test-0000.npz is missing"):
        main(["score", str(out)])
    (out / "errors/full/test-0000.npz").write_bytes(whole["errors/full/test-0000.npz"])


def test_a_folder_without_a_run_is_told(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="has no run"):
        main(["score", str(tmp_path)])
    (tmp_path / "settings.json").write_text('{"seed": 1}')
    with pytest.raises(ValueError, match="not of a run of this version"):
        main(["score", str(tmp_path)])
