# SPDX-License-Identifier: Apache-2.0
"""How well a pattern projector at a place explains what is seen, whichever way it points.

What is not explained is gathered by its direction from the place, on a grid of azimuths and elevations. A pan moves the
pattern along the azimuths of that grid, exactly; for each of some tilts the pattern is drawn once on the same grid.
Correlations over the azimuth, by their Fourier transforms, then are the gain of all pans and tilts. (On an image plane,
a turn by more than a few degrees bends the pattern: random dots no longer meet their own.)
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from activestereo.effects.core.plane_match import blurred_pattern, pixels_of
from activestereo.effects.core.pointing import axes
from activestereo.effects.core.seen_points import SeenPoints
from activestereo.effects.core.view import View

# Rows from straight down to the highest direction that a tilt below sees.
_COLUMNS, _ROWS = 384, 160
_STEP_RAD = 2 * np.pi / _COLUMNS
# Waves around the circle: dots of 0.8 degrees have no finer ones; the norm varies as the pattern's outline does.
_WAVES, _WAVES_OF_NORM, _COLUMNS_OF_NORM = 150, 24, 64
# Tilts of a unit that stands, from nearly straight down to well above the horizon, as far apart as its dots are wide.
_TILTS_RAD = np.arange(-1.4, 0.4, 0.025)
_REACH_RAD, _AT_ONCE = 1.6, 32


class SphereMatch:
    """The pattern at one sharpness, drawn at all tilts. Units stand level: their roll is 0."""

    def __init__(self, view: View, sigma_rad: float, focal_px: float) -> None:
        pattern, K = blurred_pattern(view, sigma_rad, focal_px)
        column = (np.arange(_COLUMNS) + 0.5) * _STEP_RAD
        azimuth = np.where(column > np.pi, column - 2 * np.pi, column)
        near = np.abs(azimuth) < _REACH_RAD
        a, e = np.meshgrid(azimuth[near], (np.arange(_ROWS) + 0.5) * _STEP_RAD - np.pi / 2)
        ways = np.stack([np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a)], axis=-1)
        drawn = np.zeros((len(_TILTS_RAD), _ROWS, _COLUMNS), np.float32)
        for tilted, tilt in zip(drawn, _TILTS_RAD, strict=True):
            tilted[:, near] = _drawn(pattern - pattern.mean(), K, ways @ axes(0.0, tilt, 0.0))
        # [wave][row][tilt]
        self._of_pattern, self._of_square = (
            np.ascontiguousarray(np.conj(fft.rfft(x, axis=2)[..., :waves]).transpose(2, 1, 0))
            for x, waves in ((drawn, _WAVES), (drawn**2, _WAVES_OF_NORM))
        )

    def best(self, seen: SeenPoints, places: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """(fall of chi2, pose (x, y, z, azimuth, elevation, roll)) at the best pan and tilt of each place [n][3]."""
        found: list[tuple[float, np.ndarray]] = []
        for first in range(0, len(places), _AT_ONCE):
            some = places[first : first + _AT_ONCE]
            gathered = np.array([_gathered(seen, place) for place in some], np.float32)
            moment = _correlated(gathered[:, 0], self._of_pattern, _COLUMNS)
            norm = _correlated(gathered[:, 1], self._of_square, _COLUMNS_OF_NORM)
            norm = np.maximum(norm, 0.1 * norm.max(axis=(1, 2), keepdims=True) + np.float32(1e-30))
            gain = np.maximum(moment, 0.0) ** 2 / np.repeat(norm, _COLUMNS // _COLUMNS_OF_NORM, axis=2)
            best = gain.reshape(len(some), -1).argmax(axis=1)
            for place, of_place, at in zip(some, gain, best, strict=True):
                tilt, column = divmod(int(at), _COLUMNS)
                azimuth = column * _STEP_RAD - (2 * np.pi if 2 * column > _COLUMNS else 0.0)
                found.append((float(of_place[tilt, column]), np.array([*place, azimuth, _TILTS_RAD[tilt], 0.0])))
        return found


def _drawn(pattern: np.ndarray, K: np.ndarray, beam: np.ndarray) -> np.ndarray:
    """The pattern in directions of a unit's frame; 0 beside it."""
    height, width = pattern.shape
    row, column, inside = pixels_of(beam, K, pattern.shape)
    return np.where(inside, pattern[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)], 0.0)


def _gathered(seen: SeenPoints, place: np.ndarray) -> np.ndarray:
    """[2][row][column]: gradient by, and curvature of chi2 in, what is sent that way from a place."""
    way, lit = seen.lit_from(place)
    left = seen.beyond_even(lit)
    column = np.floor(np.arctan2(way[:, 0], way[:, 2]) / _STEP_RAD).astype(int) % _COLUMNS
    height = np.clip(way[:, 1] / np.maximum(np.linalg.norm(way, axis=1), 1e-9), -1.0, 1.0)
    row = ((np.arcsin(height) + np.pi / 2) / _STEP_RAD).astype(int)
    low, size = row < _ROWS, _ROWS * _COLUMNS
    at = (row * _COLUMNS + column)[low]
    parts = (np.bincount(at, x[low], size) for x in (lit * left, lit**2 * seen.weight))
    return np.stack([part.reshape(_ROWS, _COLUMNS) for part in parts])


def _correlated(gathered: np.ndarray, conjugate: np.ndarray, columns: int) -> np.ndarray:
    """[place][tilt][column]: sums over rows and azimuths of what was gathered times what was drawn."""
    waves = len(conjugate)
    of_gathered = np.ascontiguousarray(fft.rfft(gathered, axis=2)[..., :waves].transpose(2, 0, 1))
    spectrum = (of_gathered @ conjugate).transpose(1, 2, 0)
    return fft.irfft(spectrum, columns, axis=2) * np.float32(columns / _COLUMNS)
