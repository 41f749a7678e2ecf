# SPDX-License-Identifier: Apache-2.0
"""A camera drawn by NumPy, whose parameters by EMVA 1288 are known, and its recording as the standard asks."""

import numpy as np

from activestereo.calibrate.emva1288 import Recording, Step, step_of

# A camera of 12 bits: DN, shares and cycles per pixel.
GAIN, SIGMA, BLACK, PRNU, DSNU, COLUMN, ROW, WAVE = 0.1, 3.0, 29.4, 0.006, 1.5, 0.6, 0.4, 0.5
EFFICIENCY, BEND = 0.5, 0.03
MAX_DN = 4095
SIZE = (48, 64)
STEPS = np.linspace(4e3, 9e4, 12)


class Camera:
    """frame(photons) draws one; fixed patterns are drawn once."""

    def __init__(self, seed: int, size: tuple[int, int] = SIZE, bend: float = BEND, wave: float = WAVE) -> None:
        self.rng = np.random.default_rng(seed)
        self.bend = bend
        y, x = np.mgrid[: size[0], : size[1]]
        draw = self.rng.standard_normal
        self.sensitivity = 1.0 + PRNU * draw(size)
        self.offset = DSNU * draw(size) + COLUMN * draw((1, size[1])) + ROW * draw((size[0], 1))
        self.offset += wave * np.sin(2.0 * np.pi * (0.21 * x + 0.17 * y))

    def frame(self, photons: float) -> np.ndarray:
        electrons = self.rng.poisson(photons * EFFICIENCY * self.sensitivity)
        dn = GAIN * electrons + self.rng.normal(0.0, SIGMA, electrons.shape)
        dn = dn * (1.0 - self.bend * (dn / MAX_DN) ** 2)
        return np.rint(dn + self.offset + BLACK).clip(0, MAX_DN).astype(np.uint16)

    def step(self, photons: float, frames: int = 2, known: bool = True) -> Step:
        drawn = (self.frame(photons) for _ in range(frames))
        return step_of(drawn, MAX_DN, 1e-3, photons if known or not photons else None, f"{photons:.0f}")

    def recording(self, frames: int = 24, known: bool = True) -> Recording:
        steps = [self.step(photons, 2, known) for photons in (*STEPS, 0.0)]
        return Recording("drawn", 12, (*steps, self.step(4e4, frames, known), self.step(0.0, frames)))
