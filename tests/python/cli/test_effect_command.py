# SPDX-License-Identifier: Apache-2.0
"""activestereo effect: the catalogue, its page, pictures of show, and the check of users' effects in Python and C."""

import ctypes
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from activestereo.cli import main
from activestereo.effects import Model, Stage, builtin, load_effects
from activestereo.effects.core import load as plugin
from activestereo.effects.core.descriptor import Channel, Lever, RandomTerm, SharedBy
from activestereo.effects.core.laws import example_value, example_view
from activestereo.effects.engines import CaptureRenderer
from activestereo.report import effect_pictures
from activestereo.report.strips import strip_page
from chromium import Page, needs_chromium

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "examples" / "effects" / "README.md"
HEADER = "from activestereo.effects import Parameter, Randomness, Stage, effect\n"
A = "parameters=[Parameter('a', '1', 0.0, 0.0, 1.0, 0.5)]"


def check(capsys, path):
    status = main(["effect", "check", str(path)])
    out = capsys.readouterr()
    return status, out.out, out.err


def user_file(folder, body, parameters=A, stage="READOUT"):
    path = folder / "my_effects.py"
    declared = f"@effect('mine', stage=Stage.{stage}, family='f', source='s', {parameters})"
    path.write_text(f"{HEADER}\n{declared}\ndef mine(signal, view, a):\n    'Mine.'\n    {body}\n")
    return path


