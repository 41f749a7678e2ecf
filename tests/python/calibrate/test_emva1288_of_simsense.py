# SPDX-License-Identifier: Apache-2.0
"""EMVA 1288 of simsense's frames gives back the parameters that were put in, and a measured model simulates as it was
measured."""

from types import SimpleNamespace

import numpy as np
import pytest
import simsense

from activestereo import StereoDepthSensorConfig
from activestereo.calibrate.emva1288 import Emva1288, Recording, Step, measure, step_of
from activestereo.effects.core.engine import EngineCamera
from activestereo.model import Quantity
from drawn_camera import Camera

WIDTH, HEIGHT, STACK = 256, 192, 32
SENSOR = {
    "responsivity_e": 1.0, "shot_noise": 1.0, "conversion_gain_dn_per_e": 0.05, "read_noise_e": 14.0,
    "full_well_e": 60000.0, "dark_current_e_per_s": 700.0, "prnu": 0.012, "dsnu_e": 18.0, "row_fixed_e": 8.0,
    "column_fixed_e": 11.0, "black_level_dn": 60.0, "bit_depth": 12,
}  # fmt: skip
LIGHT_E_PER_S = 70000.0
EXPOSURES_S = np.linspace(0.02, 1.0, 50)


def recording(
    signal: dict[str, float], exposures_s=EXPOSURES_S, stack: int = STACK, light: float = LIGHT_E_PER_S
) -> Recording:
    """Pairs at each exposure with and without light, and `stack` frames of both at the one nearest half of them."""
    k = np.array([[200.0, 0, WIDTH / 2], [0, 200.0, HEIGHT / 2], [0, 0, 1]])
    side = simsense.Camera(WIDTH, HEIGHT, k)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    engine = simsense.Engine(simsense.Device("host"), side, side, left_to_right, rectified=True, **signal)
    max_dn = int(2 ** signal["bit_depth"] - 1)
    taken = iter(range(10**6))

    def step(exposure_s: float, is_lit: bool, count: int) -> Step:
        image = np.full((HEIGHT, WIDTH), light if is_lit else 0.0, np.float32)

        def frame() -> np.ndarray:
            engine.set_parameters(exposure_s=exposure_s, frame_index=next(taken))
            return engine.compute(image, image, ("ir_left",))["ir_left"].copy()

        return step_of((frame() for _ in range(count)), max_dn, exposure_s, exposure_s * light if is_lit else 0.0, "")

    steps = [step(t, is_lit, 2) for t in exposures_s for is_lit in (True, False)]
    if stack:
        middle = float(exposures_s[len(exposures_s) * 2 // 5])
        steps += [step(middle, is_lit, stack) for is_lit in (True, False)]
    return Recording("simsense", int(signal["bit_depth"]), tuple(steps))


def widths_off(truth: float, quantity: Quantity) -> float:
    """By how many half widths of its 90 % interval a value lies beside its middle."""
    return abs(truth - 0.5 * (quantity.low + quantity.high)) / max(0.5 * (quantity.high - quantity.low), 1e-12)


def check(truths: list[tuple[float, Quantity]]) -> None:
    off = np.array([widths_off(truth, quantity) for truth, quantity in truths])
    # Of n intervals of 90 % two may miss, none by far (2.4 half widths are four standard deviations).
    assert (off > 1.0).sum() <= 2 and off.max() < 2.4, off


@pytest.fixture(scope="module")
def found() -> Emva1288:
    return measure(recording(SENSOR))


def test_gives_back_what_was_put_in_within_the_intervals(found):
    k, dark = SENSOR["conversion_gain_dn_per_e"], found.spatial.dark
    electrons = {
        "read_noise_e": found.transfer.dark_noise, "dark_current_e_per_s": found.transfer.dark_current,
        "dsnu_e": dark.pixel, "row_fixed_e": dark.row, "column_fixed_e": dark.column,
    }  # fmt: skip
    truths = [(k * SENSOR[name], quantity) for name, quantity in electrons.items()]
    truths += [(SENSOR["prnu"], found.prnu), (SENSOR["black_level_dn"], found.black)]
    check([*truths, (k, found.transfer.gain), (k, found.responsivity)])
    assert found.transfer.saturation_dn / k == pytest.approx(SENSOR["full_well_e"], rel=0.05)
    assert not dark.waves and not len(dark.excess)


def test_hot_pixels_are_told_by_those_that_stand_out():
    hot = {"hot_pixel_share": 0.004, "hot_pixel_e_per_s": 6000.0}
    found, k = measure(recording(SENSOR | hot)), SENSOR["conversion_gain_dn_per_e"]
    assert widths_off(0.004, found.hot_pixels["share"]) < 2.4
    assert widths_off(6000.0 * k, found.hot_pixels["rate_dn_per_s"]) < 2.4
    # Their own current is not the others'.
    assert found.dark_current.value == pytest.approx(SENSOR["dark_current_e_per_s"] * k, rel=0.01)


def test_a_linear_imager_is_found_linear(found):
    assert found.transfer.response.bend(2e4) == pytest.approx(1.0, abs=0.005)
    bent = measure(recording(SENSOR | {"response_exponent": 0.8}, EXPOSURES_S[::2], 0))
    assert bent.transfer.response.bend(2e4) < 0.9


def test_the_gain_acts_on_counts_alone():
    twice = measure(recording(SENSOR | {"gain": 0.5, "bit_depth": 14}, stack=0)).transfer
    assert widths_off(0.025, twice.gain) < 2.4
    # The most sensitive pixels fill first, 3 % before the others: there the mean variance peaks.
    assert twice.saturation_dn / twice.gain.value == pytest.approx(SENSOR["full_well_e"], rel=0.06)


def test_d435_preset_has_its_gain():
    # Amplified, so that the converter's noise spans a step in the dark, too.
    fine = {"bit_depth": 14, "gain": 32.0, "adc_noise_dn": 1.0, "responsivity_e": 1.0, "full_well_e": 51000.0}
    fine["black_level_dn"] = 50.0
    result = measure(recording(simsense.signal_preset("d435") | fine, EXPOSURES_S[::2], 0)).transfer
    assert result.gain.value / 32.0 == pytest.approx(0.00497, rel=0.05)


def test_a_measured_model_simulates_as_it_was_measured():
    """NumPy's camera of the other test, measured, as model.json and its effects put it into simsense's signal."""
    model = measure(Camera(2, (HEIGHT, WIDTH), bend=0.0, wave=0.0).recording()).model()
    config = StereoDepthSensorConfig.from_model(model)
    neutral = {"conversion_gain_dn_per_e": 1.0, "gain": 1.0, "bit_depth": 12, "prnu": 0.0, "dsnu_e": 0.0}
    signal = neutral | {"row_fixed_e": 0.0, "column_fixed_e": 0.0} | config.ir_signal
    signal["black_level_dn"] = config.ir_black_level_dn
    side = EngineCamera(None, None, signal, False)
    for entry in model.effects:
        entry.effect.engine(
            SimpleNamespace(sides=[side], warming_k=0.0), **{n: q.value for n, q in entry.parameters.items()}
        )
    again = measure(recording(signal, np.linspace(0.04, 1.0, 24), light=3000.0)).model()
    truths = [(getattr(model.imager, name).value, getattr(again.imager, name)) for name in ("shot", "offset")]
    truths.append((model.nuisances["black_dn"].value, again.nuisances["black_dn"]))
    for entry, other in zip(model.effects, again.effects, strict=True):
        assert entry.effect.id == other.effect.id
        truths += [(q.value, other.parameters[name]) for name, q in entry.parameters.items()]
    assert len(truths) == 7
    check(truths)
