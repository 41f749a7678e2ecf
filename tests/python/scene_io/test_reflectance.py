# SPDX-License-Identifier: Apache-2.0
"""Materials from measured reflectances: colours of spectra that are known in closed form, and what both bands see."""

from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo.scene_io.reflectance import Reflectance, ReflectanceError, apply_reflectances, read_reflectances

NM = np.arange(380.0, 901.0, 5.0)


def table(path: Path, **columns: np.ndarray) -> Path:
    """A CSV file of the columns."""
    lines = ["wavelength_nm," + ",".join(columns)]
    lines += [f"{nm:g}," + ",".join(f"{c[i]:.6f}" for c in columns.values()) for i, nm in enumerate(NM)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("value", [0.0, 0.18, 1.0])
def test_a_flat_reflectance_is_grey(value: float) -> None:
    np.testing.assert_allclose(Reflectance(NM, np.full(NM.size, value)).linear_rgb(), value, atol=1e-12)


def test_filters_have_the_colours_that_they_have() -> None:
    long, middle, short = (Reflectance(NM, 1.0 * m).linear_rgb() for m in (NM > 600, abs(NM - 545) < 40, NM < 480))
    assert long[0] > 0.5 and long[1] < 0.1 and long[2] < 0.05
    assert middle[1] > 0.5 and middle[1] > 2 * middle[0] and middle[1] > 2 * middle[2]
    assert short[2] > 0.6 and short[1] < 0.1


def test_the_observer_sees_most_at_555_nm() -> None:
    """Luminance of a narrow reflector: the peak of the photopic curve (CIE 1931: 555 nm)."""
    luminance = [Reflectance(NM, np.exp(-(((NM - nm) / 8) ** 2))).linear_rgb() @ (0.2126, 0.7152, 0.0722) for nm in NM]
    assert abs(NM[int(np.argmax(luminance))] - 555) <= 25, "sRGB's cut moves it a little"


def test_both_bands_get_what_was_measured(tmp_path: Path) -> None:
    leaf = np.where(NM < 700, 0.05, 0.5)  # dark to the eye, bright in the infrared
    path = table(tmp_path / "a.csv", leaf=leaf, paint=np.full(NM.size, 0.6))
    scene = kuafu.Scene(kuafu.Device("cpu"))
    texture = scene.add_texture(np.full((1, 1, 3), 9, np.uint8))
    for name in ("leaf", "paint", "other"):
        material = kuafu.Material(name=name, base_color=(0.3, 0.3, 0.3, 0.7), specular=0.0)
        material.base_color_texture = texture
        scene.add_material(material)
    assert apply_reflectances(scene, read_reflectances(path)) == ["leaf", "paint"]
    found = scene.get_material(0)
    np.testing.assert_allclose(found.base_color[:3], 0.05, atol=2e-3)
    assert found.base_color[3] == pytest.approx(0.7) and found.ir_albedo == pytest.approx(0.5)
    assert found.base_color_texture is None
    assert scene.get_material(1).ir_albedo == pytest.approx(0.6)
    assert scene.get_material(2).base_color_texture == texture


def test_wrong_tables_say_what_is_wrong(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for text, message in (
        ("wavelength_nm,a\n400,0.1\n700,0.2\n", "covers 400 to 700 nm, must cover 400 to 850"),
        ("wavelength_nm,a\n400,10\n900,20\n", "line 2: reflectances must be from 0 to 1"),
        ("wavelength_nm,a\n900,0.1\n400,0.2\n", "must ascend"),
        ("wavelength_nm,a\n400,0.1\n900,x\n", "line 3: could not convert"),
        ("wavelength_nm,a,b\n400,0.1\n900,0.1\n", "line 2 has 2 numbers"),
        ("nm,a\n400,0.1\n900,0.1\n", "first line"),
    ):
        path.write_text(text)
        with pytest.raises(ReflectanceError, match=message):
            read_reflectances(path)
    scene = kuafu.Scene(kuafu.Device("cpu"))
    scene.add_material(kuafu.Material(name="wood"))
    with pytest.raises(ReflectanceError, match="no material is called steel; the scene has wood"):
        apply_reflectances(scene, {"steel": Reflectance(NM, np.zeros(NM.size))})
