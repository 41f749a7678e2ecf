# SPDX-License-Identifier: Apache-2.0
"""Differences of pictures as the early layers of a user's network see them: AlexNet's, in the manner of LPIPS (Zhang et
al. 2018) with equal weights. The file is ONNX and is read by OpenCV; no network comes with this package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.material_views import Picture

_MOST_LAYERS = 5  # as AlexNet has
_LEAST_PX = 64  # below it AlexNet's last pooling has nothing left
_ACTIVATIONS = ("ReLU", "ReLU6", "ELU", "Swish", "Mish", "TanH", "Sigmoid")
_LOG = cv2 if hasattr(cv2, "setLogLevel") else cv2.utils.logging  # OpenCV 5 has it there
# OpenCV 5's new engine joins convolutions and activations, which hides their names.
_ENGINE = {"engine": cv2.dnn.ENGINE_CLASSIC} if hasattr(cv2.dnn, "ENGINE_CLASSIC") else {}
# What networks of torchvision are trained with.
_MEAN, _DEVIATION = np.array([[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]], np.float32)


class Network:
    """Up to five activations that follow convolutions, first ones first, are looked at; what comes behind them, such as
    a classifier, is not run."""

    def __init__(self, path: Path) -> None:
        """ValueError where the file is no such network."""
        if not path.is_file():
            raise ValueError(f"{path}: no such file, expected a network as ONNX")
        with _quiet():
            try:
                self._net = cv2.dnn.readNetFromONNX(str(path), **_ENGINE)
            except cv2.error as error:
                raise ValueError(f"{path}: OpenCV {cv2.__version__} cannot read it as ONNX ({_line(error)})") from error
        self.layers = self._early_layers()
        if not self.layers:
            raise ValueError(f"{path}: has no convolution with an activation behind it, such as AlexNet's")
        try:
            with _quiet():
                self.features(np.zeros((_LEAST_PX, _LEAST_PX + 16, 3), np.float32))
        except cv2.error as error:
            raise ValueError(
                f"{path}: does not take a picture of 3 channels and {_LEAST_PX + 16}x{_LEAST_PX} px ({_line(error)})"
            ) from error

    def _early_layers(self) -> tuple[str, ...]:
        found: list[str] = []
        behind_convolution = False
        for name in self._net.getLayerNames():
            kind = self._net.getLayer(name).type
            if kind == "Convolution":
                behind_convolution = True
            elif kind in _ACTIVATIONS and behind_convolution:
                found.append(name)
                behind_convolution = False
        return tuple(found[:_MOST_LAYERS])

    def features(self, coded: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """coded: [height][width][1 or 3], 0..1 as a screen shows it. [channel][row][column] of each layer, of unit
        length over the channels."""
        height, width = coded.shape[:2]
        scale = int(np.ceil(_LEAST_PX / min(height, width)))
        larger = cv2.resize(coded, (width * scale, height * scale), interpolation=cv2.INTER_LINEAR)
        colors = np.broadcast_to(larger.reshape(height * scale, width * scale, -1), (*larger.shape[:2], 3))
        self._net.setInput(np.ascontiguousarray(((colors - _MEAN) / _DEVIATION).transpose(2, 0, 1)[None], np.float32))
        layers = [layer[0] for layer in self._net.forward(list(self.layers))]
        return [layer / (np.linalg.norm(layer, axis=0) + 1e-10) for layer in layers]


class PictureFeatures:
    """One recorded picture as the network sees it. A layer's differences count in deviations: those that noise of the
    picture's sigma makes in it."""

    def __init__(self, network: Network, picture: Picture) -> None:
        self._network, self._picture = network, picture
        self._white = max(float(picture.seen[picture.usable].max(initial=0.0)), 1e-6)
        self._seen = network.features(self._coded(picture.seen))
        noise = np.random.default_rng(0).standard_normal(picture.seen.shape).astype(np.float32) * picture.sigma
        noisy = network.features(self._coded(picture.seen + noise))
        deviations = [float(np.sqrt(np.mean((a - b) ** 2))) for a, b in zip(noisy, self._seen, strict=True)]
        # Together all layers weigh what the picture's own pixels do.
        self._scales = [
            np.sqrt(picture.seen.size / (len(deviations) * layer.size)) / max(deviation, 1e-9)
            for deviation, layer in zip(deviations, self._seen, strict=True)
        ]

    def differences(self, image: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """image: as the picture's `seen`. Saturated pixels are taken for equal."""
        rendered = np.where(self._picture.usable[..., None], image, self._picture.seen)
        layers = self._network.features(self._coded(rendered))
        return [
            scale * (layer - seen).astype(np.float64)
            for scale, layer, seen in zip(self._scales, layers, self._seen, strict=True)
        ]

    def _coded(self, linear: NDArray) -> NDArray[np.float32]:
        """The curve of IEC 61966-2-1, straight below 0 and on above white, so that no candidate's light is cut off."""
        value = np.asarray(linear, np.float32) / self._white
        return np.where(
            value <= 0.0031308, 12.92 * value, 1.055 * np.maximum(value, 0.0031308) ** (1 / 2.4) - 0.055
        ).astype(np.float32)


@contextmanager
def _quiet() -> Iterator[None]:
    """OpenCV prints what it also raises."""
    level = _LOG.getLogLevel()
    _LOG.setLogLevel(0)  # silent
    try:
        yield
    finally:
        _LOG.setLogLevel(level)


def _line(error: cv2.error) -> str:
    return " ".join(error.err.split())
