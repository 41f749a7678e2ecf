# SPDX-License-Identifier: Apache-2.0
"""The list of pictures: each tile is a function from a device to a uint8 RGB image, with its section, title and
note."""

from dataclasses import dataclass
from typing import Callable


@dataclass(frozen=True)
class Tile:
    section: str
    name: str  # of the file
    title: str
    note: str
    draw: Callable


TILES: list[Tile] = []


def tile(section, title, note, name=None):
    """Adds the function below to the gallery. name: the picture's; without it, the function's."""

    def add(draw):
        TILES.append(Tile(section, name or draw.__name__, title, note, draw))
        return draw

    return add
