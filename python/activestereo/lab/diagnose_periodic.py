"""Where to start a fit of light that flickers: its likelihood has a peak every hundredth of a hertz, so all of them are looked at.

A row's share of ambient light is linear in the sine and cosine of the flicker's phase at that row's time: per frequency and line
time that is a regression on a few sums per row.
"""

import numpy as np

_EFFECT = "flicker_banding"
# Lamps flicker at twice the mains' 50 or 60 Hz, which grids and generators keep to 2 %; few frames alone would fit other ones as well.
_FREQUENCIES_HZ = np.arange(98.0, 122.5, 0.02)
_FINE_STEPS = 50
_LINE_TIMES_S = np.arange(0.0, 6.1e-5, 5e-6)
_STARTS = 4


def periodic_points(candidate, fitter, play, phi):
    """Parameter vectors of the best few peaks for the flicker of ambient light; None for other effects."""
    if candidate.id != _EFFECT:
        return None
    images, peaks = _images(fitter, play, phi), []
    for line_time in _LINE_TIMES_S:
        gains, sine, cosine = _gains(images, line_time)
        best = int(gains.argmax())
        peaks.append((gains[best], _FREQUENCIES_HZ[best], line_time, sine[best], cosine[best]))
    peaks.sort(reverse=True)
    points = []
    for _, frequency, line_time, sine, cosine in peaks[:_STARTS]:
        values = {"depth": np.hypot(sine, cosine), "frequency_hz": frequency, "phase_rad": np.arctan2(cosine, sine), "line_time_s": line_time}
        points.append(np.array([np.clip(values[p.name], p.low, p.high) for p in candidate.parameters]))
    return points


def _images(fitter, play, phi):
    """(frame, sums w A^2 and w A r of ambient light A in every row) of each observation."""
    images = []
    for o, slopes, residual in fitter.slopes(play, play.start, phi, fitter.lights(play, play.start), 0):
        ambient = slopes[1] * phi[1]
        images.append((o.frame, (o.weight * ambient**2).sum(axis=1), (o.weight * ambient * residual).sum(axis=1)))
    return images


def _gains(images, line_time):
    """(fall of chi2, amplitude of the sine, of the cosine) at every frequency. Sums of squares and products of sine and cosine are those of
    twice the angle: of a row's wave exp(i angle) and of its square."""
    total, square, product = 0.0, 0.0, 0.0
    waves = {len(strength): _row_waves(len(strength), line_time) for _, strength, _ in images}
    for frame, strength, moment in images:
        rows, start = waves[len(strength)], np.exp(2j * np.pi * _FREQUENCIES_HZ * frame.timestamp_s)
        averaged = np.sinc(_FREQUENCIES_HZ * frame.exposure_s)
        total = total + averaged**2 * strength.sum()
        square = square + (averaged * start) ** 2 * ((rows * rows) @ strength)
        product = product + averaged * start * (rows @ moment)
    ss, cc, sc = 0.5 * (total - square.real), 0.5 * (total + square.real), 0.5 * square.imag
    determinant = np.maximum(ss * cc - sc * sc, 1e-12 * (ss * cc + 1e-30))
    sine = (cc * product.imag - sc * product.real) / determinant
    cosine = (ss * product.real - sc * product.imag) / determinant
    return sine * product.imag + cosine * product.real, sine, cosine


def _row_waves(height, line_time):
    """exp(i angle) of rows counted from the middle, [frequencies][height]: products of coarse and fine steps of frequency."""
    lag = 2j * np.pi * line_time * (np.arange(height) - (height - 1) / 2)
    coarse = np.exp(np.outer(_FREQUENCIES_HZ[::_FINE_STEPS], lag))
    fine = np.exp(np.outer(_FREQUENCIES_HZ[:_FINE_STEPS] - _FREQUENCIES_HZ[0], lag))
    return (coarse[:, None] * fine).reshape(-1, height)[: len(_FREQUENCIES_HZ)]
