"""Random effects that stay (pixel gains, offsets, dots, speckle): no expected image, but what one frame shows tells another.

Each is a random-effects model: residual = regressor * b[index] + noise, b ~ N(0, sigma^2), where the index says what shares one
draw (a pixel in all poses, a pixel of one pose, a dot of the pattern, a column). b is predicted for each group of frames from
the other groups alone (best linear unbiased prediction, Robinson 1991), so that the fall of the squared error is honest.
"""

from dataclasses import dataclass, replace

import numpy as np

from activestereo.effects.core.dots import DotView
from activestereo.lab.diagnose_dots import dots_seen
from activestereo.lab.diagnose_inadequacy import edges

_HOT_SIGMA = 5.0
_WHITE_LIMIT = 0.35
# A renderer's own noise is no more than so many floors; dots out of place are white, too, where they are as small as pixels.
_LARGEST_WHITE = 0.06
_JACKKNIFE = 16
# Cells of the pattern that share a dot's gain.
_DOT_PX = 4
# Draws of a random field are independent: beyond this correlation something smooth is mistaken for one.
_LARGEST_CORRELATION = 0.4
# A pixel expected closer to an end of the range than so many deviations of what is looked for may be clipped.
CLEAR_OF_ENDS = 2.0


@dataclass(frozen=True)
class StaticPart:
    """One random field. regressor, index: functions of (observation, prediction, light, context) giving images; group: function
    of an observation: draws are predicted from other groups; grid: function of an observation: the shape in which indices lie, and
    how many steps lie between independent draws; parameter: the effect's parameter that is its deviation; in_pose: draws last
    as long as the rig stands still, as does the misplacement of edges, which therefore do not count; extended: pixels that lie
    together share a draw, which is structure (goodness.py) until it is predicted."""

    parameter: str
    regressor: object
    index: object
    group: object
    grid: object
    sparse: bool = False
    in_pose: bool = False
    extended: bool = False


def _pose(o):
    return o.frame.camera_to_world.tobytes(), o.frame.is_moving


def _place(o):
    """Frames of one place show pixels the same dots, moving or not."""
    return o.frame.camera_to_world.tobytes()


def _pixel(o, context):
    return np.arange(o.measured.size).reshape(o.measured.shape) + (o.measured.size if o.eye == "right" else 0)


def _column(o, context):
    return np.broadcast_to(np.arange(o.measured.shape[1]) + (o.measured.shape[1] if o.eye == "right" else 0), o.measured.shape)


def _row(o, context):
    rows = np.arange(o.measured.shape[0])[:, None] + (o.measured.shape[0] if o.eye == "right" else 0)
    return np.broadcast_to(rows, o.measured.shape)


def _pixel_of_pose(o, context):
    number = context.setdefault("poses", {}).setdefault(_pose(o), len(context.get("poses", {})))
    return _pixel(o, context) + 2 * o.measured.size * number


def _dot(o, context):
    key = ("dots", o.eye, _pose(o))
    if key not in context:
        dots, (height, width) = DotView.of(o.view), _dot_grid(o)[0]
        u, v = np.floor((dots.u + 0.5) / _DOT_PX).astype(int), np.floor((dots.v + 0.5) / _DOT_PX).astype(int)
        inside = dots.lit & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        context[key] = np.where(inside, v * width + u, height * width)
    return context[key]


def _pixel_grid(o):
    return o.measured.shape, 3


def _column_grid(o):
    return o.measured.shape[1:], 3


def _row_grid(o):
    return o.measured.shape[:1], 3


