# SPDX-License-Identifier: Apache-2.0
"""For tests/wheel.sh, in a clean environment: a D435 in front of the table-top, and the libraries' origin."""

import sys
from importlib.metadata import version
from pathlib import Path

import activestereo
import kuafu
import numpy as np
import simsense
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.common.pose import body_pose
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD, write_table_top

write_table_top("table_top.gltf")
config = StereoDepthSensorConfig("D435").scaled(0.5)
config.samples_per_pixel = 2
sensor = StereoDepthSensor(config, "table_top.gltf", pose=body_pose(CAMERA_TO_WORLD))
sensor.take_picture()
sensor.compute_depth()
depth_m, truth_m = sensor.get_depth(), sensor.get_true_depth()
valid = (depth_m > 0) & (truth_m > 0)
error_mm = 1000 * np.median(np.abs(depth_m - truth_m)[valid])
# The same memory by DLPack, both ways.
image = kuafu.Buffer(kuafu.Device("cpu"), 4096).image("float32", (4, 4))
image.array()[1, 2] = 7
array = np.zeros((4, 4), np.float32)
simsense.Image.from_dlpack(simsense.Device("host"), array).array()[3, 3] = 5
if np.from_dlpack(image)[1, 2] != 7 or array[3, 3] != 5:
    sys.exit("what crosses by DLPack is not the same memory")
loaded = {line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if ".so" in line}
# Embree and TBB are among them unless Embree is linked into libkuafu.
ours = [
    path
    for path in loaded
    if any(name in path for name in ("libkuafu", "libsimsense", "libembree3", "libtbb.", "libhwy"))
]
outside = [path for path in ours if not path.startswith(sys.prefix)]
print(
    f"NumPy {np.__version__}: {100 * valid.mean():.0f} % measured, median error {error_mm:.1f} mm, {len(ours)} "
    f"of our libraries loaded"
)
if activestereo.__version__ != version("activestereo"):
    sys.exit(f"the libraries are {activestereo.__version__}, the wheel is {version('activestereo')}")
if outside or len(ours) < 3 or not valid.mean() > 0.5 or not error_mm < 20:
    sys.exit(f"wrong: {outside} from outside the environment, {sorted(ours)}")
