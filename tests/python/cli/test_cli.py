# SPDX-License-Identifier: Apache-2.0
"""The command line as a user runs it: results, help, and one line with status 2 for what is wrong."""

import os
import subprocess

import numpy as np
import pytest
from moving_wall import write_moving_wall
from PIL import Image

K = "120,0,79.5,0,120,47.5,0,0,1"
RIG = ("--k", K, "--baseline", "0.05", "--max-disparity", "32")


@pytest.fixture(scope="session")
def process(build):
    """Runs build/bin/activestereo from nowhere in particular, without any environment of ours."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def process(*arguments, **changes):
        command = [str(build / "bin" / "activestereo"), *map(str, arguments)]
        return subprocess.run(
            command, capture_output=True, text=True, cwd="/", env={**environment, **changes}, timeout=300
        )

    return process


def assert_refused(result, *words):
    assert result.returncode == 2, result.stderr
    lines = result.stderr.splitlines()
    assert len(lines) == 1 and "Traceback" not in result.stderr, result.stderr
    for word in words:
        assert word in lines[0], lines[0]


def test_without_a_driver_it_says_what_to_install(process, table_top, tmp_path):
    missing = {"VK_ICD_FILENAMES": "/nonexistent.json", "VK_DRIVER_FILES": "/nonexistent.json"}
    assert_refused(process("simulate", table_top, "--out", tmp_path / "out", **missing), "mesa-vulkan-drivers")


def test_simulate_writes_all_files(process, table_top, tmp_path):
    out = tmp_path / "deep" / "out"
    few = ("--resolution", "212x120", "--spp", "1", "--max-bounces", "1")
    result = process("simulate", table_top, "--sensor", "D435", *few, "--verbose", "--out", out)
    assert result.returncode == 0, result.stderr
    pictures = {f"{name}.png" for name in ("rgb", "ir_left", "ir_right", "depth", "depth_true", "overview")}
    assert {path.name for path in out.iterdir()} == pictures | {"cloud.ply", "camera.json"}
    assert all(word in result.stdout for word in ("device:", "infrared", "wood")) and "done in" in result.stderr
    depth, true = (np.asarray(Image.open(out / name)) for name in ("depth.png", "depth_true.png"))
    assert depth.dtype == true.dtype and depth.shape == (120, 212) and depth.max() > 255
    both = (depth > 0) & (true > 0)
    assert np.median(np.abs(depth[both].astype(int) - true[both])) < 60


def test_simulate_repeats_with_its_seed_and_moves_the_sensor_while_it_exposes(ran, table_top, tmp_path):
    def pictures(*options):
        quick = ("--resolution", "106x60", "--spp", 1, "--max-bounces", 0)
        ran("simulate", table_top, *quick, *options, "--out", tmp_path / "out")
        return [(tmp_path / "out" / f"{name}.png").read_bytes() for name in ("ir_left", "rgb")]

    first, again, other = (pictures("--seed", seed) for seed in (3, 3, 4))
    assert first == again and first[0] != other[0]
    moving = pictures("--seed", 3, "--velocity", "2,0,0")
    assert moving[0] != first[0] and moving[1] == first[1]  # the RGB camera is open for an instant


def test_simulate_at_a_time_from_a_given_pose(run, ran, table_top, tmp_path):
    wall = write_moving_wall(tmp_path / "wall.gltf")
    ahead = "1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1"
    options = ("--resolution", "106x60", "--spp", 1, "--max-bounces", 0, "--out", tmp_path / "out")
    ran("simulate", wall, "--time", 1, "--camera-to-world", ahead, *options)
    assert abs(np.median(np.asarray(Image.open(tmp_path / "out" / "depth_true.png"))) - 3500) <= 1  # 2000 at time 0
    assert_refused(run("simulate", table_top, "--time", 1, *options), "table_top.gltf", "--time 1", "no animation")


def test_simulate_options_are_the_configuration():
    from activestereo.cli import make_parser, simulate

    options = ("--ir-distortion=-0.06,0.01,0,0", "--rgb-distortion", "0.1,0,0,0,0.2", "--readout", "rows_up")
    times = ("--ir-line-time-s", "1e-4", "--rgb-line-time-s", "2e-4", "--rgb-exposure-s", "3e-3")
    config = simulate.make_config(make_parser().parse_args(["simulate", "x.gltf", "--out", "x", *options, *times]))
    assert config.ir_distortion == (-0.06, 0.01, 0, 0, 0) and config.rgb_distortion == (0.1, 0, 0, 0, 0.2)
    assert (config.ir_line_time_s, config.rgb_line_time_s, config.rgb_exposure_s) == (1e-4, 2e-4, 3e-3)
    assert config.ir_readout == config.rgb_readout == "rows_up"
    fisheye = make_parser().parse_args(["simulate", "x.gltf", "--out", "x", "--ir-fisheye", "0.1,0,0,0"])
    assert simulate.make_config(fisheye).ir_distortion == (0.1, 0, 0, 0)


def test_depth_of_a_pair(process, pair, tmp_path):
    result = process("depth", pair / "left.png", pair / "right.png", *RIG, "--out", tmp_path)
    assert result.returncode == 0, result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "cloud.ply", "depth.npy", "depth.png", "disparity.npy", "disparity.png", "overview.png",
    ]  # fmt: skip
    disparity, metres = (np.load(tmp_path / f"{name}.npy") for name in ("disparity", "depth"))
    assert disparity.dtype == metres.dtype == np.float32
    np.testing.assert_allclose(metres[metres > 0], 6.0 / disparity[metres > 0], rtol=1e-5)
    depth = np.asarray(Image.open(tmp_path / "depth.png"))
    assert np.median(depth[depth > 0]) == 500


def test_depth_takes_equal_channels_and_arrays_like_gray(run, ran, pair, tmp_path):
    np.save(tmp_path / "right.npy", np.asarray(Image.open(pair / "right.png")))
    rest = (*RIG, "--out")
    for left, right, out in (("left.png", pair / "right.png", "a"), ("gray3.png", tmp_path / "right.npy", "b")):
        said = ran("depth", pair / left, right, *rest, tmp_path / out).stdout
        assert "hint" not in said and "cut off" not in said
    assert (tmp_path / "a" / "depth.npy").read_bytes() == (tmp_path / "b" / "depth.npy").read_bytes()
    np.save(tmp_path / "float.npy", np.zeros((96, 160)))
    result = run("depth", tmp_path / "float.npy", tmp_path / "right.npy", *rest, tmp_path / "c")
    assert_refused(result, "float.npy", "uint8 or uint16")


def test_depth_hints_at_exchanged_cameras_and_tells_what_it_cut(ran, pair, tmp_path):
    rest = (*RIG, "--out", tmp_path)
    told = ran("depth", pair / "right.png", pair / "left.png", *rest).stdout
    assert "is LEFT the right camera's image?" in " ".join(told.split())
    told = ran("depth", pair / "left.png", pair / "right.png", *rest, "--max-depth-m", "0.4").stdout
    line = " ".join(told.split()).partition("cut off: ")[2].partition(")")[0]
    count, share = int(line.split()[0]), float(line.split()[6])
    assert "--max-depth-m 0.4" in line and count > 0.8 * 96 * 140
    assert share == pytest.approx(100 * count / (96 * 160), abs=0.1)


def test_profiles_of_depth_are_for_dots_for_textures_and_the_engine_itself(ran, pair, tmp_path):
    deep, shallow = [], [pair / "left.png", pair / "right.png"]
    for path in shallow:
        deep.append(tmp_path / path.name)
        Image.fromarray(np.asarray(Image.open(path)).astype(np.uint16) * 256).save(deep[-1])
    rest = (*RIG, "--out", tmp_path / "out", "--verbose", "--profile")
    told = {"active": ["uniqueness 10 %"], "engine": ["uniqueness 15 %"]}
    told["passive"] = ["uniqueness 5 %", "block 5x5", "median 5"]
    for name, words in told.items():
        maps = []
        for images in (shallow, deep):
            said = " ".join(ran("depth", *images, *rest, name).stdout.split())
            assert all(word in said for word in words), said
            maps.append(np.load(tmp_path / "out/disparity.npy"))
        assert np.mean(maps[0] == maps[1]) > 0.99, "counts of 16 bits mean what those of 8 do"
    own = " ".join(ran("depth", *shallow, *rest, "passive", "--block", "3x3").stdout.split())
    assert "block 3x3" in own and "median 5" in own  # options go before a profile


def test_depth_explains_itself_where_asked(ran, pair, tmp_path):
    options = ("--subpixel", "none", "--confidence", "--reason")
    ran("depth", pair / "left.png", pair / "right.png", *RIG, *options, "--out", tmp_path)
    files = (tmp_path / f"{name}.png" for name in ("depth", "confidence", "reason"))
    depth, confidence, reason = (np.asarray(Image.open(file)) for file in files)
    assert ((reason == 0) == (depth > 0)).all() and np.median(confidence[depth > 0]) > 0.15 * 65535
    assert set(np.unique(depth)) <= {0} | {round(6000 / d) for d in range(1, 32)}  # whole disparities: f B is 6 px m


def test_depth_refuses_what_is_wrong(run, pair, tmp_path):
    left, right = pair / "left.png", pair / "right.png"
    rest = ("--k", K, "--baseline", "0.05", "--out", tmp_path / "out")
    assert_refused(run("depth", pair / "none.png", right, *rest), "none.png", "No such file")
    assert_refused(run("depth", pair / "vast.png", right, *rest), "vast.png", "3600000000 pixels")
    assert_refused(run("depth", pair / "signed.tiff", right, *rest), "signed.tiff", "-500")
    assert_refused(run("depth", left, pair / "deep.png", *rest), "8 and 16 bits")
    assert_refused(run("depth", left, pair / "text.png", *rest), "text.png")
    assert_refused(run("depth", pair / "color.png", right, *rest), "color.png", "gray")
    assert_refused(run("depth", left, pair / "small.png", *rest), "160x96", "160x50")
    for k, said in {"1,2,3": "9 or 4", "a,b,c,d": "a,b", "1,1,nan,1": "finite", "-5,0,1,0,5,1,0,0,1": "focal"}.items():
        assert_refused(run("depth", left, right, "--k", k, *rest[2:]), "--k", said)
    assert_refused(run("depth", left, right, "--k", K, "--baseline", "0", *rest[4:]), "--baseline")
    assert_refused(run("depth", left, right, "--k", K, "--baseline", "50000", *rest[4:]), "50000 m", "metres")
    assert_refused(run("depth", left, right, "--k", "1e9,1e9,80,48", *rest[2:]), "focal", "pixels")
    assert_refused(run("depth", left, right, *rest, "--max-disparity", "8"), "max_disparity")
    assert_refused(run("depth", left, right, *rest, "--p1", "90", "--p2", "80"), "p1")
    assert_refused(run("depth", left, right, *rest, "--census", "6x6"), "census")
    assert_refused(run("depth", left, right, *rest, "--fault", "nearest"), "remap_nearest")
    assert_refused(run("depth", left, right, *rest, "--p1", "\u00b2"), "whole number")
    assert_refused(run("depth", left, right, *rest[:4], "--out", left / "out"), "left.png")
    assert_refused(run("depth", left, right, *rest[:4], "--out", ""), "--out", "folder")
    assert not (tmp_path / "out").exists()


def test_a_preset_is_exported_without_another_sensor(run, tmp_path):
    result = run("model", "export", "D435", "--sensor", "d415", "--out", tmp_path / "out")
    assert_refused(result, "--sensor d415", "D435 is a preset: leave it out")


def test_simulate_refuses_what_is_wrong(run, table_top, tmp_path):
    out = ("--out", tmp_path / "out")
    broken = tmp_path / "broken.stl"
    broken.write_bytes(b"solid nothing")
    other = tmp_path / "scene.txt"
    other.write_text("hello")
    assert_refused(run("simulate", tmp_path / "none.gltf", *out), "none.gltf")
    assert_refused(run("simulate", table_top, "--sensor", "d999", *out), "d999", "D415", "D435")
    assert_refused(run("simulate", broken, *out), "broken.stl")
    assert_refused(run("simulate", other, *out), "scene.txt")
    assert_refused(run("simulate", table_top, "--resolution", "400x400", *out), "400x226")
    assert_refused(run("simulate", table_top, "--camera", "3", *out), "--camera 3")
    assert_refused(run("simulate", table_top, "--camera-to-world", "1,2,3", *out), "16")
    twos = ",".join(["2"] * 16)
    assert_refused(run("simulate", table_top, "--camera-to-world", twos, *out), "2, 2, 2, 2", "expected 0, 0, 0, 1")
    twice_as_large = "2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1"
    assert_refused(run("simulate", table_top, "--camera-to-world", twice_as_large, *out), "rotation")
    ones = "1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1"
    assert_refused(run("simulate", table_top, "--camera-to-world", ones, "--camera", "0", *out), "give one of them")
    assert_refused(run("simulate", table_top, "--effects", tmp_path / "mine.py", *out), "mine.py", "give --model")
    assert_refused(run("simulate", table_top, "--ir-distortion", "0.1,0.2", *out), "4 or 5 or 8")
    assert_refused(run("simulate", table_top, "--velocity", "1,2", *out), "3 or 6")
    assert_refused(run("simulate", table_top, "--velocity", "300,0,0", *out), "300", "divide mm/s by 1000")
    assert_refused(run("simulate", table_top, "--laser-power", "0.15", *out), "0.15", "multiply watts by 1000")
    assert_refused(run("simulate", table_top, "--ir-signal", "temperature_c=298", *out), "subtract 273.15 from kelvin")
    assert_refused(run("simulate", table_top, "--readout", "rows_up", *out), "--ir-line-time-s")
    assert_refused(run("simulate", table_top, "--device", "97", *out), "97")
    assert_refused(run("simulate", table_top, "--device", "best", *out), "best", "auto")
    assert_refused(run("simulate", table_top, "--spp", "0", *out), "--spp")
    assert_refused(run("simulate", table_top, "--out", table_top / "out"), "table_top.gltf")
    assert_refused(run("simulate", table_top), "--out")
    assert_refused(run("simulat", table_top, *out), "simulat")
    assert not (tmp_path / "out").exists()
