# SPDX-License-Identifier: Apache-2.0
"""Finds the spots of a dot pattern in an image. All are fitted jointly as Gaussians; then the residual is searched for
merged spots.

    image = background + sum of a_i exp(-|x - x_i|^2 / (2 sigma^2)) + noise

All spots share one sigma. Positions, amplitudes and sigma are fitted by Gauss-Newton on a sparse Jacobian, weighted by
the noise."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_laplace, maximum_filter, minimum_filter
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import lsqr
from scipy.spatial import cKDTree

from activestereo.common.parabola import vertex

_SCALES_PX = (0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0)
_LEAST_SPOTS = 50
# A spot's response is at least this share of the strong spots' around it, and this many deviations above noise.
_LEAST_RESPONSE, _LEAST_MERGED, _SIGNIFICANT = 0.12, 0.12, 5.0
_TILE_PX = 64
_LEAST_AMPLITUDE = 0.15
_FIRST_STEPS, _PEEL_STEPS, _PEELS, _LAST_STEPS = 5, 3, 3, 4
_LARGEST_STEP_PX = 0.4
_LSQR_STEPS = 40
# A spot's middle lies at most this far outside the image, in sigmas.
_OUTSIDE = 1.5
# Two spots closer than this, in sigmas, are merged.
_ONE_SPOT = 0.9


@dataclass(frozen=True)
class Spots:
    """Spots of an image. u, v: centres, pixels. flux: a spot's integral, DN px^2. sigma_px: width that includes the
    pixel's own. background: the image without spots."""

    u: np.ndarray
    v: np.ndarray
    flux: np.ndarray
    sigma_px: float
    background: np.ndarray

    def __len__(self) -> int:
        return len(self.u)

    @property
    def border_px(self) -> int:
        """Distance from the image's border within which a spot is cut by it."""
        return _reach(self.sigma_px)

    @property
    def is_whole(self) -> np.ndarray:
        """Mask of the spots that the border does not cut, whose position and flux are therefore reliable."""
        height, width = self.background.shape
        border = self.border_px
        across = (self.u > border) & (self.u < width - 1 - border)
        return np.asarray(across & (self.v > border) & (self.v < height - 1 - border))

    def selected(self, which: np.ndarray) -> "Spots":
        return replace(self, u=self.u[which], v=self.v[which], flux=self.flux[which])


