// The first depth map in Rust, without crates: simsense matches a made pair whose right image is the left one shifted by 16 pixels, on the CPU.
// Usage: first_depth. Ends with 0 when the depth is f * baseline / 16 within 2 % nearly everywhere.
use std::ffi::{c_char, c_void, CStr};
use std::mem::{size_of, zeroed};
use std::ptr::{null, null_mut};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const SHIFT_PX: usize = 16;
const FOCAL_PX: f64 = 280.0;
const BASELINE_M: f64 = 0.05;

type Handle = *mut c_void;

#[repr(C)]
#[derive(Clone, Copy)]
struct Header {
    kind: u32,
    size_bytes: u32,
    next: *const Header,
}

#[repr(C)]
struct DeviceDesc {
    header: Header,
    select: u32,
    index: u32,
    uuid: [u8; 16],
    worker_count: u32,
    validation: u32,
    log: *const c_void,
    log_user: *const c_void,
    cache_directory: *const c_char,
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Camera {
    width: u32,
    height: u32,
    k: [f64; 9],
    distortion: [f64; 5],
    reserved: [f64; 3],
}

// The fields that follow in the header's structs are left out of these: they take their neutral values.
#[repr(C)]
struct Rig {
    header: Header,
    left: Camera,
    right: Camera,
    rgb: Camera,
    left_to_right: [f64; 16],
    left_to_rgb: [f64; 16],
    rectified: u32,
    batch_count: u32,
}

#[repr(C)]
struct Parameters {
    header: Header,
    noise_seed: u64,
    frame_index: u64,
    census: [u32; 2],
    max_disparity: u32,
    block: [u32; 2],
    p1: u32,
    p2: u32,
    uniqueness_ratio: u32,
    lr_max_diff: i32,
    median_size: u32,
    subpixel: u32,
    min_depth_m: f32,
    max_depth_m: f32,
}

#[repr(C)]
#[derive(Clone, Copy)]
struct ImageDesc {
    header: Header,
    format: u32,
    dim_count: u32,
    shape: [u64; 5],
    byte_stride: [i64; 5],
    offset_bytes: u64,
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Image {
    buffer: Handle,
    host: *mut c_void,
    image: ImageDesc,
}

#[repr(C)]
struct Output {
    header: Header,
    output: u32,
    reserved: u32,
    image: Image,
}

#[repr(C)]
struct Compute {
    header: Header,
    left: Image,
    right: Image,
    outputs: *const Output,
    output_count: u32,
    reserved: u32,
}

#[link(name = "simsense")]
extern "C" {
    fn simsense_last_error() -> *const c_char;
    fn simsense_device_create(desc: *const DeviceDesc, out: *mut Handle) -> i32;
    fn simsense_device_release(device: Handle);
    fn simsense_engine_create(device: Handle, rig: *const Rig, parameters: *const Parameters, out: *mut Handle) -> i32;
    fn simsense_engine_compute(engine: Handle, compute: *const Compute) -> i32;
    fn simsense_engine_release(engine: Handle);
}

/// A zeroed struct with its header filled in. Sound for the structs above: zero is a value of every field.
unsafe fn new<T>(kind: u32) -> T {
    let mut out: T = zeroed();
    let header = Header { kind, size_bytes: size_of::<T>() as u32, next: null() };
    (&mut out as *mut T as *mut Header).write(header);
    out
}

fn check(status: i32) {
    if status < 0 {
        let text = unsafe { CStr::from_ptr(simsense_last_error()) };
        eprintln!("simsense: {}", text.to_string_lossy());
        std::process::exit(1);
    }
}

/// A packed [height][width] image in host memory.
unsafe fn host_image<T>(pixels: &mut [T], format: u32) -> Image {
    let mut image: ImageDesc = new(5);
    let item = size_of::<T>();
    image.format = format;
    image.dim_count = 2;
    image.shape[..2].copy_from_slice(&[HEIGHT as u64, WIDTH as u64]);
    image.byte_stride[..2].copy_from_slice(&[(WIDTH * item) as i64, item as i64]);
    Image { buffer: null_mut(), host: pixels.as_mut_ptr() as *mut c_void, image }
}

fn pair() -> (Vec<u8>, Vec<u8>) {
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(1664525).wrapping_add(1013904223);
        (state >> 24) as u8
    };
    let left: Vec<u8> = (0..WIDTH * HEIGHT).map(|_| noise()).collect();
    let right = (0..WIDTH * HEIGHT).map(|i| if i % WIDTH + SHIFT_PX < WIDTH { left[i + SHIFT_PX] } else { 0 }).collect();
    (left, right)
}

fn main() {
    let (mut left, mut right) = pair();
    let mut depth_m = vec![0f32; WIDTH * HEIGHT];
    let k = [FOCAL_PX, 0.0, 159.5, 0.0, FOCAL_PX, 119.5, 0.0, 0.0, 1.0];
    let camera = Camera { width: WIDTH as u32, height: HEIGHT as u32, k, distortion: [0.0; 5], reserved: [0.0; 3] };
    unsafe {
        let mut choice: DeviceDesc = new(1);
        choice.select = 3; // the host
        let mut device = null_mut();
        check(simsense_device_create(&choice, &mut device));

        let mut rig: Rig = new(0x2001);
        rig.left = camera;
        rig.right = camera;
        for axis in 0..4 {
            rig.left_to_right[5 * axis] = 1.0;
            rig.left_to_rgb[5 * axis] = 1.0;
        }
        rig.left_to_right[3] = -BASELINE_M;
        rig.rectified = 1;
        rig.batch_count = 1;
        let mut parameters: Parameters = new(0x2002);
        parameters.census = [7, 7];
        parameters.max_disparity = 64;
        parameters.block = [7, 7];
        (parameters.p1, parameters.p2) = (8, 32);
        parameters.uniqueness_ratio = 15;
        parameters.lr_max_diff = 1;
        parameters.median_size = 3;
        (parameters.min_depth_m, parameters.max_depth_m) = (0.1, 10.0);
        let mut engine = null_mut();
        check(simsense_engine_create(device, &rig, &parameters, &mut engine));

        let mut output: Output = new(0x2004);
        output.output = 2; // depth
        output.image = host_image(&mut depth_m, 6);
        let mut compute: Compute = new(0x2003);
        compute.left = host_image(&mut left, 1);
        compute.right = host_image(&mut right, 1);
        compute.outputs = &output;
        compute.output_count = 1;
        check(simsense_engine_compute(engine, &compute));
        simsense_engine_release(engine);
        simsense_device_release(device);
    }
    let truth = (FOCAL_PX * BASELINE_M / SHIFT_PX as f64) as f32;
    let right_ones = depth_m.iter().filter(|&&z| (z - truth).abs() < 0.02 * truth).count();
    let share = right_ones as f64 / (WIDTH * HEIGHT) as f64;
    println!("depth of {:.1} % of the pixels is {truth} m within 2 %", 100.0 * share);
    std::process::exit(if share > 0.8 { 0 } else { 1 });
}
