# SPDX-License-Identifier: Apache-2.0
"""KTX2 textures of glTF become PNG in a copy; a decoder made here stands in for the package opengl_basisu."""

from __future__ import annotations

import base64
import json
import os
import re
import struct
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import kuafu
import activestereo
from activestereo import StereoDepthSensor, StereoDepthSensorConfig, cli
from activestereo.benchmarks.generate.layout import Things
from activestereo.scene_io.ktx2 import Ktx2Error, convert, load_ktx2, needs_ktx2
from activestereo.scene_io.scene_files import load_scene_file

PIXELS = np.arange(2 * 3 * 4, dtype=np.uint8).reshape(2, 3, 4) * 10
EXTENSION = "KHR_texture_basisu"


def stand_in(data: bytes) -> SimpleNamespace:
    """Takes the words that activestereo.scene_io.ktx2 says to the package, and no others."""
    if data[:4] != b"\xabKTX":
        raise ValueError("not a KTX 2 file\nof any kind")

    def transcode(target: str, level: int) -> SimpleNamespace:
        assert (target, level) == ("rgba8", 0)
        return SimpleNamespace(data=PIXELS)

    return SimpleNamespace(has_alpha=data[4:] == b"alpha", transcode=transcode)


@pytest.fixture
def decoder(monkeypatch: pytest.MonkeyPatch) -> None:
    package = ModuleType("opengl_basisu")
    package.open = stand_in
    monkeypatch.setitem(sys.modules, "opengl_basisu", package)


def document(images: list[dict], chunk: bytes) -> dict:
    """A triangle whose material has the first of the images; points first in the buffer, then what `chunk` adds."""
    return {
        "asset": {"version": "2.0"},
        "extensionsUsed": [EXTENSION],
        "extensionsRequired": [EXTENSION],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
        "buffers": [{"byteLength": 60 + len(chunk)}],
        "images": images,
        "textures": [{"extensions": {EXTENSION: {"source": number}}} for number in range(len(images))],
    }


def points(chunk: bytes = b"") -> bytes:
    return np.array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1], np.float32).tobytes() + chunk


def write_glb(path: Path, content: dict, data: bytes) -> None:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
    path.write_bytes(
        head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    )


def test_all_places_of_an_image(tmp_path: Path, decoder: None) -> None:
    inside, alpha = b"\xabKTX", b"\xabKTXalpha"
    (tmp_path / "a b.ktx2").write_bytes(alpha)
    content = document(
        [
            {"name": "paint", "mimeType": "image/ktx2", "bufferView": 2},
            {"mimeType": "image/ktx2", "uri": "a%20b.ktx2"},
            {"uri": "data:image/ktx2;base64," + base64.b64encode(alpha).decode()},
        ],
        inside,
    )
    content["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": len(inside)})
    write_glb(tmp_path / "a.glb", content, points(inside))
    out = tmp_path / "out"
    out.mkdir()
    assert needs_ktx2(tmp_path / "a.glb")
    copy = convert(tmp_path / "a.glb", out)
    written = json.loads(copy.read_text())
    assert EXTENSION not in copy.read_text()
    assert [texture["source"] for texture in written["textures"]] == [0, 1, 2]
    seen = [np.asarray(Image.open(out / image["uri"])) for image in written["images"]]
    np.testing.assert_array_equal(seen[0], PIXELS[:, :, :3])
    np.testing.assert_array_equal(seen[1], PIXELS)
    np.testing.assert_array_equal(seen[2], PIXELS)
    assert not needs_ktx2(copy)


def test_the_scene_has_it(tmp_path: Path, decoder: None) -> None:
    content = document([{"uri": "a.ktx2"}], b"")
    (tmp_path / "a.ktx2").write_bytes(b"\xabKTX")
    write_glb(tmp_path / "a.glb", content, points())
    scene = kuafu.Scene(kuafu.Device("cpu"))
    load_ktx2(scene, tmp_path / "a.glb")
    assert (scene.summary.triangle_count, scene.summary.texture_count) == (1, 1)


def test_a_sensor_and_all_that_takes_scene_files_has_it(tmp_path: Path, decoder: None) -> None:
    (tmp_path / "a.ktx2").write_bytes(b"\xabKTX")
    write_glb(tmp_path / "a.glb", document([{"uri": "a.ktx2"}], b""), points())
    sensor = StereoDepthSensor(StereoDepthSensorConfig("D435").scaled(0.1), tmp_path / "a.glb", device="cpu")
    assert sensor.scene.summary.texture_count >= 1
    scene = kuafu.Scene(kuafu.Device("cpu"))
    assert load_scene_file(scene, str(tmp_path / "a.glb")) is None
    assert scene.summary.texture_count == 1


def test_a_data_sets_thing_has_it(tmp_path: Path, decoder: None) -> None:
    (tmp_path / "a.ktx2").write_bytes(b"\xabKTX")
    content = document([{"uri": "a.ktx2"}], b"")
    content["nodes"][0]["scale"] = [0.1, 0.1, 0.1]
    write_glb(tmp_path / "a.glb", content, points())
    scene = kuafu.Scene(kuafu.Device("cpu"))
    assert [thing.path for thing in Things(scene, [tmp_path / "a.glb"]).things] == [tmp_path / "a.glb"]
    assert scene.summary.texture_count == 1
    with pytest.raises(ValueError, match=r"a\.usda: a thing is no USD stage: convert it"):
        Things(scene, [tmp_path / "a.usda"])


