# SPDX-License-Identifier: Apache-2.0
"""Things fall on a floor in a simulator, whose own renderer sees them, and an active stereo camera measures its images:

PYTHONPATH=build/python python3 examples/gbuffers/play.py newton mujoco_warp mujoco genesis --out out/gbuffers.png
"""

import argparse
import os
import sys
from pathlib import Path

import kuafu
import numpy as np

from activestereo import GBufferStereo, StereoDepthSensorConfig
from activestereo.common.pose import look_at
from activestereo.integrations.gbuffers.pinhole import centred, vertical_fov_deg
from activestereo.report.pictures import labelled_figure
from activestereo.report.lettering import write_figure

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo's own default needs a display
CONFIG = centred(StereoDepthSensorConfig("D435").resized(212, 120, fov=60))
EYE, TARGET = np.array([-0.6, 0.0, 0.45]), np.array([0.05, 0.0, 0.03])
NEAR_FAR_M = (0.4, 1.6)
CAMERA_TO_WORLD = look_at(EYE, TARGET, np.array([0.0, 0.0, 1.0]))  # x right, y down, z forward
BALL_M, BOX_M, FALLS_S = 0.07, (0.06, 0.09, 0.05), 0.25
BALL_AT, BOX_AT = (0.0, 0.1, 0.3), (0.05, -0.12, 0.25)
GREY, BLUE, SAND = (0.5, 0.5, 0.5), (0.3, 0.5, 0.8), (0.8, 0.6, 0.4)


def newton():
    import newton
    import warp as wp

    from activestereo.integrations.gbuffers.newton import NewtonGBuffers

    world = newton.ModelBuilder()
    world.add_shape_sphere(world.add_body(xform=wp.transform(BALL_AT, wp.quat_identity())), radius=BALL_M, color=BLUE)
    half = dict(zip(("hx", "hy", "hz"), BOX_M, strict=True))
    world.add_shape_box(world.add_body(xform=wp.transform(BOX_AT, wp.quat_identity())), **half, color=SAND)
    builder = newton.ModelBuilder()
    builder.add_world(world)
    builder.add_ground_plane(color=GREY)
    model = builder.finalize()
    solver, state, following, control = newton.solvers.SolverXPBD(model), model.state(), model.state(), model.control()
    pipeline = newton.CollisionPipeline(model)
    contacts = pipeline.contacts()
    for _ in range(round(FALLS_S / 0.002)):
        state.clear_forces()
        pipeline.collide(state, contacts)
        solver.step(state, following, control, contacts, 0.002)
        state, following = following, state
    turn = wp.quat_from_matrix(wp.mat33(*(CAMERA_TO_WORLD[:3, :3] * [1, -1, -1]).ravel()))
    at = wp.array([wp.transform(EYE, turn)], dtype=wp.transformf)
    sensor = GBufferStereo(CONFIG)
    return sensor, NewtonGBuffers(model, sensor)(state, at)


def falling():
    """A MuJoCo model."""
    import mujoco

    right, down = CAMERA_TO_WORLD[:3, 0], CAMERA_TO_WORLD[:3, 1]

    def text(*values):
        return " ".join(f"{value:g}" for value in values)

    return mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="0.002"/><worldbody>
      <camera pos="{text(*EYE)}" xyaxes="{text(*right, *-down)}"/>
      <geom type="plane" size="5 5 1" rgba="{text(*GREY, 1)}"/>
      <body pos="{text(*BALL_AT)}"><freejoint/><geom type="sphere" size="{BALL_M}" rgba="{text(*BLUE, 1)}"/></body>
      <body pos="{text(*BOX_AT)}"><freejoint/><geom type="box" size="{text(*BOX_M)}" rgba="{text(*SAND, 1)}"/></body>
    </worldbody></mujoco>""")


def mujoco():
    import mujoco

    from activestereo.integrations.gbuffers.mujoco import MujocoGBuffers, geom_materials, set_camera

    model = falling()
    sensor, state = GBufferStereo(CONFIG, materials=geom_materials(model)), mujoco.MjData(model)
    set_camera(model, 0, sensor)
    mujoco.mj_step(model, state, round(FALLS_S / model.opt.timestep))
    mujoco.mj_forward(model, state)
    return sensor, MujocoGBuffers(model, sensor)(state)


def mujoco_warp():
    import mujoco
    import mujoco_warp as mjw

    from activestereo.integrations.gbuffers.mujoco import geom_materials, set_camera
    from activestereo.integrations.gbuffers.mujoco_warp import MujocoWarpGBuffers

    model, worlds = falling(), 4
    sensor = GBufferStereo(CONFIG, environments=worlds, materials=geom_materials(model))
    set_camera(model, 0, sensor)
    on_device, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=worlds)
    for _ in range(round(FALLS_S / model.opt.timestep)):
        mjw.step(on_device, data)
    context = mjw.create_render_context(model, nworld=worlds, render_rgb=False, render_depth=True, render_seg=True)
    return sensor, MujocoWarpGBuffers(context, sensor)(on_device, data)


def genesis():
    import genesis as gs

    from activestereo.integrations.gbuffers.genesis import genesis_gbuffers

    gs.init(backend=gs.cpu, logging_level="error")
    scene = gs.Scene(show_viewer=False, sim_options=gs.options.SimOptions(dt=0.01))
    for morph in (
        gs.morphs.Plane(),
        gs.morphs.Sphere(pos=BALL_AT, radius=BALL_M),
        gs.morphs.Box(pos=BOX_AT, size=tuple(2 * side for side in BOX_M)),
    ):
        scene.add_entity(morph)
    paints = {n: kuafu.Material(base_color=(*color, 1.0)) for n, color in enumerate((GREY, BLUE, SAND), 1)}
    sensor = GBufferStereo(CONFIG, materials=paints)
    size = sensor.shape[:0:-1]
    camera = scene.add_camera(res=size, pos=EYE, lookat=TARGET, fov=vertical_fov_deg(sensor), GUI=False)
    scene.build()
    for _ in range(round(FALLS_S / 0.01)):
        scene.step()
    return sensor, genesis_gbuffers(camera)


def run(name):
    """(the left infrared image, the simulator's depth and the measured one, the share that has depth)."""
    sensor, images = globals()[name]()
    found = sensor(**images)
    clean = np.asarray(images["depth"]).reshape(-1, *sensor.shape[1:])[0]
    pictures = [
        (f"{name}: infrared, left", found["ir_left"][0] / 255.0, None),
        ("the simulator's depth", clean, NEAR_FAR_M),
        ("depth that the D435 measures", found["depth"][0], NEAR_FAR_M),
    ]
    return pictures, float(found["valid"].mean())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulators", nargs="+", choices=("newton", "mujoco_warp", "mujoco", "genesis"))
    parser.add_argument("--out", type=Path, default=Path("out/gbuffers.png"))
    options, pictures = parser.parse_args(), []
    for simulator in options.simulators:
        try:
            row, share = run(simulator)
        except ModuleNotFoundError as error:
            sys.exit(f"{simulator}: this example needs the package {error.name}")
        pictures += row
        print(f"{simulator}: {100 * share:.1f} % measured")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_figure(options.out, labelled_figure(pictures, columns=3))
