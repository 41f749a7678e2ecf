# SPDX-License-Identifier: Apache-2.0
"""USD stages as glTF, and what is said without USD's package."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from activestereo import cli
from activestereo.scene_io.usd import UsdError, convert, load_usd
from glb_file import Glb
from PIL import Image

import kuafu

pxr = pytest.importorskip("pxr", reason="the package usd-core is not installed (pip install usd-core)")

_STAGE = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Z"
)
def Xform "World"
{
    def Mesh "Sheet" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token subdivisionScheme = "none"
        point3f[] points = [(0, 0, 100), (200, 0, 100), (200, 100, 100), (0, 100, 100)]
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
        rel material:binding = </World/Paint>
        def GeomSubset "Second" (prepend apiSchemas = ["MaterialBindingAPI"])
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </World/Coated>
        }
    }
    def Material "Paint"
    {
        token outputs:surface.connect = </World/Paint/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/Paint/T.outputs:rgb>
            float inputs:roughness.connect = </World/Paint/R.outputs:r>
            float inputs:metallic = 0.25
            float inputs:ior = 1.75
            token outputs:surface
        }
        def Shader "T"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @paint.png@
            token inputs:wrapS = "clamp"
            float3 outputs:rgb
        }
        def Shader "R"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @rough.png@
            float outputs:r
        }
    }
    def Material "Coated"
    {
        token outputs:surface.connect = </World/Coated/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
            float inputs:opacity = 0.5
            float inputs:clearcoat = 1
            color3f inputs:emissiveColor = (4, 2, 0)
            token outputs:surface
        }
    }
    def RectLight "Rect"
    {
        float inputs:width = 200
        float inputs:height = 100
        float inputs:intensity = 5
        float inputs:exposure = 1
        double3 xformOp:translate = (0, 0, 300)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DistantLight "Sun"
    {
        float inputs:intensity = 3
        bool inputs:normalize = 1
    }
    def DomeLight "Sky"
    {
        color3f inputs:color = (0.5, 1, 1)
        float inputs:intensity = 2
    }
    def Camera "RigCamera"
    {
        float focalLength = 20
        float horizontalAperture = 40
        float verticalAperture = 20
        double3 xformOp:translate = (0, 0, 500)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def PointInstancer "Copies"
    {
        point3f[] positions = [(0, 0, 0), (100, 0, 0), (0, 0, 400)]
        int[] protoIndices = [0, 0, 0]
        rel prototypes = </World/Copies/Block>
        def Cube "Block"
        {
            double size = 10
            color3f[] primvars:displayColor = [(0.25, 0.5, 0.75)]
        }
    }
    def Points "Hat"
    {
    }
    def Mesh "Hidden"
    {
        token visibility = "invisible"
        point3f[] points = [(0, 0, 0), (9e5, 0, 0), (0, 9e5, 0)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
    }
}
"""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    path = tmp_path / "a.usda"
    path.write_text(_STAGE)
    Image.new("RGB", (2, 2), (200, 100, 50)).save(tmp_path / "paint.png")
    Image.new("RGB", (2, 2), (64, 9, 9)).save(tmp_path / "rough.png")
    return path


def test_units_axes_and_subsets(stage: Path, tmp_path: Path) -> None:
    scene = kuafu.Scene(kuafu.Device("cpu"))
    converted = load_usd(scene, stage)
    # z up becomes y up: the sheet at z = 100 cm is at y = 1 m, its y at -z; the copy on top ends at 4.05 m.
    np.testing.assert_allclose(scene.summary.bounds_min_m, [-0.05, -0.05, -1.0], atol=1e-6)
    np.testing.assert_allclose(scene.summary.bounds_max_m, [2.0, 4.05, 0.05], atol=1e-6)
    assert scene.summary.triangle_count == 2 + 3 * 12
    np.testing.assert_allclose(683.0 * np.array(converted.ambient), [1.0, 2.0, 2.0])
    assert [m for m in converted.messages if "Points is not read" in m]
    assert len(converted.messages) == 1
    camera = scene.camera(0)
    np.testing.assert_allclose(np.asarray(camera.camera_to_world)[:3, 3], [0, 5, 0], atol=1e-9)
    np.testing.assert_allclose(np.asarray(camera.camera_to_world)[:3, 2], [0, -1, 0], atol=1e-9)  # looks down