def _dot_grid(o):
    return tuple(-(-n // _DOT_PX) for n in o.view.pattern.shape), 2


def _ones(o, image, dots):
    return np.ones(image.shape)


def _signal(o, image, dots):
    return image


def _dots(o, image, dots):
    return dots


def _exposure(o, image, dots):
    return np.full(image.shape, o.frame.exposure_gain)


PARTS = {
    "prnu": (StaticPart("sigma", _signal, _pixel, _place, _pixel_grid),),
    "fixed_pattern_noise": (
        StaticPart("column_dn", _ones, _column, _place, _column_grid),
        StaticPart("row_dn", _ones, _row, _place, _row_grid),
        StaticPart("pixel_dn", _ones, _pixel, _place, _pixel_grid),
    ),
    "hot_pixels": (StaticPart("rate_dn_per_s", _exposure, _pixel, _place, _pixel_grid, sparse=True),),
    "speckle_static": (StaticPart("contrast", _dots, _pixel_of_pose, lambda o: o.frame.id, _pixel_grid, in_pose=True),),
    "dot_gain_spread": (StaticPart("spread", _dots, _dot, _place, _dot_grid, extended=True),),
}


@dataclass
class StaticFit:
    """residuals: train residuals after held-out prediction; test_residuals; sigma and its standard error by parameter; extended: as
    StaticPart's."""

    residuals: list
    test_residuals: list
    sigma: dict
    error: dict
    share: float = 0.0
    extended: bool = False


def fit_static(effect_id, train, test, black_dn):
    """train, test: lists of (observation, prediction, dots DN, residual). Returns a StaticFit, or None where nothing repeats or what does is not
    random."""
    context = {}
    now, now_test = [r for *_, r in train], [r for *_, r in test]
    sigma, error, share, found = {}, {}, 0.0, False
    for part in PARTS[effect_id]:
        rows = [_row_of(part, o, image - black_dn, dots, r, context) for (o, image, dots, _), r in zip(train, now, strict=True)]
        if len({row.group for row in rows}) < 2:
            return None
        variance, sigma_error = _variance(_unclipped(rows, train, _variance(rows)[0]))
        sigma[part.parameter] = float(np.sqrt(max(variance, 0.0)))
        error[part.parameter] = float(sigma_error)
        total_a, total_b = _totals(rows)
        if variance <= 0 or not (part.sparse or _is_white(total_a, total_b, variance, *part.grid(train[0][0]))):
            sigma[part.parameter] = 0.0
            continue
        if part.index is _dot:
            seen = np.sqrt(dots_seen(train, lambda residuals, rows=rows: _variance_of(residuals, rows)))
            sigma[part.parameter], error[part.parameter] = sigma[part.parameter] / seen, error[part.parameter] / seen
        found = True
        now = [_corrected(row, rows, total_a, total_b, variance, part.sparse) for row in rows]
        tests = [_row_of(part, o, image - black_dn, dots, r, context) for (o, image, dots, _), r in zip(test, now_test, strict=True)]
        now_test = [_predicted(row, total_a, total_b, variance, part.sparse) for row in tests]
        if part.sparse:
            strong = total_b > _HOT_SIGMA * np.sqrt(np.maximum(total_a, 1e-30))
            share = float(strong.sum() / max((total_a > 0).sum(), 1))
            if strong.any():
                sigma[part.parameter] = float((total_b[strong] / total_a[strong]).mean())
    extended = any(part.extended for part in PARTS[effect_id])
    return StaticFit(now, now_test, sigma, error, share, extended) if found else None


@dataclass
class _Row:
    """One image as normal equations of b: a = w z^2, b = w z r at each pixel's index."""

    group: object
    index: np.ndarray
    z: np.ndarray
    residual: np.ndarray
    weight: np.ndarray

    def sums(self, size):
        flat, w = self.index.ravel(), self.weight
        a = np.bincount(flat, (w * self.z**2).ravel(), minlength=size)
        return a, np.bincount(flat, (w * self.z * self.residual).ravel(), minlength=size)


def _row_of(part, o, image, dots, residual, context):
    weight = np.where(edges(o), 0.0, o.weight) if part.in_pose else o.weight
    return _Row(part.group(o), part.index(o, context), part.regressor(o, image, dots), residual, weight)


def _is_white(total_a, total_b, variance, shape, steps):
    """Whether draws `steps` apart on their grid are independent: what neighbours share in expectation, over the variance."""
    count = len(total_a) // int(np.prod(shape)) * int(np.prod(shape))
    a, b = (total[:count].reshape(-1, *shape) for total in (total_a, total_b))
    for axis in range(1, a.ndim):
        near, far = np.arange(a.shape[axis] - steps), np.arange(steps, a.shape[axis])
        both = (a.take(near, axis) * a.take(far, axis)).sum()
        if both > 0 and (b.take(near, axis) * b.take(far, axis)).sum() > _LARGEST_CORRELATION * variance * both:
            return False
    return True


def _unclipped(rows, train, variance):
    """The rows without pixels that a draw of this variance may bring to an end of the range: clipped draws look smaller."""
    out = []
    for row, (o, image, *_) in zip(rows, train, strict=True):
        reach = CLEAR_OF_ENDS * np.sqrt(max(variance, 0.0)) * np.abs(row.z)
        out.append(replace(row, weight=np.where((image > reach) & (image < o.view.max_dn - reach), row.weight, 0.0)))
    return out


def _size(rows):
    return max(int(row.index.max()) for row in rows) + 1


def _totals(rows):
    size = _size(rows)
    sums = [row.sums(size) for row in rows]
    return sum(a for a, _ in sums), sum(b for _, b in sums)


def _group_sums(rows):
    size, groups = _size(rows), {}
    for row in rows:
        a, b = row.sums(size)
        if row.group in groups:
            a, b = a + groups[row.group][0], b + groups[row.group][1]
        groups[row.group] = a, b
    return groups


def _variance(rows):
    """sigma^2 from products of different groups alone, unbiased under any noise that groups do not share; standard error of sigma
    by a jackknife over interleaved subsets of the index."""
    groups = _group_sums(rows).values()
    total_a, total_b = sum(a for a, _ in groups), sum(b for _, b in groups)
    top = total_b**2 - sum(b**2 for _, b in groups)
    bottom = total_a**2 - sum(a**2 for a, _ in groups)
    if bottom.sum() <= 0:
        return 0.0, 0.0
    variance = top.sum() / bottom.sum()
    part = np.arange(len(top)) % _JACKKNIFE
    tops, bottoms = np.bincount(part, top, minlength=_JACKKNIFE), np.bincount(part, bottom, minlength=_JACKKNIFE)
    left = (top.sum() - tops) / np.maximum(bottom.sum() - bottoms, 1e-300)
    spread = np.sqrt((_JACKKNIFE - 1) / _JACKKNIFE * ((left - left.mean()) ** 2).sum())
    return float(variance), float(spread / (2.0 * np.sqrt(max(variance, spread, 1e-30))))


def _variance_of(residuals, rows):
    """The same of other residuals."""
    return _variance([replace(row, residual=r) for row, r in zip(rows, residuals, strict=True)])[0]


def _shrunk(a, b, variance, sparse):
    if not sparse:
        return b / (a + 1.0 / variance)
    return np.where(b > _HOT_SIGMA * np.sqrt(np.maximum(a, 1e-30)), b / np.maximum(a, 1e-30), 0.0)


def _corrected(row, rows, total_a, total_b, variance, sparse):
    """The residual less what the other groups predict."""
    own_a, own_b = np.zeros(len(total_a)), np.zeros(len(total_b))
    for other in rows:
        if other.group == row.group:
            a, b = other.sums(len(total_a))
            own_a, own_b = own_a + a, own_b + b
    value = _shrunk(total_a - own_a, total_b - own_b, variance, sparse)
    return row.residual - row.z * value[row.index]


def _predicted(row, total_a, total_b, variance, sparse):
    value = _shrunk(total_a, total_b, variance, sparse)
    known = row.index < len(value)
    return row.residual - row.z * np.where(known, value[np.minimum(row.index, len(value) - 1)], 0.0)


def worst_image(train):
    """The largest covariance of neighbours in one image, in floors: an effect that few frames show drowns in the mean of them all."""
    worst = 0.0
    for o, _, _, r in train:
        x = r * np.sqrt(o.weight)
        worst = max(worst, *map(float, _with_neighbours(x)))
    return worst


def _with_neighbours(x):
    """Covariances of an image's pixels with those beside them and below them."""
    return (x[:, 1:] * x[:, :-1]).mean(), (x[1:] * x[:-1]).mean()


def white_rest(train):
    """Variance that stays between repeats of a view and is white over the image, edges left out, in floors; 0 where it is not white.

    Grains are white, and so is the renderer's own Monte Carlo noise; shifted, dimmed or blurred dots are not."""
    by_view = {}
    for o, _, _, r in train:
        view = _pose(o), o.frame.exposure_gain, o.frame.projector_power, o.eye
        by_view.setdefault(view, []).append(np.where(edges(o), np.nan, r * np.sqrt(o.weight)))
    same, beside, count = 0.0, np.zeros(2), 0
    for first, second, *_ in (group for group in by_view.values() if len(group) > 1):
        same += np.nanmean(first * second)
        beside += [np.nanmean(first[:, 1:] * second[:, :-1]), np.nanmean(first[1:] * second[:-1])]
        count += 1
    white = count > 0 and same > 0 and np.abs(beside).max() < _WHITE_LIMIT * same
    return min(float(same / count), _LARGEST_WHITE) if white else 0.0
