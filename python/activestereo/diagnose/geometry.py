# SPDX-License-Identifier: Apache-2.0
"""The geometry that a capture states, which may be wrong: the pose of every view, the projector's pose, focal lengths.

A twist [v, w] is a small rigid motion: six numbers in metres and radians. Its axes are those of the moved object: the
left camera for a view, or the projector. The derivative of an image by a twist comes from the rendered light, depth and
normals of its pixels. Surfaces move in the image with the light that they scatter. Dots slide over surfaces, because
the projector moves with the rig.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import logm
from scipy.ndimage import minimum_filter

from activestereo.capture.capture import SIDES, Capture, ImageKey
from activestereo.common.grouped import grouped
from activestereo.common.pose import motion_of_twist
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.nuisances import predict
from activestereo.effects import Light
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.model import Nuisances, scales
from activestereo.effects.core.resample import means_of_squares
from activestereo.effects.core.view import Layers, View

TWIST = 6
# Half steps of differences: of the pattern, in its pixels; of the focal length, relative (a fifth of a pixel at the
# border of a small image).
_STEP_PX, _FOCAL_STEP = 0.25, 2e-3
# Rays that graze a surface by less than this cosine tell nothing of its place.
_GRAZING = 0.05
# At an edge of a surface, depth changes by more than this share from pixel to pixel.
DEPTH_STEP = 0.03
Twist = NDArray[np.float64]


@dataclass(frozen=True)
class Geometry:
    """Corrections of a capture's stated geometry.

    focal: relative changes of the left and the right focal length. projector: the projector's twist. poses: a twist of
    the left camera for each stated pose, [n][6]. deviations: standard errors of focal, then of twists(), one vector.
    misfit: the factor by which the likelihood overcounts pixels, from the scatter of the images' tiles; 1 = none. left:
    mean square of the residual after the first step of the search, in noise variances.
    """

    stated: Capture
    focal: NDArray[np.float64]
    projector: Twist
    poses: NDArray[np.float64]
    deviations: NDArray[np.float64]
    misfit: float = 1.0
    left: float = np.inf

    @classmethod
    def as_stated(cls, capture: Capture) -> "Geometry":
        poses = len(set(_numbers_of_poses(capture).values()))
        return cls(
            capture,
            np.zeros(len(SIDES)),
            np.zeros(TWIST),
            np.zeros((poses, TWIST)),
            np.zeros(len(SIDES) + TWIST * (1 + poses)),
        )

    def is_as_stated(self) -> bool:
        return not (self.focal.any() or self.twists().any())

    def twists(self) -> NDArray[np.float64]:
        """Returns the projector's twist, then every pose's, as one vector."""
        return np.concatenate([self.projector, self.poses.ravel()])

    def moved(self, focal: NDArray[np.float64], twists: NDArray[np.float64]) -> "Geometry":
        """Returns the geometry with further corrections: relative changes of the focal lengths, and twists as one
        vector in the order of twists()."""
        projector, *poses = twists.reshape(-1, TWIST)
        return replace(
            self,
            focal=(1.0 + self.focal) * (1.0 + focal) - 1.0,
            projector=_composed(self.projector, projector),
            poses=np.array([_composed(a, b) for a, b in zip(self.poses, poses, strict=True)]),
        )

    def is_same(self, other: "Geometry") -> bool:
        """Returns whether both have the same focal lengths and poses."""
        return np.array_equal(self.focal, other.focal) and np.array_equal(self.twists(), other.twists())

    def beyond_stated(self) -> NDArray[np.float64]:
        """Returns the root mean square of the corrections of train views at rest, in stated deviations: [translation,
        rotation]. Values below 1 become 1."""
        known, counts = self.stated.uncertainty, ~(self.moving() | self.held_out())
        at_rest = self.poses[counts].reshape(-1, 2, TWIST // 2) / np.array([[known.pose_m], [known.pose_rad]])
        return np.maximum(np.sqrt((at_rest**2).mean(axis=(0, 2))), 1.0) if at_rest.size else np.ones(2)

    def moving(self) -> NDArray[np.bool_]:
        """Returns a mask [n] of the poses that belong to moving frames."""
        moving = {f.id for f in self.stated.frames if f.is_moving}
        return np.array([not moving.isdisjoint(self.frames_of(row)) for row in range(len(self.poses))])

    def held_out(self) -> NDArray[np.bool_]:
        """Returns a mask [n] of the poses that only test frames have."""
        train = {f.id for f in self.stated.split("train")}
        return np.array([train.isdisjoint(self.frames_of(row)) for row in range(len(self.poses))])

    def places(self) -> dict[int, NDArray[np.intp]]:
        """Returns {frame id: indices into twists() of the twelve numbers that move its images}: the projector's six and
        its pose's six."""
        of_projector, own = np.arange(TWIST), TWIST + np.arange(TWIST)
        numbers = _numbers_of_poses(self.stated)
        return {id: np.concatenate([of_projector, own + TWIST * row]) for id, row in numbers.items()}

    def frames_of(self, row: int) -> list[int]:
        """Returns the ids of the frames at one pose."""
        return [id for id, number in _numbers_of_poses(self.stated).items() if number == row]

    def capture(self) -> Capture:
        """Returns the capture with the corrections applied."""
        if self.is_as_stated():
            return self.stated
        rig, projector, row = self.stated.rig, self.stated.rig.projector, _numbers_of_poses(self.stated)
        left_to_projector = motion_of_twist(-self.projector) @ projector.left_to_projector
        cameras = {}
        for side, change in zip(SIDES, self.focal, strict=True):
            K = rig.camera(side).K.copy()
            K[:2, :2] *= 1.0 + change
            cameras[side] = replace(rig.camera(side), K=K)
        rig = replace(rig, **cameras, projector=replace(projector, left_to_projector=left_to_projector))
        motions = [motion_of_twist(twist) for twist in self.poses]
        frames = (replace(f, camera_to_world=f.camera_to_world @ motions[row[f.id]]) for f in self.stated.frames)
        return replace(self.stated, rig=rig, frames=tuple(frames))


