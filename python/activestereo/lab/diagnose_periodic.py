"""Where to start a fit of light that flickers: its likelihood has a peak every hundredth of a hertz, so all of them are looked at.

A row's share of ambient light is linear in the sine and cosine of the flicker's phase at that row's time: per frequency and line
time that is a regression on a few sums per row.
"""

import numpy as np

_EFFECT = "flicker_banding"
_FREQUENCIES_HZ = np.arange(80.0, 130.0, 0.02)
_LINE_TIMES_S = np.arange(0.0, 6.1e-5, 5e-6)
_STARTS = 4


def periodic_points(candidate, fitter, play, phi):
    """Parameter vectors of the best few peaks for the flicker of ambient light; None for other effects."""
    if candidate.id != _EFFECT:
        return None
    time, row, exposure, strength, moment = _rows(fitter, play, phi)
    peaks = []
    for line_time in _LINE_TIMES_S:
        gains, waves = _gains(time + row * line_time, exposure, strength, moment)
        best = int(gains.argmax())
        peaks.append((gains[best], _FREQUENCIES_HZ[best], line_time, *waves[best]))
    peaks.sort(reverse=True)
    points = []
    for _, frequency, line_time, sine, cosine in peaks[:_STARTS]:
        values = {"depth": np.hypot(sine, cosine), "frequency_hz": frequency, "phase_rad": np.arctan2(cosine, sine), "line_time_s": line_time}
        points.append(np.array([np.clip(values[p.name], p.low, p.high) for p in candidate.parameters]))
    return points


def _rows(fitter, play, phi):
    """Of every row: its frame's time, its number from the middle, exposure, and the sums w A^2 and w A r of ambient light A."""
    columns = []
    lights = fitter.lights(play, play.start)
    for o, slopes, residual in fitter.slopes(play, play.start, phi, lights, 0):
        ambient = slopes[1] * phi[1]
        height = ambient.shape[0]
        strength, moment = (o.weight * ambient**2).sum(axis=1), (o.weight * ambient * residual).sum(axis=1)
        frame = o.frame
        time, exposure = np.full(height, frame.timestamp_s), np.full(height, frame.exposure_s)
        columns.append(np.stack([time, np.arange(height) - (height - 1) / 2, exposure, strength, moment]))
    return np.concatenate(columns, axis=1)


def _gains(time, exposure, strength, moment):
    """(fall of chi2 at every frequency, amplitudes of sine and cosine there)."""
    gains, waves = [], []
    for frequency in _FREQUENCIES_HZ:
        angle, averaged = 2 * np.pi * frequency * time, np.sinc(frequency * exposure)
        s, c = averaged * np.sin(angle), averaged * np.cos(angle)
        ss, cc, sc = strength @ (s * s), strength @ (c * c), strength @ (s * c)
        ms, mc = moment @ s, moment @ c
        determinant = max(ss * cc - sc * sc, 1e-12 * (ss * cc + 1e-30))
        sine, cosine = (cc * ms - sc * mc) / determinant, (ss * mc - sc * ms) / determinant
        gains.append(sine * ms + cosine * mc)
        waves.append((sine, cosine))
    return np.array(gains), waves
