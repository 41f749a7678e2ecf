"""kuafu as the lab's renderer: the known scene under the projector at power 1 and under ambient radiance 1, infrared band."""

import hashlib
from pathlib import Path

import numpy as np

import kuafu
from activestereo.lab.layers import Layers

_OUTPUTS = ("projector_direct", "projector_indirect", "ambient", "depth", "normal", "material_id")


class KuafuRenderer:
    """Renders RenderRequests. A scene is loaded once and kept; the projector moves from request to request.

    device: 'auto', 'cpu', an index or a kuafu.Device. Raises kuafu.NoDeviceError or kuafu.FileError.
    """

    def __init__(self, device="auto"):
        self._device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self._renderer = kuafu.Renderer(self._device)
        self._scene_path = self._scene = self._texture = self._light = self._pattern = None

    @property
    def version(self):
        """Changes with the library's code and the device: pixels are the same bits on one device only."""
        return f"kuafu {kuafu.__version__} {_library_digest()} on {self._device.info.name}"

    def __call__(self, request, progress=None):
        """One Layers per camera. progress: called as progress(fraction)."""
        self._load(request.scene_path)
        self._place_projector(request)
        cameras = [kuafu.Camera(c.width, c.height, c.K, c.camera_to_world) for c in request.cameras]
        images = self._renderer.render(
            self._scene,
            cameras,
            _OUTPUTS,
            band="infrared",
            spp=request.samples_per_pixel,
            max_bounces=request.max_bounces,
            seed=request.seed,
            progress=progress,
        )
        return tuple(self._layers({name: array[i] for name, array in images.items()}) for i in range(len(cameras)))

    @staticmethod
    def _layers(image):
        scalar = [image[name][..., 0].copy() for name in _OUTPUTS if name != "normal"]
        direct, indirect, ambient, depth, material = scalar
        return Layers(direct, indirect, ambient, depth, image["normal"].copy(), material)

    def _load(self, path):
        if path == self._scene_path:
            return
        self._scene = kuafu.Scene(self._device)
        self._scene.load(path)
        self._scene.set_environment((1.0, 1.0, 1.0), ir_radiance=1.0)
        self._scene_path, self._light, self._pattern = path, None, None

    def _place_projector(self, request):
        if self._pattern is None or not np.array_equal(self._pattern, request.pattern):
            self._pattern = request.pattern
            self._texture = self._scene.add_texture(request.pattern, name="pattern")
        light = kuafu.Light(
            kind="projector",
            name="projector",
            texture=self._texture,
            k=request.projector_K,
            ir_intensity=1.0,
            light_to_world=request.projector_to_world,
        )
        if self._light is None:
            self._light = self._scene.add_light(light)
        else:
            self._scene.set_light(self._light, light)


def _library_digest():
    """Short content hash of the loaded libkuafu, so that no cached picture outlives the code that made it."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").split("\n")
    paths = sorted({line.split(maxsplit=5)[5] for line in maps if "/libkuafu.so" in line})
    return hashlib.sha256(b"".join(Path(path).read_bytes() for path in paths)).hexdigest()[:12]