def _numbers_of_poses(capture: Capture) -> dict[int, int]:
    """Returns {frame id: the number of its pose}, in the order in which the capture states the poses."""
    keys = {f.id: f.camera_to_world.tobytes() for f in capture.frames}
    number = {key: i for i, key in enumerate(dict.fromkeys(keys.values()))}
    return {frame_id: number[key] for frame_id, key in keys.items()}


def _composed(first: Twist, second: Twist) -> Twist:
    """Returns the twist of the motion motion_of_twist(first) @ motion_of_twist(second)."""
    generator = logm(motion_of_twist(first) @ motion_of_twist(second)).real
    return np.array([*generator[:3, 3], generator[2, 1], generator[0, 2], generator[1, 0]])


def geometry_slopes(image: MeasuredImage) -> NDArray[np.float32]:
    """Returns the derivatives of the projector's light and of the ambient light by the projector's twist, then by the
    view's pose, per metre and radian, [2][12][height][width].

    A surface point's motion changes both lights linearly, with a gradient g [..., 3] by that motion. The derivatives by
    a twist (v, w) at point p follow as forces and moments do: v . g + (w x p) . g = v . g + w . (p x g).
    """
    view, layers, dots = image.view, image.layers, DotView.of(image.view)
    points, normal, there = view.points(), view.normal, view.projector_points()
    turn, place = view.camera_to_projector[:3, :3], np.linalg.inv(view.camera_to_projector)[:3, 3]
    x, y = view.rays()
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    in_front = _depth_in_front(view.depth_m)
    edge_points = rays * np.where(np.isfinite(in_front), in_front, 0.0)[..., None]
    flat, pattern = layers.flat[..., None], dots.mean(view.pattern)[..., None]
    from_projector = points - place
    facing = _not_grazing(normal, from_projector)[..., None]
    square = np.maximum(_dot(from_projector, from_projector), 1e-12)[..., None]
    brightening = flat * pattern * (normal / facing - 3.0 * from_projector / square)  # gradient of cos / d^2
    lit = dots.lit[..., None]
    of_dots = flat * _motion_derivative(
        view.projector_K, there, np.where(dots.lit, dots.z, np.inf), _pattern_slope(dots, view)
    )

    # The projector moves: the surfaces stay, the light that falls on them changes.
    by_place = np.where(lit, -(of_dots + brightening @ turn.T), 0.0)
    by_turn = np.where(lit, -np.cross(there, of_dots), 0.0)
    # The rig moves: surfaces move in the cameras' frames with the light that they scatter, and slide along the pixels'
    # rays through the pattern.
    sliding = _dot(of_dots @ turn, rays) / _not_grazing(normal, rays)
    of_dots_and_light = np.where(lit, sliding[..., None] * normal + brightening, 0.0)
    turning = np.where(lit, -np.cross(normal, from_projector) * flat * pattern / facing, 0.0)
    of_indirect, of_ambient, of_flat = (
        -_motion_derivative(view.K, edge_points, in_front, gradient) for gradient in _gradients(layers)
    )
    carried = np.where(lit, pattern * of_flat + of_indirect, 0.0)
    by_twist = _twist_derivative(view.left_to_camera, points, of_dots_and_light, turning)
    by_twist += _twist_derivative(view.left_to_camera, edge_points, carried)
    of_room = _twist_derivative(view.left_to_camera, edge_points, of_ambient)
    lights = [
        np.concatenate([by_place, by_turn, by_twist], axis=-1),
        np.concatenate([np.zeros((*view.shape, TWIST)), of_room], axis=-1),
    ]
    return np.moveaxis(np.array(lights, dtype=np.float32), -1, 1)


