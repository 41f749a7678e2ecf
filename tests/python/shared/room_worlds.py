# SPDX-License-Identifier: Apache-2.0
"""Recordings of a known room, drawn with NumPy alone: planes, balls, a projector of dots, and a lens of cos^n."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import map_coordinates
from activestereo.common.pose import rigid_motion

WIDTH, HEIGHT = 480, 270
F, CX, CY = 340.0, 236.0, 137.0
BASELINE_M, PLACE_M, EXPONENT, BLACK_DN = 0.055, np.array([0.0275, 0.001, -0.001]), 4.0, 4.0
WARM_UP_S = 1_700_000_000  # when a warm-up begins
# Point and normal of each plane, then centre and radius of each ball; metres, x right, y down, z forward.
PLANES = [
    ((0, 0, 2.0), (0.1, 0.0, -1.0)), ((0, 0.6, 0), (0.0, -1.0, 0.0)), ((-1.0, 0, 0), (1.0, 0, -0.2)),
    ((1.0, 0, 0), (-1.0, 0, -0.25)), ((0, -0.75, 0), (0.0, 1.0, -0.1)),
]  # fmt: skip
BALLS = [((-0.35, 0.3, 1.5), 0.3), ((0.4, 0.35, 1.4), 0.25), ((0.05, -0.2, 1.8), 0.2)]


@dataclass(frozen=True)
class Warm:
    """A warm rig: the right image's shift in px, growth of images and of the pattern's sines, the laser's power."""

    right_px: float = 0.0
    growth: float = 0.0
    pattern: float = 0.0
    power: float = 1.0


