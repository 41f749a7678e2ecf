from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

__version__: str

class Error(RuntimeError):
    status: int

class ArgumentError(Error, ValueError): ...
class FileError(Error, OSError): ...
class MissingFileError(FileError, FileNotFoundError): ...
class NoDeviceError(Error): ...
class CancelledError(Error): ...

class DeviceInfo:
    @property
    def name(self) -> str: ...
    @property
    def driver(self) -> str: ...
    @property
    def refused(self) -> str: ...
    @property
    def device_uuid(self) -> bytes: ...
    @property
    def driver_uuid(self) -> bytes: ...
    @property
    def index(self) -> int: ...
    @property
    def kind(self) -> Literal["host", "cpu", "integrated gpu", "discrete gpu", "virtual gpu", "other"]: ...
    @property
    def api_version(self) -> str: ...
    @property
    def usable(self) -> bool: ...
    @property
    def capabilities(self) -> list[str]: ...
    @property
    def memory_bytes(self) -> int: ...

class Device:
    def __init__(
        self,
        select: str | int | bytes = "auto",
        *,
        worker_count: int = 0,
        validation: bool = False,
        log: Callable[[int, str], object] | None = None,
        cache_directory: str | None = None,
    ) -> None: ...
    @staticmethod
    def enumerate() -> list[DeviceInfo]: ...
    @property
    def info(self) -> DeviceInfo: ...
    @property
    def copied_bytes(self) -> int: ...
    @property
    def allocated_bytes(self) -> int: ...

class BufferDesc:
    @property
    def memory(self) -> Literal["host", "opaque_fd"]: ...
    @property
    def memory_type_index(self) -> int: ...
    @property
    def handle(self) -> int: ...
    @property
    def allocation_bytes(self) -> int: ...
    @property
    def offset_bytes(self) -> int: ...
    @property
    def size_bytes(self) -> int: ...
    @property
    def dedicated(self) -> bool: ...
    @property
    def device_uuid(self) -> bytes: ...
    @property
    def driver_uuid(self) -> bytes: ...
    def close(self) -> None: ...
    def __enter__(self) -> BufferDesc: ...
    def __exit__(self, *args: object) -> None: ...

class Buffer:
    def __init__(self, device: Device, size_bytes: int, *, exportable: bool = False, host_visible: bool = True) -> None: ...
    @staticmethod
    def import_(device: Device, desc: Any) -> Buffer: ...
    @property
    def size_bytes(self) -> int: ...
    def export(self, memory: Literal["host", "opaque_fd"] = "opaque_fd") -> BufferDesc: ...
    def write(self, data: ArrayLike | bytes, offset_bytes: int = 0) -> None: ...
    def read(self, size_bytes: int | None = None, offset_bytes: int = 0) -> NDArray[np.uint8]: ...
    def image(self, dtype: DTypeLike, shape: Sequence[int], offset_bytes: int = 0) -> Image: ...

class Image:
    @property
    def buffer(self) -> Buffer: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def dtype(self) -> np.dtype[Any]: ...
    @property
    def offset_bytes(self) -> int: ...
    def array(self) -> NDArray[Any]: ...

class Material:
    name: str
    base_color: tuple[float, float, float, float]
    metallic: float
    roughness: float
    specular: float
    ior: float
    transmission: float
    emission: tuple[float, float, float]
    ir_albedo: float | None
    ir_emission: float
    base_color_texture: int | None
    metallic_roughness_texture: int | None
    normal_texture: int | None
    emission_texture: int | None
    transmission_texture: int | None
    specular_texture: int | None
    transmission_roughness: float
    diffuse_roughness: float
    attenuation_color: tuple[float, float, float]
    ir_attenuation_color: float | None
    attenuation_distance_m: float
    ior_texture: int | None
    ir_albedo_texture: int | None
    ir_roughness: float | None
    ir_ior: float | None
    ir_transmission: float | None
    ir_transmission_roughness: float | None
    subsurface: float
    subsurface_color: tuple[float, float, float]
    subsurface_radius_m: tuple[float, float, float]
    ir_subsurface_color: float | None
    ir_subsurface_radius_m: float | None
    thin_walled: bool
    bsdf: Literal["gltf", "paper"]
    light_group: int
    def __init__(self, **fields: Any) -> None: ...

class Light:
    name: str
    kind: Literal["point", "projector", "directional", "spot", "rectangle", "disk"]
    intensity: tuple[float, float, float]
    ir_intensity: float | None
    light_to_world: NDArray[np.float64]
    k: NDArray[np.float64]
    texture: int | None
    environment: int | None
    radius_m: float
    angle_rad: float
    inner_rad: float
    outer_rad: float
    size_m: tuple[float, float]
    distortion: tuple[float, float, float, float, float, float, float, float]
    falloff: float
    focus_m: float
    pattern_scale: float
    dots: NDArray[np.float32]
    pattern_width: int
    pattern_height: int
    dot_sigma_px: float
    light_group: int
    linear_velocity: tuple[float, float, float]
    angular_velocity: tuple[float, float, float]
    on_from_s: float
    on_until_s: float
    def __init__(self, **fields: Any) -> None: ...

class Camera:
    width: int
    height: int
    k: NDArray[np.float64]
    camera_to_world: NDArray[np.float64]
    near_m: float
    far_m: float
    @property
    def distortion(self) -> tuple[float, float, float, float, float, float, float, float]: ...
    @distortion.setter
    def distortion(self, values: Sequence[float]) -> None: ...
    lens_radius_m: float
    focus_m: float
    shutter: Literal["global", "rolling"]
    readout: Literal["rows_down", "rows_up", "columns_right", "columns_left"]
    exposure_s: float
    line_time_s: float
    linear_velocity: tuple[float, float, float]
    angular_velocity: tuple[float, float, float]
    def __init__(
        self,
        width: int,
        height: int,
        k: ArrayLike,
        camera_to_world: ArrayLike | None = None,
        near_m: float = 0.0,
        far_m: float = ...,
        **fields: Any,
    ) -> None: ...

