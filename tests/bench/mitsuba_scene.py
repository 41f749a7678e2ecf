# SPDX-License-Identifier: Apache-2.0
"""Parts of scenes of Mitsuba 3 (Jakob et al., 2022), for mitsuba.load_dict. Colours are grey: one band."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # held-out worlds share this file, and no code with the product
    from activestereo.scene_io.meshes import Mesh


def mitsuba() -> Any:
    """The package, in a variant without LLVM and CUDA. Raises ValueError if it is not installed."""
    try:
        import mitsuba as mi
    except ImportError as error:
        raise ValueError("needs the package mitsuba, which is missing: pip install mitsuba") from error
    mi.set_variant("scalar_rgb")
    return mi


def grey(value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(value)] * 3}


def bitmap(mi: Any, values: NDArray[np.floating], filter_type: str) -> dict[str, Any]:
    """A texture of values [height, width]."""
    pixels = mi.Bitmap(np.repeat(values.astype(np.float32)[..., None], 3, axis=-1))
    return {"type": "bitmap", "bitmap": pixels, "raw": True, "filter_type": filter_type, "wrap_mode": "clamp"}


def pose(mi: Any, to_world: NDArray[np.float64]) -> Any:
    """Mitsuba's pose (x left, y up) of a camera or projector with x right, y down, z forward."""
    return mi.ScalarTransform4f((to_world @ np.diag([-1.0, -1.0, 1.0, 1.0])).tolist())


def mesh(mi: Any, shape: Mesh, bsdf: dict[str, Any], to_world: NDArray[np.float64], **vertex: NDArray[Any]) -> Any:
    """vertex: values [n] at its corners, which a `mesh_attribute` texture of the name vertex_NAME gives."""
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(bsdf)
    out = mi.Mesh("", len(shape.positions), len(shape.indices.reshape(-1, 3)), props, True)
    for name, values in vertex.items():
        out.add_attribute(f"vertex_{name}", 1, np.ascontiguousarray(values, np.float32).ravel())
    parameters = mi.traverse(out)
    there = shape.positions @ to_world[:3, :3].T + to_world[:3, 3]
    parameters["vertex_positions"] = np.ascontiguousarray(there, np.float32).ravel()
    parameters["faces"] = shape.indices.astype(np.uint32).ravel()
    normals = shape.normals @ to_world[:3, :3].T
    parameters["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    parameters.update()
    return out


def projector(
    mi: Any, pattern: NDArray[np.floating], k: NDArray[np.float64], w_per_sr: float, to_world: NDArray[np.float64]
) -> dict[str, Any]:
    """pattern: [height, width], 1 = w_per_sr; k's principal point is the image's middle."""
    height, width = pattern.shape
    x = (np.arange(width) - k[0, 2]) / k[0, 0]
    y = (np.arange(height) - k[1, 2]) / k[1, 1]
    # Theirs is of the image plane and pi times as bright, as walls show; ours is of directions.
    image = w_per_sr / np.pi * pattern * (1.0 + x[None] ** 2 + y[:, None] ** 2) ** -1.5
    return {
        "type": "projector",
        "to_world": pose(mi, to_world),
        "fov": float(np.rad2deg(2 * np.arctan(0.5 * width / k[0, 0]))),
        "irradiance": mi.load_dict(bitmap(mi, image, "bilinear")),
    }
