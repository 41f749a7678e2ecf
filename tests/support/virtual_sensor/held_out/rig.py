# SPDX-License-Identifier: Apache-2.0
"""Draws the rig and the eight frames of a held-out case: true values, and the calibration that the user believes."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

WIDTH, HEIGHT = 212, 120
PATTERN_WIDTH, PATTERN_HEIGHT = 640, 400
REFERENCE_C = 25.0
FOCAL_SURVEY = 1e-3


@dataclass(frozen=True)
class Rig:
    """The stereo rig of one focal length; projector and right camera stand on the left camera's x axis."""

    focal_px: float
    baseline_m: float
    projector_x_m: float
    projector_focal_px: float
    pattern: np.ndarray

    def camera_K(self):
        return np.array([[self.focal_px, 0, (WIDTH - 1) / 2], [0, self.focal_px, (HEIGHT - 1) / 2], [0, 0, 1.0]])

    def projector_K(self):
        f = self.projector_focal_px
        return np.array([[f, 0, (PATTERN_WIDTH - 1) / 2], [0, f, (PATTERN_HEIGHT - 1) / 2], [0, 0, 1.0]])


@dataclass(frozen=True)
class Frame:
    """A frame's settings. camera_to_world: the left camera's at mid-exposure; twist: body velocity [v, w]."""

    id: int
    camera_to_world: np.ndarray
    split: str
    timestamp_s: float
    exposure_s: float
    gain: float = 1.0
    power: float = 1.0
    temperature_c: float = REFERENCE_C
    twist: tuple = (0.0,) * 6
    repeat_group: int | None = None

    @property
    def warming_k(self):
        return self.temperature_c - REFERENCE_C

    @property
    def is_moving(self):
        return any(self.twist)


def draw_rig(rng):
    return Rig(
        focal_px=rng.uniform(102, 112),
        baseline_m=rng.uniform(0.045, 0.06),
        projector_x_m=rng.uniform(0.012, 0.022),
        projector_focal_px=rng.uniform(290, 300),
        pattern=draw_pattern(rng),
    )


def believed(rig, rng, amount):
    return replace(rig, focal_px=rig.focal_px * (1.0 + amount * FOCAL_SURVEY * rng.uniform(-1, 1)))


def draw_frames(rng, moving_exposure=1 / 8):
    """Draws the frames: two train poses with repeat, projector off and half exposure, two moving frames, and warm
    frames at both poses; a moving and a warm one are for the test. moving_exposure: of the moving frames relative to
    the others'; their gain makes up for it."""
    poses = [random_pose(rng) for _ in range(4)]
    exposure = rng.uniform(0.0035, 0.0045)
    moving = {"exposure_s": exposure * moving_exposure, "gain": round(1 / moving_exposure, 4)}
    time = np.cumsum(
        np.concatenate([[0.0, 0.0334], rng.uniform(0.8, 3.0, 3), rng.uniform(8.0, 14.0, 1), rng.uniform(0.8, 3.0, 2)])
    )
    return (
        Frame(0, poses[0], "train", time[0], exposure, repeat_group=0),
        Frame(1, poses[0], "train", time[1], exposure, repeat_group=0),
        Frame(2, poses[1], "train", time[2], exposure, power=0.0),
        Frame(3, poses[1], "train", time[3], exposure / 2),
        Frame(4, poses[2], "train", time[4], twist=_twist(rng), **moving),
        Frame(5, poses[0], "train", time[5], exposure, temperature_c=45.0),
        Frame(6, poses[3], "test", time[6], temperature_c=28.0, twist=_twist(rng), **moving),
        Frame(7, poses[1], "test", time[7], exposure, temperature_c=40.0),
    )


def random_pose(rng):
    """Draws a camera-to-world pose in front of the table, looking towards its middle."""
    return look_at(*_eye_and_target(rng))


def look_at(eye, target):
    """Returns the 4x4 camera-to-world pose at `eye` looking at `target`: x right, y down, z forward, world y up."""
    eye, target = np.asarray(eye, dtype=np.float64), np.asarray(target, dtype=np.float64)
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3] = np.stack([x, np.cross(z, x), z, eye], axis=1)
    return pose


def moved(pose, twist, times):
    """Returns poses [n][4][4] of a body `times` seconds after `pose`, under a constant twist [v, w] of its own."""
    (v, w), generator = np.reshape(twist, (2, 3)), np.zeros((4, 4))
    generator[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    generator[:3, 3] = v
    return pose @ expm(np.atleast_1d(times)[:, None, None] * generator)


def draw_pattern(rng):
    """Draws the pattern's relative intensity: round dots on a jittered hexagonal grid, of four strengths."""
    pitch = rng.uniform(7.6, 9.0)
    rows, columns = int(PATTERN_HEIGHT / (0.866 * pitch)) + 1, int(PATTERN_WIDTH / pitch) + 1
    image = np.full((PATTERN_HEIGHT, PATTERN_WIDTH), 0.015)
    sigma = rng.uniform(1.25, 1.6)
    for i in range(rows):
        for j in range(columns):
            u = (j + 0.5 * (i % 2)) * pitch + rng.normal(0, 0.27 * pitch)
            v = i * 0.866 * pitch + rng.normal(0, 0.27 * pitch)
            _stamp(image, u, v, sigma, rng.choice([0.45, 0.6, 0.8, 0.95]))
    return np.clip(image, 0.0, 1.0)


def _stamp(image, u, v, sigma, strength):
    left, top = max(0, int(u) - 7), max(0, int(v) - 7)
    part = image[top : int(v) + 8, left : int(u) + 8]
    if not part.size:
        return
    y, x = np.ogrid[top : top + part.shape[0], left : left + part.shape[1]]
    part += strength * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * sigma**2))


def _eye_and_target(rng):
    eye = (rng.uniform(-0.28, 0.28), rng.uniform(0.33, 0.5), rng.uniform(0.38, 0.52))
    return eye, (rng.uniform(-0.06, 0.06), rng.uniform(0.02, 0.1), rng.uniform(-0.24, -0.14))


def _twist(rng):
    """Draws a twist (v, w), mostly sideways, up to 0.8 m/s and 1.5 rad/s, which moves the picture one way."""
    side = rng.choice([-1, 1])
    v = np.array([side * rng.uniform(0.5, 0.8), rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.2)])
    w = np.array([rng.uniform(-0.6, 0.6), side * rng.uniform(0.8, 1.5), rng.uniform(-0.4, 0.4)])
    return tuple(np.concatenate([v, w]))
