# SPDX-License-Identifier: Apache-2.0
"""Model discrepancy at edges: the scene measurement knows the positions of edges to about a millimetre.

At edges of materials, surfaces and measured textures, an error of position changes the image by the local slope times
that error. Its standard deviation is estimated on static frames and limited, so that effects that do move edges remain
to be explained.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.noise import NoiseModel

# Largest error of an edge's position that the scene measurement may make, metres. Beyond it an effect is missing.
_LARGEST_EDGE_DISCREPANCY_M = 1.5e-3
_DEPTH_STEP = 0.03
# At an edge of a measured texture the room's light changes by more than this share from pixel to pixel.
_TEXTURE_STEP = 0.1


def edges(o: MeasuredImage) -> np.ndarray:
    """Returns the pixels next to an edge of a material or a surface, bool [height][width]."""
    return o.view.once("edges", lambda: _edges(o.view.depth_m, np.asarray(o.layers.material)))


def _edges(z: np.ndarray, material: np.ndarray) -> np.ndarray:
    edge = maximum_filter(material, 3) != minimum_filter(material, 3)
    return edge | (maximum_filter(z, 3) - minimum_filter(z, 3) > _DEPTH_STEP * z)


def edge_slopes(o: MeasuredImage, image: np.ndarray) -> np.ndarray:
    """Returns the change of the expected image by misplaced edges, DN per metre, float32 [height][width]; 0 away from
    edges."""
    z, edge = o.view.depth_m, edges(o)
    down, right = np.gradient(image)
    slope = np.where(edge, np.hypot(down, right), 0.0)
    if o.view.known is not None:  # the scene was measured, its textures too
        slope = np.maximum(slope, image * o.view.once("texture edges", lambda: _texture_edges(o.layers.ambient)))
    per_m = np.where(z > 0, o.view.K[0, 0] / np.where(z > 0, z, 1.0), 0.0)
    return (slope * per_m).astype(np.float32)


def _texture_edges(room: np.ndarray) -> np.ndarray:
    """Returns the relative change of the room's light from pixel to pixel at edges of a texture, else 0. The room's
    light shows no dots."""
    down, right = np.gradient(room)
    change = np.hypot(down, right) / np.maximum(room, 1e-3 * room.max(initial=1e-9))
    return np.where(change > _TEXTURE_STEP, change, 0.0)


def edge_discrepancy(
    observations: Sequence[MeasuredImage], images: dict[tuple[int, str], np.ndarray], noise_model: NoiseModel
) -> float:
    """Returns the standard deviation of edge positions, metres, from the excess error of static frames at edges; 0 if
    there is no excess."""
    excess = slopes = 0.0
    for o in observations:
        if not o.frame.is_moving and o.frame.projector_power > 0:
            slope = edge_slopes(o, images[o.key])
            edge = slope > 0 if o.view.known is None else (slope > 0) & o.view.known
            variance = noise_model.variance(images[o.key], o.frame.gain)
            excess += ((o.measured - images[o.key]) ** 2 - variance)[edge].sum()
            slopes += (slope[edge].astype(np.float64) ** 2).sum()
    return float(np.sqrt(np.clip(excess / slopes, 0.0, _LARGEST_EDGE_DISCREPANCY_M**2))) if slopes > 0 else 0.0