def test_materials_and_textures(stage: Path, tmp_path: Path) -> None:
    convert(stage, tmp_path / "a.glb")
    made = Glb(tmp_path / "a.glb")
    document, paint, coated = made.document, made.material["/World/Paint"], made.material["/World/Coated"]
    assert paint["pbrMetallicRoughness"]["metallicFactor"] == 0.25
    assert paint["extensions"]["KHR_materials_ior"] == {"ior": 1.75}
    texture = document["textures"][paint["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
    assert document["samplers"][texture["sampler"]]["wrapS"] == 33071
    assert coated["alphaMode"] == "BLEND"
    np.testing.assert_allclose(coated["pbrMetallicRoughness"]["baseColorFactor"], [0.1, 0.2, 0.3, 0.5], rtol=1e-6)
    assert coated["emissiveFactor"] == [1.0, 0.5, 0.0]
    assert coated["extensions"]["KHR_materials_emissive_strength"] == {"emissiveStrength": 4.0}
    assert coated["extensions"]["KHR_materials_clearcoat"]["clearcoatFactor"] == 1.0
    # Roughness is the texture's red channel, glTF's the green one.
    assert made.pixel("/World/Paint", "metallicRoughnessTexture") == (255, 64, 255)


def test_lamps_and_copies(stage: Path, tmp_path: Path) -> None:
    convert(stage, tmp_path / "a.glb")
    document = Glb(tmp_path / "a.glb").document
    lights = {light["name"]: light for light in document["extensions"]["KHR_lights_punctual"]["lights"]}
    assert (lights["/World/Sun"]["type"], lights["/World/Sun"]["intensity"]) == ("directional", pytest.approx(3.0))
    # 5 nits at exposure 1 over 2 m x 1 m.
    assert lights["/World/Rect"]["extras"] == {"size_m": pytest.approx([2.0, 1.0])}
    assert lights["/World/Rect"]["intensity"] == pytest.approx(10.0 * 2.0)
    blocks = [n["mesh"] for n in document["nodes"] if n["name"] == "/World/Copies/Block"]
    assert len(blocks) == 3


_HEAD = '#usda 1.0\n(\n metersPerUnit = 1\n upAxis = "Y"\n)\n'
_WALL = (
    'def Plane "W"\n{\n double width = 40\n double length = 40\n uniform token axis = "Z"\n'
    " color3f[] primvars:displayColor = [(1, 1, 1)]\n}\n"
)


def _on_the_wall(path: Path, kind: str, inputs: dict[str, float]) -> tuple[float, float]:
    """Lux on a wall 4 m before a lamp (Rec. 709's weights), and infrared over red light at ir_ambient_scale 1."""
    fields = "".join(f" {_TYPES.get(name, 'float')} inputs:{name} = {value}\n" for name, value in inputs.items())
    fields = fields.replace("inputs:activestereo", "activestereo")
    place = ' double3 xformOp:translate = (0, 0, 4)\n uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    lamp = f'def {kind} "L" (prepend apiSchemas = ["ShapingAPI"])\n{{\n{place}{fields}}}\n'
    path.write_text(_HEAD + _WALL + lamp)
    scene = kuafu.Scene(kuafu.Device("cpu"))
    dome = load_usd(scene, path).ambient
    if dome is not None:
        scene.set_environment(dome)
    pose = np.array([[1, 0, 0, 0.05], [0, -1, 0, 0], [0, 0, -1, 0.02], [0, 0, 0, 1]], float)
    camera = kuafu.Camera(8, 8, [[100, 0, 3.5], [0, 100, 3.5], [0, 0, 1]], pose)
    light = []
    for band in ("visible", "infrared"):
        options = {"band": band, "spp": 256, "max_bounces": 0, "ir_ambient_scale": 1.0, "ir_ambient_radiance": 0.0}
        images = kuafu.Renderer(scene.device).render(scene, camera, ["radiance", "albedo"], **options)
        radiance, albedo = (images[name].mean(axis=(0, 1, 2), dtype=float) for name in ("radiance", "albedo"))
        light.append(np.pi * radiance / albedo)
    return 683.0 * float(light[0][:3] @ [0.2126, 0.7152, 0.0722]), float(light[1][0] / light[0][0])


_TYPES = {"normalize": "bool", "enableColorTemperature": "bool", "activestereo:ir_share": "token"}
_SMALL = {"radius": 0.1, "intensity": 5000}
_LUX = {"intensity": 700, "normalize": 1}


# Far before a lamp of luminance L the illuminance is L times the area that it shows over the distance's square; below
# an even sky it is pi L. A normalized light has its intensity for L times its area, a distant one for its lux.
@pytest.mark.parametrize(
    ("kind", "inputs", "lux", "share"),
    [
        ("SphereLight", _SMALL, 5000 * np.pi * 0.01 / 16, 1),
        ("SphereLight", _SMALL | {"normalize": 1}, 5000 / 4 / 16, 1),
        ("SphereLight", _SMALL | {"shaping:cone:angle": 30}, 5000 * np.pi * 0.01 / 16, 1),
        ("DiskLight", _SMALL | {"exposure": 1}, 10000 * np.pi * 0.01 / 16, 1),
        ("DiskLight", _SMALL | {"normalize": 1, "shaping:cone:angle": 30}, 5000 / 16, 1),
        ("RectLight", {"width": 0.2, "height": 0.1, "intensity": 5000}, 5000 * 0.02 / 16, 1),
        ("RectLight", _LUX | {"enableColorTemperature": 1, "colorTemperature": 3000}, 700 / 16, 1),
        ("CylinderLight", {"radius": 0.01, "length": 0.4, "intensity": 5000}, 5000 * 0.008 / 16, 1),
        ("DistantLight", _LUX, 700, 1),
        ("DistantLight", {"intensity": 1e7, "angle": 0.53}, 1e7 * np.pi * np.sin(np.deg2rad(0.265)) ** 2, 1),
        ("DistantLight", _LUX | {"activestereo:ir_share": '"sun"'}, 700, 1.6),
        ("DiskLight", _SMALL | {"activestereo:ir_share": '"2.5"'}, 5000 * np.pi * 0.01 / 16, 2.5),
        ("DomeLight", {"intensity": 1000}, 1000 * np.pi, 1),
    ],
)
def test_lamps_give_the_lux_of_their_units(
    tmp_path: Path, kind: str, inputs: dict[str, float], lux: float, share: float
) -> None:
    seen, infrared = _on_the_wall(tmp_path / "a.usda", kind, inputs)
    assert seen == pytest.approx(lux, rel=0.05)
    assert infrared == pytest.approx(share, rel=0.02)


def test_a_lamp_of_no_kind_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    path.write_text(_HEAD + _WALL + 'def DiskLight "L"\n{\n token activestereo:ir_share = "neon"\n}\n')
    with pytest.raises(UsdError, match="a.usda: /L.activestereo:ir_share: unknown lamp 'neon'"):
        convert(path, tmp_path / "a.glb")


@pytest.mark.parametrize("kind", ["SphereLight", "DistantLight", "DomeLight"])
@pytest.mark.parametrize(
    "line", ["float inputs:intensity = -5", "float inputs:intensity = inf", "float inputs:exposure = 2000",
             "float inputs:intensity = nan", "color3f inputs:color = (1, -1, 1)"]
)  # fmt: skip
def test_a_lamp_without_a_light_is_one_line(tmp_path: Path, kind: str, line: str) -> None:
    path = tmp_path / "a.usda"
    path.write_text(f'{_HEAD}{_WALL}def {kind} "L"\n{{\n {line}\n}}\n')
    with pytest.raises(UsdError, match=r"a.usda: /L: intensity \S+, exposure \S+, colour .* give no light") as error:
        convert(path, tmp_path / "a.glb")
    assert "\n" not in str(error.value)


# A white wall 1 m below a lamp of 2 x 1 m: seen light falls on it from the front alone.
def test_a_rectangle_shines_to_its_front(tmp_path: Path) -> None:
    seen = []
    for turn in (0, 180):
        lamp = (
            'def RectLight "L"\n{\n float inputs:width = 2\n float inputs:height = 1\n float inputs:intensity = 2049\n'
            f" float3 xformOp:rotateXYZ = (0, {turn}, 0)\n double3 xformOp:translate = (0, 0, 1)\n"
            ' uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]\n}\n'
        )
        path = tmp_path / f"{turn}.usda"
        path.write_text(_HEAD + _WALL + lamp)
        scene = kuafu.Scene(kuafu.Device("cpu"))
        load_usd(scene, path)
        pose = np.array([[1, 0, 0, 1.5], [0, -1, 0, 0], [0, 0, -1, 0.5], [0, 0, 0, 1]], float)  # looks at the wall
        camera = kuafu.Camera(8, 8, [[100, 0, 3.5], [0, 100, 3.5], [0, 0, 1]], pose)
        image = kuafu.Renderer(scene.device).render(scene, camera, ["radiance"], band="visible", spp=64, max_bounces=1)
        seen.append(float(np.mean(np.asarray(image["radiance"])[..., :3])))
    assert seen[0] > 0.1
    assert seen[1] < 0.02 * seen[0]


def test_what_is_no_stage_is_one_line(tmp_path: Path) -> None:
    broken = tmp_path / "b.usda"
    broken.write_text("#usda 1.0\ndef Mesh {{{")
    with pytest.raises(UsdError, match="b.usda") as error:
        convert(broken, tmp_path / "b.glb")
    assert "\n" not in str(error.value)
    empty = tmp_path / "c.usda"
    empty.write_text('#usda 1.0\ndef Xform "A"\n{\n}\n')
    with pytest.raises(UsdError, match="no mesh"):
        convert(empty, tmp_path / "c.glb")


def test_the_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "a.usda").write_text("#usda 1.0\n")
    for name in ("pxr", "pxr.Tf"):  # other tests have loaded both
        monkeypatch.setitem(sys.modules, name, None)
    code = cli.main(["simulate", str(tmp_path / "a.usda"), "--out", str(tmp_path / "out"), "--device", "cpu"])
    assert code != 0
    assert "pip install usd-core" in capsys.readouterr().err
