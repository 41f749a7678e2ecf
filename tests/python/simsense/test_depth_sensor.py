# SPDX-License-Identifier: Apache-2.0
"""simsense.DepthSensor: the published SimSense's signature and tolerance of arrays."""

import inspect

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import simsense
from depth_engines import depth_engine
from activestereo.common.pose import rigid_motion

SIGNATURE = (
    "lr_size, k_l, k_r, l2r, rgb_size=None, k_rgb=None, l2rgb=None, min_depth=0.0, max_depth=10.0, "
    "ir_noise_seed=0, speckle_shape=0.0, speckle_scale=0.0, "
    "gaussian_mu=0.0, gaussian_sigma=0.0, rectified=False, census_width=7, census_height=7, max_disp=128, "
    "block_width=7, block_height=7, p1_penalty=7, "
    "p2_penalty=86, uniqueness_ratio=15, lr_max_diff=1, median_filter_size=3, depth_dilation=False"
)
SIZE = (160, 96)
K = np.array([[120.0, 0.0, 79.5], [0.0, 120.0, 47.5], [0.0, 0.0, 1.0]])
L2R = rigid_motion((-0.05, 0, 0))
DISPARITY = 12


def make(**settings):
    return simsense.DepthSensor(SIZE, K, K, L2R, **{"rectified": True, "max_disp": 32, **settings})


@pytest.fixture(scope="module")
def pair():
    """A random texture and itself moved by DISPARITY pixels: a plane at f B / DISPARITY."""
    wide = np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0] + DISPARITY), dtype=np.uint8)
    return np.ascontiguousarray(wide[:, :-DISPARITY]), np.ascontiguousarray(wide[:, DISPARITY:])


