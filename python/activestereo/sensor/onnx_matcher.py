# SPDX-License-Identifier: Apache-2.0
"""A stereo network in an ONNX file behind a sensor, by the package onnxruntime (pip install onnxruntime)."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.input_files import checked_file
from activestereo.common.nearest import did_you_mean

# Under this name the file's metadata may hold OnnxInterface's fields, as a JSON object.
METADATA = "activestereo"


@dataclass(frozen=True)
class OnnxInterface:
    """A network's inputs and outputs. left, right: names of its inputs, float32 [1, channels, height, width], whose
    values are (counts of 0..255 - mean) / std; multiple: height and width are padded to multiples of it, at the right
    and below. disparity, confidence: names of its outputs, [1, (1,) height, width]; disparities times scale are pixels,
    and confidences 0..1; "" = absent."""

    left: str = "left"
    right: str = "right"
    disparity: str = "disparity"
    confidence: str = ""
    channels: int = 1
    mean: float = 0.0
    std: float = 255.0
    multiple: int = 1
    scale: float = 1.0


class OnnxMatcher:
    """interface: the network's inputs and outputs; None reads the file's metadata under `activestereo`, else takes the
    defaults. providers: onnxruntime's, such as CUDAExecutionProvider; None = all available. Raises ImportError without
    onnxruntime, and ValueError for a file that it cannot run or with other inputs or outputs."""

    def __init__(
        self, path: str | PathLike[str], interface: OnnxInterface | None = None, providers: list[str] | None = None
    ) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise ImportError("onnxruntime is missing: pip install onnxruntime") from error
        self._path = checked_file(Path(path))
        try:
            wanted = onnxruntime.get_available_providers() if providers is None else providers
            self._session = onnxruntime.InferenceSession(str(self._path), providers=wanted)
        except Exception as error:  # each failure has its own class in onnxruntime
            reason = " ".join(str(error).split())
            raise ValueError(f"{path}: onnxruntime cannot run it (custom operators?): {reason}") from error
        self.interface = self._read_interface() if interface is None else interface
        self._check()

    def __call__(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        found = [self._match(*pair) for pair in zip(left, right, strict=True)]
        disparities, confidences = zip(*found, strict=True)
        return np.stack(disparities), np.stack(confidences) if self.interface.confidence else None

    def _match(self, left: NDArray[Any], right: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        i, (height, width) = self.interface, left.shape
        full_scale = 255.0 if left.dtype == np.uint8 else float(max(255, int(left.max()), int(right.max())))
        inputs = {i.left: self._input(left, full_scale), i.right: self._input(right, full_scale)}
        names = [i.disparity, *([i.confidence] if i.confidence else [])]
        try:
            outputs = self._session.run(names, inputs)
        except Exception as error:
            raise ValueError(f"{self._path}: does not take {width}x{height}: {' '.join(str(error).split())}") from error
        cut = []
        for name, values in zip(names, outputs, strict=True):
            plane = np.asarray(values, np.float32).reshape(-1, *np.shape(values)[-2:])
            if plane.shape[0] != 1 or plane.shape[1] < height or plane.shape[2] < width:
                raise ValueError(f"{self._path}: {name} is {list(np.shape(values))} for images of {width}x{height}")
            cut.append(plane[0, :height, :width])
        return i.scale * cut[0], cut[-1]

    def _input(self, image: NDArray[Any], full_scale: float) -> NDArray[np.float32]:
        i = self.interface
        values = (image.astype(np.float32) * np.float32(255.0 / full_scale) - np.float32(i.mean)) / np.float32(i.std)
        padded = np.pad(values, [(0, -side % i.multiple) for side in image.shape], mode="edge")
        return np.repeat(padded[None, None], i.channels, axis=1)

    def _read_interface(self) -> OnnxInterface:
        text = self._session.get_modelmeta().custom_metadata_map.get(METADATA)
        if text is None:
            return OnnxInterface()
        known = {field.name for field in fields(OnnxInterface)}
        try:
            given = json.loads(text)
            unknown = [name for name in given if name not in known]
            if unknown:
                hint = did_you_mean(unknown[0], known)
                raise ValueError(f"'{unknown[0]}' is no field of an OnnxInterface{hint}")
            return OnnxInterface(**given)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{self._path}: metadata {METADATA}: {error}") from error

    def _check(self) -> None:
        i = self.interface
        there = {"input": self._session.get_inputs(), "output": self._session.get_outputs()}
        wanted = {"input": (i.left, i.right), "output": (i.disparity, *([i.confidence] if i.confidence else []))}
        for kind, names in wanted.items():
            known = {one.name: one.shape for one in there[kind]}
            for name in names:
                if name not in known:
                    raise ValueError(f"{self._path}: has no {kind} '{name}' (there are: {', '.join(known)})")
            extra = [name for name in known if kind == "input" and name not in names]
            if extra:
                raise ValueError(f"{self._path}: also wants the input {', '.join(extra)}, expected a pair alone")
            for name in names if kind == "input" else ():
                shape = known[name]
                if len(shape) != 4 or shape[1] not in (i.channels, None) and isinstance(shape[1], int):
                    raise ValueError(f"{self._path}: {name} is {shape}, expected [1, {i.channels}, height, width]")