def _depth_in_front(depth_m: np.ndarray) -> np.ndarray:
    """Returns the depth of the surface that moves a pixel's edges, in metres: at a step of depth, the nearer one's.
    Infinity where no surface is near."""
    z = np.where(depth_m > 0, depth_m, np.inf)
    nearest = minimum_filter(z, 3)
    return np.where(z > (1.0 + DEPTH_STEP) * nearest, nearest, z)


def _gradients(layers: Layers) -> np.ndarray:
    """Returns the change per pixel along u and v, [3][height][width][2], of `indirect`, `ambient` and `flat`. The edge
    of a texture is as sharp as a pixel, so supersampled images are shifted by one sample where there are any."""
    fine = layers.supersampled
    if fine is None:
        light = (getattr(layers, name).astype(np.float64) for name in ("indirect", "ambient", "flat"))
        return np.stack([np.stack(np.gradient(image)[::-1], axis=-1) for image in light])
    images, edge, size = fine.images()[1:], fine.margin_px * fine.scale, fine.scale
    height, width = (size * n for n in layers.depth_m.shape)

    def inside(down: int, right: int) -> np.ndarray:
        return images[:, edge + down : edge + down + height, edge + right : edge + right + width]

    along = [inside(down, right) - inside(-down, -right) for down, right in ((0, 1), (1, 0))]
    return np.stack([means_of_squares(image, size, np.float32) for image in along], axis=-1) * (0.5 * size)


def _twist_derivative(
    left_to_camera: np.ndarray, points: np.ndarray, by_motion: np.ndarray, turning: np.ndarray | float = 0.0
) -> np.ndarray:
    """Returns the derivatives [..., 6] of light by v and w of the rig's twist, in the left camera's axes. Surfaces
    move opposite to the rig. by_motion: derivative by the surface points' motion. turning: by the turn of normals."""
    force, moment = -by_motion, turning - np.cross(points, by_motion)
    turn, offset = left_to_camera[:3, :3], left_to_camera[:3, 3]
    return np.concatenate([force @ turn, (moment + np.cross(force, offset)) @ turn], axis=-1)


