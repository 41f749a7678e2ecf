# SPDX-License-Identifier: Apache-2.0
"""ARCHITECTURE.md's recipes name all files that an addition takes; ACTIVESTEREO_FULL=1 builds and renders with one."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TABLES = "capi/generation/tables"

# First words of a recipe: the addition's name, and for each file (text there, text that takes its place).
ADDITIONS = {
    "a material parameter": ("emission_boost", {
        f"{TABLES}/kuafu_material_desc.toml": [("# What shaders read beside", """[fields.emission_boost]
type = "double"
shader = true
extras = true
range = [0, 10]
doc = "The emission is multiplied by 1 + emission_boost."

# What shaders read beside""")],
        "kuafu/shaders/lib/material.glsl": [
            ("band_of(m.emission);", "band_of(m.emission) * (1.0f + m.emission_boost);")],
    }),
    "an optics step": ("neutral_density", {
        f"{TABLES}/kuafu_optics_desc.toml": [
            ("# What shaders read beside", """[fields.neutral_density]
type = "double"
shader = true
range = [0, 10]
doc = "The light is multiplied by 10^-neutral_density."

# What shaders read beside"""),
            ("[steps]", "[steps]\nneutral_density = \"Per pixel, in place.\"")],
        "kuafu/src/optics/optics.cpp": [
            ("  return (vignettes ?",
             "  return (optics.neutral_density > 0.0 ? 1u << optics_neutral_density : 0) |\n         (vignettes ?"),
            ("  if (takes(optics_vignetting) &&",
             "  if (takes(optics_neutral_density)) in_place(optics_neutral_density, pixels);\n"
             "  if (takes(optics_vignetting) &&")],
        "kuafu/shaders/stage/optics.glsl": [
            ("void optics(uint i) {", """void neutral_density(uint pixel) {
  float factor = pow(10.0f, -push.optics.at[pixel / pixels_per_view()].neutral_density);
  for (uint c = 0u; c < push.channels; ++c) push.to.at[pixel * push.channels + c] *= factor;
}

void optics(uint i) {
  if (step == optics_neutral_density) neutral_density(i);""")],
    }),
    "a matcher option": ("speckle_growth_px", {
        f"{TABLES}/simsense_parameters.toml": [("_OUTSIDE. 0 switches this check off.\"\"\"", """\
_OUTSIDE. 0 switches this check off.\"\"\"

[fields.speckle_growth_px]
type = "uint64"
range = [0, 100]
unit = "px"
doc = "Speckles may be this much larger than speckle_max_size."
""")],
        "simsense/src/stages/settings.cpp": [
            ("speckle_max_size(p.speckle_max_size)",
             "speckle_max_size(p.speckle_max_size + static_cast<uint32_t>(p.speckle_growth_px))")],
    }),
    "a reason of a missing depth": ("TOO_FLAT", {
        f"{TABLES}/headers.toml": [("#define SIMSENSE_REASON_SATURATED", """\
#define SIMSENSE_REASON_TOO_FLAT 10u
#define SIMSENSE_REASON_SATURATED""")],
    }),
    "a function of the C interface": ("kuafu_scene_light_name", {
        "capi/include/kuafu/kuafu.h": [
            ("KUAFU_API ks_status kuafu_scene_add_light(", """\
/* Name of a light, as kuafu_scene_instance_name returns names. */
KUAFU_API const char* kuafu_scene_light_name(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_add_light(""")],
        "kuafu/src/api/scene.cpp": [
            ("ks_status kuafu_scene_add_light(", """\
const char* kuafu_scene_light_name(kuafu_scene scene, uint32_t id) {
  const char* name = nullptr;
  (void)ks::call([&] { name = kuafu::there(scene_of(scene).lights(), "light", index_of(id)).name.c_str(); });
  return name;
}

ks_status kuafu_scene_add_light(""")],
    }),
    "an effect": ("grey_filter", {"python/activestereo/effects/grey_filter.py": [("", '''"""A grey filter."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.view import View


@effect("grey_filter", stage=Stage.OPTICS, family="glare", source="test",
        parameters=[Parameter("loss", "1", neutral=0.0, low=0.0, high=1.0, typical=0.1)])
def grey_filter(image: np.ndarray, view: View, loss: float) -> np.ndarray:
    """A share of all light is lost."""
    return (1.0 - loss) * image
''')]}),
}  # fmt: skip

