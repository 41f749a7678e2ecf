# SPDX-License-Identifier: Apache-2.0
"""A depth camera on a robot's wrist in MuJoCo: things fall onto a table, the camera looks on.

    PYTHONPATH=build/python python3 examples/mujoco_wrist/mujoco_wrist.py --out out/mujoco_wrist

Needs the package mujoco (pip install mujoco). No renderer of MuJoCo's is used.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

try:
    import mujoco
except ImportError:
    sys.exit("this example needs the package mujoco: pip install mujoco")

from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.integrations.mujoco import MujocoScene
from activestereo.report.pictures import labelled_figure
from activestereo.report.lettering import write_figure

NEAR_FAR_M = 0.5, 1.3
TABLE = """<mujoco>
<asset>
  <texture name="wood" type="2d" builtin="checker" rgb1=".62 .45 .30" rgb2=".52 .36 .23" width="64" height="64"/>
  <material name="wood" texture="wood" texrepeat="6 6" specular=".3"/>
  <material name="steel" rgba=".66 .64 .61 1" metallic="1" roughness=".25"/>
</asset>
<worldbody>
  <light pos=".4 .5 1.6" dir="-.2 -.25 -1"/>
  <geom name="table" type="box" size=".6 .6 .02" pos="0 0 -.02" material="wood"/>
  <body name="ball" pos=".05 .1 .3"><freejoint/>
    <geom name="ball" type="sphere" size=".05" material="steel" density="3000"/></body>
  <body name="can" pos="-.12 -.1 .25"><freejoint/>
    <geom name="can" type="cylinder" size=".035 .05" rgba=".2 .6 .3 1"/></body>
  <body name="pill" pos="-.1 .12 .35" euler="70 0 0"><freejoint/>
    <geom name="pill" type="capsule" size=".025 .05" rgba=".8 .7 .3 1"/></body>
  BOXES
  <body name="wrist" pos="-.6 0 .5"><camera name="wrist" xyaxes="0 -1 0 .64 0 .77"/></body>
</worldbody></mujoco>"""
BOX = """<body name="box {i}" pos="{x} {y} {z}" euler="{a} {b} 0"><freejoint/>
    <geom name="box {i}" type="box" size="{s}" rgba="{c} 1"/></body>"""
STEPS_PER_PICTURE = 20


def make_model(seed: int) -> mujoco.MjModel:
    random = np.random.Generator(np.random.PCG64(seed))
    boxes = "".join(
        BOX.format(
            i=i, x=random.uniform(-0.15, 0.15), y=random.uniform(-0.15, 0.15), z=0.15 + 0.11 * i,
            a=random.uniform(0, 90), b=random.uniform(0, 90),
            s=" ".join(f"{v:.3f}" for v in random.uniform(0.02, 0.05, 3)),
            c=" ".join(f"{v:.2f}" for v in random.uniform(0.2, 0.9, 3)),
        )
        for i in range(6)
    )  # fmt: skip
    return mujoco.MjModel.from_xml_string(TABLE.replace("BOXES", boxes))


def run(out: Path, pictures: int, scale: float, samples: int) -> float:
    """Writes last.png; returns the share of measured pixels of the last picture within 2 % of the truth."""
    model = make_model(seed=1)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    world = MujocoScene(model, data)
    config = StereoDepthSensorConfig("D435").scaled(scale)
    config.samples_per_pixel = samples
    sensor = StereoDepthSensor(config, world.mount("wrist"))
    for k in range(pictures):
        mujoco.mj_step(model, data, nstep=STEPS_PER_PICTURE)
        moved = world.update()
        sensor.take_picture(infrared_only=k + 1 < pictures)
        sensor.compute_depth()
        print(f"picture {k + 1} of {pictures}: {moved} things moved")
    depth, truth = sensor.get_depth(), sensor.get_true_depth()
    measured = (depth > 0) & (truth > 0)
    good = np.abs(depth - truth)[measured] < 0.02 * truth[measured]
    print(f"{100 * measured.mean():.1f} % measured, {100 * good.mean():.1f} % of that within 2 % of the true depth")
    out.mkdir(parents=True, exist_ok=True)
    pictures = [
        ("colour", sensor.get_rgb(), None),
        ("left infrared camera", sensor.get_ir()[0], None),
        ("depth that the D435 measures", depth, NEAR_FAR_M),
        ("true depth", truth, NEAR_FAR_M),
    ]
    write_figure(out / "mujoco_wrist.png", labelled_figure(pictures, columns=2))
    return float(good.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/mujoco_wrist"), help="folder of the picture")
    parser.add_argument("--pictures", type=int, default=10, help="how many pictures are taken")
    parser.add_argument("--scale", type=float, default=0.5, help="size of the images, of a D435's")
    parser.add_argument("--samples", type=int, default=16, help="samples per pixel")
    options = parser.parse_args()
    run(options.out, options.pictures, options.scale, options.samples)


if __name__ == "__main__":
    main()