def _motion_derivative(K: np.ndarray, points: np.ndarray, z: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Returns the derivative [..., 3] of an image by the motion of its surface points at depth z. gradient: the image's
    change per pixel along u and v, [..., 2]."""
    of_u = gradient[..., 0] * K[0, 0] / z
    of_v = (gradient[..., 0] * K[0, 1] + gradient[..., 1] * K[1, 1]) / z
    return np.stack([of_u, of_v, -(of_u * points[..., 0] + of_v * points[..., 1]) / z], axis=-1)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i", a, b)


def _pattern_slope(dots: DotView, view: View) -> np.ndarray:
    """Returns the change of the pattern's mean in each pixel, per projector pixel along u and v, [height][width][2]."""
    step = 2.0 * _STEP_PX
    along_u, along_v = (
        dots.mean(view.pattern, dots.u + u, dots.v + v) - dots.mean(view.pattern, dots.u - u, dots.v - v)
        for u, v in ((_STEP_PX, 0.0), (0.0, _STEP_PX))
    )
    return np.stack([along_u, along_v], axis=-1) / step


def _not_grazing(normal: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Returns the dot product of normal and direction. It is infinity where they are nearly perpendicular, so that a
    division by it gives 0."""
    product = _dot(normal, direction)
    return np.where(np.abs(product) > _GRAZING * np.linalg.norm(direction, axis=-1), product, np.inf)


def focal_slopes(image: MeasuredImage) -> NDArray[np.float32]:
    """Returns the derivatives of the projector's light and of the ambient light by the relative focal length,
    [2][height][width].

    They are central differences, of supersampled images if there are any. A dot is hardly wider than a pixel, so
    differences between pixels would be wrong by half. A wrong derivative would make the fit take a focal length error
    for an effect that also stretches the image.
    """
    (u, v), (cx, cy) = image.view.pixels(), image.view.K[:2, 2]
    light = Light.of(image.layers)

    def seen(change: float) -> NDArray[np.float64]:
        shorter = 1.0 / (1.0 + change)
        moved = light.warped(cx + (u - cx) * shorter, cy + (v - cy) * shorter)
        return np.stack([moved.projector, moved.ambient])

    return ((seen(_FOCAL_STEP) - seen(-_FOCAL_STEP)) / (2.0 * _FOCAL_STEP)).astype(np.float32)


def derivatives_in_dn(
    images: Sequence[MeasuredImage], nuisances: Nuisances, of_light: Callable[[MeasuredImage], NDArray[np.float32]]
) -> dict[ImageKey, NDArray[np.float32]]:
    """Returns {(frame id, side): derivatives of the expected image in DN, [...][height][width]}, 0 at clipped pixels.

    of_light(image): returns the derivatives of projector light and ambient light, [2][...][height][width]. It is called
    once per pose and camera.
    """
    views = grouped(((image.side, image.frame.camera_to_world.tobytes()), image) for image in images)

    def of_view(seen: list[MeasuredImage]) -> dict[ImageKey, NDArray[np.float32]]:
        by_light = of_light(seen[0])
        alike: dict[tuple[float, float], NDArray[np.float32]] = {}  # repeats share theirs
        for image in seen:
            if (level := scales(image.frame)) not in alike:
                levels = np.array([nuisances.projector_scale, nuisances.ambient_scale] * np.array(level), np.float32)
                expected = predict(image.frame, image.layers, nuisances, image.view.max_dn)
                inside = (expected > 0.0) & (expected < image.view.max_dn)
                alike[level] = np.tensordot(levels, by_light, axes=1) * inside
        return {image.key: alike[scales(image.frame)] for image in seen}

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return {key: slopes for own in pool.map(of_view, views) for key, slopes in own.items()}
