# SPDX-License-Identifier: Apache-2.0
"""Defines Layers, the rendered images of one camera, and View, all that an effect may know of one image: camera, rig,
geometry, frame settings, and random numbers. Seed and name determine a random stream, so every caller gets the same
numbers."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any

import numpy as np

from activestereo.capture.capture import Capture, Frame
from activestereo.common.computed_once import Remembering, once_of_picked
from activestereo.common.lens import to_pixels, to_tangents
from activestereo.effects.core.resample import SupersampledImages


def random_stream(seed: int, name: str, salt: bytes = b"") -> np.random.Generator:
    """Returns the numpy Generator that seed, name and salt determine."""
    digest = hashlib.sha256(f"{seed} {name} ".encode() + salt).digest()
    return np.random.Generator(np.random.Philox(key=np.frombuffer(digest[:16], dtype=np.uint64)))


REFERENCE_TEMPERATURE_C = 25.0
_NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Layers:
    """One camera's images of light and geometry, float32 [height][width] unless stated. Radiance is the mean over the
    pixel's square.

    direct, indirect: the projector's light at power 1, after one reflection and after more. flat: `direct` under a
    pattern that is 1 everywhere; NaN if rendered under a model. ambient: under uniform radiance 1 from all directions.
    depth_m: z, 0 = nothing hit; normal: [height][width][3], world frame; material: uint32. ambient_direct: the part of
    `ambient` that is reflected once, or None. supersampled: the finer and wider images (direct, indirect, ambient,
    flat) of which the pixels are means, or None.
    """

    direct: np.ndarray
    indirect: np.ndarray
    ambient: np.ndarray
    flat: np.ndarray
    depth_m: np.ndarray
    normal: np.ndarray
    material: np.ndarray
    ambient_direct: np.ndarray | None = None
    supersampled: SupersampledImages | None = None

    @property
    def projector(self) -> np.ndarray:
        return self.direct + self.indirect

    def forget(self) -> None:
        """Drops what the supersampled images keep for warps; it is computed again where it is needed."""
        if self.supersampled is not None:
            self.supersampled.forget()

    def in_camera(self, camera_to_world: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Returns depth_m, normal and ambient_bounced of a View, float64. The result for the latest pose is kept, since
        frames at one pose share their layers."""
        known = self.__dict__.get("_in_camera")
        if known is None or not np.array_equal(known[0], camera_to_world):
            bounced = None
            if self.ambient_direct is not None:
                whole = np.asarray(self.ambient, dtype=np.float64)
                bounced = np.clip(1.0 - self.ambient_direct / np.where(whole > 0, whole, np.inf), 0.0, 1.0)
                bounced *= whole > 0
            depth_m, normal = (np.asarray(image, dtype=np.float64) for image in (self.depth_m, self.normal))
            known = camera_to_world, (depth_m, normal @ camera_to_world[:3, :3], bounced)
            self.__dict__["_in_camera"] = known
        return known[1]


