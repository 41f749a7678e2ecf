# SPDX-License-Identifier: Apache-2.0
"""The first depth map by ctypes: kuafu renders the infrared pair of a scene under a projector, simsense measures its
depth.

Usage: python3 first_depth.py [SCENE]. Needs interface.py, from PREFIX/share/activestereo of an
installation, and nothing but Python.
"""

import ctypes as c
import random
import sys
from typing import Any

import interface as ks

WIDTH, HEIGHT, BASELINE_M = 320, 240, 0.05
CAMERA_K, PROJECTOR_K = (280, 0, 159.5, 0, 280, 119.5, 0, 0, 1), (500, 0, 319.5, 0, 500, 239.5, 0, 0, 1)
Side = c.c_float * WIDTH * HEIGHT


def add_projector(kuafu: ks.Library, scene: Any) -> None:
    dots, dice = (c.c_float * 3 * 6000)(), random.Random(1)
    for dot in dots:  # u, v and brightness of each, in a pattern of 640x480
        dot[:] = dice.uniform(0, 640), dice.uniform(0, 480), 6
    projector = kuafu.struct(ks.kuafu_light_desc, kind=ks.KUAFU_LIGHT_PROJECTOR, ir_intensity=2, k=PROJECTOR_K)
    projector.light_to_world[3] = BASELINE_M / 2
    projector.dots, projector.dot_count, projector.dot_sigma_px = c.addressof(dots), len(dots), 1
    projector.pattern_width, projector.pattern_height = 640, 480
    kuafu.make("kuafu_scene_add_light", scene, projector, kind=c.c_uint32)


def view_of_side(kuafu: ks.Library, side: int) -> Any:
    camera = kuafu.struct(ks.kuafu_camera_desc, width=WIDTH, height=HEIGHT, k=CAMERA_K)
    camera.camera_to_world[3] = side * BASELINE_M
    return kuafu.struct(ks.kuafu_view_desc, camera=camera, band=ks.KUAFU_BAND_INFRARED)


def rendered_pair(kuafu: ks.Library, scene_file: str) -> Any:
    """Two cameras of floats, in counts."""
    device = kuafu.make("kuafu_device_create", None)
    scene = kuafu.make("kuafu_scene_create", device)
    kuafu.call("kuafu_scene_load", scene, scene_file.encode(), None, None)
    add_projector(kuafu, scene)
    pair, views = (Side * 2)(), (ks.kuafu_view_desc * 2)(*(view_of_side(kuafu, side) for side in range(2)))
    create = kuafu.struct(ks.ks_buffer_create_desc, size_bytes=c.sizeof(pair), flags=ks.KS_BUFFER_HOST_VISIBLE)
    buffer = kuafu.make("kuafu_buffer_create", device, create)
    output = kuafu.struct(ks.kuafu_output_desc, output=ks.KUAFU_OUTPUT_RADIANCE, buffer=buffer, scale=200)
    output.image = kuafu.packed_image(ks.KS_FORMAT_F32, 4, (2, HEIGHT, WIDTH, 1))
    render = kuafu.struct(ks.kuafu_render_desc, view_count=2, output_count=1)
    render.views, render.outputs = c.addressof(views), c.addressof(output)
    renderer = kuafu.make("kuafu_renderer_create", device, None)
    kuafu.call("kuafu_renderer_render", renderer, scene, render)
    kuafu.call("kuafu_buffer_read", buffer, c.c_uint64(0), pair, c.c_uint64(c.sizeof(pair)))
    kuafu.release(renderer=renderer, buffer=buffer, scene=scene, device=device)
    return pair


def measured_depth_m(simsense: ks.Library, pair: Any) -> Any:
    """Metres of each pixel of the left camera, 0 where nothing was measured."""
    depth_m = Side()
    rig = simsense.struct(ks.simsense_rig_desc, rectified=1)
    rig.left = rig.right = ks.simsense_camera(width=WIDTH, height=HEIGHT, k=CAMERA_K)
    rig.left_to_right[3] = -BASELINE_M
    device = simsense.make("simsense_device_create", None)
    engine = simsense.make("simsense_engine_create", device, rig, simsense.struct(ks.simsense_parameters))
    image = simsense.packed_image(ks.KS_FORMAT_F32, 4, (HEIGHT, WIDTH))
    left, right, depth = (ks.simsense_image(host=c.addressof(side), image=image) for side in (*pair, depth_m))
    output = simsense.struct(ks.simsense_output_desc, output=ks.SIMSENSE_OUTPUT_DEPTH, image=depth)
    compute = simsense.struct(ks.simsense_compute_desc, left=left, right=right, output_count=1)
    compute.outputs = c.addressof(output)
    simsense.call("simsense_engine_compute", engine, compute)
    simsense.release(engine=engine, device=device)
    return depth_m


if __name__ == "__main__":
    pair = rendered_pair(ks.Library("kuafu"), sys.argv[1] if len(sys.argv) > 1 else "wall_and_board.obj")
    depth_m = measured_depth_m(ks.Library("simsense"), pair)
    print(f"wall {depth_m[20][200]:.2f} m, board {depth_m[130][200]:.2f} m")
