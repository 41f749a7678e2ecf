# SPDX-License-Identifier: Apache-2.0
"""Lets a sensor use another matcher than simsense's, such as a network in an ONNX file (pip install onnxruntime). From
its disparities it computes the same maps as simsense."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.plan import SensorPlan, registered
from activestereo.common.input_files import checked_file
from activestereo.common.lens import to_tangents
from activestereo.common.nearest import did_you_mean

# The file's metadata may hold OnnxInterface's fields under this name, as a JSON object.
METADATA = "activestereo"


@dataclass(frozen=True)
class OnnxInterface:
    """Describes a network's inputs and outputs. left, right: names of its inputs, float32 [1, channels, height, width],
    whose values are (counts of 0..255 - mean) / std; multiple: height and width are padded to multiples of it, at the
    right and below. disparity, confidence: names of its outputs, [1, (1,) height, width]; disparities times scale are
    pixels, and confidences 0..1; "" = absent."""

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
    """Matches rectified pairs with a network in an ONNX file. interface: its inputs and outputs; None reads the file's
    metadata under `activestereo`, else takes the defaults. providers: onnxruntime's, such as CUDAExecutionProvider;
    None = all available. Raises ImportError without onnxruntime, and ValueError for a file that it cannot run or with
    other inputs or outputs."""

    def __init__(
        self, path: str | PathLike[str], interface: OnnxInterface | None = None, providers: list[str] | None = None
    ) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise ImportError("onnxruntime is missing: pip install onnxruntime") from error
        self._path = checked_file(Path(path))
        try:
            found = onnxruntime.get_available_providers() if providers is None else providers
            self._session = onnxruntime.InferenceSession(str(self._path), providers=found)
        except Exception as error:  # each failure has its own class in onnxruntime
            reason = " ".join(str(error).split())
            raise ValueError(f"{path}: onnxruntime cannot run it (custom operators?): {reason}") from error
        # 1. The interface.
        text = self._session.get_modelmeta().custom_metadata_map.get(METADATA)
        if interface is None and text is not None:
            fields_known = {field.name for field in fields(OnnxInterface)}
            try:
                given = json.loads(text)
                unknown = [name for name in given if name not in fields_known]
                if unknown:
                    hint = did_you_mean(unknown[0], fields_known)
                    raise ValueError(f"'{unknown[0]}' is no field of an OnnxInterface{hint}")
                interface = OnnxInterface(**given)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{self._path}: metadata {METADATA}: {error}") from error
        self.interface = i = interface or OnnxInterface()
        # 2. The file's inputs and outputs have to be the interface's.
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

    def __call__(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        found = [self._match(*pair) for pair in zip(left, right, strict=True)]
        disparities, confidences = zip(*found, strict=True)
        return np.stack(disparities), np.stack(confidences) if self.interface.confidence else None

    def _match(self, left: NDArray[Any], right: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        i, (height, width) = self.interface, left.shape
        full_scale = 255.0 if left.dtype == np.uint8 else float(max(255, int(left.max()), int(right.max())))
        inputs = {}
        for name, image in ((i.left, left), (i.right, right)):
            values = image.astype(np.float32) * np.float32(255.0 / full_scale) - np.float32(i.mean)
            padded = np.pad(values / np.float32(i.std), [(0, -n % i.multiple) for n in image.shape], mode="edge")
            inputs[name] = np.repeat(padded[None, None], i.channels, axis=1)
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


class Matcher(Protocol):
    """A callable that matches rectified pairs of images, uint8 or uint16 [pairs, height, width]."""

    def __call__(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Returns (disparities, confidences or None), float32 [pairs, height, width]. Disparities are pixels of the
        left image; NaN, 0 or less = not measured. Confidences are 0..1."""


# Matchers that a sensor accepts: simsense's own, OpenCV's, the path of an ONNX file, or a Matcher.
MatcherLike = str | PathLike[str] | Matcher
_SGBM_BLOCK = 7
_SGBM_STEPS = 16  # OpenCV's disparities are whole numbers of 1/16 pixel
_SGBM_STEP_PX = 16  # its range of disparities is a multiple of this
_IMAGES = ("ir_left", "ir_right", "rectified_left", "rectified_right")


def as_matcher(given: MatcherLike, engine: simsense.Engine) -> Matcher | None:
    """Returns the Matcher that `given` names, or None for simsense's own. engine: its parameters set up OpenCV's
    matcher. Raises ValueError, which lists the choices."""
    if callable(given):
        return given
    if given == "simsense":
        return None
    if given == "opencv":
        return OpenCVMatcher(engine.parameters)
    if str(given).endswith(".onnx"):
        return OnnxMatcher(given)
    raise ValueError(f"matcher is {given!r}, expected 'simsense', 'opencv', the path of an .onnx file, or a Matcher")


