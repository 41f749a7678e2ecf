# SPDX-License-Identifier: Apache-2.0
"""Observations of a diagnosis: one camera's image of one frame each, and all of them together with what is known of
their noise.

The *noise floor* of an image is its mean temporal variance in DN^2: what a perfect model would leave of the squared
error. It comes from repeated frames of a static view (activestereo.compare.noise), or where there are none from the
difference of each frame's two cameras (activestereo.compare.noise), an upper bound. Every figure named
`reduced_chi2` is a mean square in units of that variance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from activestereo.capture.capture import SIDES, Capture
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import NoiseModel
from activestereo.compare.nuisances import Nuisances
from activestereo.diagnose.evidence.geometry import TWIST, Geometry
from activestereo.diagnose.evidence.measured_image import MeasuredImage
from activestereo.diagnose.evidence.model_discrepancy import edge_slopes

# Correlated errors are judged by tiles of this side.
TILE_PX = 16
# What lies closer than this may share an error: standard errors go by blocks.
BLOCK_PX = 32
# Of the pixels, where a few images stand for all.
_PICKED_SHARE, _SEED = 0.25, 11


@dataclass(frozen=True)
class Observation(MeasuredImage):
    """A measured image with what fits need of it. All images are [height][width].

    weight: 1 / variance of the measurement, 1/DN^2. tile: each pixel's tile, numbered over all train observations, -1
    for test frames. material: index into the
    albedo nuisances, -1 = none. focal_slope: DN per relative change of the focal length. geometry_slopes: DN per
    metre and radian, [12][height][width], of the numbers at geometry_places in NuisancePrior. pick: flat indices
    of the pixels that count, None = all.
    """

    weight: np.ndarray
    tile: np.ndarray
    material: np.ndarray
    focal_slope: np.ndarray
    geometry_slopes: np.ndarray
    geometry_places: np.ndarray
    pick: np.ndarray | None = None

    def picked(self) -> np.ndarray | slice:
        """The index that takes the pixels that count out of a flat image."""
        return slice(None) if self.pick is None else self.pick

    @property
    def pixels(self) -> int:
        """The number of pixels that count."""
        return self.measured.size if self.pick is None else len(self.pick)


@dataclass(frozen=True)
class NuisancePrior:
    """A normal prior of the nuisances after scales and black level: both focal lengths, albedos, then
    Geometry.twists(). value, sigma: [n]; materials: how many albedos. black_dn: the measured black level and its
    deviation, or None: it is free. weighed_up: sigma^2 is what is stated over this."""

    value: np.ndarray
    sigma: np.ndarray
    materials: int
    black_dn: tuple[float, float] | None = None
    weighed_up: float = 1.0


@dataclass(frozen=True)
class Evidence:
    """All observations of a capture.

    nuisances: a first fit of projector scale, ambient scale and black level. noise_model: the photon-transfer noise
    model of the noise; has_floor: whether repeats gave it, or the two cameras of each frame. noise_variances: {(frame
    id, side): DN^2}. materials: how many albedo nuisances there are. tiles: how many tiles. seed: rules every random
    choice. geometry: corrections of the stated one that the capture has here.
    """

    capture: Capture
    train: tuple[Observation, ...]
    test: tuple[Observation, ...]
    nuisances: Nuisances
    noise_model: NoiseModel
    noise_variances: dict[tuple[int, str], float]
    has_floor: bool
    materials: int
    tiles: int
    geometry: Geometry
    seed: int = 0

    def nuisance_prior(self) -> NuisancePrior:
        """The calibration's and scene measurement's word on the nuisances, from where images were rendered; poses of
        test frames alone stay where they were found. All views were measured alike: where those at rest were found
        farther off than is stated, so may the others be. Where the likelihood counts more pixels than it should, what
        is stated is weighed up by as much (a tempered posterior; Miller and Dunson, JASA 2019)."""
        known = self.capture.uncertainty
        twist = np.repeat(self.geometry.beyond_stated() * [known.pose_m, known.pose_rad], TWIST // 2)
        projector = np.repeat([known.projector_m, known.projector_rad], TWIST // 2)
        focal, albedo = np.full(len(SIDES), known.focal), np.full(self.materials, known.albedo)
        sigma = np.concatenate([focal, albedo, projector, *[twist] * len(self.geometry.poses)])
        sigma /= np.sqrt(self.geometry.misfit)
        value = np.concatenate([-self.geometry.focal, np.zeros(self.materials), -self.geometry.twists()])
        seen = np.unique(np.concatenate([o.geometry_places for o in self.train]))
        value[np.setdiff1d(np.arange(len(SIDES) + self.materials, len(value)), seen)] = 0.0
        black_dn, misfit = self.capture.rig.black_dn, self.geometry.misfit
        return NuisancePrior(value, sigma, self.materials, black_dn, misfit)

    @property
    def pixels(self) -> int:
        """The number of train pixels."""
        return sum(o.pixels for o in self.train)

    def floor_variance(self, observations: tuple[Observation, ...]) -> float:
        """The observations' mean noise floor, DN^2."""
        return float(np.mean([self.noise_variances[o.key] for o in observations]))


def weight_of(
    noise_model: NoiseModel, edge_discrepancy_m: float, observation: MeasuredImage, expected_dn: np.ndarray
) -> np.ndarray:
    """1 / variance of pixels: the noise model's variance, and at edges what their misplacement adds; 0 where the scene
    is not known."""
    variance = np.maximum(noise_model.variance(expected_dn, observation.frame.gain), ROUNDING_VARIANCE)
    if edge_discrepancy_m > 0:
        variance = variance + (edge_discrepancy_m * edge_slopes(observation, expected_dn)) ** 2
    known = observation.view.known
    return (1.0 / variance).astype(np.float32) * (np.float32(1.0) if known is None else known)


def one_of_each_situation(observations: Sequence[Observation], seed: int = 0) -> tuple[Observation, ...]:
    """One image of each situation: the right camera (which every camera effect touches), one frame per pose and
    setting, and one of the left camera, which the right one may differ from; a random part of the pixels counts.
    """
    seen: set[tuple] = set()
    left = _left_image(observations)
    chosen: list[Observation] = []
    for o in observations:
        f = o.frame
        light = f.exposure_gain, f.projector_power, f.ambient
        setting = f.camera_to_world.tobytes(), *light, f.temperature_c, f.is_moving
        if o is left or (o.side == "right" and setting not in seen):
            seen |= {setting} if o.side == "right" else set()
            rng = np.random.Generator(np.random.PCG64([_SEED, len(chosen), seed]))
            picked = np.sort(rng.permutation(o.pixels)[: int(_PICKED_SHARE * o.pixels)])
            chosen.append(replace(o, pick=picked if o.pick is None else o.pick[picked]))
    return tuple(chosen)


def _left_image(observations: Sequence[Observation]) -> Observation | None:
    """The first of the left camera, or its last repeat: light that flickers is seen at one more instant then."""
    left = [o for o in observations if o.side == "left"]
    group = left[0].frame.repeat_group if left else None
    repeats = [o for o in left if o.frame.repeat_group == group] if group is not None else left[:1]
    return repeats[-1] if repeats else None
