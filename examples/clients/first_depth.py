"""The first depth map through ctypes alone: NumPy only makes arrays. Usage: python3 first_depth.py [FOLDER OF THE LIBRARIES]

An infrared pair of a wall at 1.5 m and a board at 0.8 m under a dot projector, rendered by kuafu; depth by simsense, from
the memory that kuafu rendered into. The structs are those of the C headers; a field that is left out here is at the end
of its struct and takes its neutral value. Ends with 0 when both depths are right within 2 %.
"""

import ctypes as c
import math
import sys
from typing import Any

import numpy as np

u32, u64, f32, f64 = c.c_uint32, c.c_uint64, c.c_float, c.c_double
NONE = 0xFFFFFFFF
WIDTH, HEIGHT, BASELINE_M, WALL_M, BOARD_M = 320, 240, 0.05, 1.5, 0.8
CAMERA_K = (280, 0, 159.5, 0, 280, 119.5, 0, 0, 1)
MEMORY_HOST, MEMORY_OPAQUE_FD = 1, 2


def at(x: float) -> tuple[float, ...]:
    """A row-major transform that moves along x."""
    return (1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)


class Header(c.Structure):
    _fields_ = [("type", u32), ("size_bytes", u32), ("next", c.c_void_p)]


class Struct(c.Structure):
    """A struct of the interface: the header is filled in, the rest is zero but for what is given."""

    type_id = 0

    def __init__(self, **values: Any) -> None:
        super().__init__()
        if self.type_id:
            self.header.type, self.header.size_bytes = self.type_id, c.sizeof(self)
        for name, value in values.items():
            field = getattr(self, name)
            setattr(self, name, type(field)(*value) if isinstance(field, c.Array) else value)


def struct(name: str, type_id: int, *fields: tuple[str, Any]) -> type[Struct]:
    header = [("header", Header)] if type_id else []
    return type(name, (Struct,), {"_fields_": [*header, *fields], "type_id": type_id})


DeviceDesc = struct("DeviceDesc", 1, ("select", u32), ("index", u32), ("uuid", c.c_uint8 * 16), ("workers", u32),
                    ("validation", u32), ("log", c.c_void_p), ("log_user", c.c_void_p), ("cache", c.c_char_p))
DeviceInfo = struct("DeviceInfo", 2, ("name", c.c_char * 256), ("driver", c.c_char * 256), ("refused", c.c_char * 512),
                    ("device_uuid", c.c_uint8 * 16), ("driver_uuid", c.c_uint8 * 16), ("index", u32), ("kind", u32),
                    ("api_version", u32), ("usable", u32), ("capabilities", u64), ("memory_bytes", u64))
BufferCreate = struct("BufferCreate", 3, ("size_bytes", u64), ("flags", u32), ("reserved", u32))
BufferDesc = struct("BufferDesc", 4, ("memory", u32), ("memory_type_index", u32), ("handle", u64), ("allocation", u64),
                    ("offset", u64), ("size", u64), ("dedicated", u32), ("reserved", u32),
                    ("device_uuid", c.c_uint8 * 16), ("driver_uuid", c.c_uint8 * 16))
Image = struct("Image", 5, ("format", u32), ("dim_count", u32), ("shape", u64 * 5), ("byte_stride", c.c_int64 * 5),
               ("offset_bytes", u64))
Mesh = struct("Mesh", 0x1001, ("name", c.c_char_p), ("positions", c.c_void_p), ("normals", c.c_void_p),
              ("uvs", c.c_void_p), ("indices", c.c_void_p), ("slots", c.c_void_p), ("vertices", u32), ("triangles", u32))
Instance = struct("Instance", 0x1004, ("name", c.c_char_p), ("mesh", u32), ("environment", u32),
                  ("materials", c.c_void_p), ("material_count", u32), ("semantic_id", u32), ("pose", f64 * 16))
Light = struct("Light", 0x1005, ("name", c.c_char_p), ("kind", u32), ("environment", u32), ("intensity", f32 * 3),
               ("ir_intensity", f32), ("pose", f64 * 16), ("texture", u32), ("light_group", u32), ("k", f64 * 9),
               ("radius_m", f64), ("angle_rad", f64), ("inner_rad", f64), ("outer_rad", f64), ("size_m", f64 * 2),
               ("distortion", f64 * 8), ("falloff", f64), ("focus_m", f64), ("pattern_scale", f64),
               ("dots", c.c_void_p), ("dot_count", u32), ("pattern_width", u32), ("pattern_height", u32),
               ("dot_sigma_px", f32))
Environment = struct("Environment", 0x1007, ("radiance", f32 * 3), ("ir_radiance", f32), ("texture", u32),
                     ("light_group", u32), ("map_to_world", f64 * 9))
