# SPDX-License-Identifier: Apache-2.0
"""The geometry that a capture states and may have wrong: the pose of every view and the projector's place.

Twists are [v, w]: six numbers, metres and radians, in the axes of what they move: the left camera of a view, the
projector. The change of an image by a twist comes from the rendered light, depth and normals of its pixels: surfaces
move in the image with what they scatter, and dots slide over them, because the pattern rides with the rig.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, logm

from activestereo.capture.capture import SIDES, Camera, Capture, ImageKey
from activestereo.compare.nuisances import Nuisances
from activestereo.diagnose.evidence.measured_image import MeasuredImage
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.model import scales
from activestereo.effects.core.view import View

TWIST = 6
# Half of the step of the pattern's slope, in its pixels.
_STEP_PX = 0.25
# Rays that graze a surface by less than this cosine tell nothing of where it stands.
_GRAZING = 0.05
Twist = NDArray[np.float64]


@dataclass(frozen=True)
class Geometry:
    """Corrections that carry a capture from where it is stated to where it stands.

    focal: relative, of the left and the right camera. projector: its twist. poses: [n][6], of the left camera, one for
    each pose that the capture states. deviations: standard errors of focal and twists() together.
    """

    stated: Capture
    focal: NDArray[np.float64]
    projector: Twist
    poses: NDArray[np.float64]
    deviations: NDArray[np.float64]

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
        """The projector's twist, then every pose's, as one vector."""
        return np.concatenate([self.projector, self.poses.ravel()])

    def moved(self, focal: NDArray[np.float64], twists: NDArray[np.float64]) -> "Geometry":
        """Further corrections on top, of the focal lengths and as twists() has them."""
        projector, *poses = twists.reshape(-1, TWIST)
        return replace(
            self,
            focal=(1.0 + self.focal) * (1.0 + focal) - 1.0,
            projector=_composed(self.projector, projector),
            poses=np.array([_composed(a, b) for a, b in zip(self.poses, poses, strict=True)]),
        )

    def places(self) -> dict[int, NDArray[np.intp]]:
        """{frame id: where the numbers that its images depend on stand in twists()}."""
        of_projector, own = np.arange(TWIST), TWIST + np.arange(TWIST)
        numbers = _numbers_of_poses(self.stated)
        return {id: np.concatenate([of_projector, own + TWIST * row]) for id, row in numbers.items()}

    def frames_of(self, row: int) -> list[int]:
        """Ids of the frames at one of the poses."""
        return [id for id, number in _numbers_of_poses(self.stated).items() if number == row]

    def capture(self) -> Capture:
        """The capture as it stands."""
        if self.is_as_stated():
            return self.stated
        rig, projector, row = self.stated.rig, self.stated.rig.projector, _numbers_of_poses(self.stated)
        left_to_projector = matrix_of(-self.projector) @ projector.left_to_projector
        cameras = {
            side: _with_focal(rig.camera(side), 1.0 + change) for side, change in zip(SIDES, self.focal, strict=True)
        }
        rig = replace(rig, **cameras, projector=replace(projector, left_to_projector=left_to_projector))
        motions = [matrix_of(twist) for twist in self.poses]
        frames = (replace(f, camera_to_world=f.camera_to_world @ motions[row[f.id]]) for f in self.stated.frames)
        return replace(self.stated, rig=rig, frames=tuple(frames))


def _numbers_of_poses(capture: Capture) -> dict[int, int]:
    """{frame id: the number of its pose, in the order in which the capture states them}."""
    keys = {f.id: f.camera_to_world.tobytes() for f in capture.frames}
    number = {key: i for i, key in enumerate(dict.fromkeys(keys.values()))}
    return {frame_id: number[key] for frame_id, key in keys.items()}


def _with_focal(camera: Camera, factor: float) -> Camera:
    K = camera.K.copy()
    K[:2, :2] *= factor
    return replace(camera, K=K)


def matrix_of(twist: Twist) -> NDArray[np.float64]:
    """The 4x4 motion exp([v, w])."""
    v, w = twist[:3], twist[3:]
    generator = np.array([[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]])
    return expm(generator)


def _composed(first: Twist, second: Twist) -> Twist:
    """The twist of one motion after another."""
    generator = logm(matrix_of(first) @ matrix_of(second)).real
    return np.array([*generator[:3, 3], generator[2, 1], generator[0, 2], generator[1, 0]])


def geometry_slopes(
    measured_images: Sequence[MeasuredImage], nuisances: Nuisances
) -> dict[ImageKey, NDArray[np.float32]]:
    """DN per metre and radian of the projector's twist, then of the view's pose, [12][height][width] of each image."""
    known: dict[tuple[str, bytes], NDArray[np.float64]] = {}  # images of one pose and camera share their light
    out = {}
    for image in measured_images:
        light = image.side, image.frame.camera_to_world.tobytes()
        if light not in known:
            known[light] = _radiance_slopes(image)
        projector, ambient = scales(image.frame)
        levels = np.array([nuisances.projector_scale * projector, nuisances.ambient_scale * ambient])
        out[image.key] = np.tensordot(levels, known[light], axes=1).astype(np.float32)
    return out


def _radiance_slopes(image: MeasuredImage) -> NDArray[np.float64]:
    """Derivatives of the projector's light and of the ambient light, [2][12][height][width]."""
    view, dots = image.view, DotView.of(image.view)
    points, normal = view.points(), view.normal
    place = np.linalg.inv(view.camera_to_projector)[:3, 3]
    x, y = view.rays()
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    z = np.where(view.depth_m > 0, view.depth_m, np.inf)
    from_projector = points - place
    gradients = {name: _gradient(getattr(image.layers, name)) for name in ("flat", "indirect", "ambient")}
    there = view.projector_points()
    pattern, slope = dots.mean(view.pattern), _pattern_slope(dots, view.pattern)
    flat = image.layers.flat
    out = np.zeros((2, 2 * TWIST, *view.shape))
    for j, unit in enumerate(np.eye(TWIST)):
        # The projector: the surfaces stay, the light that falls on them changes.
        shift = np.broadcast_to(-unit[:3] @ view.camera_to_projector[:3, :3], points.shape)
        out[0, j] = flat * (
            _dot(slope, _sliding(view, dots, there, -_moving(unit, there)))
            + pattern * _brightening(from_projector, normal, shift)
        )
        # The rig: surfaces move in the cameras' frames.
        of_left = _in_camera(view.left_to_camera, unit)
        moved = -_moving(of_left, points)
        turned = -np.cross(of_left[3:], normal)
        flow = _flow(view.K, points, z, moved)
        along = _dot(normal, moved) / _not_grazing(_dot(normal, rays))
        slid = (along[..., None] * rays) @ view.camera_to_projector[:3, :3].T
        change = -_dot(gradients["flat"], flow) + flat * _brightening(from_projector, normal, moved, turned)
        k = TWIST + j
        dots_slide = flat * _dot(slope, _sliding(view, dots, there, slid))
        out[0, k] = dots_slide + pattern * change - _dot(gradients["indirect"], flow)
        out[1, k] = -_dot(gradients["ambient"], flow)
    out[0, :, ~dots.lit] = 0.0
    return out


