# SPDX-License-Identifier: Apache-2.0
"""Meshes, poses and images that the gallery is made of: numpy only. World: metres, z up."""

import numpy as np


def ball(radius=0.5, rings=48, squeeze=1.0):
    """positions, indices, normals, uvs of a sphere, its height times `squeeze`."""
    v, u = np.meshgrid(np.linspace(0, 1, rings + 1), np.linspace(0, 1, 2 * rings + 1), indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    n = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)
    columns = 2 * rings + 1
    i = (np.arange(rings)[:, None] * columns + np.arange(columns - 1)[None]).reshape(-1)
    faces = np.concatenate([np.stack([i, i + columns, i + 1], 1), np.stack([i + 1, i + columns, i + columns + 1], 1)])
    corners = n[faces]
    faces = faces[np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 1e-9]
    stretch = np.array([1, 1, squeeze])
    normals = n / stretch
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return radius * n * stretch, faces, normals, np.stack([2 * u, v], -1).reshape(-1, 2)


def quad(centre, a, b, repeat=1.0):
    """A parallelogram of half edges a, b; front side a x b; its texture `repeat` times each way."""
    centre, a, b = (np.asarray(x, float) for x in (centre, a, b))
    positions = np.stack([centre - a - b, centre + a - b, centre + a + b, centre - a + b])
    normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    uvs = repeat * np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
    return positions, np.array([[0, 1, 2], [0, 2, 3]]), np.tile(normal, (4, 1)), uvs


def box(half):
    """A box around the origin."""
    parts = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            centre, a, b = np.zeros(3), np.zeros(3), np.zeros(3)
            centre[axis], a[(axis + 1) % 3], b[(axis + 2) % 3] = (
                side * half[axis],
                half[(axis + 1) % 3],
                side * half[(axis + 2) % 3],
            )
            parts.append(quad(centre, a, b))
    positions, faces, normals, uvs = (np.concatenate([p[k] for p in parts]) for k in range(4))
    return positions, faces + 4 * np.repeat(np.arange(6), 2)[:, None], normals, uvs


def look_at(eye, target):
    """A pose whose z points from eye to target; x right, y down."""
    eye, target = np.asarray(eye, float), np.asarray(target, float)
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0, 0, 1])
    x = np.array([1.0, 0, 0]) if np.linalg.norm(x) < 1e-6 else x / np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, np.cross(z, x), z, eye
    return pose


def at(x, y, z, yaw=0.0):
    """A pose turned by `yaw` radians about z."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:3, 3] = x, y, z
    return pose


def checker(cells=8, low=60, high=200):
    squares = np.indices((cells, cells)).sum(0) % 2
    return np.kron(np.where(squares, high, low), np.ones((8, 8))).astype(np.uint8)


def bumps(size=128, waves=10, height=0.35):
    """A tangent-space normal map of round bumps, uint8 RGB."""
    v, u = np.mgrid[:size, :size] * 2 * np.pi * waves / size
    n = np.stack([-height * np.cos(u) * np.sin(v), -height * np.sin(u) * np.cos(v), np.ones_like(u)], -1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.round(255 * (0.5 * n + 0.5)).astype(np.uint8)


def sky(height=64):
    """An equirectangular evening: blue above, grey below, a low sun."""
    rows = np.linspace(1, -1, height)[:, None, None]
    image = np.where(rows > 0, [0.25, 0.4, 0.75] + (1 - rows) ** 3 * [0.6, 0.45, 0.2], [0.18, 0.16, 0.14]) * np.ones(
        (1, 2 * height, 1)
    )
    image[18:22, 92:96] = [60, 45, 25]
    return image.astype(np.float32)


def dots(size=160, count=900, seed=3):
    """A projector's pattern: single bright pixels blurred a little."""
    pattern = np.zeros((size, size))
    rows, columns = np.random.default_rng(seed).integers(2, size - 2, (2, count))
    pattern[rows, columns] = 1
    near = sum(np.roll(pattern, s, (0, 1)) for s in ((0, 1), (1, 0), (0, -1), (-1, 0)))
    return (255 * np.clip(pattern + 0.35 * near, 0, 1)).astype(np.uint8)


def grid(size=160, step=10):
    """A pattern of dots in rows and columns, on which distortion shows."""
    pattern = np.zeros((size, size), np.uint8)
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        pattern[step // 2 + row :: step, step // 2 + column :: step] = 255
    return pattern


def stripes(size=128):
    """Coloured bars, a window of stained glass."""
    hues = np.array([[220, 40, 40], [230, 180, 30], [40, 160, 70], [40, 90, 210]], np.uint8)
    image = hues[np.arange(size) * 4 // size][None].repeat(size, 0)
    image[:, np.arange(size) % (size // 4) < 4] = 10
    return image
