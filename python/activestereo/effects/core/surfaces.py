# SPDX-License-Identifier: Apache-2.0
"""Lists a scene's surfaces, and restricts effects to some of them, such as a glaze on one object. A surface is a
material on one object. kuafu knows materials only, so each surface gets a material of its own.

If a single object has the material, the surface has the material's name; else it is called `plaster of ball`. The first
object of a material keeps the material's number; the others get numbers after all of the scene's materials."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import kuafu
from activestereo.effects.core.descriptor import Parameter
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View
from activestereo.scene_io.scene_files import read_document

_OF = " of "
_TRIANGLES, _FAN = 4, 6
_DEFAULT = "glTF default"


@dataclass(frozen=True)
class Surface:
    """A material on an object. material: its number in the scene file. instance: kuafu's number of the object; None =
    every object with the material."""

    name: str
    material: int
    instance: int | None = None


# (an object's name, the number of each part's material, -1 where the file names none)
_Instance = tuple[str, tuple[int, ...]]


def scene_surfaces(scene_path: str | Path | None) -> list[Surface]:
    """Lists the surfaces of a glTF file, in the order of their numbers. The list is empty if the file cannot be read:
    loading the scene raises the error."""
    try:
        document = read_document(Path(scene_path)) if scene_path is not None else {}
        instances = _instances(document)
    except (OSError, ValueError, KeyError, IndexError, TypeError, struct.error):
        return []
    names = [m.get("name") or f"material {k}" for k, m in enumerate(document.get("materials", []))]
    users: dict[int, list[int]] = {}
    for number, (_, materials) in enumerate(instances):
        for material in dict.fromkeys(materials):
            users.setdefault(material, []).append(number)
    shared = {k: found for k, found in users.items() if k >= 0 and len(found) > 1}
    whole = [Surface(name, k) for k, name in enumerate([*names, *([_DEFAULT] if -1 in users else [])])]
    out = list(whole)
    for k, found in shared.items():
        first, *others = (Surface(f"{names[k]}{_OF}{instances[i][0]}", k, i) for i in found)
        out[k] = first
        out += others
    return out if len(out) <= MOST_MATERIALS else whole


def surface_names(scene_path: str | Path | None) -> list[str]:
    return [surface.name for surface in scene_surfaces(scene_path)]


def surface_text(scene_path: str | Path | None) -> Callable[[int], str]:
    """Returns a function that names a surface by its material number."""
    names = surface_names(scene_path)
    return lambda index: names[index] if index < len(names) else f"material {index}"


def surfaces_of_object(scene_path: str | Path, name: str) -> list[int]:
    """Returns the numbers of the surfaces on the objects of this name. Raises ValueError, with the known names, if
    there is no such object; also if a part of one has no material."""
    instances = _instances(read_document(Path(scene_path)))
    chosen = [k for k, (own, _) in enumerate(instances) if own == name]
    if not chosen:
        known = ", ".join(dict.fromkeys(own for own, _ in instances)) or "none"
        raise ValueError(f"{scene_path}: there is no object '{name}' (there are: {known})")
    of_objects = {m for k in chosen for m in instances[k][1]}
    if -1 in of_objects:
        raise ValueError(f"{scene_path}: the object '{name}' has a part without a material: give it one")
    return [
        k
        for k, surface in enumerate(scene_surfaces(scene_path))
        if (surface.instance in chosen if surface.instance is not None else surface.material in of_objects)
    ]


def split_surfaces(scene: kuafu.Scene, scene_path: str | Path) -> None:
    """Gives every surface of a scene a material of its own: surface k is material k. The scene must be loaded from this
    file alone; else raises ValueError."""
    surfaces = scene_surfaces(scene_path)
    extra = range(scene.summary.material_count, len(surfaces))
    if not extra:
        return
    instances = _instances(read_document(Path(scene_path)))
    if len(instances) != scene.summary.instance_count:
        found = scene.summary.instance_count
        raise ValueError(f"{scene_path}: the scene has {found} objects, its file {len(instances)}")
    default = next((k for k, surface in enumerate(surfaces) if surface.name == _DEFAULT), 0)
    chosen = {n: [default if m < 0 else m for m in materials] for n, (_, materials) in enumerate(instances)}
    changed = set()
    for k, surface in enumerate(surfaces):
        if surface.instance is None:
            continue
        material = scene.get_material(surface.material)
        material.name = surface.name
        if k not in extra:
            scene.set_material(k, material)
            continue
        if scene.add_material(material) != k:
            raise ValueError(f"{scene_path}: its materials are not the scene's: load the file into an empty scene")
        chosen[surface.instance] = [k if m == surface.material else m for m in chosen[surface.instance]]
        changed.add(surface.instance)
    for instance in changed:
        scene.set_instance_materials(instance, chosen[instance])


def split_surfaces_named(scene: kuafu.Scene, scene_path: str | Path, names: set[str]) -> None:
    """Does split_surfaces() if one of `names` is no material of the scene, but perhaps a surface's name."""
    if not names <= {scene.material_name(k) for k in range(scene.summary.material_count)}:
        split_surfaces(scene, scene_path)