def _gradient(image: np.ndarray) -> np.ndarray:
    """Change per pixel along u and v, [height][width][2]."""
    down, right = np.gradient(image.astype(np.float64))
    return np.stack([right, down], axis=-1)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i", a, b)


def _moving(twist: Twist, points: np.ndarray) -> np.ndarray:
    """Velocity of points that ride with a frame under its twist."""
    return twist[:3] + np.cross(twist[3:], points)


def _in_camera(left_to_camera: np.ndarray, twist: Twist) -> Twist:
    """The left camera's twist in the axes and at the origin of another camera of the rig."""
    turn = left_to_camera[:3, :3] @ twist[3:]
    return np.concatenate([left_to_camera[:3, :3] @ twist[:3] + np.cross(left_to_camera[:3, 3], turn), turn])


def _flow(K: np.ndarray, points: np.ndarray, z: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Pixels [..., 2] by which points go in the image."""
    across = (moved[..., :2] - points[..., :2] / z[..., None] * moved[..., 2:]) / z[..., None]
    return np.stack([K[0, 0] * across[..., 0] + K[0, 1] * across[..., 1], K[1, 1] * across[..., 1]], axis=-1)


def _sliding(view: View, dots: DotView, points: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Projector pixels [..., 2] by which points in the projector's frame go over the pattern."""
    return _flow(view.projector_K, points, np.where(dots.lit, dots.z, np.inf), moved)


def _pattern_slope(dots: DotView, pattern: np.ndarray) -> np.ndarray:
    """Change of the pattern's mean over each pixel per projector pixel, [height][width][2]."""
    step = 2.0 * _STEP_PX
    along_u = dots.mean(pattern, dots.u + _STEP_PX, dots.v) - dots.mean(pattern, dots.u - _STEP_PX, dots.v)
    along_v = dots.mean(pattern, dots.u, dots.v + _STEP_PX) - dots.mean(pattern, dots.u, dots.v - _STEP_PX)
    return np.stack([along_u, along_v], axis=-1) / step


def _brightening(
    from_projector: np.ndarray, normal: np.ndarray, moved: np.ndarray, turned: np.ndarray | float = 0.0
) -> np.ndarray:
    """Relative change of the irradiance cos / d^2 where surfaces move against the projector."""
    facing = _dot(normal, from_projector)
    facing = np.where(np.abs(facing) > _GRAZING * np.linalg.norm(from_projector, axis=-1), facing, np.inf)
    square = np.maximum(_dot(from_projector, from_projector), 1e-12)
    turning = _dot(turned, from_projector) if isinstance(turned, np.ndarray) else 0.0
    return (turning + _dot(normal, moved)) / facing - 3.0 * _dot(from_projector, moved) / square


def _not_grazing(cosine: np.ndarray) -> np.ndarray:
    return np.where(np.abs(cosine) > _GRAZING, cosine, np.inf)