RENDER = """
import numpy as np
import kuafu
from activestereo.effects import builtin
from activestereo.effects.core.laws import example_view

device = kuafu.Device()

def radiance(optics=None, **material):
    scene = kuafu.Scene(device)
    wall = scene.add_material(kuafu.Material(base_color=(0, 0, 0, 1), specular=0.0, emission=(1, 1, 1), **material))
    corners = np.array([[-9, -9, 2], [9, -9, 2], [9, 9, 2], [-9, 9, 2]], np.float32)
    scene.add_instance(scene.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)), [wall])
    camera = kuafu.Camera(16, 12, np.array([[12.0, 0, 8], [0, 12, 6], [0, 0, 1]]))
    options = {"band": "visible", "spp": 1, "max_bounces": 0, "optics": optics}
    return kuafu.Renderer(device).render(scene, camera, ["radiance"], **options)["radiance"]

np.testing.assert_allclose(radiance(), 1.0, rtol=1e-5)
np.testing.assert_allclose(radiance(emission_boost=2.0), 3.0, rtol=1e-5)
np.testing.assert_allclose(radiance(optics=kuafu.Optics(neutral_density=1.0)), 0.1, rtol=1e-5)
np.testing.assert_allclose(builtin()["grey_filter"](np.ones((4, 4)), example_view(), loss=0.25), 0.75)
"""


def run(*command: object, **options) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    """The tree's files with the additions, before anything is generated."""
    folder = tmp_path_factory.mktemp("recipes")
    kept = run("git", "-C", ROOT, "ls-files", "CMakeLists.txt", "LICENSE", "NOTICE", "README.md", "capi", "kuafu",
               "simsense", "python", "examples/clients", "tests/capi")  # fmt: skip
    for path in kept.splitlines():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, folder / path)
    for _, files in ADDITIONS.values():
        for path, edits in files.items():
            text = (folder / path).read_text() if (folder / path).exists() else ""
            for old, new in edits:
                assert not old or text.count(old) == 1, f"{path} has '{old}' {text.count(old)} times"
                text = text.replace(old, new) if old else new
            (folder / path).write_text(text)
    return folder


@pytest.mark.parametrize("recipe", ADDITIONS)
def test_the_recipe_names_the_files_of_the_addition(recipe: str) -> None:
    rows = [row for row in (ROOT / "ARCHITECTURE.md").read_text().splitlines() if row.startswith(f"| {recipe} |")]
    assert len(rows) == 1
    name, files = ADDITIONS[recipe]
    for path in files:
        assert (path if (ROOT / path).exists() else str(Path(path).parent)) in rows[0]


def test_nothing_else_written_by_hand_knows_the_additions(copy: Path) -> None:
    before = {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()}
    written = run(sys.executable, copy / "capi/generation/generate.py")
    assert "capi/include/kuafu/material.h" in written
    made = copy.parent / "generated"
    run(sys.executable, copy / "capi/generation/generate.py", "--build", made)
    assert "emission_boost" in (made / "kuafu/shaders/shared/material_fields.h").read_text()
    assert '"saturated", "too_flat"}' in (made / "python/simsense/fields.h").read_text()
    assert "kuafu_scene_light_name" in (made / "kuafu/src/api/api_table.cpp").read_text()
    for name, files in ADDITIONS.values():
        known = {str(p.relative_to(copy)) for p, text in before.items() if name.encode() in text}
        assert known == set(files)


def test_what_was_added_renders(copy: Path) -> None:
    if not os.environ.get("ACTIVESTEREO_FULL"):
        pytest.skip("compiles the renderer: ACTIVESTEREO_FULL=1 (tests/run.sh --full) does")
    run(sys.executable, copy / "capi/generation/generate.py")
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    ccache = {**os.environ, "CCACHE_BASEDIR": str(copy), "CCACHE_NOHASHDIR": "1"}
    run("cmake", "-S", copy, "-B", copy / "build", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", *launcher,
        "-DACTIVESTEREO_TESTS=OFF", "-DACTIVESTEREO_BENCH=OFF", "-DACTIVESTEREO_INSTALL=OFF", env=ccache)  # fmt: skip
    run("ninja", "-C", copy / "build", "product", env=ccache)
    run("/usr/bin/python3", "-c", RENDER, env={**os.environ, "PYTHONPATH": str(copy / "build/python")})
