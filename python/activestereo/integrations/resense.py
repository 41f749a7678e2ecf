# SPDX-License-Identifier: Apache-2.0
"""Replays the MuJoCo states of stored demonstrations and takes a depth sensor's pictures of them.

A file is in robosuite's layout, which LIBERO and robomimic have too (robosuite, "Human Demonstrations"): a group
data/NAME for each demonstration, with the model's MJCF as the attribute model_file, and states [T, 1 + nq + nv or
more]: time, positions, velocities. Needs mujoco and h5py (pip install mujoco h5py), not robosuite.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.input_files import checked_file
from activestereo.common.output_files import write_depth_png, write_png
from activestereo.common.progress_bar import Progress
from activestereo.sensor.sensor import StereoDepthSensor


@dataclass(frozen=True)
class Demo:
    name: str
    mjcf: str
    states: NDArray[np.float64]


def packages() -> tuple[Any, Any]:
    """Imports and returns the modules mujoco and h5py. Raises ImportError if one is missing."""
    import h5py
    import mujoco

    return mujoco, h5py


def read_demos(path: str | Path) -> Iterator[Demo]:
    """Reads the demonstrations of an HDF5 file one by one. Raises ValueError if a part of robosuite's layout is
    absent."""
    _, h5py = packages()
    try:
        file = h5py.File(checked_file(path), "r")
    except OSError as error:
        raise ValueError(f"{path}: is no HDF5 file: {error}") from error
    with file:
        if "data" not in file or not len(file["data"]):
            raise ValueError(f"{path}: has no demonstrations: expected groups data/NAME, found {list(file)[:5]}")
        for name, group in file["data"].items():
            if "states" not in group or "model_file" not in group.attrs:
                raise ValueError(f"{path}: data/{name}: has no states, or no attribute model_file")
            yield Demo(name, str(group.attrs["model_file"]), np.asarray(group["states"], np.float64))


def resense(
    demo: Demo, config: StereoDepthSensorConfig, out: Path, camera: str | None = None, every: int = 1,
    device: str | int = "auto", progress: Progress | None = None,
) -> int:  # fmt: skip
    """Takes a picture of every `every`-th state from the model's camera (None: the first). Writes into the folders
    `out`/KIND, as PNG files named by the state's number: depth and depth_true (uint16 millimetres in the RGB camera),
    ir_left and ir_right (as measured), and cause (uint8 of the left infrared camera, an index into
    sensor.gbuffer.cause.CAUSES). Returns the number of pictures. Raises ValueError for a model that MuJoCo cannot load,
    and for states of a wrong size or with non-finite values."""
    from activestereo.integrations.mujoco import MujocoScene

    mujoco, _ = packages()
    try:
        model = mujoco.MjModel.from_xml_string(demo.mjcf)
    except ValueError as error:
        raise ValueError(f"{demo.name}: MuJoCo cannot load its model: {error}") from error
    least = 1 + model.nq + model.nv
    if demo.states.ndim != 2 or demo.states.shape[1] < least:
        raise ValueError(f"{demo.name}: states are {demo.states.shape}, expected [T, {least} or more]")
    broken = np.flatnonzero(~np.isfinite(demo.states).all(axis=1))
    if broken.size:
        raise ValueError(f"{demo.name}: state {broken[0]} has values that are no numbers")
    if camera is None and not model.ncam:
        raise ValueError(f"{demo.name}: its model has no camera")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # robosuite puts visual geoms into group 1 and collision geoms into group 0.
    groups = (1, 2) if (model.geom_group == 1).any() else (0, 1, 2)
    world = MujocoScene(model, data, groups, device)
    numbers = range(0, len(demo.states), every)
    for kind in ("depth", "depth_true", "ir_left", "ir_right", "cause"):
        (out / kind).mkdir(parents=True, exist_ok=True)
    with StereoDepthSensor(config, world.mount(camera or model.camera(0).name)) as sensor:
        for done, number in enumerate(numbers, 1):
            state = demo.states[number]
            data.time, data.qpos[:], data.qvel[:] = state[0], state[1 : 1 + model.nq], state[1 + model.nq : least]
            mujoco.mj_forward(model, data)
            world.update()
            sensor.take_picture()
            sensor.compute_depth()
            name = f"{number:06d}.png"
            write_depth_png(out / "depth" / name, sensor.get_depth())
            write_depth_png(out / "depth_true" / name, sensor.get_true_depth())
            for side, image in zip(("left", "right"), sensor.get_ir_measured(), strict=True):
                write_png(out / f"ir_{side}" / name, image)
            write_png(out / "cause" / name, sensor.get_depth_map("cause"))
            if progress is not None:
                progress(done / len(numbers))
    return len(numbers)
