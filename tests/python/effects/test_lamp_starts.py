# SPDX-License-Identifier: Apache-2.0
"""Where a fit of a lamp starts: near one that stands in the room, too."""

from types import SimpleNamespace

import numpy as np

from activestereo.effects.core import lamp as module
from activestereo.effects.core.descriptor import StartImage
from activestereo.effects.core.lamp import lamp_pose, lamp_starts, radiance_under

SHAPE = (48, 80)


def room():
    """(points, normals) of a floor and a wall behind it, in camera axes that are the world's."""
    across, along = np.meshgrid(np.linspace(-1.2, 1.2, SHAPE[1]), np.linspace(-1.0, 1.0, SHAPE[0]))
    on_floor = (along < 0.0)[..., None]
    points = np.where(
        on_floor,
        np.stack([across, np.full(SHAPE, -0.3), 0.8 + along], -1),
        np.stack([across, along, 0 * across + 0.8], -1),
    )
    return points, np.where(on_floor, [0.0, 1.0, 0.0], [0.0, 0.0, -1.0])


def test_a_lamp_in_the_room_is_sought_where_it_may_stand(monkeypatch):
    """Light falls off beside a near lamp, of which the normals of two surfaces tell nothing."""
    points, normal = room()
    shading = module.Shading.__new__(module.Shading)
    vars(shading).update(points=points, normal=normal, reflectance=np.full(SHAPE, 0.2), hit=np.ones(SHAPE, bool))
    monkeypatch.setattr(module.Shading, "of", lambda *_: shading)
    frame, unshadowed = SimpleNamespace(camera_to_world=np.eye(4)), lambda *_, choice: np.ones(SHAPE)
    view = SimpleNamespace(left_to_camera=np.eye(4), frame=frame, latest=unshadowed)
    light = SimpleNamespace(ambient=np.full(SHAPE, 0.1))

    def shown(azimuth_rad, elevation_rad, nearness_per_m):
        pose = lamp_pose(azimuth_rad, elevation_rad, nearness_per_m)
        kind = "point" if nearness_per_m else "directional"
        lamp = SimpleNamespace(kind=kind, ir_intensity=np.pi)
        return radiance_under(lamp, pose, light, view)

    truth = {"azimuth_rad": 2.0, "elevation_rad": 0.7, "nearness_per_m": 0.9}
    residual = 40.0 * 1.5 * shown(*truth.values())

    def left_by(start):
        place = shown(*(start.get(name, 0.0) for name in truth))
        columns = np.stack([place.ravel(), np.ones(place.size)])
        found = np.linalg.lstsq(columns.T, residual.ravel(), rcond=None)[0]
        return np.mean((residual.ravel() - found @ columns) ** 2) / np.var(residual)

    starts = lamp_starts([StartImage(view, light, np.ones(SHAPE), residual, residual, 40.0, residual)])
    assert min(map(left_by, starts)) < 0.05 < min(map(left_by, starts[:2]))
