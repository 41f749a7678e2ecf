# SPDX-License-Identifier: Apache-2.0
"""activestereo effect show: the strip's pictures follow the effect's law, for every effect of the library."""

import numpy as np
import pytest
from PIL import Image

from activestereo.cli import main
from activestereo.compare import effect_trials
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects import Stage, builtin
from activestereo.report.strips import strip_page
from chromium import Page, is_installed

BLACK_DN = 5.0


@pytest.fixture(scope="module")
def world(lab_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(effect_trials, "_STRIP_SAMPLES", 16)
        return effect_trials.StripWorld(CaptureRenderer("cpu"), lab_cache)


@pytest.mark.parametrize("name", builtin())
def test_every_effect_changes_the_picture(world, name):
    strip = world.strip(builtin()[name])
    assert strip.unit == ("DN" if builtin()[name].stage <= Stage.DIGITAL else "px")
    assert np.isfinite(strip.with_it).all() and np.mean(strip.difference != 0.0) > 1e-3  # and it is seen


def test_the_picture_with_an_effect_follows_its_law(world):
    shaded = world.strip(builtin()["vignetting"], {"exponent": 3.0})
    height, width = shaded.without.shape
    v, u = np.mgrid[0:height, 0:width]
    cosine = 1.0 / np.sqrt(1.0 + ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / 160.0**2)
    expected = BLACK_DN + (shaded.without - BLACK_DN) * cosine**3
    free = shaded.without < 250.0
    assert np.allclose(shaded.with_it[free], expected[free], rtol=1e-4, atol=1e-3)


def test_the_command_draws_a_row_for_each_effect(tmp_path, capsys):
    own = tmp_path / "mine.py"
    own.write_text(
        "from activestereo.effects import Parameter, Stage, effect\n"
        "@effect('mine', stage=Stage.DIGITAL, family='f', source='s',\n"
        "        parameters=[Parameter('dn', 'DN', 0.0, 0.0, 9.0, 3.0)])\n"
        "def mine(dn_of_image, view, dn):\n    'Mine.'\n    return dn_of_image + dn\n"
    )
    sizes = []
    for names in (["vignetting"], ["vignetting", str(own)]):
        assert main(["effect", "show", *names, "-o", str(tmp_path / "strip.png"), "--device", "cpu"]) == 0
        sizes.append(Image.open(tmp_path / "strip.png").size)
    said = capsys.readouterr().out
    assert "mine: changes the picture by 3 DN" in said
    assert sizes[1][0] == sizes[0][0] and sizes[1][1] == pytest.approx(2 * sizes[0][1], abs=2)


def test_strengths_go_from_no_effect_over_the_typical_one_to_twice_as_much(world):
    strips = world.strengths(builtin()["veiling_glare"])
    typical = world.strip(builtin()["veiling_glare"])
    assert np.array_equal(strips[0].with_it, strips[0].without)
    assert strips[len(strips) // 2].parameters == typical.parameters
    changes = [float(np.mean(np.abs(strip.difference))) for strip in strips]
    assert changes == sorted(changes) and changes[-1] > 1.5 * changes[len(strips) // 2]


@pytest.mark.skipif(not is_installed(), reason="no chromium: install Debian's package chromium to test the page")
def test_the_slider_of_a_page_changes_its_pictures_and_words(world, tmp_path):
    effect = builtin()["projector_defocus"]
    file = tmp_path / "strip.html"
    file.write_text(strip_page([world.strengths(effect)]))
    with Page(file) as page:
        seen = {"4": read(page)}
        for value in ("0", "8"):
            page.value(f"(() => {{ const s = document.querySelector('input'); s.value = '{value}'; s.oninput(); }})()")
            seen[value] = read(page)
    assert len({one[0] for one in seen.values()}) == 3 and seen["0"][0] == seen["0"][2]
    assert f"{effect.parameters[0].name} {effect.parameters[0].typical_value:.4g}" in seen["4"][1]


def read(page):
    """The picture with the effect, the words below the slider, the picture without."""
    without, with_it = "document.images[0].src", "document.images[1].src"
    return page.value(with_it), page.value("document.querySelector('output').textContent"), page.value(without)


def test_a_misspelt_effect_is_answered_before_the_render(tmp_path, capsys):
    assert main(["effect", "show", "vignetng", "-o", str(tmp_path / "strip.png")]) == 2
    assert "vignetting" in capsys.readouterr().err