@dataclass(frozen=True)
class View(Remembering):
    """One camera of one frame. Arrays are [height][width]. K: intrinsics [3][3]. depth_m: z, 0 = no surface. normal:
    [height][width][3], unit, camera coordinates. pattern: relative radiant intensity 0..1. a_to_b: maps coordinates in
    a to those in b. distortion: of the nominal camera, see activestereo/common/lens.py. material: number in the scene
    file, or None. ambient_bounced: share of the ambient light that other surfaces have reflected before, or None =
    unknown. known: mask of pixels whose scene is known; None = all. binning: images average binning x binning pixels.
    before: the result of an effect with memory for the frame before; None at the start of a stream. Effects on
    disparity and depth get the left camera's view."""

    side: str
    K: np.ndarray
    depth_m: np.ndarray
    normal: np.ndarray
    pattern: np.ndarray
    projector_K: np.ndarray
    camera_to_projector: np.ndarray
    left_to_camera: np.ndarray
    frame: Frame
    max_dn: float = 255.0
    seed: int = 0
    distortion: tuple[float, ...] = _NO_DISTORTION
    baseline_m: float = 0.05
    material: np.ndarray | None = None
    ambient_bounced: np.ndarray | None = None
    known: np.ndarray | None = None
    binning: int = 1
    before: np.ndarray | None = None

    @classmethod
    def of(cls, capture: Capture, frame: Frame, side: str, layers: Layers, seed: int = 0) -> View:
        rig = capture.rig
        left_to_camera = np.eye(4) if side == "left" else rig.left_to_right
        depth_m, normal, bounced = layers.in_camera(frame.camera_to_world @ np.linalg.inv(left_to_camera))
        return cls(
            side=side,
            K=rig.camera(side).K,
            depth_m=depth_m,
            normal=normal,
            pattern=rig.projector.pattern(),
            projector_K=rig.projector.K,
            camera_to_projector=rig.projector.left_to_projector @ np.linalg.inv(left_to_camera),
            left_to_camera=left_to_camera,
            frame=frame,
            max_dn=rig.max_dn,
            seed=seed,
            distortion=tuple(rig.camera(side).distortion),
            baseline_m=rig.baseline_m,
            material=np.asarray(layers.material),
            ambient_bounced=bounced,
            known=capture.known(frame, side),
            binning=capture.binning,
        )

    @property
    def shape(self) -> tuple[int, int]:
        height, width = self.depth_m.shape
        return height, width

    def known_mask(self) -> np.ndarray:
        """Returns `known` as a mask, also where it is None."""
        return np.ones(self.shape, dtype=bool) if self.known is None else self.known

    @property
    def is_right(self) -> bool:
        return self.side == "right"

    @property
    def warming_k(self) -> float:
        """Returns kelvins above the reference temperature of 25 C; 0 where the temperature is not known."""
        return 0.0 if self.frame.temperature_c is None else self.frame.temperature_c - REFERENCE_TEMPERATURE_C

    def latest(
        self, name: Hashable, light: Any, make: Callable[[], Any], choice: Hashable = None, most: int = 1
    ) -> Any:
        """Returns make(), or its stored value for the same name, light and `choice`. Values for the latest `most`
        choices are kept, since fits change one parameter at a time. Another light clears them."""
        known = self._memory().get(name, ())
        for seen_light, seen_choice, value in known:
            if seen_light is light and seen_choice == choice:
                return value
        kept = [entry for entry in known if entry[0] is light]
        value = make()
        self._memory()[name] = (*kept[max(len(kept) - most + 1, 0) :], (light, choice, value))
        return value

    def pixels(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (u, v) of every pixel's centre, float64 [height][width] each."""
        return _pixels(self.shape)

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (x, y) of the pixels' directions (x, y, 1), through the nominal camera and its lens."""
        return self.once("rays", lambda: _read_only(*to_tangents(*self.pixels(), self.K, self.distortion)))

    def to_pixels(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the pixel position (u, v) to which the nominal camera projects the direction (x, y, 1)."""
        return to_pixels(x, y, self.K, self.distortion)

    def field(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (fx, fy): each pixel's position in the image, -1..1 from border to border, 0 at its middle."""
        height, width = self.shape
        u, v = self.pixels()
        return 2 * u / (width - 1) - 1, 2 * v / (height - 1) - 1

    def points(self, depth_m: np.ndarray | None = None) -> np.ndarray:
        """Returns camera coordinates [..., 3] of the points that the pixels see. depth_m replaces the view's own."""
        if depth_m is None:
            return self.once("points", lambda: _read_only(self.points(self.depth_m))[0])
        x, y = self.rays()
        return np.stack([x * depth_m, y * depth_m, depth_m], axis=-1)

    def projector_points(self) -> np.ndarray:
        """Returns projector coordinates [height][width][3] of the surface points that the pixels see."""
        return self.once("projector points", lambda: _read_only(transform(self.camera_to_projector, self.points()))[0])

    def at(self, pick: np.ndarray) -> PickedView:
        """Returns a view of the selected pixels alone, as an image [1][n]. pick: flat indices of the pixels."""
        images = ("depth_m", "material", "ambient_bounced", "known")

        def picked() -> PickedView:
            own = {one.name: getattr(self, one.name) for one in fields(View)}
            own |= {name: own[name].ravel()[pick][None] for name in images if own[name] is not None}
            return PickedView(**own | {"normal": self.normal.reshape(-1, 3)[pick][None]}, whole=self, pick=pick)

        some: PickedView = once_of_picked(self.once("picked", list), pick, picked)
        return some

    def rng(self, name: str, per: str = "sensor") -> np.random.Generator:
        """Returns a numpy Generator for one effect. per: 'sensor' (one per camera), 'pose' (the same while the rig
        stands still), 'frame', or 'rig' (one for both cameras)."""
        salt = {
            "rig": b"",
            "sensor": self.side.encode(),
            "pose": self.side.encode() + np.ascontiguousarray(self.frame.camera_to_world).tobytes(),
            "frame": f"{self.side} {self.frame.id}".encode(),
        }[per]
        return random_stream(self.seed, name, salt)


@dataclass(frozen=True)
class PickedView(View):
    """Selected pixels of a whole View, at flat indices `pick`, as an image [1][n] for effects that are pointwise."""

    whole: View = field(kw_only=True)
    pick: np.ndarray = field(kw_only=True)

    def pixels(self) -> tuple[np.ndarray, np.ndarray]:
        return self._pick_pair(self.whole.pixels())

    def field(self) -> tuple[np.ndarray, np.ndarray]:
        return self._pick_pair(self.whole.field())

    def _pick_pair(self, images: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        first, second = (image.ravel()[self.pick][None] for image in images)
        return first, second


def _pixels(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.meshgrid(np.arange(shape[1], dtype=np.float64), np.arange(shape[0], dtype=np.float64))
    return u, v


@lru_cache(maxsize=8)
def drawn_by(
    shape: tuple[int, int], k: tuple[float, ...], nominal: tuple[float, ...], other_k: tuple[float, ...],
    other: tuple[float, ...],
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Returns (u, v), [height][width] each: the pixel position in a nominal camera of the ray through each pixel of
    another camera. k, other_k: their intrinsics, row by row; nominal, other: their lenses' distortion."""
    # Cameras with the same lens differ by their intrinsics alone.
    own, lens = ((), ()) if nominal == other else (nominal, other)
    u, v = to_pixels(*to_tangents(*_pixels(shape), np.reshape(other_k, (3, 3)), lens), np.reshape(k, (3, 3)), own)
    _read_only(u, v)
    return u, v


def _read_only(*arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    for array in arrays:
        array.flags.writeable = False
    return arrays


def transform(a_to_b: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Returns points [..., 3] in frame b from those in frame a. a_to_b: [4][4]."""
    return points @ a_to_b[:3, :3].T + a_to_b[:3, 3]
