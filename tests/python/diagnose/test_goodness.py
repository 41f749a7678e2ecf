# SPDX-License-Identifier: Apache-2.0
"""Structure that a residual still holds, and random fields that lie over each other."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects import builtin
from activestereo.diagnose.channels.fields_together import components, pixel_term
from activestereo.diagnose.thresholds import THRESHOLDS
from activestereo.diagnose.refine import ImageResidual
from activestereo.diagnose.score.steadiness import uneven_structure, unsteady_reduced_chi2
from activestereo.diagnose.score.structure import local_structure

SHAPE = (96, 160)
NOISE_DN = 2.0


def dots(rng):
    """An image of smoothed random dots on a ramp, DN."""
    image = np.kron(rng.random((SHAPE[0] // 4, SHAPE[1] // 4)) > 0.7, np.ones((4, 4))) * 80.0
    for axis in (0, 1):
        image = (np.roll(image, 1, axis) + 2 * image + np.roll(image, -1, axis)) / 4
    return 20.0 + image + np.linspace(0, 10, SHAPE[1])


def row(image, residual, **frame):
    o = SimpleNamespace(
        side="left",
        frame=SimpleNamespace(**frame),
        weight=np.full(SHAPE, NOISE_DN**-2),
        pixels=image.size,
        view=SimpleNamespace(once=lambda *_: np.zeros(SHAPE, bool), max_dn=255),
    )
    return ImageResidual(o, image, image - 20.0, residual)


def components_of(largest, rows):
    """largest: {id: deviation of a draw at most}."""
    return components({name: pixel_term(builtin()[name]) for name in largest}, largest, rows, 0.0, THRESHOLDS)


def test_noise_and_grains_are_no_structure():
    rng = np.random.default_rng(3)
    for _ in range(3):
        image = dots(rng)
        noise = NOISE_DN * rng.standard_normal(SHAPE)
        assert abs(local_structure([row(image, noise)])) < 0.01
        grains = 0.2 * image * rng.standard_normal(SHAPE)
        assert abs(local_structure([row(image, noise + grains)])) < 0.03 * np.mean(grains**2) / NOISE_DN**2


@pytest.mark.parametrize("kind", ["displaced", "brighter", "offset", "blurred"])
def test_what_moves_dims_or_blurs_smoothly_is_structure_of_its_own_size(kind):
    rng = np.random.default_rng(4)
    image = dots(rng)
    across = np.linspace(-1.0, 1.0, SHAPE[1])
    change = {
        "displaced": 0.2 * across * np.gradient(image)[1],
        "brighter": 0.08 * across * image,
        "offset": 3.0 * across * np.ones(SHAPE),
        "blurred": 0.1 * (1.0 + across) * sum(np.gradient(np.gradient(image)[axis])[axis] for axis in (0, 1)),
    }[kind]
    size = np.mean(change**2) / NOISE_DN**2
    structure = local_structure([row(image, change + NOISE_DN * rng.standard_normal(SHAPE))])
    assert (0.5 if kind == "blurred" else 0.8) * size < structure < 1.1 * size


def frames(rng, gain_sigma, contrast):
    """Rows of six frames at three poses (two of them once repeated) under pixel gains, and grains that change with the
    pose."""
    gains, rows = gain_sigma * rng.standard_normal(SHAPE), []
    for pose, count in enumerate((3, 2, 1)):
        image, grains = dots(rng), contrast * rng.standard_normal(SHAPE)
        for _ in range(count):
            residual = 1.0 * image * gains + (image - 20.0) * grains + NOISE_DN * rng.standard_normal(SHAPE)
            rows.append(row(image, residual, is_moving=False, camera_to_world=np.eye(4) * (1 + pose)))
    return rows


@pytest.mark.parametrize(("gain_sigma", "contrast"), [(0.1, 0.2), (0.1, 0.0), (0.0, 0.2)])
def test_gains_of_pixels_and_grains_are_told_apart_where_both_are_there(gain_sigma, contrast):
    largest = {"prnu": 0.2, "fixed_pattern_noise": 5.0, "speckle_static": 0.3}
    found = components_of(largest, frames(np.random.default_rng(5), gain_sigma, contrast))
    for name, truth in (("prnu", gain_sigma), ("fixed_pattern_noise", 0.0), ("speckle_static", contrast)):
        deviation = abs(found[name].variance - truth**2)
        assert deviation <= max(4.0 * found[name].error, 0.01 * max(gain_sigma, contrast) ** 2), name
        assert (
            (found[name].variance > 3.0 * found[name].error) == (truth > 0)
            or truth == 0
            and found[name].reduced_chi2 < 0.02
        )


def test_offsets_that_the_range_clips_are_no_gains():
    rng = np.random.default_rng(6)
    offsets, rows = 12.0 * rng.standard_normal(SHAPE), []
    for pose in range(5):
        image = dots(rng)
        measured = np.clip(image + offsets + NOISE_DN * rng.standard_normal(SHAPE), 0.0, 255.0)
        rows.append(row(image, measured - image, is_moving=False, camera_to_world=np.eye(4) * (1 + pose)))
    found = components_of({"prnu": 0.3, "fixed_pattern_noise": 12.0}, rows)
    assert found["prnu"].variance < 3.0 * found["prnu"].error
    believed = components_of({"prnu": 0.0, "fixed_pattern_noise": 0.0}, rows)
    assert believed["prnu"].variance > 3.0 * believed["prnu"].error


def test_an_error_that_one_frame_of_a_view_shows_is_told_from_one_that_all_show():
    rng = np.random.Generator(np.random.PCG64(5))
    image, view = dots(rng), {"is_moving": False, "camera_to_world": np.eye(4)}
    view |= {"exposure_gain": 1.0, "projector_power": 1.0, "ambient": None}
    edges = 0.5 * np.gradient(image)[1]
    noise = [edges + NOISE_DN * rng.standard_normal(SHAPE) for _ in range(3)]
    calm = [row(image, residual, **view) for residual in noise]
    assert unsteady_reduced_chi2(calm) < 0.06
    assert unsteady_reduced_chi2(calm[:2]) == 0.0  # two frames cannot tell which of them is the other one
    moved = [*calm[:2], row(image, noise[2] + 0.3 * np.gradient(image)[1], **view)]
    size = np.mean((0.3 * np.gradient(image)[1]) ** 2) / NOISE_DN**2
    assert 0.4 * size < unsteady_reduced_chi2(moved) < size
    assert abs(uneven_structure(calm)) < 0.02 * size < uneven_structure(moved)


def test_an_edge_in_one_corner_of_a_dark_picture_makes_no_structure_of_noise():
    image = np.full(SHAPE, 6.0)
    image[4::16, 4::16] += 0.02  # one half of each tile has an edge, of which the other hardly shows anything
    image[2::16, 1::16] += 8.0
    noise = NOISE_DN * np.random.default_rng(7).standard_normal((20, *SHAPE))
    assert max(abs(local_structure([row(image, residual)])) for residual in noise) < 0.05
