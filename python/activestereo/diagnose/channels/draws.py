# SPDX-License-Identifier: Apache-2.0
"""Maps a random effect to images: the factor on each random draw, and which pixels share one draw.

A draw is one random number of a field, such as the gain of one pixel, one row or one dot.
"""

from collections.abc import Callable, Hashable, Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt, maximum_filter

from activestereo.diagnose.evidence import Observation
from activestereo.diagnose.refine import ImageResidual
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy

# Side of the pattern's cells that share one gain, in pattern pixels: as large as a dot.
DOT_CELL_PX = 3
# Dots of the pattern are at least so many pattern pixels apart, and no dimmer than this share of the brightest.
_DOT_PX, _DIMMEST = 5, 0.1
_SPREAD, _SEED = 0.1, 13
# Least share of the true variance by which an estimate is divided: less would only amplify noise.
_LEAST = 0.1


def pose_key(o: Observation) -> tuple[bytes, bool]:
    """Returns a key that is equal for images of one pose, and apart for moving and resting frames."""
    return o.frame.camera_to_world.tobytes(), o.frame.is_moving


def lever_image(lever: Lever, row: ImageResidual, black_dn: float) -> np.ndarray:
    """Returns by how many DN a random draw of standard deviation 1 changes each pixel at parameter value 1,
    [height][width]. lever: the signal that scales the draw."""
    if lever is Lever.SIGNAL:
        return row.expected - black_dn
    if lever is Lever.PROJECTOR:
        return row.projector
    if lever is Lever.EXPOSURE:
        return np.full(row.expected.shape, row.observation.frame.exposure_gain)
    if lever is Lever.PHOTONS:
        return np.sqrt(np.maximum(row.observation.frame.gain * (row.expected - black_dn), 0.0))
    return np.ones(row.expected.shape)


def frames_that_share(term: RandomTerm, o: Observation) -> Hashable:
    """Returns a key of the group that an observation belongs to. Random draws of one group's images are predicted only
    from other groups, because frames of one pose also share other errors, such as misplaced edges.

    Draws that last only while the rig stands still exist in one view alone, so other frames of that view predict them.
    """
    return o.frame.id if term.shared_by is SharedBy.VIEW else o.frame.camera_to_world.tobytes()


class DrawIndex:
    """Numbers the random draws of a field: pixels with the same number share one draw (of a pixel, row, column or
    dot)."""

    def __init__(self) -> None:
        self._views: dict[Hashable, int] = {}
        self._dots: dict[Hashable, np.ndarray] = {}

    def __call__(self, term: RandomTerm, o: Observation) -> np.ndarray:
        """Returns the number of the draw at every pixel, [height][width]."""
        height, width = o.measured.shape
        right = o.side == "right"
        if term.shared_by is SharedBy.COLUMN:
            return np.broadcast_to(np.arange(width) + right * width, o.measured.shape)
        if term.shared_by is SharedBy.ROW:
            return np.broadcast_to(np.arange(height)[:, None] + right * height, o.measured.shape)
        if term.shared_by is SharedBy.DOT:
            return self._dot(o)
        pixel = np.arange(o.measured.size).reshape(o.measured.shape) + right * o.measured.size
        if term.shared_by is SharedBy.PIXEL:
            return pixel
        number = self._views.setdefault(pose_key(o), len(self._views))
        return pixel + 2 * o.measured.size * number

    def _dot(self, o: Observation) -> np.ndarray:
        key = o.side, pose_key(o)
        if key not in self._dots:
            dots, (height, width) = DotView.of(o.view), draw_grid(SharedBy.DOT, o)[0]
            u, v = (np.floor((x + 0.5) / DOT_CELL_PX).astype(int) for x in (dots.u, dots.v))
            inside = dots.lit & (u >= 0) & (u < width) & (v >= 0) & (v < height)
            self._dots[key] = np.where(inside, v * width + u, height * width)
        return self._dots[key]


def draw_grid(shared_by: SharedBy, o: Observation) -> tuple[tuple[int, ...], int]:
    """Returns (the shape of the grid on which draws lie, how many steps apart draws are independent)."""
    if shared_by is SharedBy.COLUMN:
        return o.measured.shape[1:], 3
    if shared_by is SharedBy.ROW:
        return o.measured.shape[:1], 3
    if shared_by is SharedBy.DOT:
        return tuple(-(-n // DOT_CELL_PX) for n in o.view.pattern.shape), 3
    return o.measured.shape, 3


def dots_seen(train: Sequence[ImageResidual], variance_of: Callable[[list[np.ndarray]], float]) -> float:
    """Returns estimated over true variance for gains that vary independently from dot to dot.

    The estimate bins dots into cells of the pattern; neighbouring dots share pixels and cells, so it is too small. The
    factor comes from simulated gains (method of simulated moments: McFadden 1989). variance_of: estimates the variance
    from the train images' residuals.
    """
    drawn = None
    residuals = []
    for o, _, dots, _ in train:
        if drawn is None:
            drawn = o.view.pattern * _gains(o.view.pattern, o.view.seed)
        view = DotView.of(o.view)
        nominal = view.nominal()
        residuals.append(
            dots * np.where(nominal > 0, view.mean(drawn) / np.where(nominal > 0, nominal, 1.0) - 1.0, 0.0)
        )
    return max(variance_of(residuals) / _SPREAD**2, _LEAST)


def _gains(pattern: np.ndarray, seed: int) -> np.ndarray:
    """Draws a gain for every dot, mean 1 and deviation _SPREAD; each pattern pixel gets the nearest dot's gain."""
    peaks = (pattern == maximum_filter(pattern, _DOT_PX)) & (pattern > _DIMMEST * pattern.max())
    draws = np.zeros(pattern.shape)
    draws[peaks] = np.random.Generator(np.random.PCG64([_SEED, seed])).normal(1.0, _SPREAD, int(peaks.sum()))
    nearest = distance_transform_edt(~peaks, return_distances=False, return_indices=True)
    return draws[tuple(nearest)]
