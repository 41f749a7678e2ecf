# SPDX-License-Identifier: Apache-2.0
"""Compares the simulator with a capture. Renders the capture's poses and fits the nuisances on the train frames.
Computes the errors of train and test frames, and finds which pixels of the train frames the model gets wrong.

compare() computes; report/ writes compare.json and report.html.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.capture.capture import SIDES, Capture, read_capture, usual_samples
from activestereo.common.html_table import table, text
from activestereo.common.phases import Phases
from activestereo.common.progress_bar import Progress
from activestereo.common.text_table import columns
from activestereo.compare.cache import LayerCache
from activestereo.compare.depth_compare import DepthFrame, depth_scores, model_depths
from activestereo.compare.engine_prediction import engines_of
from activestereo.compare.image_errors import ImageErrors, Judged, error_shape, image_errors
from activestereo.compare.mismatch import match_of, recording_warnings, scale_warnings
from activestereo.compare.noise import transfer_points
from activestereo.compare.render import BaseRenders, Renderer
from activestereo.compare.where import (
    LARGEST_DISPARITY_ERROR_PX,
    ResidualImage,
    covariate_maps,
    gather_samples,
    where_tables,
)
from activestereo.effects.core.model import Model
from activestereo.effects.core.surfaces import surface_text
from activestereo.effects.engines import CaptureRenderer, SceneMeasurement
from activestereo.effects.engines.loaded_scene import is_measured_room

# The phases' names, and the seconds that each takes on two cores: a guess for a first run.
RENDERING, LOOKING = "rendering the views", "looking where it fails"
PHASES = {RENDERING: 70.0, LOOKING: 20.0}  # seconds of twelve frames of 424x240

_ERRORS = ["frames", "infrared RMSE, DN", "noise floor, DN", "explainable, DN"]


@dataclass(frozen=True, repr=False)
class Comparison(ImageErrors):
    """The result of compare(): the model's expected images, their errors without the renderer's noise, and all scores.
    scores: the content of compare.json (report/schema/compare.schema.json). depths: a DepthFrame for each frame with
    the device's depth."""

    scores: dict[str, Any]
    depths: list[DepthFrame]

    def __repr__(self) -> str:
        return f"{self.scores['capture']}\n{columns([_ERRORS, *self._errors()])}"

    def _repr_html_(self) -> str:
        """Returns an HTML table of the errors of train and test frames, for a notebook."""
        return f"<p><b>{text(self.scores['capture'])}</b></p>{table(_ERRORS, self._errors(), numbers=(1, 2, 3))}"

    def _errors(self) -> list[list[str]]:
        """Returns the table's rows, under the titles _ERRORS."""
        errors = ("rmse_dn", "noise_floor_dn", "explainable_rmse_dn")
        return [
            [split, *("unknown" if scores[name] is None else f"{scores[name]:.3f}" for name in errors)]
            for split, scores in self.scores["ir"].items()
        ]


@dataclass(frozen=True)
class RenderedWith:
    """The settings with which a comparison's images were rendered. renderer: the renderer's `version`."""

    renderer: str
    samples_per_pixel: int
    max_bounces: int
    seed: int


def compare(
    capture_path: str | Path, model: Model | None = None, renderer: Renderer | None = None,
    samples_per_pixel: int | None = None, max_bounces: int = 8, seed: int = 0, cache: LayerCache | None = None,
    progress: Progress | None = None,
    engines: Callable[[Capture], CaptureRenderer] | None = None, scene_measurement: SceneMeasurement | None = None,
    calibrate: Callable[[Capture], Capture] | None = None,
) -> Comparison:  # fmt: skip
    """Compares the simulator with the capture in a folder. Raises CaptureError for a capture that cannot be used.

    model: effects on top of the base renderer; None: no effects. Expected images leave out random effects. renderer: a
    Renderer (render.py); None: kuafu on the best device. samples_per_pixel: None: usual_samples(). progress: called as
    progress(fraction done), or Phases that begin with PHASES. engines: makes a CaptureRenderer, which renders the
    model's effects; None: kuafu's if renderer is None, else effects change images by formulas. scene_measurement:
    measured focal lengths and albedos.
    calibrate: returns the capture with a measured rig and pattern in place of the nominal ones.
    """
    capture = read_capture(capture_path)
    capture.check_train()
    capture.check_scene()
    if calibrate is not None:
        capture = calibrate(capture)
    if renderer is None:
        renderer = CaptureRenderer()
        if not is_measured_room(capture):
            engines = engines or engines_of("auto", samples_per_pixel, max_bounces, seed)
    phases = progress if isinstance(progress, Phases) else Phases(progress, PHASES)
    phases.begin(RENDERING)
    model, samples = model or Model(), samples_per_pixel or usual_samples(capture)
    judged = [Judged(model, engines, scene_measurement), Judged(Model())][: 1 + bool(model.effects)]
    renders = BaseRenders(renderer, samples, max_bounces, seed, cache)
    errors, *without = image_errors(capture, judged, renders, phases)
    phases.begin(LOOKING)
    made = RenderedWith(renderer.version, samples, max_bounces, seed)
    return comparison_of(errors, made, without[0] if without else None)