def test_signature():
    parameters = inspect.signature(simsense.DepthSensor).parameters.values()
    given = [p for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
    assert ", ".join(str(p.replace(annotation=p.empty)) for p in given) == SIGNATURE


def test_plane_comes_back(pair):
    depth = make().compute(*pair)
    assert depth.shape == (SIZE[1], SIZE[0]) and depth.dtype == np.float32
    inside = depth[:, DISPARITY + 8 : -8]
    assert (inside > 0).mean() > 0.95
    assert np.median(inside[inside > 0]) == pytest.approx(120.0 * 0.05 / DISPARITY, rel=0.002)


@pytest.mark.parametrize(
    "view",
    [
        lambda image: np.repeat(image, 2, axis=1)[:, ::2],
        lambda image: image[:, ::-1].copy()[:, ::-1],
        lambda image: image[::-1].copy()[::-1],
        lambda image: np.asfortranarray(image),
        lambda image: np.dstack([image] * 3)[..., 1],
        lambda image: np.pad(image, 5)[5:-5, 5:-5],
    ],
    ids=["every second column", "mirrored", "upside down", "column-major", "one channel of three", "crop"],
)
def test_any_strides_give_the_same(pair, view):
    sensor = make()
    expected = sensor.compute(*pair)
    left, right = (view(image) for image in pair)
    assert not left.flags.c_contiguous
    np.testing.assert_array_equal(sensor.compute(left, right), expected)


def test_input_is_not_written(pair):
    left, right = (image.copy() for image in pair)
    left.flags.writeable = right.flags.writeable = False
    make().compute(left, right)
    np.testing.assert_array_equal(left, pair[0])


@pytest.mark.parametrize(
    "settings",
    [
        {"census_width": 6}, {"census_width": 9, "census_height": 9}, {"max_disp": 1025}, {"max_disp": 64.0},
        {"block_width": 8}, {"block_width": 17, "block_height": 17}, {"p1_penalty": 0}, {"p1_penalty": 86},
        {"p2_penalty": 224}, {"uniqueness_ratio": 256}, {"uniqueness_ratio": -1}, {"lr_max_diff": -2},
        {"median_filter_size": 4}, {"speckle_shape": 1.0}, {"rgb_size": SIZE}, {"k_rgb": K},
        {"k_rgb": K, "rgb_size": SIZE}, {"mode": "exact"},
    ],
)  # fmt: skip
def test_out_of_range_is_a_value_error_and_a_type_error(settings):
    for kind in (ValueError, TypeError):
        with pytest.raises(kind):
            make(**settings)


@pytest.mark.parametrize("size", [(31, 96), (160, 31), (160,), (160.0, 96.0)])
def test_sizes_are_checked(size):
    with pytest.raises(TypeError):
        simsense.DepthSensor(size, K, K, L2R)


def test_wrong_images_are_refused(pair):
    left, right = pair
    for bad in (left[:-1], left.astype(np.float32), left[..., None], left.tolist()):
        with pytest.raises(TypeError, match="uint8"):
            make().compute(bad, right)


def test_setters_change_what_comes_out(pair):
    sensor = make(block_width=1, block_height=1)
    before = sensor.compute(*pair)
    sensor.set_matching_block_size(5, 5)
    sensor.set_census_window_size(5, 5)
    sensor.set_penalties(3, 20)
    sensor.set_lr_max_diff(255)
    sensor.set_uniqueness_ratio(100)
    told = {"block_width": 5, "census_height": 5, "p1": 3, "p2": 20, "lr_max_diff": -1, "uniqueness_ratio": 100}
    assert told.items() <= sensor.engine.parameters.items()
    assert (sensor.compute(*pair) > 0).mean() < (before > 0).mean()
    with pytest.raises(TypeError):
        sensor.set_penalties(9, 9)
    assert sensor.engine.parameters["p1"] == 3


def test_noise_is_new_on_each_call_and_repeats_with_the_seed(pair):
    noise = {"speckle_shape": 4.0, "speckle_scale": 0.25, "gaussian_sigma": 3.0, "gaussian_mu": 0.0}
    first, again, other = make(**noise), make(**noise), make(ir_noise_seed=7, **noise)
    a = first.compute(*pair)
    np.testing.assert_array_equal(a, again.compute(*pair))
    assert not np.array_equal(a, first.compute(*pair))
    assert not np.array_equal(a, other.compute(*pair))
    first.set_ir_noise_parameters(0.0, 0.0, 0.0, 0.0)
    np.testing.assert_array_equal(first.compute(*pair), make().compute(*pair))


def test_registers_to_the_rgb_camera(pair):
    """An RGB camera of twice the focal length and size that stands where the left one does sees the same plane."""
    k_rgb = K * 2
    k_rgb[2, 2] = 1.0
    depth = make(rgb_size=(320, 192), k_rgb=k_rgb, l2rgb=np.eye(4), depth_dilation=True).compute(*pair)
    assert depth.shape == (192, 320)
    assert np.median(depth[depth > 0]) == pytest.approx(0.5, rel=0.002)


def test_each_fault_has_its_switch(pair):
    k_rgb = K * [[2.4], [2.4], [1]] - [[0, 0, 112], [0, 0, 67], [0, 0, 0]]
    rgb = {"rgb_size": SIZE, "k_rgb": k_rgb, "l2rgb": np.eye(4)}
    turned = rigid_motion(L2R[:3, 3], Rotation.from_euler("y", 0.03).as_matrix())
    views = ({}, {**rgb, "depth_dilation": True})

    def depth(**settings):
        sensors = (simsense.DepthSensor(SIZE, K, K, turned, max_disp=32, **view, **settings) for view in views)
        return np.concatenate([sensor.compute(*pair).ravel() for sensor in sensors])

    fixed, exact = depth(), depth(mode="simsense-exact")
    np.testing.assert_array_equal(depth(faults=()), fixed)
    np.testing.assert_array_equal(depth(mode="simsense-exact", faults=simsense.FAULTS), exact)
    assert simsense.FAULTS[-1] == "splat_clipped" and len(set(simsense.FAULTS)) == 7
    assert (depth(faults=("remap_nearest",)) != fixed).any()
    without = [name for name in simsense.FAULTS if name != "remap_nearest"]
    assert (depth(mode="simsense-exact", faults=without) != exact).any()
    for name in simsense.FAULTS:
        depth_engine(SIZE, 120, faults=[name])
    with pytest.raises(ValueError, match="unknown fault"):
        make(faults=("remap",))
