# SPDX-License-Identifier: Apache-2.0
"""Saves the sensor under the page's settings as a model, for `activestereo simulate --model`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

from activestereo.model import Quantity, SensorModel
from activestereo.model.model import NUISANCES
from activestereo.report.view.settings import BY_HAND, Settings
from activestereo.report.view.simulation import Exposure

_MOST_NUMBERS = 10_000
_POWER = "projector_scale"


def saved_model(exposure: Exposure, settings: Settings) -> tuple[SensorModel, str]:
    """The model, and the settings that it cannot hold without a rig or a fitted projector, as options of simulate;
    empty if it holds all."""
    config, model = settings.applied(deepcopy(exposure.config), exposure.model)
    remarks = []
    if model.rig is not None:
        rig = replace(model.rig, exposure_s=config.ir_camera_exposure, gain=config.ir_camera_gain)
        model = replace(model, rig=rig)
    else:
        remarks += [] if settings.exposure_s is None else [f"--ir-exposure {settings.exposure_s:g}"]
        remarks += [] if settings.gain is None else [f"in Python config.ir_camera_gain = {settings.gain:g}"]
    if settings.laser_power_mw is not None:
        known = model.nuisances.get(_POWER)
        if known is None:
            remarks.insert(0, f"--laser-power {settings.laser_power_mw:g}")
        else:
            share = settings.laser_power_mw / config.laser_power_nominal_mw
            scaled = Quantity(share * known.value, unit=NUISANCES[_POWER][0], source=BY_HAND)
            model = replace(model, nuisances={**model.nuisances, _POWER: scaled})
    return model, ", ".join(remarks)


@contextmanager
def free_name(path: Path) -> Iterator[Path]:
    """The path, or if it exists the same with a number: model.json, model-2.json. An empty file reserves the name at
    once, and is removed if the block fails."""
    for number in range(1, _MOST_NUMBERS):
        name = path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
        try:
            name.touch(exist_ok=False)
        except FileExistsError:
            continue
        try:
            yield name
        except BaseException:
            name.unlink()
            raise
        return
    raise ValueError(f"{path}: there are {_MOST_NUMBERS} files of this name: give another one with --out")