def foreign_maps(
    matcher: Matcher, engine: simsense.Engine, plan: SensorPlan, pair: tuple[Any, Any], outputs: Any,
    lasers: dict[str, Any],
) -> dict[str, NDArray[Any]]:  # fmt: skip
    """Computes maps as simsense.Engine.compute() does, but with this matcher's disparities. The engine still simulates
    the imagers and rectifies the images. pair, lasers: compute()'s arguments. outputs: names, or {name: array to write
    into}. Raises ValueError if the matcher returns another size."""
    images = dict(engine.compute(*pair, _IMAGES, **lasers))
    left, right = images["rectified_left"], images["rectified_right"]
    leading = left.shape[:-2]
    disparity, confidence = matcher(*(image.reshape(-1, *image.shape[-2:]) for image in (left, right)))
    expected = (int(np.prod(leading)), *left.shape[-2:])
    for name, found in (("disparities", disparity), ("confidences", confidence)):
        if found is not None and found.shape != expected:
            raise ValueError(f"the matcher gives {name} of {list(found.shape)}, expected {list(expected)}")
    disparity = np.asarray(disparity, np.float32)
    k, baseline_m, left_to_rectified = engine.rectified
    is_measured = np.isfinite(disparity) & (disparity > 0)
    z = np.where(is_measured, k[0, 0] * baseline_m / np.where(is_measured, disparity, 1.0), 0.0)
    is_near = (z >= plan.engine["min_depth_m"]) & (z < plan.engine["max_depth_m"])
    depth = np.where(is_near, z, 0.0).astype(np.float32)
    v, u = np.indices(depth.shape[-2:])
    rays = np.stack([*to_tangents(u, v, k), np.ones(u.shape)], axis=-1)
    reason = np.where(is_measured, simsense.REASONS.index("valid"), simsense.REASONS.index("not_unique"))
    reason = np.where(is_measured & (depth == 0), simsense.REASONS.index("out_of_range"), reason)
    found_maps = {
        "disparity": np.where(is_measured, disparity, -1.0).astype(np.float32),
        "confidence": np.where(is_measured, 1.0 if confidence is None else confidence, 0.0).astype(np.float32),
        "reason": reason.astype(np.uint8),
        "depth": depth,
        "points": (rays * depth[..., None]).astype(np.float32),
        "depth_rgb": np.stack([registered(one, k, left_to_rectified, plan) for one in depth]),
    }
    maps = images | {name: values.reshape(*leading, *values.shape[1:]) for name, values in found_maps.items()}
    missing = [name for name in outputs if name not in maps]
    if missing:
        raise ValueError(f"only simsense's own matcher gives {', '.join(missing)}")
    if isinstance(outputs, Mapping):
        for name, target in outputs.items():
            np.copyto(target, maps[name].reshape(target.shape))
    return {name: maps[name] for name in outputs}


class OpenCVMatcher:
    """Matches with OpenCV's semi-global matcher (SGBM) over eight paths. Disparity range, uniqueness and left-right
    check are simsense's parameters; others follow OpenCV's documentation. Raises ImportError if cv2 is missing."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        import cv2

        self._least = parameters["min_disparity"]
        count = -(-parameters["max_disparity"] // _SGBM_STEP_PX) * _SGBM_STEP_PX
        self._margin = count + max(0, self._least)
        self._cv2, self._sgbm = cv2, cv2.StereoSGBM_create(
            minDisparity=self._least, numDisparities=count, blockSize=_SGBM_BLOCK, P1=8 * _SGBM_BLOCK**2,
            P2=32 * _SGBM_BLOCK**2, disp12MaxDiff=parameters["lr_max_diff"], preFilterCap=63,
            uniquenessRatio=parameters["uniqueness_ratio"], mode=cv2.STEREO_SGBM_MODE_HH4,
        )  # fmt: skip

    def __call__(self, left: NDArray[Any], right: NDArray[Any]) -> tuple[NDArray[np.float32], None]:
        found = []
        for pair in zip(left, right, strict=True):
            scale, border = 255.0 / max(255, *(int(image.max()) for image in pair)), self._cv2.BORDER_REPLICATE
            counts = ((image * scale).astype(np.uint8) for image in pair)
            # OpenCV leaves the first columns out, as many as there are disparities.
            wide = (self._cv2.copyMakeBorder(image, 0, 0, self._margin, 0, border) for image in counts)
            disparity = self._sgbm.compute(*wide)[:, self._margin :].astype(np.float32) / _SGBM_STEPS
            found.append(np.where(disparity >= self._least, disparity, np.float32(np.nan)))
        return np.stack(found), None