def comparison_of(errors: ImageErrors, made: RenderedWith, without: ImageErrors | None = None) -> Comparison:
    """Makes a Comparison from a model's image errors, without rendering. made: the render's settings. without: the
    errors of the model without effects, for comparison; None leaves them out."""
    capture, model, seed = errors.capture, errors.model, made.seed
    views, measured, predictions = errors.views, errors.measured, errors.predictions
    noise_model = errors.noise_model
    depths = model_depths(capture, errors, model, seed)
    # The shape of the train frames' error.
    keys = [(frame.id, side) for frame in capture.split("train") for side in SIDES]
    floor = {key: errors.noise_variances.get(key, (0.0, ""))[0] for key in keys}
    shape = error_shape((measured[key], predictions[key], floor[key], views[key].known_mask()) for key in keys)
    beside = None
    if without is not None:  # {"ir": {split: RMSE in DN}, "depth": {split: RMSE of disparity in px}}
        scores_without = depth_scores(model_depths(capture, without, without.model, seed))
        beside = {
            "ir": {split: found["rmse_dn"] for split, found in without.by_split().items()},
            "depth": {split: found["rmse_px"] for split, found in scores_without.items()},
        }
    scores = {
        "capture": capture.name,
        **vars(made),
        "warnings": [*recording_warnings(errors), *scale_warnings(errors.fit)],
        "match": asdict(match_of(errors)) | {"frames": list(match_of(errors).frames)},
        "fit": asdict(errors.fit) | {"at_bound": list(errors.fit.at_bound)},
        "effects": [effect.id for effect, _ in model.effects],
        "noise_model": None if noise_model is None else vars(noise_model),
        "photon_transfer": transfer_points(capture),
        "ir": errors.by_split(),
        "shape": None if shape is None else vars(shape),
        "without_effects": beside,
        "depth": depth_scores(depths),
        "frames": errors.by_frame(),
    }
    scores |= _where_it_fails(errors, depths, seed)
    return Comparison(**{f.name: getattr(errors, f.name) for f in fields(errors)}, scores=scores, depths=depths)


def _where_it_fails(errors: ImageErrors, depths: Sequence[DepthFrame], seed: int) -> dict[str, Any]:
    """Returns the entries `where` and `channels` of compare.json: tables of the train frames' errors by covariate, and
    sizes."""
    capture, noise_model, maps = errors.capture, errors.noise_model, {}
    images: dict[str, list[ResidualImage]] = {"infrared": [], "disparity": [], "validity": []}
    for frame in capture.split("train"):
        for side in SIDES:
            key, expected = (frame.id, side), errors.predictions[frame.id, side]
            view, material = errors.views[key], errors.layers[frame.id][side].material
            maps[key] = covariate_maps(view, material, expected, capture.rig.baseline_m)
            # Each pixel's variance by the noise model, scaled to the image's mean variance; 0 if that is unknown.
            floor = np.zeros(expected.shape)
            if key in errors.noise_variances and noise_model is not None:
                variance, own = noise_model.variance(expected, frame.gain), errors.noise_variances[key][0]
                mean = variance.mean()
                floor = variance * (own / mean) if mean > 0 else np.full(expected.shape, own)
            residual, pose = errors.measured[key] - expected, side.encode() + frame.camera_to_world.tobytes()
            images["infrared"].append(ResidualImage(residual, floor, view.known_mask(), maps[key], pose))
    for d in (d for d in depths if d.frame.split == "train"):
        here = maps[d.frame.id, "left"], b"left" + d.frame.camera_to_world.tobytes()
        # Device minus model, and the squared difference of two exposures of the model.
        error, valid = d.disparity_error(d.measured, d.model[0])
        repeat, again = d.disparity_error(d.model[0], d.model[1])
        limit = LARGEST_DISPARITY_ERROR_PX
        error, repeat = (np.clip(x, -limit, limit) for x in (error, repeat))
        images["disparity"].append(ResidualImage(error, repeat**2, valid & again, *here))
        device, one, two = (np.asarray(z > 0, dtype=np.float64) for z in (d.measured, *d.model))
        images["validity"].append(ResidualImage(device - one, np.abs(one - two), np.ones(one.shape, bool), *here))
    units = {"infrared": "DN", "disparity": "px", "validity": "1"}
    found = {name: gather_samples(of_channel, units[name], seed) for name, of_channel in images.items()}
    channels = {name: samples for name, samples in found.items() if samples is not None}
    sizes = {}
    for name, samples in channels.items():
        rmse, noise = (float(np.sqrt(x.mean())) for x in (samples.residual**2, samples.floor))
        sizes[name] = {"is_explainable": samples.is_explainable, "rmse": rmse, "noise_floor": noise}
    return {"where": where_tables(channels, seed, surface_text(capture.scene_path)), "channels": sizes}
