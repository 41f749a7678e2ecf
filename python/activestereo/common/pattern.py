# SPDX-License-Identifier: Apache-2.0
"""Generates projector patterns: pseudo-random dots like those of the D4xx, the same on every machine.

Random dots: each cell of a square grid holds one dot at a random position. The cell's height has four quarters. Of four
neighbouring cells in a row, each has its dot in another quarter, so no low, wide window lacks dots. Stereo needs unique
windows, which a test checks: every window of UNIQUE_WINDOW camera pixels differs from all others along its row within
the disparity range. The difference is at least half the energy of a mean dot. Density and size are measured on D435 and
D415 images: about 5000 dots in view, with a sigma of 1.2 and 1.8 pixels in the image, including the pixel's own blur.

Lattices: square lattices rotated against each other, as the D415 projects; overlapping dots of two lattices form
rosettes. A grating's orders are evenly spaced in the sines of their angles (grating equation), so lattices widen
towards the border."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

UNIQUE_WINDOW = (49, 7)  # width, height in camera pixels of a D435


@dataclass(frozen=True)
class PatternDesign:
    """Describes a projector pattern to generate. Lengths are in pixels of the pattern image."""

    width: int
    height: int
    dot_pitch_px: float  # side of the cell that holds one dot; of lattices, in the image's middle
    dot_sigma_px: float  # of the Gaussian spot
    weakest_dot: float = 0.5  # peaks are uniform from here to 1, as on devices once falloff is taken out
    background: float = 0.02  # light between the dots, relative to the brightest peak
    seed: int = 0
    lattice_angles_deg: tuple[float, ...] = ()  # each lattice's rotation from the rows; () = random dots
    focal_px: float = 0.0  # of the image; only for lattices


def make_pattern(design: PatternDesign) -> np.ndarray:
    """Draws the pattern as uint8 [height, width]; value / 255 is the relative radiant intensity."""
    image = spots_image(*dots(design), design.dot_sigma_px, design.width, design.height)
    image = design.background + (1.0 - design.background) * image
    return np.rint(255.0 * np.minimum(image, 1.0)).astype(np.uint8)


def spots_image(x: np.ndarray, y: np.ndarray, peak: np.ndarray, sigma_px: float, width: int, height: int) -> np.ndarray:
    """Draws the sum [height, width] of Gaussian spots with these centres, peaks and sigma. Spots are cut at four
    sigmas, and those centred outside the image are left out."""
    reach = int(np.ceil(4.0 * sigma_px))
    inside = (np.rint(x) >= 0) & (np.rint(x) < width) & (np.rint(y) >= 0) & (np.rint(y) < height)
    x, y, peak = x[inside], y[inside], peak[inside]
    offsets = np.arange(-reach, reach + 1)
    columns, rows = (np.rint(p).astype(int)[:, None] + offsets for p in (x, y))
    across, down = (np.exp(-0.5 * ((p - m[:, None]) / sigma_px) ** 2) for p, m in ((columns, x), (rows, y)))
    patches = peak[:, None, None] * down[:, :, None] * across[:, None, :]
    tall, wide = height + 2 * reach, width + 2 * reach
    places = (rows[:, :, None] + reach) * wide + columns[:, None, :] + reach
    image = np.bincount(places.ravel(), patches.ravel(), tall * wide).reshape(tall, wide)
    return np.asarray(image[reach:-reach, reach:-reach])


def dots(design: PatternDesign) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns centres x, y in pattern pixels and peaks 0..1 of all dots inside the image."""
    if design.lattice_angles_deg:
        x, y = _lattices(design)
    else:
        across = int(np.ceil(design.width / design.dot_pitch_px / 4)) * 4
        down = int(np.ceil(design.height / design.dot_pitch_px))
        column, row = np.meshgrid(np.arange(across), np.arange(down))
        order = _random(design.seed, 0, (down, across // 4, 4))
        quarter = np.argsort(order, axis=2).reshape(down, across)
        # A tenth of the cell stays free on either side, so that neighbours do not merge.
        x = (column + 0.1 + 0.8 * _random(design.seed, 1, column.shape)) * design.dot_pitch_px
        y = (row + (quarter + _random(design.seed, 2, row.shape)) / 4) * design.dot_pitch_px
    peak = design.weakest_dot + (1.0 - design.weakest_dot) * _random(design.seed, 3, x.shape)
    inside = (x >= 0) & (y >= 0) & (x <= design.width - 1) & (y <= design.height - 1)
    return x[inside], y[inside], peak[inside]


def _lattices(design: PatternDesign) -> tuple[np.ndarray, np.ndarray]:
    pitch = design.dot_pitch_px / design.focal_px  # in direction cosines
    orders = np.arange(-int(1.0 / pitch), int(1.0 / pitch) + 1)
    places = []
    for number, angle_deg in enumerate(design.lattice_angles_deg):
        start_u, start_v = _random(design.seed, number, (2,))
        u, v = np.meshgrid(pitch * (orders + start_u), pitch * (orders + start_v))
        angle = np.deg2rad(angle_deg)
        sines = np.stack([np.cos(angle) * u - np.sin(angle) * v, np.sin(angle) * u + np.cos(angle) * v])
        forward = 1.0 - np.sum(sines**2, axis=0)
        seen = sines[:, forward > 0.0] / np.sqrt(forward[forward > 0.0])
        places.append(design.focal_px * seen + [[0.5 * (design.width - 1)], [0.5 * (design.height - 1)]])
    x, y = np.concatenate(places, axis=1)
    return x, y


def _random(seed: int, stream: int, shape: Sequence[int]) -> np.ndarray:
    """Returns uniform numbers in [0, 1): SplitMix64 (Steele, Lea, Flood 2014) applied to a counter, so they depend on
    no library's version."""
    count = np.arange(1, np.prod(shape) + 1, dtype=np.uint64)
    with np.errstate(over="ignore"):
        z = (count + (np.uint64(seed * 4 + stream) << np.uint64(40))) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return ((z >> np.uint64(11)).astype(np.float64) / 2**53).reshape(shape)