@dataclass
class Room:
    """turns_deg: of each view, about y and x, perhaps z; exposures: relative; session: its noise."""

    turns_deg: tuple[tuple[float, ...], ...] = ((0, 0), (14, 3), (-13, -4), (6, -3))
    exposures: tuple[float, ...] = (1.0, 0.85, 1.3, 1.1)
    dots_dn: float = 180.0
    room_dn: float = 110.0
    seed: int = 3
    session: int = 0
    balls: dict[int, list] = field(default_factory=dict)  # of a view, where they are others

    def pose(self, k: int) -> np.ndarray:
        """camera_to_world: turned about a tripod's axis, 5 cm behind the camera."""
        y, x, z = np.radians((*self.turns_deg[k], 0.0)[:3])
        turn = np.linalg.multi_dot([cv2.Rodrigues(np.array(a))[0] for a in ((0, y, 0.0), (x, 0, 0.0), (0, 0, z))])
        return rigid_motion(turn @ (0, 0, 0.05) - (0, 0, 0.05), turn)

    def write(self, folder: Path) -> Path:
        """A folder as cameras' users have it: left, right, depth (0.1 mm)."""
        rng = np.random.default_rng(self.seed)
        pattern = _dots(rng)
        waves = _waves(rng)
        rng = np.random.default_rng([self.seed, self.session]) if self.session else rng
        for name in ("left", "right", "depth"):
            (folder / name).mkdir(parents=True)
        for k in range(len(self.turns_deg)):
            for side, offset in (("left", 0.0), ("right", BASELINE_M)):
                seen = self._seen(k, offset, waves)
                depth, image = seen[0], self._image(k, seen, pattern)
                noise = rng.normal(0, 0.4, image.shape)
                dn = np.rint(np.clip(image + noise, 0, 255)).astype(np.uint8)
                cv2.imwrite(str(folder / side / f"{k:03d}.png"), dn)
                if side == "left":
                    noisy = depth + rng.normal(0, 3e-4, depth.shape)
                    cv2.imwrite(str(folder / "depth" / f"{k:03d}.png"), np.rint(1e4 * noisy).astype(np.uint16))
        return folder

    def write_warm_up(self, folder: Path, warmth: list[Warm], off: int = 4) -> Path:
        """Pairs of the first view, one for each Warm, in on/; `off` cold pairs without dots in off/. Names are times,
        WARM_UP_S + 75 k seconds for frame k. A lens blurs what is drawn cold, and what the cameras' geometry moves is
        moved by splines: edges drawn anew would jump from sample to sample, which shows up to a sixth less drift, or
        more."""
        rng = np.random.default_rng(self.seed)
        pattern, waves = _dots(rng), _waves(rng)
        states = [("off", k, Warm(power=0.0)) for k in range(off)] + [("on", k, w) for k, w in enumerate(warmth)]
        seen = {side: self._seen(0, offset, waves, 2) for side, offset in (("left", 0.0), ("right", BASELINE_M))}
        for name, k, warm in states:
            for side in seen:
                (folder / name / side).mkdir(parents=True, exist_ok=True)
                fine = cv2.GaussianBlur(self._image(0, seen[side], pattern, warm), (0, 0), 1.2)
                moved = _moved(fine, warm.right_px if side == "right" else 0.0, 1.0 + warm.growth)
                image = cv2.resize(moved, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
                dn = np.rint(np.clip(image + rng.normal(0, 0.4, image.shape), 0, 255)).astype(np.uint8)
                cv2.imwrite(str(folder / name / side / f"{1000 * (WARM_UP_S + 75 * k)}.png"), dn)
        return folder

    def _seen(self, k: int, offset: float, waves: list, parts: int = 1) -> tuple[np.ndarray, ...]:
        """A view's depth, places from the projector, light of its room and of its surfaces, and its lens."""
        pose = self.pose(k)
        v, u = (np.mgrid[0 : HEIGHT * parts, 0 : WIDTH * parts] + 0.5) / parts - 0.5
        ray = np.stack([(u - CX) / F, (v - CY) / F, np.ones_like(u)], axis=-1)
        z, normal, surface = self._cast(pose[:3, :3] @ (offset, 0, 0) + pose[:3, 3], ray @ pose[:3, :3].T, k)
        here = ray * z[..., None] + (offset, 0, 0)  # in the left camera's frame
        world = here @ pose[:3, :3].T + pose[:3, 3]
        albedo = np.where(surface % 2 == 0, 0.6, 0.15) * (1.0 + 0.4 * _texture(world, surface, waves))
        room = self.room_dn * albedo * (0.6 + 0.3 * np.sin(1.3 * world[..., 0] + 0.8 * world[..., 1]))
        ray_p = here - PLACE_M
        distance = np.linalg.norm(ray_p, axis=-1)
        cosine = np.abs((ray_p * (normal @ pose[:3, :3])).sum(axis=-1)) / distance
        lens = (1.0 + ((ray[..., :2]) ** 2).sum(axis=-1)) ** (-EXPONENT / 2)
        return z, ray_p, room, albedo * cosine / distance**2, lens

    def _image(self, k: int, seen: tuple[np.ndarray, ...], pattern: np.ndarray, warm: Warm = Warm()) -> np.ndarray:
        _, ray_p, room, sent, lens = seen
        distance = np.linalg.norm(ray_p, axis=-1)
        sine = ray_p / distance[..., None] / (1.0 + warm.pattern)
        tangent = sine[..., :2] / np.sqrt(1.0 - (sine[..., :2] ** 2).sum(axis=-1))[..., None]
        at = [(2 * F * tangent[..., i] + pattern.shape[1 - i] / 2).astype(np.float32) for i in (0, 1)]
        lit = cv2.remap(pattern, *at, cv2.INTER_LINEAR) * self.dots_dn * warm.power * sent
        return BLACK_DN + self.exposures[k] * lens * (room + lit)

    def _cast(self, origin: np.ndarray, ray: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(distance in units of the ray, normal, number of the surface)."""
        best, normal, surface = np.full(ray.shape[:2], 1e3), np.zeros(ray.shape), np.zeros(ray.shape[:2], int)
        hits = []
        for point, n in PLANES:
            n = np.array(n) / np.linalg.norm(n)
            across = ray @ n
            t = (np.array(point) - origin) @ n / np.where(np.abs(across) < 1e-9, 1e-9, across)
            hits.append((np.where(t > 0.05, t, 1e3), np.broadcast_to(n, ray.shape)))
        for centre, radius in self.balls.get(k, BALLS):
            away = origin - np.array(centre)
            a, b, c = (ray * ray).sum(axis=-1), ray @ away, away @ away - radius**2
            root = b * b - a * c
            t = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, 1e3)
            hits.append((t, (away + ray * t[..., None]) / radius))
        for number, (t, n) in enumerate(hits):
            near = t < best
            best, surface = np.where(near, t, best), np.where(near, number, surface)
            normal = np.where(near[..., None], n, normal)
        return best, normal, surface


def _moved(fine: np.ndarray, right_px: float, growth: float) -> np.ndarray:
    """An image of twice the camera's resolution, grown about the principal point, then shifted to the right."""
    if (right_px, growth) == (0.0, 1.0):
        return fine
    v, u = np.indices(fine.shape)
    axes = ((v, 2.0 * CY + 0.5, 0.0), (u, 2.0 * CX + 0.5, 2.0 * right_px))
    at = [middle + (x - middle - shift) / growth for x, middle, shift in axes]
    return map_coordinates(fine, at, order=3, mode="nearest")


def _dots(rng: np.random.Generator) -> np.ndarray:
    """Random dots at twice the camera's angular resolution, float32."""
    image = np.zeros((int(2.4 * HEIGHT), int(2.4 * WIDTH)), np.float32)
    count = image.size // 90
    image[rng.integers(0, image.shape[0], count), rng.integers(0, image.shape[1], count)] = rng.uniform(0.5, 1, count)
    image = cv2.GaussianBlur(image, (0, 0), 2.2)
    return image / np.quantile(image, 0.999)


def _waves(rng: np.random.Generator) -> list:
    """Wave vectors, 1/m, and phases of each surface."""
    count = len(PLANES) + len(BALLS)
    return [(rng.normal(0, 9, (8, 3)), rng.uniform(0, 2 * np.pi, 8)) for _ in range(count)]


def _texture(world: np.ndarray, surface: np.ndarray, waves: list) -> np.ndarray:
    out = np.zeros(surface.shape)
    for number, (k, phase) in enumerate(waves):
        own = surface == number
        out[own] = np.tanh(np.sin(world[own] @ k.T + phase).sum(axis=-1))
    return out
