# SPDX-License-Identifier: Apache-2.0
"""What a sensor has of its last picture: the RGB camera's images and the depth engine's maps, which the host reads, or
CUDA where they lie."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import NDArray

import kuafu
import simsense
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.nearest import did_you_mean
from activestereo.sensor.cuda_maps import DEPTH_MAPS, MAPS, PICTURES, CudaMap, CudaMaps, check_cuda_name
from activestereo.sensor.cuda_memory import CudaArray
from activestereo.sensor.lazy_maps import LazyMaps
from activestereo.sensor.picture_memory import RGB_OUTPUTS, PictureMemory

# Computes maps of the last picture: to arrays by their names, or into {name: simsense.Image}.
Match = Callable[[Any], Mapping[str, NDArray[Any]]]


def require_picture(has_picture: bool) -> None:
    """RuntimeError where none was taken."""
    if not has_picture:
        raise RuntimeError("no picture yet: call take_picture() first")


def require_rgb(has_picture: bool, has_rgb: bool) -> None:
    """RuntimeError where none was taken, or in the infrared alone."""
    require_picture(has_picture)
    if not has_rgb:
        raise RuntimeError("no RGB picture yet: call take_picture() first, without infrared_only")


def require_depth(maps: LazyMaps) -> None:
    """RuntimeError where the last picture has not been matched."""
    if not maps:
        raise RuntimeError("no depth of this picture yet: call compute_depth() after take_picture()")


class SensorResults:
    """match, in each call: the sensor's. RuntimeError where the last picture has not what is asked for.

    on_cuda: all lies where CUDA sees it, too, and the host reads it from there; CudaError where there is no CUDA, or
    none on this GPU.
    """

    def __init__(
        self, device: kuafu.Device, engine_device: simsense.Device, config: StereoDepthSensorConfig, on_cuda: bool
    ) -> None:
        width, height = config.rgb_resolution
        self._device, self._rgb_shape = device, (1, height, width)
        self._depth_maps = tuple(config.depth_maps)
        self._cuda_maps = CudaMaps(engine_device) if on_cuda else None
        self.rgb = self.rgb_memory()
        self.has_picture = self.has_rgb = False
        self.maps = LazyMaps("depth_rgb")

    def rgb_memory(self) -> PictureMemory:
        """Memory for another RGB picture."""
        return PictureMemory(self._device, self._rgb_shape, RGB_OUTPUTS, on_cuda=self._cuda_maps is not None)

    def match(self, match: Match) -> None:
        """Computes the maps that have been read of earlier pictures."""
        require_picture(self.has_picture)
        self.maps.begin(lambda names: self._computed(names, match))

    def complete(self, match: Match) -> None:
        """Has all maps at hand where the picture has been matched, as before the engine changes."""
        if self.maps:
            names = ("disparity", "ir_left", "ir_right", *self._depth_maps)
            self.maps.complete(names, lambda missing: self._computed(missing, match))

    def map(self, name: str, match: Match) -> NDArray[Any]:
        """One of the depth engine's, [height, width, ...]."""
        found = self._map(name, match)
        return found.read() if isinstance(found, CudaMap) else found

    def depth_map(self, name: str, match: Match) -> NDArray[Any]:
        """One of the config's depth_maps."""
        self._check_depth_map(name)
        return self.map(name, match)

    def picture(self, name: str) -> NDArray[Any]:
        """One of the RGB camera's, [height, width, channels]."""
        require_rgb(self.has_picture, self.has_rgb)
        return self.rgb.read(name)[0]

    def cuda(self, name: str, match: Match) -> CudaArray:
        """get_cuda() of the sensor."""
        if self._cuda_maps is None:
            raise RuntimeError("this sensor is of the host: make it with on_cuda=True")
        check_cuda_name(name, "a sensor")
        if name in DEPTH_MAPS:
            self._check_depth_map(name)
        if name in MAPS:
            found = self._map(MAPS[name], match)
            return found.array(found.image.shape)
        require_rgb(self.has_picture, self.has_rgb)
        _, height, width, channels = self.rgb.targets[PICTURES[name]].shape
        return self.rgb.cuda(PICTURES[name], (height, width, channels) if channels > 1 else (height, width))

    def _check_depth_map(self, name: str) -> None:
        if name not in self._depth_maps:
            hint = did_you_mean(name, self._depth_maps)
            raise ValueError(f"'{name}' is none of the config's depth_maps {self._depth_maps}{hint}")

    def _map(self, name: str, match: Match) -> Any:
        require_depth(self.maps)
        return self.maps.read(name, lambda names: self._computed(names, match))

    def _computed(self, names: list[str], match: Match) -> Mapping[str, Any]:
        return match(names) if self._cuda_maps is None else self._cuda_maps.compute(names, match)
