"""What a moving rig sees a little before or after mid-exposure: the scene shifts, the rig's own dots hardly do."""

import numpy as np
from scipy.linalg import expm

from activestereo.effects.core.dots import DotView
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import sample

_ITERATIONS = 3


def displaced(light, view, dt_s):
    """The Light at time mid-exposure + dt_s: a number, or one per row [height] (row-wise readout).

    Each pixel looks up where the point that it sees then is at mid-exposure. Scene light is taken from there; the dots stay with
    the rig and are placed by the pixel's own new depth. New occlusions are not seen: the motions meant here are of few pixels.
    """
    rows = np.broadcast_to(np.asarray(dt_s, dtype=np.float64), view.shape[:1])
    if not view.frame.is_moving or not rows.any():
        return light
    then_to_mid = _poses(view, rows)
    u, v, points = _source_pixels(view, then_to_mid)
    moved = Light(*sample(np.stack([light.direct, light.indirect, light.ambient, light.flat]), u, v, order=3))
    dots = DotView(view)
    nominal = dots.mean(view.pattern)
    then = dots.mean(view.pattern, *dots.project_camera(points))
    lit = dots.lit & (light.flat > 0)
    seen = np.where(lit, light.direct / np.where(lit, light.flat, 1.0), nominal)
    direct = np.maximum(moved.flat * (seen + then - nominal), 0.0)
    return Light(direct, moved.indirect, moved.ambient, moved.flat)


def _poses(view, rows):
    """[height][4][4]: camera coordinates at each row's time to those at mid-exposure."""
    twist = view.frame.camera_velocity
    velocity, spin = twist[:3], twist[3:]
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0, -spin[2], spin[1]], [spin[2], 0, -spin[0]], [-spin[1], spin[0], 0]]
    generator[:3, 3] = velocity
    to_left = np.linalg.inv(view.left_to_camera)
    times, index = np.unique(rows, return_inverse=True)
    poses = np.stack([view.left_to_camera @ expm(t * generator) @ to_left for t in times])
    return poses[index]


def _source_pixels(view, then_to_mid):
    """(u, v) at mid-exposure of what each pixel sees then, and its camera coordinates then."""
    rotation, shift = then_to_mid[:, None, :3, :3], then_to_mid[:, None, :3, 3]
    far = view.depth_m.max() if view.depth_m.any() else 1.0
    depth_mid = np.where(view.depth_m > 0, view.depth_m, 100.0 * far)  # the sky only turns
    depth = depth_mid
    for _ in range(_ITERATIONS):
        then = view.points(depth)
        mid = np.einsum("rcij,rcj->rci", np.broadcast_to(rotation, (*view.shape, 3, 3)), then) + shift
        u, v = view.to_pixels(mid[..., 0] / mid[..., 2], mid[..., 1] / mid[..., 2])
        depth_there = sample(depth_mid, u, v, order=1)
        depth = depth * depth_there / mid[..., 2]
    return u, v, view.points(depth)
