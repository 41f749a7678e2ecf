// SPDX-License-Identifier: Apache-2.0
// The first depth map in Rust, without crates: kuafu renders the infrared pair of a scene under a dot projector, and simsense measures its
// depth. interface.rs, from PREFIX/share/activestereo, has the structs. rustc --edition 2021 -L PREFIX/lib first_depth.rs && ./first_depth wall_and_board.obj
mod interface;
use interface::*;
use std::ffi::CString;
use std::os::raw::c_void;
use std::ptr::{null, null_mut};
const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const BASELINE_M: f64 = 0.05;
const CAMERA_K: [f64; 9] = [280.0, 0.0, 159.5, 0.0, 280.0, 119.5, 0.0, 0.0, 1.0];

unsafe fn rendered_pair(scene_file: &str) -> Vec<f32> {
    let (ok, mut pair) = (|status| check(status, kuafu_last_error), vec![0f32; 2 * HEIGHT * WIDTH]);
    let (mut device, mut scene, mut renderer, mut buffer) = (null_mut(), null_mut(), null_mut(), null_mut());
    ok(kuafu_device_create(null(), &mut device));
    ok(kuafu_scene_create(device, &mut scene));
    ok(kuafu_scene_load(scene, CString::new(scene_file).unwrap().as_ptr(), null(), null()));
    let mut state = 1u64; // of Knuth's linear congruential generator, for u and v of dots in a pattern of 640x480
    let mut below = |size: u64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 32) * size >> 32) as f32
    };
    let dots: Vec<f32> = (0..6000).flat_map(|_| [below(640), below(480), 6.0]).collect();
    let mut projector: kuafu_light_desc = filled(kuafu_struct_init, KUAFU_TYPE_LIGHT_DESC);
    (projector.kind, projector.ir_intensity, projector.dot_sigma_px) = (KUAFU_LIGHT_PROJECTOR, 2.0, 1.0);
    projector.k = [500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0];
    projector.light_to_world[3] = BASELINE_M / 2.0;
    (projector.dots, projector.dot_count) = (dots.as_ptr() as *const c_void, dots.len() as u32 / 3);
    (projector.pattern_width, projector.pattern_height) = (640, 480);
    ok(kuafu_scene_add_light(scene, &projector, &mut 0));
    let mut views: [kuafu_view_desc; 2] = [filled(kuafu_struct_init, KUAFU_TYPE_VIEW_DESC); 2];
    for (side, view) in views.iter_mut().enumerate() {
        (view.band, view.camera.width, view.camera.height, view.camera.k) = (KUAFU_BAND_INFRARED, WIDTH as u32, HEIGHT as u32, CAMERA_K);
        view.camera.camera_to_world[3] = side as f64 * BASELINE_M;
    }
    let mut create: ks_buffer_create_desc = filled(kuafu_struct_init, KS_TYPE_BUFFER_CREATE_DESC);
    (create.size_bytes, create.flags) = (4 * pair.len() as u64, KS_BUFFER_HOST_VISIBLE);
    ok(kuafu_buffer_create(device, &create, &mut buffer));
    let mut output: kuafu_output_desc = filled(kuafu_struct_init, KUAFU_TYPE_OUTPUT_DESC);
    (output.output, output.buffer, output.scale) = (KUAFU_OUTPUT_RADIANCE, buffer, 200.0);
    output.image = packed_image(KS_FORMAT_F32, 4, &[2, HEIGHT, WIDTH, 1]);
    let mut render: kuafu_render_desc = filled(kuafu_struct_init, KUAFU_TYPE_RENDER_DESC);
    (render.views, render.view_count, render.output_count) = (views.as_ptr() as *const c_void, 2, 1);
    render.outputs = &output as *const _ as *const c_void;
    ok(kuafu_renderer_create(device, null(), &mut renderer));
    ok(kuafu_renderer_render(renderer, scene, &render));
    ok(kuafu_buffer_read(buffer, 0, pair.as_mut_ptr() as *mut c_void, create.size_bytes));
    (kuafu_renderer_release(renderer), kuafu_buffer_release(buffer), kuafu_scene_release(scene), kuafu_device_release(device));
    pair
}

unsafe fn measured_depth_m(pair: &mut [f32]) -> Vec<f32> {
    let ok = |status| check(status, simsense_last_error);
    let (mut device, mut engine, mut depth_m) = (null_mut(), null_mut(), vec![0f32; HEIGHT * WIDTH]);
    let mut rig: simsense_rig_desc = filled(simsense_struct_init, SIMSENSE_TYPE_RIG_DESC);
    (rig.left.width, rig.left.height, rig.left.k, rig.rectified) = (WIDTH as u32, HEIGHT as u32, CAMERA_K, 1);
    (rig.right, rig.left_to_right[3]) = (rig.left, -BASELINE_M);
    let parameters: simsense_parameters = filled(simsense_struct_init, SIMSENSE_TYPE_PARAMETERS);
    ok(simsense_device_create(null(), &mut device));
    ok(simsense_engine_create(device, &rig, &parameters, &mut engine));
    let image = packed_image(KS_FORMAT_F32, 4, &[HEIGHT, WIDTH]);
    let host = |pixels: &mut [f32]| simsense_image { buffer: null_mut(), host: pixels.as_mut_ptr() as *mut c_void, image };
    let mut output: simsense_output_desc = filled(simsense_struct_init, SIMSENSE_TYPE_OUTPUT_DESC);
    (output.output, output.image) = (SIMSENSE_OUTPUT_DEPTH, host(&mut depth_m));
    let mut compute: simsense_compute_desc = filled(simsense_struct_init, SIMSENSE_TYPE_COMPUTE_DESC);
    let (left, right) = pair.split_at_mut(HEIGHT * WIDTH);
    (compute.left, compute.right, compute.output_count) = (host(left), host(right), 1);
    compute.outputs = &output as *const _ as *const c_void;
    ok(simsense_engine_compute(engine, &compute));
    (simsense_engine_release(engine), simsense_device_release(device));
    depth_m
}

fn main() {
    let file = std::env::args().nth(1).unwrap_or("wall_and_board.obj".into());
    let depth_m = unsafe { measured_depth_m(&mut rendered_pair(&file)) };
    println!("wall {:.2} m, board {:.2} m", depth_m[20 * WIDTH + 200], depth_m[130 * WIDTH + 200]);
}
