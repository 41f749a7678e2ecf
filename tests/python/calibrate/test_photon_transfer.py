# SPDX-License-Identifier: Apache-2.0
"""EMVA 1288 analysis of simulated frames gives back the parameters that were put in."""

import numpy as np
import pytest

import simsense
from photon_transfer import photon_transfer

WIDTH, HEIGHT = 256, 192
SENSOR = {
    "responsivity_e": 1.0,
    "shot_noise": 1.0,
    "conversion_gain_dn_per_e": 0.05,
    "read_noise_e": 14.0,
    "full_well_e": 60000.0,
    "dark_current_e_per_s": 700.0,
    "prnu": 0.012,
    "dsnu_e": 18.0,
    "black_level_dn": 60.0,
    "bit_depth": 12,
}
LIGHT_E_PER_S = 70000.0


def camera(**signal):
    """take(exposure_s, is_lit, frame) of a simulated imager."""
    k = np.array([[200.0, 0, WIDTH / 2], [0, 200.0, HEIGHT / 2], [0, 0, 1]])
    side = simsense.Camera(WIDTH, HEIGHT, k)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    engine = simsense.Engine(simsense.Device("host"), side, side, left_to_right, rectified=True, **signal)
    lit, dark = np.full((HEIGHT, WIDTH), LIGHT_E_PER_S, np.float32), np.zeros((HEIGHT, WIDTH), np.float32)

    def take(exposure_s, is_lit, frame):
        # Each level and each light is another time: noise of its own.
        index = frame + 1000 * round(exposure_s * 1e6) + 500 * is_lit
        engine.set_parameters(exposure_s=exposure_s, frame_index=index)
        image = lit if is_lit else dark
        return engine.compute(image, image, ("ir_left",))["ir_left"]

    return take


@pytest.fixture(scope="module")
def result():
    return photon_transfer(camera(**SENSOR), np.linspace(0.02, 1.0, 50))


@pytest.mark.parametrize(
    "name",
    [
        "conversion_gain_dn_per_e",
        "read_noise_e",
        "full_well_e",
        "dark_current_e_per_s",
        "prnu",
        "dsnu_e",
        "black_level_dn",
    ],
)
def test_gives_back_what_was_put_in_to_five_percent(result, name):
    assert getattr(result, name) == pytest.approx(SENSOR[name], rel=0.05)


def test_a_linear_imager_is_found_linear(result):
    assert result.linearity_error < 0.005
    bent = photon_transfer(camera(**SENSOR, response_exponent=0.8), np.linspace(0.02, 1.0, 20), stack_count=2)
    assert bent.linearity_error > 0.02


def test_the_gain_acts_on_counts_alone():
    twice = photon_transfer(
        camera(**(SENSOR | {"gain": 0.5, "bit_depth": 14})), np.linspace(0.02, 1.0, 50), stack_count=2
    )
    assert twice.conversion_gain_dn_per_e == pytest.approx(0.025, rel=0.05)
    assert twice.full_well_e == pytest.approx(SENSOR["full_well_e"], rel=0.05)


def test_d435_preset_has_its_gain():
    # Amplified, so that the converter's noise spans a step in the dark too, which the analysis needs.
    fine = {"bit_depth": 14, "gain": 32.0, "adc_noise_dn": 1.0, "responsivity_e": 1.0, "full_well_e": 51000.0}
    result = photon_transfer(
        camera(**(simsense.signal_preset("d435") | fine)), np.linspace(0.02, 1.0, 40), stack_count=2
    )
    assert result.conversion_gain_dn_per_e / 32.0 == pytest.approx(0.00497, rel=0.05)


@pytest.mark.parametrize(
    "exposures, says",
    [
        (np.linspace(0.02, 0.5, 30), "does not saturate"),
        ([0.1, 0.2], "at least 6"),
        ([0.5, 0.4, 0.3, 0.2, 0.1, 0.05], "increasing"),
        ([0.8, 0.82, 0.84, 0.9, 0.95, 1.0], "shorter"),
    ],
)
def test_exposures_that_show_too_little_are_refused(exposures, says):
    with pytest.raises(ValueError, match=says):
        photon_transfer(camera(**SENSOR), exposures)


def test_unequal_cameras_and_presets_from_python():
    k = np.array([[200.0, 0, WIDTH / 2], [0, 200.0, HEIGHT / 2], [0, 0, 1]])
    side = simsense.Camera(WIDTH, HEIGHT, k)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    engine = simsense.Engine(simsense.Device("host"), side, side, left_to_right, rectified=True)
    engine.set_signal(right={"gain": 1.1, "black_level_dn": 2.0, "bit_depth": 10})
    image = np.full((HEIGHT, WIDTH), 100, np.uint8)
    out = engine.compute(image, image, ("ir_left", "ir_right"))
    assert out["ir_left"].dtype == np.uint8 and out["ir_right"].dtype == np.uint16
    assert out["ir_left"][0, 0] == 100 and out["ir_right"][0, 0] == 112
    left, right = engine.signal
    assert left["gain"] == 1.0 and right["bit_depth"] == 10
    engine.set_signal(simsense.signal_preset("paper-d415"))
    assert engine.parameters["speckle_shape"] == pytest.approx(3.98)
    with pytest.raises(simsense.ArgumentError, match="left signal: shot_noise is 300"):
        engine.set_parameters(shot_noise=300.0, p1=3)
    assert engine.parameters["p1"] == 8
    with pytest.raises(simsense.ArgumentError, match="p1 is 0"):
        engine.set_parameters(shot_noise=1.0, p1=0)
    assert engine.parameters["shot_noise"] == 0.0
    with pytest.raises(TypeError, match="no parameter 'census_width'"):
        engine.set_signal({"census_width": 7})
