"""What effects change in the world itself: materials, the medium, ambient light. Put into a kuafu scene, and taken
back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import kuafu
from activestereo.effects.core.engine import EngineInputs


def record_key(record: Any) -> tuple:
    """The values of all fields of one of kuafu's records: equal keys mean equal records."""
    if record is None:
        return ()
    names = [n for n, value in vars(type(record)).items() if isinstance(value, property)]
    return tuple(
        (n, value.tobytes() if isinstance(value, np.ndarray) else value)
        for n in names
        for value in [getattr(record, n)]
    )


def copy_record(record: Any) -> Any:
    """Another record with the same fields; not for cameras, which are made with arguments."""
    return type(record)(
        **{n: getattr(record, n) for n, value in vars(type(record)).items() if isinstance(value, property)}
    )


def world_key(inputs: EngineInputs) -> tuple:
    """What all poses of one render share."""
    return (tuple((number, record_key(m)) for number, m in sorted(inputs.materials.items())), repr(inputs.medium))


@contextmanager
def changed_world(scene: kuafu.Scene, inputs: EngineInputs) -> Iterator[None]:
    """The scene with the inputs' materials and medium, as it was before afterwards."""
    before = {number: scene.get_material(number) for number in inputs.materials}
    try:
        enter_world(scene, inputs)
        yield
    finally:
        for number, material in before.items():
            scene.set_material(number, material)
        if inputs.medium is not None:
            scene.set_medium(None)


def enter_world(scene: kuafu.Scene, inputs: EngineInputs) -> None:
    """Gives the scene the inputs' materials and medium."""
    for number, material in inputs.materials.items():
        scene.set_material(number, material)
    medium = inputs.medium
    if medium is not None:
        scene.set_medium(
            (medium.extinction_per_m,) * 3,
            (medium.albedo,) * 3,
            ir_extinction_per_m=medium.extinction_per_m,
            ir_albedo=medium.albedo,
            phase_g=medium.phase_g,
            bounds_m=medium.bounds_m,
        )
