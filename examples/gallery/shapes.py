# SPDX-License-Identifier: Apache-2.0
"""Poses and images that the gallery is made of. World: metres, z up."""

import numpy as np


def at(x, y, z, yaw=0.0, size=(1.0, 1.0, 1.0)):
    """A pose turned by `yaw` radians about z, of something that is `size` times as large."""
    pose = np.diag([*size, 1.0])
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]] @ pose[:2, :2]
    pose[:3, 3] = x, y, z
    return pose


def checker(cells, low=60, high=200):
    squares = np.indices((cells, cells)).sum(0) % 2
    return np.kron(np.where(squares, high, low), np.ones((8, 8))).astype(np.uint8)


def bumps():
    """A tangent-space normal map of round bumps, uint8 RGB."""
    v, u = np.mgrid[:128, :128] * 2 * np.pi * 10 / 128
    n = np.stack([-0.35 * np.cos(u) * np.sin(v), -0.35 * np.sin(u) * np.cos(v), np.ones_like(u)], -1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.round(255 * (0.5 * n + 0.5)).astype(np.uint8)


def sky():
    """An equirectangular evening: blue above, grey below, a low sun."""
    rows = np.linspace(1, -1, 64)[:, None, None]
    above = [0.25, 0.4, 0.75] + (1 - rows) ** 3 * [0.6, 0.45, 0.2]
    image = np.repeat(np.where(rows > 0, above, [0.18, 0.16, 0.14]), 128, axis=1)
    image[18:22, 92:96] = [60, 45, 25]
    return image.astype(np.float32)


def dots():
    """A projector's pattern: single bright pixels blurred a little."""
    pattern = np.zeros((160, 160))
    rows, columns = np.random.default_rng(3).integers(2, 158, (2, 900))
    pattern[rows, columns] = 1
    near = sum(np.roll(pattern, s, (0, 1)) for s in ((0, 1), (1, 0), (0, -1), (-1, 0)))
    return (255 * np.clip(pattern + 0.35 * near, 0, 1)).astype(np.uint8)


def grid():
    """A pattern of dots in rows and columns, on which distortion shows."""
    pattern = np.zeros((160, 160), np.uint8)
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        pattern[5 + row :: 10, 5 + column :: 10] = 255
    return pattern


def stripes():
    """Coloured bars, a window of stained glass."""
    hues = np.array([[220, 40, 40], [230, 180, 30], [40, 160, 70], [40, 90, 210]], np.uint8)
    image = hues[np.arange(128) // 32][None].repeat(128, 0)
    image[:, np.arange(128) % 32 < 4] = 10
    return image
