# SPDX-License-Identifier: Apache-2.0
"""A capture on its way from a recording: what its steps have measured so far, and what the capture had before."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.overlaps import Overlap, Surface
from activestereo.calibrate.world.pattern import PatternEstimate
from activestereo.calibrate.world.poses import PoseEstimate
from activestereo.calibrate.world.views import SceneView
from activestereo.capture.capture import Capture

# The pattern's image is dark, or was never lit, where nothing shines within so many of its pixels.
_LIT_PX = 41


@dataclass
class World:
    """A capture on its way. lines: what each step found, for the user; surfaces, overlaps, groups: of views, where
    steps compare their surfaces; poses, dots: as steps of this run measured them; pictures: by their names."""

    capture: Capture
    views: list[SceneView]
    pattern: NDArray[np.uint8]
    lines: list[str] = field(default_factory=list)
    surfaces: list[Surface] = field(default_factory=list)
    overlaps: list[Overlap] = field(default_factory=list)
    groups: list[list[int]] = field(default_factory=list)
    poses: PoseEstimate | None = None
    dots: PatternEstimate | None = None
    masks: dict[tuple[int, str], NDArray[np.bool_]] = field(default_factory=dict)
    pictures: dict[str, NDArray[np.uint8]] = field(default_factory=dict)

    @property
    def K(self) -> NDArray[np.float64]:
        return self.capture.rig.left.K

    @property
    def where(self) -> str:
        return str(self.capture.path)

    def note(self, name: str, values: dict[str, Any], line: str) -> None:
        """Keeps what a step measured."""
        self.capture = replace(self.capture, measured={**self.capture.measured, name: values})
        self.lines.append(line)

    def scene_views(self) -> tuple[list[SceneView], list[NDArray[np.float64]]]:
        """Views of one scene and their view_to_world: as measured, or as the capture states them. ValueError where it
        states none."""
        if self.poses is not None:
            return [self.views[i] for i in self.poses.views], list(self.poses.view_to_world)
        frames = {frame.id: frame.camera_to_world for frame in self.capture.frames}
        views = [view for view in self.views if view.frame.id in frames]
        if len({frames[view.frame.id].tobytes() for view in views}) < min(len(views), 2):
            raise ValueError(f"{self.where}: its views have no poses: take 'calibrate poses' first, or give them")
        return views, [frames[view.frame.id] for view in views]

    def projected(self) -> PatternEstimate:
        """The projector's dots: as measured, or as the capture states them."""
        if self.dots is not None:
            return self.dots
        projector = self.capture.rig.projector
        shining = cv2.dilate((self.pattern > 0).astype(np.uint8), np.ones((_LIT_PX, _LIT_PX), np.uint8)) > 0
        image = np.where(shining, self.pattern / np.float32(255.0), np.nan).astype(np.float32)
        place = np.linalg.inv(projector.left_to_projector)[:3, 3]
        return PatternEstimate(image, projector.K, place, np.zeros((3, 3)), {})