Camera = struct("Camera", 0x1006, ("width", u32), ("height", u32), ("k", f64 * 9), ("pose", f64 * 16), ("near_m", f64),
                ("far_m", f64), ("distortion", f64 * 8), ("lens_radius_m", f64), ("focus_m", f64), ("shutter", u32),
                ("readout", u32), ("exposure_s", f64), ("line_time_s", f64), ("velocity", f64 * 6),
                ("reserved", f64 * 8))
View = struct("View", 0x1008, ("camera", Camera), ("band", u32), ("environment", u32), ("film", c.c_void_p),
              ("previous_pose", f64 * 16))
Output = struct("Output", 0x1009, ("output", u32), ("scale", f32), ("buffer", c.c_void_p), ("image", Image))
Render = struct("Render", 0x100A, ("views", c.c_void_p), ("outputs", c.c_void_p), ("view_count", u32),
                ("output_count", u32), ("samples_per_pixel", u32), ("max_bounces", u32), ("seed", u64),
                ("first_sample", u32), ("ambient_scale", f32), ("ambient_radiance", f32), ("glass_surfaces", u32),
                ("progress", c.c_void_p), ("progress_user", c.c_void_p), ("light_sampling", u32), ("denoise", u32),
                ("projector", u32), ("temporal_weight", f32))
PlainCamera = struct("PlainCamera", 0, ("width", u32), ("height", u32), ("k", f64 * 9), ("distortion", f64 * 5),
                     ("reserved", f64 * 3))
Rig = struct("Rig", 0x2001, ("left", PlainCamera), ("right", PlainCamera), ("rgb", PlainCamera),
             ("left_to_right", f64 * 16), ("left_to_rgb", f64 * 16), ("rectified", u32), ("batch_count", u32))
Parameters = struct("Parameters", 0x2002, ("noise_seed", u64), ("frame_index", u64), ("census", u32 * 2),
                    ("max_disparity", u32), ("block", u32 * 2), ("p1", u32), ("p2", u32), ("uniqueness", u32),
                    ("lr_max_diff", c.c_int32), ("median_size", u32), ("subpixel", u32), ("min_depth_m", f32),
                    ("max_depth_m", f32))
BoundImage = struct("BoundImage", 0, ("buffer", c.c_void_p), ("host", c.c_void_p), ("image", Image))
DepthOutput = struct("DepthOutput", 0x2004, ("output", u32), ("reserved", u32), ("image", BoundImage))
Compute = struct("Compute", 0x2003, ("left", BoundImage), ("right", BoundImage), ("outputs", c.c_void_p),
                 ("output_count", u32), ("reserved", u32))


class Library:
    """Calls by name, raises on an error, and returns what the function writes through its last argument."""

    def __init__(self, name: str, folder: str) -> None:
        self.name, self.library = name, c.CDLL(f"{folder}/lib{name}.so.0" if folder else f"lib{name}.so.0")
        self.library[f"{name}_last_error"].restype = c.c_char_p

    def call(self, function: str, *arguments: Any) -> None:
        passed = [c.byref(a) if isinstance(a, c.Structure) else a for a in arguments]
        if self.library[f"{self.name}_{function}"](*passed) < 0:
            sys.exit(f"{function}: {self.library[f'{self.name}_last_error']().decode()}")

    def made(self, function: str, *arguments: Any, kind: Any = c.c_void_p) -> Any:
        out = kind()
        self.call(function, *arguments, c.byref(out))
        return out

    def release(self, **handles: Any) -> None:
        for kind, handle in handles.items():
            self.library[f"{self.name}_{kind}_release"](handle)


def packed(code: int, item_bytes: int, *shape: int) -> Struct:
    strides = [item_bytes * math.prod(shape[axis + 1 :]) for axis in range(len(shape))]
    return Image(format=code, dim_count=len(shape), shape=shape, byte_stride=strides)


def add_square(kuafu: Library, scene: Any, x: float, y: float, z: float, half_m: float) -> None:
    corners = [(x - half_m, y - half_m, z), (x + half_m, y - half_m, z), (x + half_m, y + half_m, z), (x - half_m, y + half_m, z)]
    positions, indices = np.array(corners, np.float32), np.array([0, 2, 1, 0, 3, 2], np.uint32)
    mesh = Mesh(positions=positions.ctypes.data, indices=indices.ctypes.data, vertices=4, triangles=2)
    number = kuafu.made("scene_add_mesh", scene, mesh, kind=u32)
    kuafu.made("scene_add_instance", scene, Instance(mesh=number.value, environment=NONE, pose=at(0)), kind=u32)


