# SPDX-License-Identifier: Apache-2.0
"""A flickering lamp's change between repeats is no noise; noise that the pixels of a row share is."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from activestereo.compare.noise import unsteady_light

HEIGHT, WIDTH = 120, 160
NOISE_DN = 1.5


@dataclass(frozen=True)
class _Light:
    projector: np.ndarray
    ambient: np.ndarray


def _light() -> _Light:
    u, v = np.meshgrid(np.arange(WIDTH) / WIDTH, np.arange(HEIGHT) / HEIGHT)
    return _Light(np.zeros((HEIGHT, WIDTH)), 1.0 + 0.6 * np.sin(9 * u) * np.cos(7 * v))


def _shots(change_by_row: list[np.ndarray]) -> dict[tuple[int, str], tuple[Any, _Light, np.ndarray]]:
    """Repeats of one view, whose mean is 20 DN of ambient light; change_by_row: DN [height][width] added to each."""
    rng, light = np.random.default_rng(7), _light()
    frame = lambda k: SimpleNamespace(  # noqa: E731
        id=k, repeat_group=0, exposure_gain=1.0, ambient=None, projector_power=1.0
    )
    return {
        (k, "left"): (frame(k), light, 20.0 * light.ambient + change + NOISE_DN * rng.standard_normal((HEIGHT, WIDTH)))
        for k, change in enumerate(change_by_row)
    }


def _variance(shots: dict[Any, Any], taken_out: dict[Any, np.ndarray]) -> float:
    images = [image - taken_out.get(key, 0.0) for key, (_, _, image) in shots.items()]
    return float(np.var(images, axis=0, ddof=1).mean())


@pytest.mark.parametrize(("frequency_hz", "line_time_s"), [(100.0, 2.6e-5), (230.0, 1.3e-5)])
def test_what_a_flickering_lamp_changes_is_taken_out_of_repeats(frequency_hz: float, line_time_s: float) -> None:
    time_s = np.arange(HEIGHT)[:, None] * line_time_s + np.array([0.0, 0.0334])
    factor = 0.4 * np.sin(2 * np.pi * frequency_hz * time_s)
    shots = _shots([20.0 * factor[:, k, None] * _light().ambient for k in range(2)])
    assert _variance(shots, {}) > 2.0 * NOISE_DN**2
    assert _variance(shots, unsteady_light(shots)) == pytest.approx(NOISE_DN**2, rel=0.03)


def test_noise_of_rows_and_of_pixels_stays() -> None:
    rng = np.random.default_rng(3)
    rows = [np.repeat(1.5 * rng.standard_normal((HEIGHT, 1)), WIDTH, axis=1) for _ in range(2)]
    assert unsteady_light(_shots(rows)) == {}
    assert unsteady_light(_shots([np.zeros((HEIGHT, WIDTH))] * 2)) == {}


def test_a_level_that_drifts_in_the_dark_is_no_lamp() -> None:
    assert unsteady_light(_shots([np.full((HEIGHT, WIDTH), level) for level in (0.0, 4.0)])) == {}


def test_frames_that_are_no_repeats_have_no_change() -> None:
    (key, (frame, light, image)), *_ = _shots([np.zeros((HEIGHT, WIDTH))]).items()
    frame.repeat_group = None
    assert unsteady_light({key: (frame, light, image)}) == {}
