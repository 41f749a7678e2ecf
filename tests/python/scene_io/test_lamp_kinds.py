# SPDX-License-Identifier: Apache-2.0
"""Lamps in photometric units give the light that the definition of the candela says, and kinds of lamps Planck's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.staging import INFRARED_SHARES, infrared_share, set_infrared_share

_WHITE_LED_LM_PER_W = 300.0
_NM = np.arange(380.0, 1100.0)
# CIE's V(lambda) by its usual Gaussian, and silicon whose quantum efficiency falls from 600 nm on.
_EYE = 1.019 * np.exp(-285.4 * (1e-3 * _NM - 0.559) ** 2)
_SILICON = np.where(_NM < 400.0, 0.0, np.clip((1050.0 - _NM) / 450.0, 0.0, 1.0) * _NM / 570.0)


@pytest.mark.parametrize(
    ("kind", "kelvin"), [("sun", 5778.0), ("halogen", 3000.0), ("incandescent", 2700.0), ("candle", 1900.0)]
)
def test_what_glows_follows_plancks_law(kind: str, kelvin: float) -> None:
    planck = _NM**-5 / np.expm1(1.4388e7 / (_NM * kelvin))
    counts_per_lm = (_SILICON * planck).sum() / (683.0 * (_EYE * planck).sum())
    assert INFRARED_SHARES[kind] == pytest.approx(_WHITE_LED_LM_PER_W * counts_per_lm, rel=0.03)


@pytest.mark.parametrize("text", ["neon", "-1", "nan", "inf"])
def test_what_is_no_kind_is_said(text: str) -> None:
    with pytest.raises(ValueError, match="lamp"):
        infrared_share(text)


def _written(path: Path, extras: dict[str, float]) -> kuafu.Scene:
    """A lamp of each kind that glTF has, of 2 W."""
    writer = GltfWriter()
    writer.add_point_light("bulb", (0, 0, 1), (1, 0.5, 0.25), 2.0)
    writer.add_directional_light("sun", np.eye(4), (1, 1, 1), 2.0)
    writer.add_spot_light("spot", np.eye(4), (1, 1, 1), 2.0, (0.1, 0.4))
    document, _ = writer.document()
    for light in document["extensions"]["KHR_lights_punctual"]["lights"]:
        assert light["intensity"] == pytest.approx(2.0 * 683.0)
        light["extras"] = extras
    (path / "a.gltf").write_text(json.dumps(document))
    scene = kuafu.Scene(kuafu.Device("cpu"))
    scene.load(path / "a.gltf")
    return scene


def test_what_is_written_in_watts_is_read_in_watts(tmp_path: Path) -> None:
    scene = _written(tmp_path, {})
    assert scene.get_light(0).intensity == (2.0, 1.0, 0.5)
    assert all(scene.get_light(number).intensity == (2.0, 2.0, 2.0) for number in (1, 2))
    assert scene.get_light(2).outer_rad == 0.4


def _seen(scene: kuafu.Scene) -> float:
    """The infrared radiance of a white wall before the lamps."""
    wall = scene.add_material(kuafu.Material(base_color=(1, 1, 1, 1), ir_albedo=1.0, specular=0.0))
    sheet = scene.add_mesh([[-9, -9, -2], [9, -9, -2], [0, 9, -2]], [[0, 1, 2]])
    scene.add_instance(sheet, [wall])
    camera = kuafu.Camera(4, 4, [[100, 0, 1.5], [0, 100, 1.5], [0, 0, 1]], np.diag([1.0, -1.0, -1.0, 1.0]))
    options = {"spp": 4, "max_bounces": 0, "ir_ambient_scale": 0.5, "ir_ambient_radiance": 0.0}
    images = kuafu.Renderer(scene.device).render(scene, camera, ["radiance"], band="infrared", **options)
    return float(np.mean(images["radiance"]))


@pytest.mark.parametrize(
    ("extras", "option", "factor"),
    [
        ({}, None, 1.0),
        ({}, 2.9, 2.9),
        ({}, 0.0, 0.0),
        ({"ir_share": 3.0}, None, 3.0),
        ({"ir_share": 3.0}, 2.9, 3.0),  # what a file says of a lamp counts
        ({"ir_intensity": 4.0}, 2.9, 4.0),  # 2 W by an ir_ambient_scale of 0.5 are 1 W
    ],
)
def test_the_infrared_share(tmp_path: Path, extras: dict[str, float], option: float | None, factor: float) -> None:
    scene, plain = _written(tmp_path, extras), _written(tmp_path, {})
    if option is not None:
        set_infrared_share(scene, option)
    assert _seen(scene) == pytest.approx(factor * _seen(plain), rel=1e-5)
