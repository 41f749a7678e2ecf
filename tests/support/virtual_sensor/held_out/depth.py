# SPDX-License-Identifier: Apache-2.0
"""The virtual device's own depth engine: census of a cross, eight-path SGM, and its possible faults."""

import numpy as np
from scipy.ndimage import gaussian_filter, median_filter, uniform_filter

MAX_DISPARITY = 32
_P1, _P2 = 4, 28
_CROSS = [
    (dy, dx) for dy in range(-3, 4) for dx in range(-4, 5) if (dy, dx) != (0, 0) and (abs(dx) % 2 == 0 or dy == 0)
]
_PATHS = [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]


def device_depth(left, right, focal_px, baseline_m, hidden, earlier=()):
    """Returns the device's depth in metres, [height][width], 0 = none. hidden: {effect: {parameter: value}}; earlier:
    previous pairs, latest first, for a device that averages over time."""
    disparity = _matched(left, right, hidden)
    if "temporal_filter" in hidden:
        frames = [disparity, *(_matched(*pair, hidden) for pair in earlier)]
        disparity = _averaged(np.stack(frames), hidden["temporal_filter"]["weight"])
    if "hole_filling" in hidden:
        disparity = _filled(disparity, int(hidden["hole_filling"]["reach_px"]))
    return np.where(disparity > 0.5, focal_px * baseline_m / np.maximum(disparity, 0.5), 0.0)


def _averaged(frames, weight):
    """Averages disparities [age][height][width] within half a pixel of the latest, by weights (1 - weight)^age."""
    near = (frames > 0) & (np.abs(frames - frames[0]) < 0.5)
    weights = near * (1.0 - weight) ** np.arange(len(frames))[:, None, None]
    return np.where(frames[0] > 0, (weights * frames).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-9), 0.0)


def _filled(disparity, reach):
    """Fills holes in each row with the value to their left, at most `reach` pixels in a row."""
    out, since = disparity.copy(), np.zeros(disparity.shape[0], dtype=int)
    for x in range(1, out.shape[1]):
        since = np.where(disparity[:, x] > 0, 0, since + 1)
        out[:, x] = np.where((since > 0) & (since <= reach), out[:, x - 1], disparity[:, x])
    return out


def _matched(left, right, hidden):
    """Matches a pair under the matcher's hidden faults. Returns disparity in pixels [height][width], 0 = none."""
    fattening = hidden.get("edge_fattening", {}).get("block_px", 1)
    cost = _cost(_census(left), _census(right), fattening)
    total = sum(_aggregate(cost, *path) for path in _PATHS)
    disparity = _subpixel(total)
    other = _right_winner(total)
    disparity = np.where(_consistent(disparity, other), disparity, 0.0)
    disparity = np.rint(_faults(disparity, hidden) * 16) / 16
    return np.where(disparity > 0, median_filter(disparity, 3), 0.0)


def _faults(disparity, hidden):
    valid = disparity > 0
    d = disparity
    if "pixel_locking" in hidden:  # A triangle-like wave: fundamental and third harmonic.
        a = hidden["pixel_locking"]["amplitude_px"]
        d = d - a * (np.sin(2 * np.pi * d) - np.sin(6 * np.pi * d) / 9)
    if "foreshortening_bias" in hidden:
        slope = np.abs(np.gradient(_smoothed(d, valid, 2.5), axis=0)).clip(0, 0.3)
        d = d + hidden["foreshortening_bias"]["px_per_slope"] * slope
    if "post_filter" in hidden:
        d = _smoothed(d, valid, hidden["post_filter"]["sigma_px"])
    return np.where(valid, d, 0.0)


def _smoothed(d, valid, sigma):
    weight = gaussian_filter(valid.astype(float), sigma)
    return gaussian_filter(np.where(valid, d, 0.0), sigma) / np.maximum(weight, 1e-6)


def _census(image):
    height, width = image.shape
    padded = np.pad(image.astype(np.int16), ((3, 3), (4, 4)), mode="edge")
    code = np.zeros((height, width), dtype=np.uint64)
    for k, (dy, dx) in enumerate(_CROSS):
        brighter = padded[3 + dy : 3 + dy + height, 4 + dx : 4 + dx + width] > image
        code |= brighter.astype(np.uint64) << np.uint64(k)
    return code


def _cost(left, right, block):
    """Returns census codes' Hamming distance [height][width][disparity], without a partner the largest, over blocks."""
    height, width = left.shape
    cost = np.full((height, width, MAX_DISPARITY), float(len(_CROSS)))
    for d in range(MAX_DISPARITY):
        cost[:, d:, d] = _bits(left[:, d:] ^ right[:, : width - d])
    return cost if block <= 1 else uniform_filter(cost, (block, block, 1), mode="nearest")


def _bits(x):
    table = np.array([bin(i).count("1") for i in range(256)], dtype=np.uint8)
    return table[np.ascontiguousarray(x).view(np.uint8).reshape(*x.shape, 8)].sum(axis=-1)


def _aggregate(cost, dy, dx):
    """Aggregates the cost along one direction of semi-global matching (Hirschmueller 2008), line by line."""
    vertical = dy != 0
    volume = cost if vertical else cost.transpose(1, 0, 2)
    step = dy if vertical else dx
    order = range(volume.shape[0]) if step > 0 else range(volume.shape[0] - 1, -1, -1)
    out, before = np.empty_like(volume), None
    for i in order:
        line = volume[i].copy()
        if before is not None:
            line += _least(before, dx if vertical else 0)
        out[i] = before = line
    return out if vertical else out.transpose(1, 0, 2)


def _least(before, shift):
    """Returns each disparity's least cost from the line before, less its minimum. shift: a diagonal's sideways step."""
    low = before.min(axis=1, keepdims=True)
    best = np.minimum(before, low + _P2)
    best[:, 1:] = np.minimum(best[:, 1:], before[:, :-1] + _P1)
    best[:, :-1] = np.minimum(best[:, :-1], before[:, 1:] + _P1)
    best -= low
    if shift:
        best = np.roll(best, shift, axis=0)
        best[0 if shift > 0 else -1] = 0.0
    return best


def _subpixel(total):
    winner = total.argmin(axis=2)
    inner = np.clip(winner, 1, MAX_DISPARITY - 2)
    y, x = np.indices(winner.shape)
    below, at, above = (total[y, x, inner + k] for k in (-1, 0, 1))
    slope = np.maximum(below - at, above - at)
    step = np.where((slope > 0) & (inner == winner), 0.5 * (below - above) / np.maximum(slope, 1e-9), 0.0)
    return winner + step.clip(-0.5, 0.5)


def _right_winner(total):
    height, width, _ = total.shape
    best, winner = np.full((height, width), np.inf), np.zeros((height, width))
    for d in range(MAX_DISPARITY):
        cost = np.full((height, width), np.inf)
        cost[:, : width - d] = total[:, d:, d]
        winner, best = np.where(cost < best, d, winner), np.minimum(cost, best)
    return winner


def _consistent(disparity, other):
    y, x = np.indices(disparity.shape)
    partner = np.rint(x - disparity).astype(int)
    return (partner >= 0) & (np.abs(other[y, np.maximum(partner, 0)] - disparity) <= 1.0)