def find_spots(image: np.ndarray, variance: np.ndarray, progress: Callable[[float], object] | None = None) -> Spots:
    """Finds the spots of an averaged image [height, width], DN, including those that its border cuts. variance: of its
    pixels, DN^2. Raises ValueError for fewer than 50 spots."""
    tell = progress or (lambda fraction: None)
    image = np.asarray(image, dtype=np.float64)
    # 1. Find the scale of the strong spots' largest response (Lindeberg 1998: a Gaussian's is at its own sigma).
    first = -gaussian_laplace(image, 1.25)
    v, u = _peaks(first, np.full(image.shape, 0.0))
    order = np.argsort(-first[v, u])[: max(len(u) // 4, 1)]
    answer = [np.median(-(scale**2) * gaussian_laplace(image, scale)[v[order], u[order]]) for scale in _SCALES_PX]
    sigma = float(_SCALES_PX[int(np.argmax(answer))])
    # 2. Peaks of the response at this scale, each moved to its parabola's top.
    size = int(np.ceil(12.0 * sigma)) | 1
    background = gaussian_filter(minimum_filter(gaussian_filter(image, 0.6 * sigma), size), 0.5 * size)
    response = -gaussian_laplace(image, sigma)
    noise = _response_noise(variance, sigma)
    # The 90th percentile of the peaks around each pixel, smooth.
    is_peak = (response == maximum_filter(response, 3)) & (response > 0)
    (height, width), whole = image.shape, np.quantile(response[is_peak], 0.9) if is_peak.any() else 0.0
    tiles = np.full((-(-height // _TILE_PX), -(-width // _TILE_PX)), whole)
    for r, c in np.ndindex(*tiles.shape):
        part = np.s_[r * _TILE_PX : (r + 1) * _TILE_PX, c * _TILE_PX : (c + 1) * _TILE_PX]
        if is_peak[part].sum() >= 8:
            tiles[r, c] = np.quantile(response[part][is_peak[part]], 0.9)
    strong = gaussian_filter(np.kron(tiles, np.ones((_TILE_PX, _TILE_PX)))[:height, :width], 0.5 * _TILE_PX)
    v, u = _peaks(response, np.maximum(_LEAST_RESPONSE * strong, _SIGNIFICANT * noise))
    if len(u) < _LEAST_SPOTS:
        raise ValueError(f"only {len(u)} dots are seen: is the projector on, and the wall in focus?")
    wide = np.pad(response, 1, mode="edge")  # the border's last pixel is repeated
    here = wide[v + 1, u + 1]
    across, down = vertex(wide[v + 1, u], here, wide[v + 1, u + 2]), vertex(wide[v, u + 1], here, wide[v + 2, u + 1])
    # 3. Fit all spots, then search the residual for merged ones.
    fit = _Fit(image, background, variance, u + across, v + down, sigma)
    fit.run(_FIRST_STEPS)
    tell(0.3)
    for peel in range(_PEELS):
        scale = 0.8 * fit.sigma
        left = -gaussian_laplace(fit.residual(), scale)
        v, u = _peaks(left, np.maximum(_LEAST_MERGED * strong, _SIGNIFICANT * _response_noise(variance, scale)))
        fit.add(u.astype(float), v.astype(float))
        fit.run(_PEEL_STEPS)
        fit.drop_weak()
        tell(0.3 + 0.2 * (peel + 1))
    fit.run(_LAST_STEPS)
    fit.drop_weak()
    tell(1.0)
    return Spots(fit.u, fit.v, 2.0 * np.pi * fit.sigma**2 * fit.amplitude, float(fit.sigma), fit.background)


class _Fit:
    """A joint least-squares fit of all spots, their common width and a smooth background to an image."""

    def __init__(
        self, image: np.ndarray, background: np.ndarray, variance: np.ndarray, u: np.ndarray, v: np.ndarray,
        sigma: float,
    ) -> None:  # fmt: skip
        self.image, self.background, self.sigma = image, background, sigma
        self.deviation = np.sqrt(variance)
        self.weight = 1.0 / self.deviation
        self.u, self.v, self.amplitude = np.empty(0), np.empty(0), np.empty(0)
        self.add(u, v)

    def add(self, u: np.ndarray, v: np.ndarray) -> None:
        left = self.residual()
        at = left[self._pixel(u, v)]
        self.u, self.v, self.amplitude = np.r_[self.u, u], np.r_[self.v, v], np.r_[self.amplitude, np.maximum(at, 0.3)]

    def _pixel(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the row and column of the nearest pixel inside the image."""
        height, width = self.image.shape
        return np.rint(v).astype(int).clip(0, height - 1), np.rint(u).astype(int).clip(0, width - 1)

    def _patches(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Returns (pixel numbers, offsets in u, offsets in v, the spot's Gaussian), each [spot, pixel of the patch
        around it]. The Gaussian is 0 outside the image."""
        reach, (height, width) = _reach(self.sigma), self.image.shape
        y, x = (part.ravel() for part in np.mgrid[-reach : reach + 1, -reach : reach + 1])
        column, row = np.rint(self.u).astype(int)[:, None] + x, np.rint(self.v).astype(int)[:, None] + y
        du, dv = column - self.u[:, None], row - self.v[:, None]
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        column, row = column.clip(0, width - 1), row.clip(0, height - 1)
        return row * width + column, du, dv, inside * np.exp(-0.5 * (du**2 + dv**2) / self.sigma**2)

    def residual(self) -> np.ndarray:
        if not len(self.u):
            return self.image - self.background
        pixel, _, _, gauss = self._patches()
        model = np.bincount(pixel.ravel(), (self.amplitude[:, None] * gauss).ravel(), self.image.size)
        return self.image - self.background - model.reshape(self.image.shape)

    def run(self, steps: int) -> None:
        """Makes Gauss-Newton steps. After each, the smooth part of the residual moves to the background."""
        for _ in range(steps):
            self._step()
            self.background = self.background + gaussian_filter(self.residual(), 6.0 * self.sigma)

    def _step(self) -> None:
        pixel, du, dv, gauss = self._patches()
        count, of = len(self.u), np.repeat(np.arange(len(self.u)), gauss.shape[1])
        high = self.amplitude[:, None] * gauss / self.sigma**2
        wide = high * (du**2 + dv**2) / self.sigma
        values = np.concatenate([gauss.ravel(), (high * du).ravel(), (high * dv).ravel(), wide.ravel()])
        columns = np.concatenate([of, of + count, of + 2 * count, np.full(of.size, 3 * count)])
        jacobian = csr_matrix((values, (np.tile(pixel.ravel(), 4), columns)), shape=(self.image.size, 3 * count + 1))
        weighted = diags(self.weight.ravel()) @ jacobian
        # Columns of one size: the solver needs few steps then.
        size = np.sqrt(np.asarray(weighted.multiply(weighted).sum(axis=0)).ravel()) + 1e-9
        left = (self.weight * self.residual()).ravel()
        step = lsqr(weighted @ diags(1.0 / size), left, damp=0.02, iter_lim=_LSQR_STEPS)[0] / size
        self.amplitude = np.maximum(self.amplitude + step[:count], 0.05)
        height, width = self.image.shape
        outside = _OUTSIDE * self.sigma
        u = self.u + np.clip(step[count : 2 * count], -_LARGEST_STEP_PX, _LARGEST_STEP_PX)
        v = self.v + np.clip(step[2 * count : 3 * count], -_LARGEST_STEP_PX, _LARGEST_STEP_PX)
        self.u, self.v = u.clip(-outside, width - 1 + outside), v.clip(-outside, height - 1 + outside)
        self.sigma = float(np.clip(self.sigma + np.clip(step[-1], -0.1, 0.1), 0.4, 8.0))

    def drop_weak(self) -> None:
        """Drops spots far weaker than their neighbours or within the noise, and merges two spots at one place."""
        tree = cKDTree(np.column_stack([self.u, self.v]))
        _, near = tree.query(tree.data, k=min(30, len(self.u)))
        keep = self.amplitude > _LEAST_AMPLITUDE * np.median(self.amplitude[near], axis=1)
        # The amplitude's error from noise alone; a Gaussian's square sums to pi sigma^2 over the pixels.
        error = self.deviation[self._pixel(self.u, self.v)] / (np.sqrt(np.pi) * self.sigma)
        keep &= self.amplitude > _SIGNIFICANT * error
        for a, b in tree.query_pairs(_ONE_SPOT * self.sigma):
            if keep[a] and keep[b]:
                strong, weak = (a, b) if self.amplitude[a] >= self.amplitude[b] else (b, a)
                share = self.amplitude[weak] / (self.amplitude[a] + self.amplitude[b])
                self.u[strong] += share * (self.u[weak] - self.u[strong])
                self.v[strong] += share * (self.v[weak] - self.v[strong])
                self.amplitude[strong] += self.amplitude[weak]
                keep[weak] = False
        self.u, self.v, self.amplitude = self.u[keep], self.v[keep], self.amplitude[keep]


def _reach(sigma: float) -> int:
    """Returns the radius in pixels of the patch on which a spot is drawn."""
    return int(np.ceil(3.5 * sigma))


def _response_noise(variance: np.ndarray, sigma: float) -> np.ndarray:
    """Returns the standard deviation that pixel noise of this variance causes in the response of a Laplacian of
    Gaussian, from the sampled filter's energy. For a sigma well above a pixel the energy is 1 / (2 pi sigma^6)."""
    impulse = np.zeros((31, 31))
    impulse[15, 15] = 1.0
    energy = float(np.sum(gaussian_laplace(impulse, sigma) ** 2))
    return np.sqrt(gaussian_filter(variance, 2.0 * sigma) * energy)


def _peaks(response: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (rows, columns) of local maxima above `least`."""
    rows, columns = np.nonzero((response == maximum_filter(response, 3)) & (response > least))
    return rows, columns
