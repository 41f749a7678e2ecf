# SPDX-License-Identifier: Apache-2.0
"""Causes of the holes of a path-traced sensor, from G-buffers that are rendered of its infrared cameras."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.plan import ir_intrinsics
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.lens import is_distorting
from activestereo.effects.core.engine import EngineInputs
from activestereo.sensor.gbuffer.cause import causes, hidden_from_right
from activestereo.sensor.gbuffer.materials import mirrors_or_is_glass
from activestereo.sensor.gbuffer.rig import inverse_depth

_NOTHING = 0xFFFFFFFF


class TracedSensor(Protocol):
    """The members of a StereoDepthSensor that traced_causes() uses."""

    @property
    def scene(self) -> kuafu.Scene: ...

    def get_config(self) -> StereoDepthSensorConfig: ...

    def get_picture(self, name: str, camera: str) -> NDArray[Any]: ...

    def get_ir_measured(self) -> list[NDArray[Any]]: ...

    def engine_inputs(self) -> EngineInputs: ...


def traced_causes(sensor: TracedSensor, reason: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Returns uint8 [height, width], an index into cause.CAUSES, of the scene as it is now. reason: the matcher's.
    Raises ValueError for a sensor that rectifies images before it matches them."""
    config = sensor.get_config()
    if not config.rectified or any(is_distorting(ir_intrinsics(config, is_right)[1]) for is_right in (False, True)):
        raise ValueError("causes are told of pairs that are matched as they come: rectified=True, and no distortion")
    inputs = sensor.engine_inputs()
    depth, numbers = (sensor.get_picture(name, "left")[None, ..., 0] for name in ("depth", "material_id"))
    own = inverse_depth(np.where(numbers == _NOTHING, np.float32(0.0), depth))
    is_odd = np.zeros(own.shape, bool)
    for number in np.unique(numbers[own > 0]).tolist():
        if mirrors_or_is_glass(sensor.scene.get_material(number)):
            is_odd |= numbers == number
    beside = inverse_depth(sensor.get_picture("depth", "right")[None, ..., 0])
    is_lit = sensor.get_picture("projector_visibility", "left")[None, ..., 0] > 0.5
    is_hidden = hidden_from_right(config, own, beside)
    counts, black_dn = sensor.get_ir_measured()[0][None], float(inputs.left.signal["black_level_dn"])
    return causes(config, own, is_odd, is_lit, is_hidden, counts, reason[None], black_dn, inputs.max_dn)[0]
