# SPDX-License-Identifier: Apache-2.0
"""Observations of a diagnosis: one camera's image of one frame each, and all of them together with what is known of
their noise.

The *noise floor* of an image is its mean temporal variance in DN^2: what a perfect model would leave of the squared
error. It comes from repeated frames of a static view (activestereo.compare.noise). Every figure named `reduced_chi2`
is a mean square in units of that variance.
"""

from dataclasses import dataclass

import numpy as np

from activestereo.capture.capture import SIDES, Capture
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import NoiseModel
from activestereo.compare.nuisances import Nuisances
from activestereo.diagnose.evidence.measured_image import MeasuredImage
from activestereo.diagnose.evidence.model_discrepancy import edge_slopes

# Correlated errors are judged by tiles of this side.
TILE_PX = 16
# What lies closer than this may share an error: cross-validation folds and standard errors go by blocks.
BLOCK_PX = 32
FOLDS = 4
# A material's nominal albedo is believed to this relative deviation, a calibration's focal length to this one.
ALBEDO_SIGMA = 0.03
FOCAL_SIGMA = 6e-4


@dataclass(frozen=True)
class Observation(MeasuredImage):
    """A measured image with what fits need of it. All images are [height][width].

    weight: 1 / variance of the measurement, 1/DN^2. tile: each pixel's tile, numbered over all train
    observations, and fold: the tile's cross-validation fold (both -1 for test frames). material: index into the
    albedo nuisances, -1 = none. focal_slope: DN per relative change of the focal length. pick: flat indices of the
    pixels that count, None = all.
    """

    weight: np.ndarray
    tile: np.ndarray
    fold: np.ndarray
    material: np.ndarray
    focal_slope: np.ndarray
    pick: np.ndarray | None = None


@dataclass(frozen=True)
class Evidence:
    """All observations of a capture.

    nuisances: a first fit of projector scale, ambient scale and black level. noise_model: the photon-transfer noise
    model of the noise; has_floor: whether repeats gave it. noise_variances: {(frame id, side): DN^2}. materials: how
    many albedo nuisances there are. tiles: how many tiles. seed: rules every random choice. edge_discrepancy_m:
    standard deviation of the positions of the scene's edges.
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
    edge_discrepancy_m: float
    seed: int = 0

    @property
    def prior_sigma(self) -> np.ndarray:
        """Prior deviations of the nuisances that calibration and scene measurement tell: both cameras' focal lengths,
        then albedos.
        """
        return np.concatenate([np.full(len(SIDES), FOCAL_SIGMA), np.full(self.materials, ALBEDO_SIGMA)])

    @property
    def pixels(self) -> int:
        """The number of train pixels."""
        return sum(o.measured.size for o in self.train)

    @property
    def tile_pixels(self) -> np.ndarray:
        """Pixels of each tile."""
        return np.bincount(np.concatenate([o.tile.ravel() for o in self.train]), minlength=self.tiles)

    def floor_variance(self, observations: tuple[Observation, ...]) -> float:
        """The observations' mean noise floor, DN^2."""
        return float(np.mean([self.noise_variances[o.key] for o in observations]))

    def weight(self, observation: Observation, expected_dn: np.ndarray) -> np.ndarray:
        """1 / variance of an observation's pixels, float32, from their expected values."""
        return weight_of(self.noise_model, self.edge_discrepancy_m, observation, expected_dn)


def weight_of(
    noise_model: NoiseModel, edge_discrepancy_m: float, observation: MeasuredImage, expected_dn: np.ndarray
) -> np.ndarray:
    """1 / variance of pixels: the noise model's variance, and at edges what their misplacement adds."""
    variance = np.maximum(noise_model.variance(expected_dn, observation.frame.gain), ROUNDING_VARIANCE)
    if edge_discrepancy_m > 0:
        variance = variance + (edge_discrepancy_m * edge_slopes(observation, expected_dn)) ** 2
    return (1.0 / variance).astype(np.float32)