def test_scene_files_are_loaded_in_one_place() -> None:
    """Captures, data sets and sensors convert what `simulate` does, for nothing but scene_io calls Scene.load."""
    package = Path(activestereo.__file__).resolve().parent
    calls = re.compile(r"\b(?:scene|_scene|alone)\.load\(")
    found = {str(path.relative_to(package)) for path in package.rglob("*.py") if calls.search(path.read_text("utf-8"))}
    assert found == {f"scene_io/{name}.py" for name in ("ktx2", "parts", "scene_files", "usd/convert")}


def test_log_lines_name_the_callers_file(
    tmp_path: Path, decoder: None, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "a.ktx2").write_bytes(b"\xabKTX")
    content = document([{"uri": "a.ktx2"}], b"")
    content["extensionsUsed"] = [*content.get("extensionsUsed", []), "EXT_of_nobody"]
    write_glb(tmp_path / "a.glb", content, points())
    load_scene_file(kuafu.Scene(kuafu.Device("cpu")), tmp_path / "a.glb")
    lines = [record.getMessage() for record in caplog.records if "EXT_of_nobody" in record.getMessage()]
    assert lines and all(line.startswith(f"{tmp_path / 'a.glb'}: ") for line in lines)


def test_what_is_wrong_is_wrong_in_the_callers_file(tmp_path: Path, decoder: None) -> None:
    (tmp_path / "a.ktx2").write_bytes(b"\xabKTX")
    content = document([{"uri": "a.ktx2"}], b"")
    content["accessors"][0]["count"] = 300  # beyond the buffer
    write_glb(tmp_path / "a.glb", content, points())
    with pytest.raises(kuafu.FileError) as raised:
        load_scene_file(kuafu.Scene(kuafu.Device("cpu")), tmp_path / "a.glb")
    assert str(tmp_path / "a.glb") in str(raised.value)
    assert "/a.gltf" not in str(raised.value)


def test_what_is_no_plain_file_or_too_deep_is_left_to_the_importer(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.gltf")
    assert not needs_ktx2(tmp_path / "pipe.gltf")
    (tmp_path / "deep.gltf").write_text('{"a": ' + "[" * 100_000)
    assert not needs_ktx2(tmp_path / "deep.gltf")


# As some files of Khronos's sample assets are, without the extension.
def test_a_plain_source_may_be_ktx2(tmp_path: Path, decoder: None) -> None:
    content = document([{"uri": "a.ktx2"}], b"")
    content["textures"] = [{"source": 0}]
    del content["extensionsRequired"], content["extensionsUsed"]
    (tmp_path / "a.ktx2").write_bytes(b"\xabKTX")
    write_glb(tmp_path / "a.glb", content, points())
    assert needs_ktx2(tmp_path / "a.glb")
    out = tmp_path / "out"
    out.mkdir()
    assert json.loads(convert(tmp_path / "a.glb", out).read_text())["images"][0]["uri"] == "image_0.png"


# No decoder is here: the image that stands in is enough.
def test_an_image_that_stands_in_is_kept(tmp_path: Path) -> None:
    content = document([{"uri": "a.ktx2"}, {"uri": "a.png"}], b"")
    content["textures"] = [{"source": 1, "extensions": {EXTENSION: {"source": 0}}}]
    Image.new("RGB", (2, 2), (9, 8, 7)).save(tmp_path / "a.png")
    write_glb(tmp_path / "a.glb", content, points())
    out = tmp_path / "out"
    out.mkdir()
    written = json.loads(convert(tmp_path / "a.glb", out).read_text())
    assert written["textures"] == [{"source": 1, "extensions": {}}]
    assert (out / written["images"][1]["uri"]).read_bytes() == (tmp_path / "a.png").read_bytes()
    del content["extensionsRequired"]
    write_glb(tmp_path / "b.glb", content, points())
    assert not needs_ktx2(tmp_path / "b.glb")


def test_what_cannot_be_read_is_one_line(tmp_path: Path, decoder: None, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "in").mkdir()
    scene = tmp_path / "in" / "a.glb"
    (tmp_path / "in" / "a.ktx2").write_bytes(b"PNG")
    (tmp_path / "b.ktx2").write_bytes(b"\xabKTX")
    wrong = {"a.ktx2": "is no KTX2", "../b.ktx2": "outside the file's folder", "c.ktx2": "is not there"}
    for uri, text in wrong.items():
        write_glb(scene, document([{"uri": uri}], b""), points())
        with pytest.raises(Ktx2Error, match=text) as error:
            convert(scene, tmp_path)
        assert "\n" not in str(error.value)
    monkeypatch.setenv("KUAFU_LOAD_OUTSIDE", "1")
    write_glb(scene, document([{"uri": "../b.ktx2"}], b""), points())
    assert convert(scene, tmp_path).is_file()
    broken = document([{"bufferView": 7}], b"")
    write_glb(scene, broken, points())
    with pytest.raises(Ktx2Error, match="cannot be read"):
        convert(scene, tmp_path)
    scene.write_bytes(b"glTF")
    assert not needs_ktx2(scene)


def test_the_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "a.ktx2").write_bytes(b"\xabKTX")
    write_glb(tmp_path / "a.glb", document([{"uri": "a.ktx2"}], b""), points())
    monkeypatch.setitem(sys.modules, "opengl_basisu", None)
    code = cli.main(["simulate", str(tmp_path / "a.glb"), "--out", str(tmp_path / "out"), "--device", "cpu"])
    assert code != 0
    assert "opengl_basisu" in capsys.readouterr().err
