# SPDX-License-Identifier: Apache-2.0
"""GBufferStereo simulates active stereo depth on the images of any renderer, for many environments at once.

sensor = GBufferStereo("D435", environments=4096, materials={7: kuafu.Material(ir_albedo=0.4, roughness=0.3)})
out = sensor(depth=depth, normal=normal, albedo=albedo, material=material)  # [E, height, width]
out["depth"], out["ir_left"], out["valid"], out["cause"]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from os import PathLike
from typing import Any, Literal, TypedDict, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
from activestereo.camera.config_limits import FRAME
from activestereo.camera.plan import plan_of
from activestereo.camera.presets import StereoDepthSensorConfig, own_config
from activestereo.common.lens import is_distorting, to_tangents, with_finer_pixels
from activestereo.common.limits import FACTOR, Limits
from activestereo.common.pose import host_array
from activestereo.common.shown import require_known, shown
from activestereo.effects.engines.capture_inputs import copy_record
from activestereo.model import SensorModel
from activestereo.sensor.cuda_memory import CudaMaps, CudaMemory, cuda_tensor, require_no_capture, wait_for
from activestereo.sensor.gbuffer.cause import causes, hidden_from_right, inverse_depth, mirrors_or_is_glass, require_row
from activestereo.sensor.pictures import IrLink, expose_each, has_own_memory
from activestereo.sensor.rig import RigInputs

_NONE = np.uint32(0xFFFFFFFF)


class MaterialNumbers:
    """Adds materials to a scene and maps the caller's numbers to the scene's material ids.

    materials: a sequence of kuafu.Material, or {number: kuafu.Material} with numbers 0 to 65535. None: all surfaces are
    matt and differ only in albedo. Raises TypeError for other entries, ValueError for other numbers."""

    def __init__(self, scene: kuafu.Scene, materials: Any) -> None:
        self.is_given = materials is not None
        items = materials.items() if isinstance(materials, Mapping) else enumerate(materials or ())
        found = dict(items)
        for number, material in found.items():
            if not isinstance(number, (int, np.integer)):
                text = "the materials' numbers are whole, as the image `material` has them"
                raise TypeError(f"materials has the key {shown(number)}: {text}")
            if not isinstance(material, kuafu.Material):
                raise TypeError(f"materials[{number}] is {material!r}, expected a kuafu.Material")
        if found and (min(found) < 0 or max(found) > 0xFFFF):
            raise ValueError(f"materials have the numbers {sorted(found)}, expected 0 to 65535")
        self.numbers = sorted(found)
        self._ids = np.full(max(found, default=0) + 2, _NONE)  # the last entry stands for all unknown numbers
        self._is_odd = np.zeros(len(self._ids), bool)
        for number in self.numbers:
            self._ids[number] = 1 + scene.add_material(found[number])
            self._is_odd[number] = mirrors_or_is_glass(found[number])
        self._ids_on_cuda: Any = None

    def ids(self, numbers: NDArray[Any], unknown: np.uint32 | int = _NONE) -> NDArray[np.uint32]:
        """Returns the scene's material ids for kuafu's light_gbuffers(). numbers: the caller's, of any shape; those
        without a material get `unknown`."""
        ids = self._ids[self._places(numbers)]
        return np.where(ids == _NONE, np.uint32(unknown), ids)

    def ids_of_tensor(self, numbers: Any) -> Any:
        """Returns kuafu's material ids for a torch tensor of the user's material numbers, int32 on its device."""
        if self._ids_on_cuda is None:
            import torch

            self._ids_on_cuda = torch.from_numpy(self._ids.view(np.int32).copy()).to(numbers.device)
        last = len(self._ids) - 1
        places = numbers.long()
        return self._ids_on_cuda[places.where((places >= 0) & (places < last), places.new_tensor(last))]

    def are_odd(self, numbers: NDArray[Any]) -> NDArray[np.bool_]:
        """Returns a mask of the material numbers whose material mirrors or is glass."""
        return self._is_odd[self._places(numbers)]

    def require_known(self, numbers: NDArray[Any], depth: NDArray[Any]) -> None:
        """Raises ValueError if a surface (depth > 0) has a material number that is unknown, with its environment and
        pixel."""
        is_bad = (self.ids(numbers) == _NONE) & (depth > 0) & np.isfinite(depth)
        if is_bad.any():
            environment, v, u = (int(i) for i in np.unravel_index(int(np.argmax(is_bad)), is_bad.shape))
            value, known = numbers[environment, v, u], self.numbers
            place = f"environment {environment}, pixel ({u}, {v})"
            raise ValueError(f"{place}: material is {value}, expected a number of materials {known}")

    def _places(self, numbers: NDArray[Any]) -> NDArray[np.intp]:
        last = len(self._ids) - 1
        if numbers.dtype.kind == "f":
            numbers = np.where(numbers == np.floor(numbers), numbers, -1.0)
        return np.where((numbers >= 0) & (numbers < last), numbers, last).astype(np.intp)


_TYPES = {"depth": np.float32, "normal": np.float32, "albedo": np.float32, "material": np.uint32}
_FURTHEST_NEAR_M = 50.0  # no sensor of this kind measures there


def host_image(name: str, values: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """Returns the values as an array of this shape on the host; for one environment the first axis may be missing.
    Raises ValueError for another shape, TypeError for anything but numbers."""
    image = host_array(values, None)
    if image.dtype.kind not in "fiub":
        raise TypeError(f"{name} is of {image.dtype}, expected numbers")
    return _checked_shape(name, image, shape)


def require_metres(name: str, depth: NDArray[Any]) -> None:
    """Raises ValueError if depth [...] is likely in millimetres: every surface is beyond 50 m, and their depths
    differ."""
    there = depth[np.isfinite(depth) & (depth > 0)]
    if there.size and there.min() > _FURTHEST_NEAR_M and there.max() > 1.01 * there.min():
        raise ValueError(
            f"{name} begins at {there.min():g} m: is it in millimetres? Then give {name} / 1000; 0 and inf are nothing"
        )


# Normals are checked at so many pixels at most.
_LOOKED_AT = 1 << 16


def require_towards(name: str, normal: NDArray[Any], depth: NDArray[Any], k: NDArray[np.float64]) -> None:
    """Raises ValueError if most normals [E, height, width, 3] of surfaces (depth > 0) face away from the camera with
    the 3x3 matrix k: their axes are others. A part may, at the edges of bent or rough surfaces."""
    places = np.flatnonzero((depth > 0) & np.isfinite(depth))
    places = places[:: 1 + places.size // _LOOKED_AT]
    _, v, u = np.unravel_index(places, depth.shape)
    rays = np.stack([*to_tangents(u, v, k), np.ones(u.size)], axis=-1)
    away = (normal.reshape(-1, 3)[places].astype(np.float64) * rays).sum(axis=-1) > 0.0
    if away.size and away.mean() > 0.5:
        axes = "it is in the left camera's axes, x right, y down, z forward, towards the camera"
        share = f"faces away from the camera at {100.0 * away.mean():.3g} % of the pixels with a surface"
        raise ValueError(f"{name} {share}: {axes} (of OpenGL's axes negate y and z; of outward ones all three)")


def _checked_shape(name: str, image: Any, shape: tuple[int, ...]) -> Any:
    if shape[0] == 1 and tuple(image.shape) == shape[1:]:
        image = image[None]
    if tuple(image.shape) != shape:
        raise ValueError(f"{name} is {list(image.shape)}, expected {list(shape)}: input_shape of the sensor")
    return image


def _red(name: str, image: Any, shape: tuple[int, ...]) -> Any:
    """Returns an albedo image with one value per pixel. RGB(A) gives its red channel, a guess of the infrared albedo;
    uint8 is scaled to 0..1."""
    is_rgb = image.ndim > 2 and image.shape[-1] in (3, 4) and tuple(image.shape[-3:-1]) == shape[1:]
    image = _checked_shape(name, image[..., 0] if is_rgb else image, shape)
    return image / 255.0 if str(image.dtype).endswith("uint8") else image


class InputImages:
    """Holds the memory from which kuafu reads one camera's images [E, height, width]: depth, normal, albedo, material.
    Each is allocated when it is first given."""

    def __init__(self, device: kuafu.Device, shape: tuple[int, ...], materials: MaterialNumbers) -> None:
        self._device, self._shape, self._materials = device, shape, materials
        self._is_on_gpu = has_own_memory(device)
        self._buffers: dict[str, kuafu.Buffer] = {}
        self._seen_by_cuda: dict[str, Any] = {}

    def put(self, given: Mapping[str, Any]) -> dict[str, kuafu.Buffer]:
        """Copies the images that are not None to the memory that kuafu's light_gbuffers() reads, and returns {name:
        buffer}."""
        found = {}
        for name, values in given.items():
            if values is None:
                continue
            shape = (*self._shape, 3) if name == "normal" else self._shape
            if name not in self._buffers:
                size_bytes, on_gpu = 4 * int(np.prod(shape)), self._is_on_gpu
                self._buffers[name] = kuafu.Buffer(self._device, size_bytes, exportable=on_gpu, host_visible=not on_gpu)
            found[name] = buffer = self._buffers[name]
            if self._is_on_gpu and getattr(values, "is_cuda", False):
                if name not in self._seen_by_cuda:
                    dtype = "int32" if name == "material" else "float32"  # torch has no arithmetic of uint32
                    self._seen_by_cuda[name] = cuda_tensor(CudaMemory(buffer).array(dtype, shape))
                image = _red(name, values, self._shape) if name == "albedo" else _checked_shape(name, values, shape)
                target = self._seen_by_cuda[name]
                target.copy_(self._materials.ids_of_tensor(image) if name == "material" else image)
                wait_for(target)
                continue
            if name == "albedo":
                image = _red(name, host_array(values, None), self._shape)
            else:
                image = host_image(name, values, shape)
            if name == "material":
                image = self._materials.ids(image, unknown=0)  # no surface here, after require_known()
            if self._is_on_gpu:
                buffer.write(np.ascontiguousarray(image, _TYPES[name]))
            else:
                np.copyto(buffer.image(_TYPES[name], shape).array(), image, casting="unsafe")
        return found


_ENVIRONMENTS = Limits(1, 1_000_000, whole=True)
_SUPERSAMPLING = Limits(1, 4, whole=True)
_SEED = Limits(0, 2**64 - 1, whole=True)
_RADIANCE = Limits(0.0, float(np.finfo(np.float32).max), "W/(sr m^2)")
KINDS = ("planar", "ray")
Output = Literal["depth", "disparity", "ir_left", "ir_right", "valid", "cause"]
OUTPUTS: tuple[Output, ...] = get_args(Output)
_OF_ENGINE: tuple[Output, ...] = ("depth", "disparity", "ir_left", "ir_right")
_IMAGES = ("depth", "normal", "albedo", "material")


class StereoImages(TypedDict):
    """The results of one simulated frame, [E, height, width] each; those that the caller did not ask for are absent.
    With on_cuda they are arrays that torch and CuPy take."""

    depth: NDArray[np.float32]  # metres in the left infrared camera, 0 = no measurement
    disparity: NDArray[np.float32]  # pixels, -1 = none
    ir_left: NDArray[Any]  # the imager's counts
    ir_right: NDArray[Any]
    valid: NDArray[np.bool_]
    cause: NDArray[np.uint8]  # indices into cause.CAUSES


class GBufferStereo:
    """Simulates an active stereo sensor in E environments from images that another renderer made for its left camera.

    config: a StereoDepthSensorConfig, which is copied, or a camera's name; 'converging' exposure becomes 'settled'.
    device: where light and depth are computed, as kuafu.Device has it. materials: kuafu.Materials by number. model: a
    SensorModel or a model.json, whose effects on projector, cameras, imagers and depth engine are applied. Light
    bounces only between surfaces that the images show; the output 'cause' marks metal mirrors and glass. supersampling:
    factor 1 to 4 of the input images' rows and columns over the imagers'. All input pixels are lit; an imager's pixel
    is their mean and so mixes the surfaces at an edge, as a path-traced one does. on_cuda: the depth engine's results
    stay on the GPU, in arrays that torch and CuPy take without a copy. The next call overwrites them. The first call
    raises CudaError without CUDA. With a fixed exposure all other images stay there, too. Raises ValueError for a
    configuration or a model with lens distortion, unaligned rows, or effects on images.
    """

    def __init__(
        self, config: StereoDepthSensorConfig | str = "D435", environments: int = 1,
        device: str | int | kuafu.Device = "auto", materials: Any = None,
        model: SensorModel | str | PathLike[str] | None = None, on_cuda: bool = False, supersampling: int = 1,
    ) -> None:  # fmt: skip
        config = own_config(config)
        if config.ir_exposure_mode == "converging":
            config.ir_exposure_mode = "settled"
        plan, self._config = plan_of(config), config
        for name in ("ir_distortion", "ir_distortion_right"):
            if is_distorting(getattr(config, name) or (0.0,)):
                raise ValueError(f"{name} is {getattr(config, name)}: G-buffers are of pinholes: set it to zeros")
        require_row(config.trans_pose_l, config.trans_pose_r, "the right infrared camera")
        require_row(config.trans_pose_l, config.pose_rgb_irproj, "the projector")
        self._count = int(_ENVIRONMENTS.check("environments", environments))
        self._supersampling = int(_SUPERSAMPLING.check("supersampling", supersampling))
        device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self._scene = kuafu.Scene(device)
        self._materials = MaterialNumbers(self._scene, materials)
        self._rig = RigInputs(plan, self._scene, [None], model, None, takes_image_effects=False)
        self._renderer = kuafu.Renderer(device)
        self._views = [InputImages(device, self.input_shape, self._materials) for _ in range(2)]
        self._shadows = InputImages(device, self.input_shape, self._materials)
        self._engine = self._rig.make_matcher(self._count)
        width, height = config.ir_resolution
        self._link = IrLink(device, self._engine.device, width, height, count=self._count)
        self._exposure, self._frame = plan.exposure, -1
        self._seeds: list[int] | None = None
        self._on_cuda = CudaMaps(self._engine.device) if on_cuda else None
        # The 3x3 matrix of the left infrared camera for images of input_shape, which the given images must have.
        self.k: NDArray[np.float64] = with_finer_pixels(plan.left["k"], self._supersampling)
        self._rig.enter()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Returns (environments, height, width) of all outputs."""
        width, height = self._config.ir_resolution
        return self._count, height, width

    @property
    def input_shape(self) -> tuple[int, int, int]:
        """Returns (environments, rows, columns) of the input images: `shape` times supersampling."""
        count, height, width = self.shape
        return count, height * self._supersampling, width * self._supersampling

    def get_config(self) -> StereoDepthSensorConfig:
        """Returns a copy of the configuration."""
        return deepcopy(self._config)

    def restart(self, seed: int | Sequence[int]) -> None:
        """Numbers the next frame 0 and seeds its noise; the same seed repeats the noise. seed: a number, or one for
        each environment. With one for each, an environment's noise does not depend on its index."""
        given = np.asarray(seed, dtype=object)
        if given.ndim == 0:
            self._engine.set_parameters(noise_seed=int(_SEED.check("the seed", given.item())))
            self._seeds = None
        else:
            seeds = [int(_SEED.check(f"the seed of environment {n}", one)) for n, one in enumerate(given.tolist())]
            if len(seeds) != self._count:
                raise ValueError(f"{len(seeds)} seeds for {self._count} environments")
            self._seeds = seeds
        self._frame = -1

    def __call__(
        self, *, depth: Any, normal: Any = None, albedo: Any = None, material: Any = None,
        depth_kind: Literal["planar", "ray"] = "planar",
        right: Mapping[str, Any] | None = None, projector: Any = None, ambient: ArrayLike | None = None,
        laser_power: ArrayLike = 1.0, exposure: ArrayLike = 1.0, outputs: Sequence[Output] | None = None,
    ) -> StereoImages:  # fmt: skip
        """Simulates one frame and returns its outputs. Images have the shape input_shape and show the view of the left
        infrared camera with matrix k. They are NumPy, torch or DLPack arrays.

        depth: metres, 0 or inf = nothing there; depth_kind: 'planar' (z) or 'ray' (along the ray). normal [..., 3]:
        unit, in the camera's axes (x right, y down, z forward), None = computed from depth. albedo: infrared, 0..1 or
        uint8, or [..., 3] of RGB, whose red serves as a guess; needed without materials. material: numbers of the
        sensor's materials; their ir_albedo overrides the albedo image. right: {name: the same image of the right
        camera}; None = warped from the left camera's images, and parts that these do not show are extrapolated.
        projector: depth from a camera like the left one at the projector's position, for its shadows; None = warped.
        ambient: the room's radiance, W/(sr m^2), a number or [E], None = ir_ambient_radiance. laser_power, exposure:
        factors on the configured values, a number or [E]. outputs: which of OUTPUTS to return, None = all; 'cause'
        takes time on the host; with on_cuda there is neither 'cause' nor 'valid'.

        Raises ValueError with the environment and the invalid value. It also does for depth on the host that can only
        be in millimetres, and for normals there that face away. No frame is taken then. Raises RuntimeError while torch
        captures a CUDA graph.
        """
        known = OUTPUTS if self._on_cuda is None else _OF_ENGINE
        outputs = known if outputs is None else outputs
        require_known("output", outputs, known)
        require_known("depth_kind", [depth_kind], KINDS)
        given = {"depth": depth, "normal": normal, "albedo": albedo, "material": material}
        if any(getattr(image, "is_cuda", False) for image in given.values()):
            require_no_capture()
        self._require(given, "")
        own, other = self._views[0].put(given), None
        if right is not None:
            if not isinstance(right, Mapping):
                raise ValueError(f"right is {shown(right)}, expected a mapping of its images: {', '.join(_IMAGES)}")
            require_known("right image", right, _IMAGES)
            self._require(right, "right ")
            other = self._views[1].put({name: right.get(name) for name in _IMAGES})
        if projector is not None and not getattr(projector, "is_cuda", False):
            require_metres("projector", host_image("projector", projector, self.input_shape))
        hiding = None if projector is None else self._shadows.put({"depth": projector})["depth"]
        numbers = {
            "laser_power": FACTOR.check_each("laser_power", laser_power, self._count),
            "ambient_radiance": _RADIANCE.check_each(
                "ambient", self._rig.inputs().ambient_radiance if ambient is None else ambient, self._count
            ),
        }
        share = FACTOR.check_each("exposure", exposure, self._count)
        frame = int(FRAME.check("the frame", self._frame + 1))
        inputs = self._rig.begin(frame)
        self._rig.shine(np.eye(4)[None])
        self._engine.set_signal(*self._rig.signals())
        wants_cause = "cause" in outputs
        targets: dict[str, Any] = {"radiance": self._link.target}
        if inputs.speckle_of_laser:
            targets["projector"] = self._link.laser().target
        if wants_cause:
            targets |= {"depth": None, "projector_visibility": None}

        optics = [copy_record(one) for one in self._rig.infrared()["optics"]]
        for one in optics:
            one.firefly_factor = 0.0  # light on G-buffers has no fireflies

        def lit(light: NDArray[np.float64]) -> dict[str, Any]:
            return self._renderer.light_gbuffers(
                self._scene, self._rig.ir_cameras(np.eye(4)[None]), targets, left=own, right=other,
                projector_depth=hiding, depth_kind=depth_kind, optics=optics, environment_count=self._count,
                pixel_blur_px=self._config.pixel_blur_px, supersampling=self._supersampling,
                **{name: light * values for name, values in numbers.items()},
            )  # fmt: skip

        seen = lit(share)
        expose_each(self._link, np.ones(self._count), inputs.speckle_of_laser, self._exposure, inputs)
        self._frame = frame
        wanted = {*outputs, *(["depth"] if "valid" in outputs else []), *(["ir_left", "reason"] if wants_cause else [])}
        names = [name for name in (*_OF_ENGINE, "reason") if name in wanted]
        link, engine = self._link, self._engine
        engine.set_parameters(frame_index=frame, scene_index=0)
        own_light: dict[str, Any] = dict(link.lasers(inputs.speckle_of_laser)) | {"noise_seeds": self._seeds}
        found: dict[str, Any]
        if self._on_cuda is None:
            maps = engine.compute(link.left, link.right, names, **own_light)
            found = {name: image.reshape(self.shape) for name, image in maps.items()}
        else:
            on_cuda = self._on_cuda.compute(names, lambda new: engine.compute(link.left, link.right, new, **own_light))
            found = {name: memory.array(image.dtype, self.shape) for name, (image, memory) in on_cuda.items()}
        if wants_cause:
            near, is_odd = inverse_depth(seen["depth"][..., 0]), np.zeros(self.shape, bool)
            is_lit = seen["projector_visibility"][: self._count, ..., 0] > 0.5
            if material is not None:
                is_odd = self._materials.are_odd(host_image("material", material, self.input_shape))
                n = self._supersampling
                is_odd = is_odd[:, n // 2 :: n, n // 2 :: n]  # as depth: of the sample in a pixel's middle
            is_hidden = hidden_from_right(self._config, near[: self._count], near[self._count :])
            black_dn, counts = float(inputs.left.signal["black_level_dn"]), found["ir_left"]
            found["cause"] = causes(
                self._config, near[: self._count], is_odd, is_lit, is_hidden, counts, found.pop("reason"), black_dn,
                inputs.max_dn,
            )  # fmt: skip
        if "valid" in outputs:
            found["valid"] = found["depth"] > 0.0
        return cast(StereoImages, {name: found[name] for name in outputs})

    # ---- inside ----

    def _require(self, given: Mapping[str, Any], whose: str) -> None:
        """Raises ValueError unless `given` has depth, and material (albedo if the sensor has no materials). On the
        host, depth must be in metres, normals must face the camera, and the surfaces' material numbers must be known.
        whose: the camera's name in the message."""
        if given.get("depth") is None:
            raise ValueError(f"{whose}depth is missing: give it in metres, 0 or inf where nothing is")
        normal = given.get("normal")
        if not getattr(given["depth"], "is_cuda", False):
            depth = host_image(f"{whose}depth", given["depth"], self.input_shape)
            require_metres(f"{whose}depth", depth)
            if normal is not None and not getattr(normal, "is_cuda", False):
                towards = host_image(f"{whose}normal", normal, (*self.input_shape, 3))
                require_towards(f"{whose}normal", towards, depth, self.k)
        material = given.get("material")
        if not self._materials.is_given:
            if material is not None:
                raise ValueError(f"{whose}material is given, but this sensor was made without materials=")
            if given.get("albedo") is None:
                raise ValueError(f"{whose}albedo is missing: give it, or material with materials= of the sensor")
        elif material is None:
            known = ", ".join(map(str, self._materials.numbers[:8])) or "none"
            text = f"give each pixel's number, here of {known}"
            raise ValueError(f"{whose}material is missing: {text}, or make the sensor without materials=")
        elif not getattr(material, "is_cuda", False):
            numbers, depth = (host_image(whose + name, given[name], self.input_shape) for name in ("material", "depth"))
            self._materials.require_known(numbers, depth)