def material_of(surface_name: str) -> str:
    """Returns the name of a surface's material: plaster for `plaster of ball`."""
    return surface_name.rpartition(_OF)[0] or surface_name


def names_of(chosen: Sequence[int], names: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of the surfaces numbered `chosen`. names: all surfaces' names by number. A material whose
    surfaces are all chosen appears once, under its own name."""
    of_material: dict[str, set[int]] = {}
    for k, name in enumerate(names):
        of_material.setdefault(material_of(name), set()).add(k)
    whole = {m for m, all_of_it in of_material.items() if all_of_it <= set(chosen)}
    out = (material_of(names[k]) if material_of(names[k]) in whole else names[k] for k in chosen)
    return tuple(dict.fromkeys(out))


def numbers_of(name: str, names: Sequence[str]) -> list[int]:
    """Returns the numbers of the surfaces that a name means: one surface, or all surfaces of a material."""
    exact = [k for k, other in enumerate(names) if other == name]
    return exact or [k for k, other in enumerate(names) if material_of(other) == name]


def _instances(document: dict[str, Any]) -> list[_Instance]:
    """Returns the objects of the default scene in the order of kuafu's numbers: each node before its children."""
    nodes, meshes = document.get("nodes", []), document.get("meshes", [])
    if document.get("scenes"):
        roots = document["scenes"][document.get("scene", 0)].get("nodes", [])
    else:
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [n for n in range(len(nodes)) if n not in children]
    out: list[_Instance] = []
    stack = list(reversed(roots))
    while stack:
        node = nodes[stack.pop()]
        matrix = np.reshape(node.get("matrix", np.eye(4)), (4, 4))
        if np.linalg.det(matrix[:3, :3]) * np.prod(node.get("scale", 1.0)) == 0.0:
            continue  # a scale of 0 hides the node and what is below it
        if "mesh" in node:
            mesh = meshes[node["mesh"]]
            shown = [p for p in mesh["primitives"] if _TRIANGLES <= p.get("mode", _TRIANGLES) <= _FAN]
            if shown:
                name = node.get("name") or mesh.get("name") or f"object {len(out)}"
                out.append((name, tuple(p.get("material", -1) for p in shown)))
        stack += reversed(node.get("children", []))
    return out


MATERIAL_FAMILY = "surface"  # of effects that change how materials send light back
# A float in a file holds a sum of powers of 2 exactly up to this number of materials.
MOST_MATERIALS = 48

SURFACES = Parameter(
    "surfaces", "bits", neutral=0.0, low=0.0, high=2.0**MOST_MATERIALS - 1, typical=1.0, choice=True,
    source="sum of 2^k over the scene file's materials k that show it; 0 = all surfaces",
)  # fmt: skip


def material_numbers(surfaces: float) -> list[int]:
    """Returns the material numbers k that an effect's parameter `surfaces`, a sum of 2^k, selects."""
    return [k for k in range(MOST_MATERIALS) if int(surfaces) >> k & 1]


def on_surfaces(light: Light, changed: Light, view: View, surfaces: float) -> Light:
    """Returns the light that is `changed` on the selected materials and `light` elsewhere. surfaces: the sum of 2^k
    over their numbers k. All pixels are selected by 0, or if the view has no material image."""
    if surfaces == 0 or view.material is None:
        return changed
    numbers = view.material, material_numbers(surfaces)
    here = view.once(("surfaces", surfaces), lambda: np.isin(*numbers))
    return Light.of_images(np.where(here, changed.images, light.images), light.supersampled)
