"""Light layers: what one rig pose looks like under each light alone, so that exposure, power and scale need no new ray."""

from dataclasses import dataclass

import numpy as np

from activestereo.capture import EYES


@dataclass(frozen=True)
class ViewCamera:
    """An ideal pinhole at a pose."""

    width: int
    height: int
    K: np.ndarray
    camera_to_world: np.ndarray


@dataclass(frozen=True)
class RenderRequest:
    """Everything that decides the pixels of one rig pose; equal requests give equal layers."""

    scene_path: object
    cameras: tuple
    pattern: np.ndarray
    projector_K: np.ndarray
    projector_to_world: np.ndarray
    samples_per_pixel: int
    max_bounces: int
    seed: int


@dataclass(frozen=True)
class Layers:
    """One camera's view, float32 [height][width] unless said. Radiance is the mean over the pixel's square.

    direct, indirect: the projector's light at power 1, straight off the first surface and otherwise; flat: what `direct` would
    be under a pattern that is 1 everywhere; ambient: under uniform radiance 1 from all directions. depth_m: z, 0 = nothing hit;
    normal: [height][width][3], world frame; material: uint32.
    """

    direct: np.ndarray
    indirect: np.ndarray
    ambient: np.ndarray
    flat: np.ndarray
    depth_m: np.ndarray
    normal: np.ndarray
    material: np.ndarray

    @property
    def projector(self):
        return self.direct + self.indirect


def rig_request(capture, frame, samples_per_pixel, max_bounces, seed):
    """The render of a frame's pose: both eyes, and the projector that rides with the rig."""
    rig = capture.rig
    left_to_world = frame.camera_to_world
    poses = {"left": left_to_world, "right": left_to_world @ np.linalg.inv(rig.left_to_right)}
    cameras = tuple(
        ViewCamera(rig.camera(eye).width, rig.camera(eye).height, rig.camera(eye).K, poses[eye]) for eye in EYES
    )
    return RenderRequest(
        scene_path=capture.scene_path,
        cameras=cameras,
        pattern=rig.projector.pattern(),
        projector_K=rig.projector.K,
        projector_to_world=left_to_world @ np.linalg.inv(rig.projector.left_to_projector),
        samples_per_pixel=samples_per_pixel,
        max_bounces=max_bounces,
        seed=seed,
    )
