# SPDX-License-Identifier: Apache-2.0
"""Files and names that the code blocks of a page take for granted."""

import pathlib
import subprocess
from collections.abc import Callable

import numpy as np
from PIL import Image


def write_pair(folder: pathlib.Path) -> None:
    """Noise as the left image, and the same noise 12 pixels further left as the right one."""
    noise = np.random.default_rng(0).integers(0, 256, (160, 252), np.uint8)
    Image.fromarray(noise[:, :-12]).save(folder / "LEFT.png")
    Image.fromarray(noise[:, 12:]).save(folder / "RIGHT.png")


def write_scene_and_models(folder: pathlib.Path) -> None:
    """A scene under two names, and models before and after an effect was found."""
    from activestereo.effects import builtin
    from activestereo.scene_io.example_scene import write_table_top
    from activestereo.capture.capture import Camera
    from activestereo.model import Quantity, Rig, SensorModel, write_model

    for name in ("scene.gltf", "SCENE.gltf"):
        write_table_top(folder / name)
    camera = Camera(212, 120, np.array([[215.0, 0, 105.5], [0, 215.0, 59.5], [0, 0, 1]]))
    beside = np.eye(4)
    beside[0, 3] = -0.05
    before = SensorModel(rig=Rig(camera, camera, beside, beside))
    write_model(folder / "before.json", before)
    (folder / "D").mkdir()
    write_model(folder / "D/model.json", before.with_effect(builtin()["vignetting"], {"exponent": Quantity(1.0)}))


def hide_an_effect(folder: pathlib.Path) -> None:
    """The capture that the example makes."""
    command = ["/usr/bin/python3", "examples/hidden_effect/hidden_effect.py", "--out", "out/hidden_effect"]
    subprocess.run(command, cwd=folder, check=True)


FILES: dict[str, Callable[[pathlib.Path], None]] = {
    "examples/hidden_effect/README.md": hide_an_effect,
    "examples/opencv_users/README.md": write_pair,
    "python/activestereo/model/README.md": write_scene_and_models,
}

# Python text that runs before the blocks of a page.
NAMES: dict[str, str] = {
    "examples/opencv_users/README.md": """
import cv2
import numpy as np
left, right = (cv2.imread(name, cv2.IMREAD_GRAYSCALE) for name in ("LEFT.png", "RIGHT.png"))
""",
    "simsense/README.md": """
import numpy as np
import simsense
device = simsense.Device()
left = right = rgb = simsense.Camera(64, 48, np.array([[60.0, 0, 31.5], [0, 60.0, 23.5], [0, 0, 1]]))
left_to_right = np.eye(4)
left_to_right[0, 3] = -0.05
pairs = simsense.Buffer(device, 2 * 32 * 48 * 64)
left_images, right_images = (pairs.image(np.uint8, (32, 48, 64), side * 32 * 48 * 64) for side in range(2))
depth_images = simsense.Buffer(device, 4 * 32 * 48 * 64).image(np.float32, (32, 48, 64))
""",
}
