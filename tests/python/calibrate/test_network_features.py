# SPDX-License-Identifier: Apache-2.0
"""A user's network, given as ONNX, compares pictures in the filter bank's place."""

import numpy as np
import pytest
from material_worlds import PAINTS, record, seen_of
from onnx_bytes import edge_network, network

from activestereo.calibrate.material_fit import MaterialFit
from activestereo.calibrate.network_features import Network, PictureFeatures
from activestereo.cli import main


@pytest.fixture(scope="module")
def edges(tmp_path_factory):
    path = tmp_path_factory.mktemp("network") / "edges.onnx"
    path.write_bytes(edge_network())
    return path


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    return record(tmp_path_factory.mktemp("plastic"), PAINTS["plastic"], scale=0.4, samples=64, poses=1)


@pytest.fixture(scope="module")
def seen(ball):
    return seen_of(ball, "ball")


def test_the_layers_behind_convolutions_are_looked_at_and_no_classifier(edges):
    layers = Network(edges).features(np.zeros((64, 80, 3), np.float32))
    assert [layer.shape for layer in layers] == [(8, 64, 80), (6, 32, 40)]


def test_a_small_picture_is_enlarged_and_a_gray_one_is_three_times_the_same(edges):
    gray = np.random.default_rng(0).random((40, 60, 1), dtype=np.float32)
    layers = Network(edges).features(gray)
    assert layers[0].shape == (8, 80, 120)
    assert np.allclose(layers[0], Network(edges).features(np.repeat(gray, 3, axis=2))[0])
    length = np.linalg.norm(layers[0], axis=0)
    assert np.allclose(length[length > 0.5], 1.0, atol=1e-5) and (length > 0.5).mean() > 0.9


def test_noise_counts_in_deviations_as_it_does_in_pixels(edges, seen):
    for picture in seen[1]:
        compared = PictureFeatures(Network(edges), picture)
        assert all(not part.any() for part in compared.differences(picture.seen))
        noise = np.random.default_rng(5).standard_normal(picture.seen.shape) * picture.sigma
        total = sum(float(np.sum(part**2)) for part in compared.differences(picture.seen + noise))
        assert total == pytest.approx(picture.seen.size, rel=0.25)


def test_the_loss_with_a_network_is_least_at_the_truth(edges, seen):
    fit = MaterialFit(*seen, network=Network(edges))
    truth = np.array(PAINTS["plastic"])
    least = fit.residuals(truth, 16).loss
    for place, value in ((0, 0.15), (0, 0.6), (1, 0.4), (2, 0.2), (4, 0.35), (4, 0.65)):
        other = truth.copy()
        other[place] = value
        assert fit.residuals(other, 16).loss > 1.02 * least, (place, value)
    assert MaterialFit(*seen).residuals(truth, 16).first.size != fit.residuals(truth, 16).first.size


def test_files_that_are_no_network_are_refused_in_one_line(ball, tmp_path, capfd):
    bad = {
        "missing.onnx": (None, "no such file"),
        "text.onnx": (b"hello", "cannot read it as ONNX"),
        "cut.onnx": (edge_network()[:900], "cannot read it as ONNX"),
        "unknown.onnx": (network([("Quux", ["picture"], "out", {})], {}), "cannot read it as ONNX"),
        "plain.onnx": (network([("Relu", ["picture"], "out", {})], {}), "has no convolution"),
        "four.onnx": (
            network(
                [("Conv", ["picture", "w"], "c", {"kernel_shape": [1, 1]}), ("Relu", ["c"], "a", {})],
                {"w": np.ones((2, 4, 1, 1))}, channels=4,
            ),
            "does not take a picture of 3 channels",
        ),
    }  # fmt: skip
    out = tmp_path / "model.json"
    for name, (data, words) in bad.items():
        if data is not None:
            (tmp_path / name).write_bytes(data)
        arguments = ["calibrate", "materials", str(ball), "--object", "ball", "-o", str(out)]
        assert main([*arguments, "--network", str(tmp_path / name)]) == 2
        said = capfd.readouterr().err
        assert name in said and words in said and len(said.strip().splitlines()) == 1, said
    assert not out.exists()
