# SPDX-License-Identifier: Apache-2.0
"""Objects a millimetre from where the survey has them: nuisances, in the base model and beside every effect."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from activestereo.capture import read_capture
from activestereo.effects import Model
from activestereo.lab.cache import LayerCache
from activestereo.lab.diagnose.base_fit import fit_base
from activestereo.lab.diagnose.evidence import gather
from activestereo.lab.diagnose.evidence.places import MOTIONS, PLACE_SIGMA_M, TURN_SIGMA_RAD
from activestereo.lab.diagnose.gates import GATES
from activestereo.lab.diagnose.propose.scan import scan_observations
from activestereo.lab.diagnose.refine import Fitters
from activestereo.lab.fit import predict
from activestereo.lab.render import WARP_SCALE, render_frames
from lab_worlds import WorldRenderer
from worlds.world import make_world

BALL, BOX = 2, 3
SHIFT_M, YAW_RAD = np.array([1.5e-3, -0.5e-3, 1.0e-3]), np.radians(0.5)


def displaced(solids):
    """The ball shifted; the box turned about its vertical axis."""
    out = list(solids)
    out[BALL] = replace(solids[BALL], centre=tuple(np.asarray(solids[BALL].centre) + SHIFT_M))
    out[BOX] = replace(solids[BOX], yaw=solids[BOX].yaw + YAW_RAD)
    return tuple(out)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """(evidence whose images are of the displaced world without noise, images as surveyed {key: DN})."""
    folder = tmp_path_factory.mktemp("world")
    world = make_world(folder, grid=2)
    capture = read_capture(world.capture_path)

    def layers_of(solids, name):
        renderer = WorldRenderer(replace(world, solids=solids), grid=6, bounces=1)
        return render_frames(capture, renderer, cache=LayerCache(folder / name), scale=WARP_SCALE)

    evidence, moved = gather(capture, layers_of(world.solids, "surveyed")), layers_of(displaced(world.solids), "moved")

    def exposed(o):
        measured = predict(o.frame, moved[o.frame.id][o.eye], evidence.nuisances, capture.rig.max_dn)
        # Next to no noise: a small capture tells as much as a large one does.
        return replace(o, measured=measured.astype(np.float32), weight=np.full_like(o.weight, 25.0))

    return replace(evidence, train=tuple(map(exposed, evidence.train)), test=tuple(map(exposed, evidence.test)))


def expected_of(evidence, o):
    return predict(o.frame, o.layers, evidence.nuisances, evidence.capture.rig.max_dn)


def test_slopes_foretell_what_a_motion_changes(made):
    motions = np.zeros(made.motions)
    motions[MOTIONS * BALL : MOTIONS * BALL + 3] = SHIFT_M / PLACE_SIGMA_M
    motions[MOTIONS * BOX + 4] = YAW_RAD / TURN_SIGMA_RAD
    changes, foretold = [], []
    for o in made.train:
        if o.frame.projector_power > 0:
            continue  # under even light no dot lies between a side and its pixel
        foretold.append(o.place_slopes @ motions)
        changes.append((o.measured - expected_of(made, o)).ravel())
    change, slopes = np.concatenate(changes), np.concatenate(foretold)
    seen = np.abs(slopes) > 0
    assert np.corrcoef(change[seen], slopes[seen])[0, 1] > 0.85
    assert (change[seen] @ slopes[seen]) / (slopes[seen] @ slopes[seen]) == pytest.approx(1.0, abs=0.15)


def test_a_fit_finds_the_motions_and_removes_their_error_from_other_frames(made):
    def without(o):
        return replace(o, place_slopes=csr_matrix((o.measured.size, 0), dtype=np.float32))

    held = replace(made, train=tuple(map(without, made.train)), test=tuple(map(without, made.test)), motions=0)
    errors = {}
    for name, evidence in (("free", made), ("held", held)):
        fitters = Fitters.of(evidence, scan_observations(evidence.train))
        base = fit_base(evidence, fitters, Model(), GATES)
        outlines = [o.place_slopes.getnnz(axis=1).reshape(o.measured.shape) > 0 for o in made.test]
        errors[name] = sum(float((row.residual[here] ** 2).sum()) for row, here in zip(base.test, outlines, strict=True))
        if name == "free":
            found = base.solution.phi[-made.motions :].reshape(-1, MOTIONS)
    # What is left is of dots on the ball and of shadows, which move, too.
    assert errors["free"] < 0.7 * errors["held"]
    np.testing.assert_allclose(PLACE_SIGMA_M * found[BALL, :3], SHIFT_M, atol=0.5e-3)
    assert TURN_SIGMA_RAD * found[BOX, 4] == pytest.approx(YAW_RAD, rel=0.35)


def test_the_normal_equations_are_those_of_dense_columns(made):
    fitters = Fitters.of(made, scan_observations(made.train))
    base, fitter = fit_base(made, fitters, Model(), GATES), fitters.train
    solution = base.solution
    sums = fitter.linearise(solution.space, solution.theta, solution.phi, fitter.lights(solution.space, solution.theta))
    gram, moment = np.zeros((made.motions, made.motions)), np.zeros(made.motions)
    for row in base.train:
        o = row.observation
        weighted = o.place_slopes.toarray() * np.sqrt(o.weight.ravel())[:, None]
        gram += weighted.T @ weighted
        moment += weighted.T @ (row.residual * np.sqrt(o.weight)).ravel()
    np.testing.assert_allclose(sums.gram.sum(0)[-made.motions :, -made.motions :], gram, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(sums.moment.sum(0)[-made.motions :], moment, rtol=1e-2, atol=1e-2 * np.abs(moment).max())
