# SPDX-License-Identifier: Apache-2.0
"""kuafu: path tracer for active stereo (infrared pattern projectors), on any Vulkan device.

Metres, radians; camera x right, y down, z forward; pixel centres at integers; a 4x4 named a_to_b maps coordinates in a
to coordinates in b.

    device = kuafu.Device()
    scene = kuafu.Scene(device)
    scene.load("table_top.gltf")
    images = kuafu.Renderer(device).render(scene, scene.camera(0), ["radiance", "depth"], band="visible", spp=16)
"""

from ._kuafu import (
    ArgumentError,
    Buffer,
    BufferDesc,
    Camera,
    CancelledError,
    Device,
    DeviceInfo,
    Error,
    FileError,
    Image,
    Light,
    Material,
    Medium,
    MissingFileError,
    NoDeviceError,
    Optics,
    Renderer,
    RenderSummary,
    Scene,
    SceneSummary,
    Submission,
    __version__,
)

__all__ = [
    "ArgumentError",
    "Buffer",
    "BufferDesc",
    "Camera",
    "CancelledError",
    "Device",
    "DeviceInfo",
    "Error",
    "FileError",
    "Image",
    "Light",
    "Material",
    "Medium",
    "MissingFileError",
    "NoDeviceError",
    "Optics",
    "Renderer",
    "RenderSummary",
    "Scene",
    "SceneSummary",
    "Submission",
]
