# SPDX-License-Identifier: Apache-2.0
"""Wraps a Gymnasium environment with a depth camera so that its depth is measured by an active stereo camera. A policy
is then evaluated on the kind of depth that it was trained on.

    env = StereoDepth(env, depth=("pixels", "wrist_depth"), color=("pixels", "wrist"), fovy_deg=75.0)

robosuite and LIBERO give MuJoCo's depth buffer, upside down: take it with

    metres=lambda z: get_real_depth_map(env.sim, z)[::-1], and put back with back=lambda z: z[::-1]

and make robosuite's environment with hard_reset=False. Otherwise robosuite 1.5 loses its OpenGL context when Python
frees that of an earlier reset (eglReleaseThread), and returns uninitialised memory as depth.

robosuite 1.5 needs mujoco<4. LeRobot has its own module, activestereo.integrations.lerobot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from activestereo.camera.presets import FIELD_OF_VIEW, StereoDepthSensorConfig, own_config
from activestereo.integrations.gbuffers.pinhole import fitted
from activestereo.sensor.gbuffer.stereo import GBufferStereo

Keys = str | Sequence[str]
Images = Callable[[NDArray[Any]], NDArray[Any]]


class StereoDepth(gymnasium.ObservationWrapper):
    """Replaces the depth in a Dict observation by simulated stereo depth, float32 metres, 0 = no measurement.

    depth, color: the keys of planar depth [H, W] or [H, W, 1] and of the colour image, whose red channel is used as the
    infrared albedo; without color all surfaces have albedo_of_all. fovy_deg: the camera's vertical field of view, as in
    MuJoCo. camera: a preset or a configuration. metres: converts the environment's depth to upright metres. back: turns
    an upright image to the environment's orientation. rendered(env): returns upright planar depth [H, W] in metres, for
    an environment whose observation has none; its size is the colour image's. coded: converts metres [H, W] to the
    policy's input, float or bytes. supersampling: factor of the images' rows and columns over the sensor's, whose depth
    is repeated to the images' size; edges and gloss are then nearer to path-traced ones. The seed of reset() also seeds
    the noise. Raises ValueError if a key is missing.
    """

    def __init__(
        self, env: gymnasium.Env, depth: Keys, color: Keys | None = None, fovy_deg: float = 45.0,
        camera: StereoDepthSensorConfig | str = "D435", metres: Images | None = None, back: Images | None = None,
        albedo_of_all: float = 0.5, rendered: Callable[[gymnasium.Env], NDArray[Any]] | None = None,
        coded: Images | None = None, supersampling: int = 1,
    ) -> None:  # fmt: skip
        super().__init__(env)
        self._depth = (depth,) if isinstance(depth, str) else tuple(depth)
        self._color = (color,) if isinstance(color, str) else color and tuple(color)
        self._metres, self._back, self._albedo = metres or np.asarray, back or np.asarray, albedo_of_all
        self._rendered, self._coded = rendered, coded
        if rendered is not None and metres is not None:
            raise ValueError("metres converts the observation's depth, rendered takes its place: give one of them")
        if rendered is not None and self._color is None:
            raise ValueError("rendered depth has the size of the colour image: give color, too")
        given = self._depth if rendered is None or self._color is None else self._color
        shape = _entry(env.observation_space, given).shape
        if self._color is not None:
            _entry(env.observation_space, self._color)
        self._shape = shape if rendered is None else (*shape[:2], 1)
        height, width = shape[:2]
        FIELD_OF_VIEW.check("fovy_deg", fovy_deg)
        fovx_deg = float(np.rad2deg(2.0 * np.arctan(np.tan(np.deg2rad(fovy_deg) / 2.0) * width / height)))
        config = fitted(own_config(camera), width, height, fovx_deg, supersampling)
        self._sensor, self._finer = GBufferStereo(config, supersampling=supersampling), supersampling
        sample = self._observed(np.zeros((height, width), np.float32))
        most = 255 if sample.dtype == np.uint8 else float(config.max_depth_m)
        box = gymnasium.spaces.Box(0, most, sample.shape, sample.dtype.type)
        self.observation_space = _with_entry(env.observation_space, self._depth, box, gymnasium.spaces.Dict)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        if seed is not None:
            self._sensor.restart(seed)
        return super().reset(seed=seed, options=options)

    def observation(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        if self._rendered is None:
            depth_m = self._metres(np.asarray(_entry(observation, self._depth))).reshape(self._sensor.input_shape)
        else:
            depth_m = np.asarray(self._rendered(self.env)).reshape(self._sensor.input_shape)
        albedo = np.full(self._sensor.input_shape, self._albedo)
        if self._color is not None:  # `back` is its own inverse: it also turns an image upright
            albedo = self._back(np.asarray(_entry(observation, self._color)))[None]
        found = self._sensor(depth=depth_m, albedo=albedo, outputs=("depth",))["depth"][0]
        found = found.repeat(self._finer, axis=0).repeat(self._finer, axis=1)
        return _with_entry(observation, self._depth, self._observed(found), dict)

    def _observed(self, depth_m: NDArray[np.float32]) -> NDArray[Any]:
        """Returns measured depth with the observation's shape, coding and orientation. depth_m: upright, [H, W] metres.
        The result is contiguous, because torch takes no negative strides."""
        return np.ascontiguousarray(
            self._back(depth_m.reshape(self._shape) if self._coded is None else self._coded(depth_m))
        )


def _entry(values: Any, keys: Sequence[str]) -> Any:
    for key in keys:
        try:
            values = values[key]
        except (KeyError, TypeError) as error:
            had = ", ".join(map(str, values)) if isinstance(values, Mapping) else f"a {type(values).__name__}"
            raise ValueError(f"the observation has no {'/'.join(keys)}: in place of '{key}' it has {had}") from error
    return values


def _with_entry(values: Any, keys: Sequence[str], new: Any, kind: Callable[[dict[str, Any]], Any]) -> Any:
    """Returns a copy of nested mappings in which the path `keys` leads to `new`. kind: makes the mapping of each level
    from a dict."""
    own = new if len(keys) == 1 else _with_entry(values[keys[0]], keys[1:], new, kind)
    return kind({**dict(values.items()), keys[0]: own})
