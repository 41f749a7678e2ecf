# SPDX-License-Identifier: Apache-2.0
"""A comparison with much to explain, a diagnosis of it, and the decoder of the page's pictures."""

import base64
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import Comparison, compare
from lab_worlds import WorldRenderer
from virtual_sensor.world import World

DIAGNOSIS = {
    "verdict": "effect",
    "ranking": [
        {
            "effect": "radial_distortion", "family": "camera geometry", "score_nats": 812.4, "confidence": 0.97,
            "explained_share": 0.98,
            "parameters": {"k1": {"value": -0.0085, "low": -0.0088, "high": -0.0082, "unit": "1"}},
            "equivalent": ["radial_distortion", "principal_point_offset"],
        },
        {
            "effect": "vignetting", "family": "lens <shading>", "score_nats": 3.1, "confidence": 0.01,
            "explained_share": 0.01,
            "parameters": {"exponent": {"value": 0.1, "low": None, "high": None, "unit": "1"}}, "equivalent": [],
        },
    ],
    "added": ["radial_distortion"],
    "sets": [{"effects": ["radial_distortion", "principal_point_offset"], "probabilities": [0.6, 0.4]}],
    "heldout_ir_rmse_before": 6.21,
    "heldout_ir_rmse_after": 2.51,
    "heldout_noise_floor": 2.44,
    "next_measurement": [
        {"text": "a second distance"},
        {"text": "tilt by 30 degrees (expected 14.2 nats)", "separates": ["a", "b"]},
    ],
    "residual_model": None,
    "curve": [
        {"effects": [], "heldout_ir_rmse": 6.21, "train_ir_rmse": 5.9},
        {"effects": ["radial_distortion"], "heldout_ir_rmse": 2.51, "train_ir_rmse": 2.3},
    ],
}  # fmt: skip
WITH_MODEL = DIAGNOSIS | {"model": {"effects": [{"id": "radial_distortion", "parameters": {"k1": -0.0085}}]}}


def make_ball_comparison(world: World, capture: Path, folder: Path) -> Comparison:
    """A model that lacks the ball, on a world with device depth. folder: of the renders."""
    wrong = replace(world, solids=tuple(s for s in world.solids if s.name != "ball"))
    return compare(capture, renderer=WorldRenderer(wrong, grid=2), cache=LayerCache(folder))


def decoded(layer: dict) -> np.ndarray:
    """The values that the page's script reads from a picture: float64 [height][width], NaN where it holds no value."""
    kind, data = layer["src"].split(",", 1)
    assert kind == "data:image/webp;base64"
    code = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))[..., 0].astype(np.float64)
    if layer["planes"] == 2:
        high, low = np.split(code, 2)
        code = 256.0 * high + low
    values = layer["low"] + layer["step"] * code
    return np.where(code == 0, np.nan, values) if layer["has_empty"] else values