class Film:
    vignetting_exponent: float
    vignetting_polynomial: tuple[float, float, float]
    defocus_lens_radius_m: float
    defocus_focus_m: float
    psf_sigma_px: float
    psf_corner_sigma_px: float
    veiling_glare_fraction: float
    def __init__(self, **fields: Any) -> None: ...

class SceneSummary:
    @property
    def mesh_count(self) -> int: ...
    @property
    def texture_count(self) -> int: ...
    @property
    def material_count(self) -> int: ...
    @property
    def instance_count(self) -> int: ...
    @property
    def light_count(self) -> int: ...
    @property
    def camera_count(self) -> int: ...
    @property
    def triangle_count(self) -> int: ...
    @property
    def bounds_min_m(self) -> tuple[float, float, float]: ...
    @property
    def bounds_max_m(self) -> tuple[float, float, float]: ...

class Scene:
    def __init__(self, device: Device) -> None: ...
    @property
    def device(self) -> Device: ...
    @property
    def summary(self) -> SceneSummary: ...
    def load(self, path: str | PathLike[str], root_to_world: ArrayLike | None = None) -> None: ...
    def add_mesh(
        self,
        positions: ArrayLike,
        indices: ArrayLike,
        *,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        slots: ArrayLike | None = None,
        name: str = "",
    ) -> int: ...
    def update_mesh(self, id: int, positions: ArrayLike, normals: ArrayLike | None = None) -> None: ...
    def add_texture(self, texels: ArrayLike, *, srgb: bool = False, name: str = "") -> int: ...
    def set_texture(self, id: int, texels: ArrayLike, *, srgb: bool = False, name: str = "") -> None: ...
    def add_material(self, material: Material) -> int: ...
    def set_material(self, id: int, material: Material) -> None: ...
    def get_material(self, id: int) -> Material: ...
    def add_instance(
        self,
        mesh: int,
        materials: Sequence[int] = (),
        *,
        local_to_world: ArrayLike | None = None,
        environment: int | None = None,
        semantic_id: int = 0,
        name: str = "",
        linear_velocity: Sequence[float] = ...,
        angular_velocity: Sequence[float] = ...,
    ) -> int: ...
    def set_instance_pose(self, id: int, local_to_world: ArrayLike) -> None: ...
    def set_instance_velocity(self, id: int, linear: Sequence[float], angular: Sequence[float] = ...) -> None: ...
    def set_instance_materials(self, id: int, materials: Sequence[int]) -> None: ...
    def remove_mesh(self, id: int) -> None: ...
    def remove_texture(self, id: int) -> None: ...
    def remove_material(self, id: int) -> None: ...
    def remove_instance(self, id: int) -> None: ...
    def next_frame(self) -> None: ...
    def add_light(self, light: Light) -> int: ...
    def set_light(self, id: int, light: Light) -> None: ...
    def get_light(self, id: int) -> Light: ...
    def remove_light(self, id: int) -> None: ...
    def set_environment(
        self,
        radiance: Sequence[float],
        ir_radiance: float | None = None,
        *,
        texture: int | None = None,
        map_to_world: ArrayLike | None = None,
        light_group: int = 0,
    ) -> None: ...
    def set_medium(
        self,
        extinction_per_m: tuple[float, float, float] | None,
        albedo: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        ir_extinction_per_m: float | None = None,
        ir_albedo: float | None = None,
        phase_g: float = 0.0,
        bounds_m: Sequence[Sequence[float]] | None = None,
    ) -> None: ...
    def camera(self, index: int) -> Camera: ...
    def instance_name(self, id: int) -> str: ...
    def material_name(self, id: int) -> str: ...

class RenderSummary:
    @property
    def samples_per_pixel(self) -> int: ...
    @property
    def call_samples_per_pixel(self) -> int: ...
    @property
    def relative_error(self) -> float: ...
    @property
    def seconds(self) -> float: ...

class Renderer:
    def __init__(
        self,
        device: Device,
        tracer: Literal["auto", "embree", "compute", "rt_pipeline"] = "auto",
        oidn_library: str | None = None,
    ) -> None: ...
    @property
    def device(self) -> Device: ...
    @property
    def stage_times(self) -> dict[str, float]: ...
    @property
    def summary(self) -> RenderSummary: ...
    def render(
        self,
        scene: Scene,
        cameras: Camera | Sequence[Camera],
        outputs: Sequence[str] | Mapping[str, Image | Buffer | DTypeLike | None] = ("radiance",),
        *,
        band: Literal["infrared", "visible"] = "infrared",
        environments: Sequence[int] | None = None,
        spp: int = 16,
        max_bounces: int = 8,
        seed: int = 0,
        first_sample: int = 0,
        ir_ambient_scale: float = 0.05,
        ir_ambient_radiance: float = 0.002,
        glass_surfaces: int = 8,
        light_sampling: Literal["mis", "lights", "bsdf"] = "mis",
        denoise: Literal["none", "atrous", "oidn"] = "none",
        temporal_weight: float = 0.0,
        film: Film | Mapping[str, Any] | Sequence[Film | Mapping[str, Any]] | None = None,
        projector: int | None = None,
        previous_poses: ArrayLike | None = None,
        scales: Mapping[str, float] = {},
        accumulate: bool = False,
        max_seconds: float = 0.0,
        relative_error: float = 0.0,
        progress: Callable[[float], object] | None = None,
    ) -> dict[str, NDArray[Any]]: ...
