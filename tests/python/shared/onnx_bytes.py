# SPDX-License-Identifier: Apache-2.0
"""Shared by tests: small networks as the bytes of an ONNX file (protobuf, onnx.proto of ONNX 1.8)."""

import numpy as np


def _number(value):
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def _field(key, value):
    """value: an integer, text, or the bytes of a message."""
    if isinstance(value, int):
        return _number(key << 3) + _number(value)
    data = value.encode() if isinstance(value, str) else value
    return _number(key << 3 | 2) + _number(len(data)) + data


def _tensor(name, array):
    sizes = b"".join(_field(1, size) for size in array.shape)
    return sizes + _field(2, 1) + _field(8, name) + _field(9, array.astype("<f4").tobytes())


def _node(operator, inputs, output, **attributes):
    """attributes: lists of integers."""
    parts = [_field(1, name) for name in inputs] + [_field(2, output), _field(3, output), _field(4, operator)]
    for name, values in attributes.items():
        parts.append(_field(5, _field(1, name) + b"".join(_field(8, v) for v in values) + _field(20, 7)))
    return b"".join(parts)


def _value(name, shape):
    sizes = b"".join(_field(1, _field(1, size)) for size in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, 1) + _field(2, sizes)))


def network(layers, weights, channels=3):
    """layers: [(operator, inputs, output, attributes)], the first input being `picture`; weights: {name: array}."""
    graph = b"".join(_field(1, _node(kind, inputs, out, **more)) for kind, inputs, out, more in layers)
    graph += _field(2, "net")
    graph += b"".join(_field(5, _tensor(name, array)) for name, array in weights.items())
    graph += _field(11, _value("picture", (1, channels, 64, 64))) + _field(12, _value(layers[-1][2], (1, 1)))
    return _field(1, 7) + _field(8, _field(2, 13)) + _field(7, graph)


def edge_network():
    """Two convolutions: steps across, down and of colour in fours of a layer; then sums of neighbours; then what stands
    for a classifier."""
    first = np.zeros((8, 3, 3, 3))
    step = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]]) / 8.0
    for k, kernel in enumerate((step, step.T, -step, -step.T)):
        first[k] = kernel
    first[4:7, :, 1, 1], first[7, :, 1, 1] = np.eye(3), -1.0
    second = np.random.default_rng(1).normal(size=(6, 8, 3, 3)) / 8.0
    layers = [
        ("Conv", ["picture", "w1"], "c1", {"kernel_shape": [3, 3], "pads": [1, 1, 1, 1]}),
        ("Relu", ["c1"], "a1", {}),
        ("MaxPool", ["a1"], "p1", {"kernel_shape": [2, 2], "strides": [2, 2]}),
        ("Conv", ["p1", "w2"], "c2", {"kernel_shape": [3, 3], "pads": [1, 1, 1, 1]}),
        ("Relu", ["c2"], "a2", {}),
        ("Flatten", ["a2"], "f", {}),
        ("Relu", ["f"], "a3", {}),
    ]
    return network(layers, {"w1": first, "w2": second})