def render_pair(kuafu: Library, device: Any, pair: Any) -> None:
    scene = kuafu.made("scene_create", device)
    add_square(kuafu, scene, 0, 0, WALL_M, 3)
    add_square(kuafu, scene, 0.1, 0.05, BOARD_M, 0.2)
    dots = np.random.default_rng(0).uniform((0, 0, 6), (640, 480, 6), (6000, 3)).astype(np.float32)
    projector = Light(kind=2, environment=NONE, ir_intensity=2, pose=at(BASELINE_M / 2), texture=NONE, pattern_scale=1,
                      k=(500, 0, 319.5, 0, 500, 239.5, 0, 0, 1), outer_rad=math.pi / 4, dots=dots.ctypes.data,
                      dot_count=len(dots), pattern_width=640, pattern_height=480, dot_sigma_px=1)
    kuafu.made("scene_add_light", scene, projector, kind=u32)
    identity = (1, 0, 0, 0, 1, 0, 0, 0, 1)
    kuafu.call("scene_set_environment", scene, Environment(ir_radiance=0.02, texture=NONE, map_to_world=identity))
    views = (View * 2)()
    for eye in range(2):
        camera = Camera(width=WIDTH, height=HEIGHT, k=CAMERA_K, pose=at(eye * BASELINE_M), far_m=math.inf)
        views[eye] = View(camera=camera, band=1)
    output = Output(output=1, scale=200, buffer=pair, image=packed(6, 4, 2, HEIGHT, WIDTH, 1))
    render = Render(views=c.addressof(views), view_count=2, outputs=c.addressof(output), output_count=1, projector=NONE,
                    samples_per_pixel=16, max_bounces=8, ambient_scale=0.05, ambient_radiance=0.002, glass_surfaces=8)
    renderer = kuafu.made("renderer_create", device, None)
    kuafu.call("renderer_render", renderer, scene, render)
    kuafu.release(renderer=renderer, scene=scene)


def measure_depth_mm(simsense: Library, device: Any, pair: Any) -> np.ndarray:
    camera = PlainCamera(width=WIDTH, height=HEIGHT, k=CAMERA_K)
    rig = Rig(left=camera, right=camera, left_to_right=at(-BASELINE_M), left_to_rgb=at(0), rectified=1, batch_count=1)
    parameters = Parameters(census=(7, 7), max_disparity=64, block=(7, 7), p1=8, p2=32, uniqueness=15, lr_max_diff=1,
                            median_size=3, subpixel=2, min_depth_m=0.2, max_depth_m=10)
    engine = simsense.made("engine_create", device, rig, parameters)
    depth_mm = np.zeros((HEIGHT, WIDTH), np.uint16)
    image = BoundImage(host=depth_mm.ctypes.data, image=packed(2, 2, HEIGHT, WIDTH))
    output = DepthOutput(output=2, image=image)
    eyes = [packed(6, 4, HEIGHT, WIDTH) for _ in range(2)]
    eyes[1].offset_bytes = 4 * HEIGHT * WIDTH
    left, right = (BoundImage(buffer=pair, image=eye) for eye in eyes)
    compute = Compute(left=left, right=right, outputs=c.addressof(output), output_count=1)
    simsense.call("engine_compute", engine, compute)
    simsense.release(engine=engine)
    return depth_mm


def main() -> int:
    folder = sys.argv[1] if len(sys.argv) > 1 else ""
    kuafu, simsense = Library("kuafu", folder), Library("simsense", folder)
    device = kuafu.made("device_create", None)
    info = DeviceInfo()
    kuafu.call("device_get_info", device, info)
    host = info.kind == 1  # the device is the CPU: both libraries work on the same host memory
    rendered = kuafu.made("buffer_create", device, BufferCreate(size_bytes=8 * HEIGHT * WIDTH, flags=2 if host else 1))
    render_pair(kuafu, device, rendered)
    shared = BufferDesc()
    kuafu.call("buffer_export", rendered, u32(MEMORY_HOST if host else MEMORY_OPAQUE_FD), shared)

    depth_device = simsense.made("device_create", DeviceDesc(select=2, uuid=info.device_uuid))
    pair = simsense.made("buffer_import", depth_device, shared)
    depth_mm = measure_depth_mm(simsense, depth_device, pair)
    wall_mm, board_mm = float(depth_mm[20, 200]), float(depth_mm[130, 200])
    print(f"{info.name.decode()}: wall {wall_mm:.0f} mm, board {board_mm:.0f} mm")
    simsense.release(buffer=pair, device=depth_device)
    kuafu.release(buffer=rendered, device=device)
    return int(abs(wall_mm - 1000 * WALL_M) > 20 * WALL_M or abs(board_mm - 1000 * BOARD_M) > 20 * BOARD_M)


if __name__ == "__main__":
    sys.exit(main())
