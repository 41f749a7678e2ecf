# SPDX-License-Identifier: Apache-2.0
"""The evidence of a diagnosis: observations (one camera's image of one frame each), with their noise and weights.

The *noise floor* of an image is its mean temporal variance in DN^2: the squared error that a perfect model would leave.
It comes from repeated frames of a static view (activestereo.compare.noise). Without repeats, the difference of each
frame's two cameras gives an upper bound. Every figure named `reduced_chi2` is a mean square in units of that variance.

The scene measurement knows edges to about a millimetre. At edges of materials, surfaces and measured textures, an error
of position changes the image by the local slope times that error. Its deviation is estimated on static frames and
limited, so that effects that do move edges remain to be explained.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from activestereo.capture.capture import SIDES, Capture, ImageKey
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.noise import NoiseModel, by_repeats
from activestereo.diagnose.geometry import DEPTH_STEP, TWIST, Geometry
from activestereo.effects.core.model import Nuisances

# Largest error of an edge's position that the scene measurement may make, metres. Beyond it an effect is missing.
_LARGEST_EDGE_DISCREPANCY_M = 1.5e-3
# At an edge of a measured texture the room's light changes by more than this share from pixel to pixel.
_TEXTURE_STEP = 0.1
# Side of the tiles by which correlated errors are judged.
TILE_PX = 16
# Pixels closer than this may share an error: standard errors treat blocks as units.
BLOCK_PX = 32
# Share of the pixels that is used if a few images represent all.
_PICKED_SHARE, _SEED = 0.25, 11


def edges(o: MeasuredImage) -> np.ndarray:
    """Returns the pixels next to an edge of a material or a surface, bool [height][width]."""

    def found() -> np.ndarray:
        z, material = o.view.depth_m, np.asarray(o.layers.material)
        edge = maximum_filter(material, 3) != minimum_filter(material, 3)
        return edge | (maximum_filter(z, 3) - minimum_filter(z, 3) > DEPTH_STEP * z)

    return o.view.once("edges", found)


def edge_slopes(o: MeasuredImage, image: np.ndarray) -> np.ndarray:
    """Returns how the expected image changes if an edge is misplaced, DN per metre, float32 [height][width]; 0 away
    from edges."""
    z, edge = o.view.depth_m, edges(o)
    down, right = np.gradient(image)
    slope = np.where(edge, np.hypot(down, right), 0.0)
    if o.view.known is not None:  # the scene was measured, its textures too
        slope = np.maximum(slope, image * o.view.once("texture edges", lambda: _texture_edges(o.layers.ambient)))
    per_m = np.where(z > 0, o.view.K[0, 0] / np.where(z > 0, z, 1.0), 0.0)
    return (slope * per_m).astype(np.float32)


def _texture_edges(room: np.ndarray) -> np.ndarray:
    """Returns the relative change of the ambient light from pixel to pixel at edges of a texture, else 0,
    [height][width]. Ambient light is used because it holds no dots."""
    down, right = np.gradient(room)
    change = np.hypot(down, right) / np.maximum(room, 1e-3 * room.max(initial=1e-9))
    return np.where(change > _TEXTURE_STEP, change, 0.0)


def edge_discrepancy(
    observations: Sequence[MeasuredImage], images: dict[ImageKey, np.ndarray], noise_model: NoiseModel
) -> float:
    """Returns the standard deviation of edge positions in metres, limited to _LARGEST_EDGE_DISCREPANCY_M. It follows
    from the error beyond noise at edges of static frames; 0 if there is none."""
    excess = slopes = 0.0
    for o in observations:
        if not o.frame.is_moving and o.frame.projector_power > 0:
            slope = edge_slopes(o, images[o.key])
            edge = (slope > 0) & o.view.known_mask()
            variance = noise_model.variance(images[o.key], o.frame.gain)
            excess += ((o.measured - images[o.key]) ** 2 - variance)[edge].sum()
            slopes += (slope[edge].astype(np.float64) ** 2).sum()
    return float(np.sqrt(np.clip(excess / slopes, 0.0, _LARGEST_EDGE_DISCREPANCY_M**2))) if slopes > 0 else 0.0


@dataclass(frozen=True)
class Observation(MeasuredImage):
    """A measured image with the inputs of fits. All images are [height][width].

    weight: 1 / variance of the measurement, 1/DN^2. tile: each pixel's tile, numbered over all train observations, -1
    for test frames. material: index into the albedo nuisances, -1 = none. focal_slope: DN per relative change of the
    focal length. geometry_slopes: DN per metre and radian, [12][height][width]. geometry_places: indices into
    NuisancePrior of the twelve numbers that these slopes belong to. pick: flat indices of the pixels that count, None =
    all.
    """

    weight: np.ndarray
    tile: np.ndarray
    material: np.ndarray
    focal_slope: np.ndarray
    geometry_slopes: np.ndarray
    geometry_places: np.ndarray
    pick: np.ndarray | None = None

    def picked(self) -> np.ndarray | slice:
        """Returns the index that takes the pixels that count from a flat image."""
        return slice(None) if self.pick is None else self.pick

    @property
    def pixels(self) -> int:
        """The number of pixels that count."""
        return self.measured.size if self.pick is None else len(self.pick)


@dataclass(frozen=True)
class NuisancePrior:
    """The normal prior of all nuisances except scales and black level. In order: relative focal length of both cameras,
    relative albedos, Geometry.twists(). value, sigma: mean and standard deviation, [n]. materials: number of albedos.
    black_dn: (measured black level, its standard deviation), DN; None leaves it free. weighed_up: factor by which the
    prior variances were divided."""

    value: np.ndarray
    sigma: np.ndarray
    materials: int
    black_dn: tuple[float, float] | None = None
    weighed_up: float = 1.0


@dataclass(frozen=True)
class Evidence:
    """All observations of a capture with the inputs of fits.

    nuisances: a first fit of projector scale, ambient scale and black level. noise_model: the photon-transfer noise
    model. has_floor: whether that model was measured, from repeats or from the two cameras of each frame.
    noise_variances: {(frame id, side): DN^2}. materials: number of albedo nuisances. tiles: number of tiles. seed:
    seeds every random choice. geometry: the corrections of the stated geometry that `capture` already contains.
    """

    capture: Capture
    train: tuple[Observation, ...]
    test: tuple[Observation, ...]
    nuisances: Nuisances
    noise_model: NoiseModel
    noise_variances: dict[ImageKey, float]
    has_floor: bool
    materials: int
    tiles: int
    geometry: Geometry
    seed: int = 0

    def nuisance_prior(self, of_albedo: float = 1.0) -> NuisancePrior:
        """Returns the prior of the nuisances, which are corrections of the rendered geometry. It is centred on the
        stated values and has the stated uncertainty. The prior of poses is wider if static views were measured worse
        than stated. Poses that only test frames have stay where they were found. If the likelihood counts too many
        pixels, prior variances are divided by the same factor (a tempered posterior; Miller and Dunson, JASA 2019).
        of_albedo: factor on the albedos' stated uncertainty."""
        known = self.capture.uncertainty
        twist = np.repeat(self.geometry.beyond_stated() * [known.pose_m, known.pose_rad], TWIST // 2)
        projector = np.repeat([known.projector_m, known.projector_rad], TWIST // 2)
        focal, albedo = np.full(len(SIDES), known.focal), np.full(self.materials, of_albedo * known.albedo)
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

    def less(self, images: Mapping[ImageKey, np.ndarray]) -> "Evidence":
        """Returns the evidence with images, DN [height][width], subtracted from the measured ones of train frames."""
        train = tuple(replace(o, measured=o.measured - images.get(o.key, 0.0)) for o in self.train)
        return replace(self, train=train)

    def forget(self) -> None:
        """Drops what the images keep for fits, gigabytes of large images; it is computed again where it is needed."""
        for o in (*self.train, *self.test):
            o.forget()

    def floor_variance(self, observations: tuple[Observation, ...]) -> float:
        """Returns the mean noise floor of observations, DN^2."""
        return float(np.mean([self.noise_variances[o.key] for o in observations]))


def weight_of(
    noise_model: NoiseModel, edge_discrepancy_m: float, observation: MeasuredImage, expected_dn: np.ndarray
) -> np.ndarray:
    """Returns each pixel's weight 1 / variance, 1/DN^2, [height][width]. The variance is that of the noise plus, at
    edges, that of misplacement by edge_discrepancy_m. The weight is 0 where the scene is unknown."""
    variance = np.maximum(noise_model.variance(expected_dn, observation.frame.gain), ROUNDING_VARIANCE)
    if edge_discrepancy_m > 0:
        variance = variance + (edge_discrepancy_m * edge_slopes(observation, expected_dn)) ** 2
    return (1.0 / variance).astype(np.float32) * observation.view.known_mask()


def one_of_each_situation(
    observations: Sequence[Observation], seed: int = 0, share: float = _PICKED_SHARE, most_pixels: float = np.inf
) -> tuple[Observation, ...]:
    """Returns one right image of each situation (pose and settings), and one left image. In each, only a random share
    of the pixels counts. Every camera effect acts on the right camera; the left image shows differences between the
    cameras. Right images of equal settings have at most most_pixels in all; one image is always there."""
    poses_of: dict[tuple, set[bytes]] = {}
    lefts = [o for o in observations if o.side == "left"]
    # The last repeat of the left camera's first image shows flickering light at another time.
    groups = by_repeats((o.frame, o.side, o) for o in lefts)
    left = next((group[-1] for group in groups if group[0] is lefts[0]), lefts[0] if lefts else None)
    chosen: list[Observation] = []
    for o in observations:
        f = o.frame
        setting = float(f"{f.exposure_gain:.2g}"), f.projector_power, f.ambient, f.temperature_c, f.is_moving
        pose, poses = f.camera_to_world.tobytes(), poses_of.setdefault(setting, set())
        has_place = not poses or (len(poses) + 1) * o.measured.size <= most_pixels
        is_new = o.side == "right" and pose not in poses and has_place
        if is_new:
            poses.add(pose)
        if is_new or o is left:
            rng = np.random.Generator(np.random.PCG64([_SEED, len(chosen), seed]))
            picked = np.sort(rng.permutation(o.pixels)[: int(share * o.pixels)])
            chosen.append(replace(o, pick=picked if o.pick is None else o.pick[picked]))
    return tuple(chosen)
