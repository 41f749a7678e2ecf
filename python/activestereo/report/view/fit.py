# SPDX-License-Identifier: Apache-2.0
"""The numbers of a capture that its calibration does not tell: how bright the projector and the room are in counts, the
black level, and the noise."""

from __future__ import annotations

from activestereo.capture.capture import SIDES, Capture, Frame
from activestereo.compare.cache import LayerCache
from activestereo.compare.kuafu_renderer import KuafuRenderer
from activestereo.compare.noise import fit_noise_model, repeat_statistics
from activestereo.compare.nuisances import fit_nuisances
from activestereo.compare.render import render_frames
from activestereo.model import Imager, Quantity
from activestereo.model.model import NOISE_TERMS, NUISANCES

_SOURCE = "fitted in activestereo view"
# Poses that the light is fitted to; one suffices where its dots stand out.
_MOST_POSES = 3
_SAMPLES, _BOUNCES = 16, 4


def fitted_nuisances(capture: Capture, renderer: KuafuRenderer) -> dict[str, Quantity]:
    """{name of NUISANCES: Quantity}, by least squares on a few train frames without any effect. Raises ValueError if
    there is nothing to fit."""
    frames = _chosen(capture)
    layers = render_frames(capture, renderer, _SAMPLES, _BOUNCES, cache=LayerCache(), frames=frames)
    seen = [(f, layers[f.id][side], capture.ir(f, side)) for f in frames for side in SIDES]
    values = vars(fit_nuisances(seen, capture.rig.max_dn, capture.rig.black_dn).nuisances)
    return {name: Quantity(float(value), unit=NUISANCES[name][0], source=_SOURCE) for name, value in values.items()}


def fitted_noise(capture: Capture, black_dn: float) -> Imager | None:
    """The noise model of the capture's repeats; None without repeats."""
    noise_model = fit_noise_model(repeat_statistics(capture), black_dn, capture.rig.max_dn)
    if noise_model is None:
        return None
    return Imager(
        **{n: Quantity(getattr(noise_model, n), unit=unit, source=_SOURCE) for n, unit in NOISE_TERMS.items()}
    )


def _chosen(capture: Capture) -> list[Frame]:
    """Frames of the first few poses, the train frames' first."""
    poses: dict[bytes, Frame] = {}
    for frame in [*capture.split("train"), *capture.frames]:
        if frame.has_infrared:
            poses.setdefault(frame.camera_to_world.tobytes(), frame)
    return list(poses.values())[:_MOST_POSES]
