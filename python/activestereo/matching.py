"""The sensor's configuration in the engine's terms."""

import simsense

# SAPIEN's noise at scale 1: a gamma factor of shape 1333.33 and mean 1, and Gaussian noise of 0.25 counts.
SPECKLE_SHAPE = 1333.33
THERMAL_SIGMA_DN = 0.25


def signal_parameters(config):
    """Both imagers' parameters, all of them: ir_signal or SAPIEN's noise, with the exposure, responsivity and black level."""
    signal = config.ir_signal
    if isinstance(signal, str):
        signal = simsense.signal_preset(signal)
    signal = simsense.signal_preset("neutral") | (_sapien_noise(config) if signal is None else signal)
    signal["exposure_s"] = config.ir_camera_exposure
    signal["responsivity_e"] *= config.ir_responsivity_dn
    signal["black_level_dn"] += config.ir_black_level_dn
    return signal


def _sapien_noise(config):
    speckle, thermal = config.ir_speckle_noise, config.ir_thermal_noise
    if speckle < 0 or (speckle > 0 and thermal <= 0):
        raise ValueError(f"noise scales must be positive, or ir_speckle_noise 0 for none; they are {speckle} and {thermal}")
    if speckle == 0:
        return {"speckle_shape": 0.0, "speckle_scale": 0.0, "adc_noise_dn": 0.0}
    return {
        "speckle_shape": SPECKLE_SHAPE / speckle,
        "speckle_scale": speckle / SPECKLE_SHAPE,
        "adc_noise_dn": THERMAL_SIGMA_DN * thermal,
    }


def engine_parameters(config):
    """Keyword arguments of simsense.Engine, the imagers' included."""
    return {
        "census_width": config.census_width,
        "census_height": config.census_height,
        "max_disparity": config.max_disp,
        "block_width": config.block_width,
        "block_height": config.block_height,
        "p1": config.p1_penalty,
        "p2": config.p2_penalty,
        "uniqueness_ratio": min(config.uniqueness_ratio, 100),
        "lr_max_diff": -1 if config.lr_max_diff == 255 else config.lr_max_diff,
        "median_size": config.median_filter_size,
        "min_depth_m": config.min_depth,
        "max_depth_m": config.max_depth,
        "depth_dilation": bool(config.depth_dilation),
        **signal_parameters(config),
    }
