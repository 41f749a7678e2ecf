# SPDX-License-Identifier: Apache-2.0
"""A data set as a recording of Rerun's viewer (pip install rerun-sdk): DIR/rerun/frames.rrd.

world/camera is a pinhole at the RGB camera's pose, with depth and true depth as Rerun's depth images in millimetres."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from activestereo.benchmarks.generate.stored import stored_frames


def package() -> Any:
    """The module rerun. Raises ImportError if it is missing."""
    try:
        import rerun
    except ImportError as error:
        raise ImportError("rerun is missing: pip install rerun-sdk") from error
    return rerun


def write(out: Path, count: int, to: Path) -> None:
    """Frames 0 to count - 1 of the data set `out` into the folder `to`, which must not exist."""
    rr = package()
    to.mkdir()
    recording = rr.RecordingStream("activestereo")
    recording.save(to / "frames.rrd")
    for frame in stored_frames(out, count):
        recording.set_time("frame", sequence=frame.number)
        pose, (height, width) = frame.camera_to_world, frame.rgb.shape[:2]
        recording.log("world/camera", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        pinhole = rr.Pinhole(image_from_camera=frame.k, width=width, height=height, camera_xyz=rr.ViewCoordinates.RDF)
        recording.log("world/camera", pinhole)
        recording.log("world/camera/rgb", rr.Image(frame.rgb))
        recording.log("world/camera/depth", rr.DepthImage(frame.depth_mm, meter=1000.0))
        recording.log("world/camera/depth_true", rr.DepthImage(frame.depth_true_mm, meter=1000.0))
        for side, image in (("left", frame.ir_left), ("right", frame.ir_right)):
            recording.log(f"infrared/{side}", rr.Image(image))
    recording.flush()
