# SPDX-License-Identifier: Apache-2.0
"""simulate tells the light of a scene, and which bodies cannot be measured and why."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.cli import simulate
from activestereo.model import read_model
from activestereo.report.view.sources import SceneSource
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter

_QUICK = ("--device", "cpu", "--resolution", "106x60", "--spp", "1", "--max-bounces", "1")


def _tetrahedron(path: Path, size: float, opacity: str = "") -> Path:
    """An .obj file beside its .mtl."""
    path.with_suffix(".mtl").write_text(f"newmtl m\nKd 0.6 0.6 0.6\nillum 2\n{opacity}\n")
    corners = "".join(f"v {x * size} {y * size} {z * size}\n" for x, y, z in np.vstack([np.zeros(3), np.eye(3)]))
    faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    path.write_text(f"mtllib {path.stem}.mtl\no thing\n{corners}usemtl m\n{faces}")
    return path


def _room(path: Path, lamp_w_sr: float | None) -> Path:
    """A wall 1 m before the camera, a ball behind the camera, one to its right, and one behind the wall."""
    writer = GltfWriter()
    surface = {"baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": 0}
    grey = writer.add_material("grey", pbrMetallicRoughness=surface)
    writer.add_mesh("wall", meshes.sheet((-1, -1, -1), (2, 0, 0), (0, 2, 0)), grey)
    writer.add_mesh("follower", meshes.sphere(0.1), grey, (0, 0, 2))
    writer.add_mesh("neighbour", meshes.sphere(0.1), grey, (2, 0, 0))
    writer.add_mesh("hidden", meshes.sphere(0.1), grey, (0, 0, -1.5))
    if lamp_w_sr is not None:
        writer.add_light("floodlight", (0, 0.5, 0), (1, 1, 1), lamp_w_sr)
        writer.add_light("night light", (0, -0.5, 0), (1, 1, 1), 1e-3)
    writer.add_camera("camera", np.diag([1.0, -1.0, -1.0, 1.0]), 0.75, 16 / 9)
    writer.write(path)
    return path


def test_bodies_that_are_not_seen_are_named_with_the_reason(ran, tmp_path: Path) -> None:
    result = ran("simulate", _room(tmp_path / "a.glb", None), *_QUICK, "--out", tmp_path / "out")
    said = [line for line in result.stderr.splitlines() if "cannot be measured" in line]
    assert len(said) == 1 and "3 of 4 bodies" in said[0]
    for name, why in (("follower", "behind the camera"), ("neighbour", "to the right of"), ("hidden", "hidden behind")):
        assert f"'{name}' is {why}" in said[0]


@pytest.mark.parametrize(
    ("size", "options", "words"),
    [
        (200.0, (), ("beyond the sensor's 10 m", "200 m large", "--unit 0.001")),
        (0.2, ("--unit", "0.001"), ("0.2 mm large", "in metres, which --unit 1 says")),
        (200.0, ("--unit", "0.001"), ()),
    ],
)  # fmt: skip
def test_a_scene_in_another_unit(run, tmp_path: Path, size: float, options: tuple, words: tuple) -> None:
    thing = _tetrahedron(tmp_path / "a.obj", size)
    result = run("simulate", thing, *options, *_QUICK, "--json", "--out", tmp_path / "out")
    said = [line for line in result.stderr.splitlines() if "nothing can be measured" in line]
    assert bool(said) == bool(words)
    assert all(word in said[0] for word in words)
    assert bool(json.loads(result.stdout)["accuracy"][-1]["pixels"]) != bool(words)


@pytest.mark.parametrize(("options", "is_seen"), [((), True), (("--keep-transparent",), False)])
def test_a_body_of_opacity_0(run, monkeypatch, tmp_path: Path, options: tuple[str, ...], is_seen: bool) -> None:
    monkeypatch.setenv("KUAFU_LOAD_TRANSPARENT", "")  # what the option sets goes with the test
    thing = _tetrahedron(tmp_path / "a.obj", 0.2, "Tr 1.000000")
    result = run("simulate", thing, *options, *_QUICK, "--json", "--out", tmp_path / "out")
    found = json.loads(result.stdout)
    assert bool(found["accuracy"][-1]["pixels"]) == is_seen
    assert [name for name, _ in found["unseen"].items()] == ([] if is_seen else ["thing"])


@pytest.mark.parametrize(("lamp_w_sr", "drowns"), [(0.1, False), (5000.0, True)])
def test_the_lamp_that_drowns_the_dots_is_named(run, tmp_path: Path, lamp_w_sr: float, drowns: bool) -> None:
    result = run("simulate", _room(tmp_path / "a.glb", lamp_w_sr), *_QUICK, "--out", tmp_path / "out")
    told = " ".join(result.stdout.split())
    assert "infrared at the dots (1.00 m): projector" in told and "room" not in told and "view:" not in told
    said = [line for line in result.stderr.splitlines() if "dots hardly stand out" in line]
    assert bool(said) == drowns
    assert all("'floodlight' gives 100 %" in line for line in said)


@pytest.mark.parametrize(("exposure_s", "is_full"), [("0.005", False), ("0.5", True)])
def test_an_overexposed_pair_is_told(run, tmp_path: Path, exposure_s: str, is_full: bool) -> None:
    told = run("simulate", _room(tmp_path / "a.glb", 0.1), *_QUICK, "--ir-exposure", exposure_s, "--out", tmp_path)
    assert ("of the left infrared image is at full scale" in told.stderr) == is_full


def test_a_scene_without_light_is_a_room(run, tmp_path: Path) -> None:
    room = _room(tmp_path / "a.glb", None)
    lit = run("simulate", room, *_QUICK, "--out", tmp_path / "lit").stdout
    assert "light added: a room of 400 lux" in lit
    dark = json.loads(run("simulate", room, *_QUICK, "--ambient", "0", "--json", "--out", tmp_path / "dark").stdout)
    assert dark["added_radiance"] is None
    assert dark["light"]["projector"] == pytest.approx(1.0) and dark["light"]["brightest"] is None


def test_noise_and_the_laser_are_switched_off(ran, tmp_path: Path) -> None:
    still = (_room(tmp_path / "a.glb", None), *_QUICK, "--ir-exposure", "0.005", "-o", tmp_path / "out")
    pictures = []
    for more in ((), ("--no-noise",), ("--no-noise", "--ambient", "0", "--laser-power", "0")):
        ran("simulate", *still, *more)
        pictures.append(np.asarray(Image.open(tmp_path / "out/ir_left.png")).astype(float))
    assert np.std(pictures[0] - pictures[1]) > 0.3 and pictures[1].std() > 1.0 and pictures[2].std() == 0.0


def test_without_noise_the_imagers_keep_their_response(ran, tmp_path: Path) -> None:
    """A bent response brightens what is below full scale."""
    means, room = [], _room(tmp_path / "a.glb", None)
    for exponent in (1.0, 0.5):
        of_ir = ("--ir-signal", f"response_exponent={exponent}", "--ir-signal", "read_noise_e=9", "--no-noise")
        ran("simulate", room, *_QUICK, "--ir-exposure", "0.001", *of_ir, "-o", tmp_path / "out")
        means.append(np.asarray(Image.open(tmp_path / "out/ir_left.png")).astype(float).mean())
    assert means[1] > 1.2 * means[0]


def test_a_model_states_infrared_albedos_by_the_names_of_materials(ran, tmp_path: Path) -> None:
    """As examples/guide/infrared_materials.md says; a name that the scene lacks is told, and so are files without."""
    wedge = _tetrahedron(tmp_path / "a.obj", 0.2)
    facet = "vertex 0 0 0\nvertex 0.2 0 0\nvertex 0 0.2 0"
    (tmp_path / "a.stl").write_text(
        f"solid a\nfacet normal 0 0 1\nouter loop\n{facet}\nendloop\nendfacet\nendsolid a\n"
    )
    means, told = [], []
    for scene, name, albedo in ((wedge, "m", 0.05), (wedge, "m", 0.9), (wedge, "cloth", 0.9), ("a.stl", "m", 0.9)):
        model = {"format": "active-stereo-model", "version": 2, "materials": {name: {"ir_albedo": albedo}}}
        (tmp_path / "model.json").write_text(json.dumps(model))
        more = (*_QUICK, "--ir-exposure", "0.001", "--model", tmp_path / "model.json")
        result = ran("simulate", tmp_path / scene, *more, "-o", tmp_path / "out")
        means.append(np.asarray(Image.open(tmp_path / "out/ir_left.png"))[25:35, 48:58].mean())
        told.append(" ".join(f"{result.stdout} {result.stderr}".split()))
    assert means[1] > 1.2 * means[0]
    assert "no such material" not in told[0] and "cloth: the scene has no such material (there are: m)" in told[2]
    assert "(there are: none)" in told[3] and "unnamed material" in told[3]


def test_a_model_makes_one_of_two_objects_of_a_material_shine(ran, tmp_path: Path, monkeypatch) -> None:
    """As the command does that `diagnose` prints, for a capture whose material is on several objects."""
    room, model = _room(tmp_path / "a.glb", None), tmp_path / "model.json"
    make, means = simulate.make_config, []  # --resolution is refused beside effects
    monkeypatch.setattr(simulate, "make_config", lambda *given: make(*given).scaled(0.125))
    for surface in ("grey of wall", "grey of neighbour"):
        ran("add", "specular", "--set", "factor=5", "--on", surface, "-o", model)
        ran("simulate", room, "--model", model, *_QUICK[:2], *_QUICK[4:], "--no-noise", "-o", tmp_path / "out")
        means.append(np.asarray(Image.open(tmp_path / "out/ir_left.png")).mean())
    assert means[0] != means[1]
    source = SceneSource(room, kuafu.Device("cpu"), StereoDepthSensorConfig("D435"), read_model(model))
    assert "grey of neighbour" in source.simulation().material_names()