def test_list_names_every_effect_with_its_units(capsys):
    assert main(["effect", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [line for line in lines if not line.startswith(" ")]
    assert [line.split()[0] for line in rows] == ["id", *builtin()] and max(map(len, lines)) <= 80
    assert re.search(r"^rolling_shutter +camera +motion +engine\s+line_time_s \[s\]$", "\n".join(lines), re.MULTILINE)


def test_the_documentation_page_is_what_the_descriptors_say():
    run = subprocess.run([sys.executable, PAGE.parent / "make_page.py", "--check"], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def test_the_pages_ten_line_example_is_lawful_and_joins_a_model(tmp_path, capsys):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    path = tmp_path / "filter_haze.py"
    path.write_text(code)
    status, out, err = check(capsys, path)
    assert (status, err) == (0, "")
    assert "ok: all laws hold" in out
    (haze,) = load_effects(path).values()
    view = example_view()
    light = example_value(Stage.PROJECTOR, view)
    hazy = Model().with_effect(haze, fraction=0.1).light(light, view)
    assert hazy.ambient.mean() == pytest.approx(light.ambient.mean())
    assert hazy.ambient.std() == pytest.approx(0.9 * light.ambient.std())


def test_effects_are_checked_by_name_where_there_is_no_engine_field_without_a_render(capsys):
    assert main(["effect", "check", "double_image", "lens_ghost"]) == 0
    assert capsys.readouterr().out.count("ok: all laws hold\n") == 2
    for words in ([], ["lens_ghost", "--all"], ["lens_gost"], ["nowhere/none.py"]):
        assert main(["effect", "check", *words]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return signal + 1", "neutral"),
        ("return signal / (1 - a)", "not finite"),
        ("return signal", "no influence"),
        ("return signal.sum() * a", "not an array of shape"),
        ("return signal[None] * (1 + a)", "returns an array of shape (1, 72, 96)"),
        ("return signal @ view.missing", "fails at my_effects.py, line 6: AttributeError"),
    ],
)
def test_a_broken_law_is_named_and_the_status_says_so(tmp_path, capsys, body, words):
    path = user_file(tmp_path, body)
    with np.errstate(all="ignore"):
        status, out, err = check(capsys, path)
        assert main(["effect", "check", str(path), "--json"]) == status == 1
    assert "broken: " in out and words in out
    assert len(err.splitlines()) == 1 and "1 effect with broken laws" in err
    (row,) = json.loads(capsys.readouterr().out)
    assert row["id"] == "mine" and words in row["broken"][0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = (\n", "line 1: SyntaxError"),
        ("x = 1\n", "holds no effect"),
        (HEADER + "\n\n1 / 0\n", "line 4: ZeroDivisionError"),
        (HEADER + "Parameter('a', '1', 0.0, 1.0, 2.0, 0.5)\n", "needs low <= neutral <= high"),
        ("no library", "neither a Python file nor a shared library"),
    ],
)
def test_a_file_that_does_not_load_is_one_line_with_the_place(tmp_path, capsys, text, words):
    path = tmp_path / ("my_effects.py" if "\n" in text else "foreign.so")
    path.write_text(text)
    status, _, err = check(capsys, path)
    assert status == 2 and len(err.splitlines()) == 1 and words in err


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Compiles C text, or a file, against ks/effect.h as strict C99."""

    def compile_c(source, name):
        folder = tmp_path_factory.mktemp(name)
        if not isinstance(source, Path):
            path = folder / f"{name}.c"
            path.write_text(source)
            source = path
        library = folder / f"{name}.so"
        flags = [*"-std=c99 -pedantic -Wall -Wextra -Werror -shared -fPIC".split(), f"-I{ROOT / 'capi/include'}"]
        subprocess.run(["cc", *flags, str(source), "-o", str(library)], check=True, capture_output=True, text=True)
        return library

    return compile_c


def test_an_effect_in_c_is_lawful_and_does_what_it_says(compiled, capsys):
    library = compiled(ROOT / "examples/effects/tinted_window.c", "tinted_window")
    status, out, _ = check(capsys, library)
    assert status == 0 and "tinted_window: medium stage, family 'medium', absorbed [1] 0..0.9" in out
    (tinted,) = load_effects(library).values()
    light = example_value(Stage.MEDIUM, example_view())
    seen = tinted(light, example_view(), absorbed=0.2)
    np.testing.assert_allclose(seen.direct, 0.64 * light.direct)
    np.testing.assert_allclose(seen.ambient, 0.8 * light.ambient)


SPY = """
#include "ks/effect.h"
static int32_t apply(const ks_effect_view* v, const double* p, uint32_t n, const double* in, double* out) {
  uint32_t i = 0, count = n * v->width * v->height;
  if (p[0] > 0.9) return KS_ERROR_UNSUPPORTED;
  for (; i < count; ++i) out[i] = in[i];
  if (p[0] > 0.0) {
    out[0] = v->k[2]; out[1] = v->camera_to_projector[3]; out[2] = v->depth_m[v->width - 1]; out[3] = v->normal[2];
    out[4] = v->pattern[v->pattern_width * v->pattern_height - 1]; out[5] = v->temperature_c; out[6] = v->is_right;
    out[7] = (double)(v->random_seed %% 1000003u); out[8] = v->baseline_m; out[9] = v->header.size_bytes == sizeof *v;
  }
  return KS_OK;
}
static const ks_effect_parameter parameters[] = {{"a", "1", "", 0.0, 0.0, 1.0, 0.5}};
static const ks_effect_random_term term = {"a", 0, KS_LEVER_ONE, KS_SHARED_BY_ROW};
const ks_effect* ks_effect_plugin(uint32_t* count) {
  static ks_effect e;
  e = ks_effect_init();
  e.header.size_bytes += %d;
  e.id = "spy"; e.family = "f"; e.summary = "s"; e.source = "s"; e.stage = %d;
  e.randomness = KS_RANDOMNESS_TEMPORAL; e.random_term_count = 1; e.random_terms = &term;
  e.parameter_count = 1; e.parameters = parameters; e.apply = apply;
  *count = 1;
  return &e;
}
"""


def test_what_c_sees_is_what_python_has(compiled):
    (spy,) = load_effects(compiled(SPY % (0, 7), "spy")).values()
    view = example_view()
    seen = spy(np.zeros(view.shape), view, a=0.5)[0]
    place, depth_m = view.camera_to_projector[0, 3], view.depth_m[0, -1]
    np.testing.assert_allclose(seen[:7], [view.K[0, 2], place, depth_m, -1.0, view.pattern[-1, -1], 45.0, 1.0])
    np.testing.assert_allclose(seen[8:10], [view.baseline_m, 1.0])
    with pytest.raises(ValueError, match="gave status -3"):
        spy(np.zeros(view.shape), view, a=1.0)
    assert spy.random_terms == (RandomTerm("a", Lever.ONE, SharedBy.ROW),) and spy.channel is Channel.NOISE_MODEL


def test_a_plug_in_of_another_header_or_stage_is_refused(compiled):
    with pytest.raises(ValueError, match="built against another ks/effect.h"):
        load_effects(compiled(SPY % (8, 7), "newer"))
    with pytest.raises(ValueError, match="stage 77"):
        load_effects(compiled(SPY % (0, 77), "astray"))
    with pytest.raises(ValueError, match="exports no ks_effect_plugin"):
        load_effects(compiled("int nothing(void);\nint nothing(void) { return 0; }\n", "nothing"))


def test_the_python_mirror_of_the_c_descriptor_has_its_layout(tmp_path):
    """Sizes are those that plug-ins were compiled against: they never change."""
    structs = {
        "ks_effect": (plugin.records.Effect, 80),
        "ks_effect_parameter": (plugin.records.Parameter, 56),
        "ks_effect_view": (plugin.records.View, 560),
    }
    fields = [(name, field) for name, (mirror, _) in structs.items() for field, *_ in mirror._fields_]
    prints = [f'printf("%u\\n", (unsigned)sizeof({name}));' for name in structs]
    prints += [f'printf("%u\\n", (unsigned)offsetof({name}, {field}));' for name, field in fields]
    source, program = tmp_path / "layout.c", tmp_path / "layout"
    body = "\n".join(prints)
    includes = '#include <stddef.h>\n#include <stdio.h>\n#include "ks/effect.h"\n'
    source.write_text(f"{includes}int main(void) {{\n{body}\nreturn 0; }}\n")
    subprocess.run(["cc", "-std=c99", f"-I{ROOT / 'capi/include'}", str(source), "-o", str(program)], check=True)
    seen = [int(line) for line in subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()]
    sizes = [size for _, size in structs.values()]
    assert seen[:3] == sizes == [ctypes.sizeof(mirror) for mirror, _ in structs.values()]
    assert seen[3:] == [getattr(structs[name][0], field).offset for name, field in fields]


BLACK_DN = 5.0


@pytest.fixture(scope="module")
def world(lab_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(effect_pictures, "_STRIP_SAMPLES", 16)
        return effect_pictures.StripWorld(CaptureRenderer("cpu"), lab_cache)


@pytest.mark.parametrize("name", builtin())
def test_every_effect_changes_the_picture(world, name):
    strip = world.strip(builtin()[name])
    assert strip.unit == ("DN" if builtin()[name].stage <= Stage.DIGITAL else "px")
    assert np.isfinite(strip.with_it).all() and np.mean(strip.difference != 0.0) > 1e-3  # and it is seen


@pytest.mark.parametrize(
    ("unit", "with_it", "rms", "filled_and_lost"),
    [
        ("px", (9.0, 4.0, 2.0, 0.0), 1.0, (1, 1)),
        ("DN", (0.0, 3.0, 0.0, 4.0), 1.5, (0, 0)),
        ("m", [0.0] * 4, 0.0, (0, 3)),
    ],
)
def test_a_pixel_that_gains_or_loses_its_depth_is_counted_apart(unit, with_it, rms, filled_and_lost):
    without = np.array([0.0, 3.0, 3.0, 4.0])
    strip = effect_pictures.EffectStrip(builtin()["hole_filling"], {}, unit, without, np.array(with_it))
    assert strip.rms() == pytest.approx(rms) and strip.filled_and_lost() == filled_and_lost


def test_the_picture_with_an_effect_follows_its_law(world):
    shaded = world.strip(builtin()["vignetting"], {"exponent": 3.0})
    height, width = shaded.without.shape
    v, u = np.mgrid[0:height, 0:width]
    cosine = 1.0 / np.sqrt(1.0 + ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / 160.0**2)
    expected = BLACK_DN + (shaded.without - BLACK_DN) * cosine**3
    free = shaded.without < 250.0
    assert np.allclose(shaded.with_it[free], expected[free], rtol=1e-4, atol=1e-3)


def test_the_command_draws_a_row_for_each_effect(tmp_path, capsys):
    parameters = "parameters=[Parameter('a', 'DN', 0.0, 0.0, 9.0, 3.0)]"
    own = user_file(tmp_path, "return signal + a", parameters, stage="DIGITAL")
    sizes = []
    for names in (["vignetting"], ["hole_filling", str(own)]):
        assert main(["effect", "show", *names, "-o", str(tmp_path / "strip.png"), "--device", "cpu"]) == 0
        sizes.append(Image.open(tmp_path / "strip.png").size)
    said = capsys.readouterr().out
    assert "mine: changes the picture by 3 DN" in said
    assert re.search(r"hole_filling: changes the picture by 0 px .*; \d+ pixels filled", said), said
    assert sizes[1][0] == sizes[0][0] and sizes[1][1] == pytest.approx(2 * sizes[0][1], abs=2)


def test_strengths_go_from_no_effect_over_the_typical_one_to_twice_as_much(world):
    strips = world.strengths(builtin()["veiling_glare"])
    typical = world.strip(builtin()["veiling_glare"])
    assert np.array_equal(strips[0].with_it, strips[0].without)
    assert strips[len(strips) // 2].parameters == typical.parameters
    changes = [float(np.mean(np.abs(strip.difference))) for strip in strips]
    assert changes == sorted(changes) and changes[-1] > 1.5 * changes[len(strips) // 2]


@needs_chromium
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
