# SPDX-License-Identifier: Apache-2.0
"""Gathers a capture's evidence: images, their expected variances, tiles. Estimates the variances again under a model.

A missing effect passes for noise and for misplaced edges. For example, a dark signal that grows with temperature is not
light, but photon transfer takes it for light. If it grows from one repeat to the next, it adds to their variance. The
model found so far removes such errors from the estimate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from activestereo.capture.capture import SIDES, SPLITS, Capture, ImageKey, repeat_keys
from activestereo.capture.images import block_numbers
from activestereo.common.grouped import grouped
from activestereo.common.input_files import read_json
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.noise import (
    NoiseModel,
    by_repeats,
    frame_noise_variances,
    noise_at_other_gains,
    noise_of_images,
)
from activestereo.compare.nuisances import Nuisances, fit_nuisances, predict
from activestereo.compare.render import LayersOfFrames
from activestereo.diagnose.evidence import TILE_PX, Evidence, Observation, edge_discrepancy, weight_of
from activestereo.diagnose.fitter import ImageResidual
from activestereo.diagnose.geometry import Geometry, derivatives_in_dn, focal_slopes, geometry_slopes
from activestereo.effects import Model, View
from activestereo.effects.core.surfaces import scene_surfaces

# Noise if neither repeats nor the two cameras show it: the paper's gamma speckle (k = 60) and a read noise of 1 DN. It
# never leads to a named effect.
_ASSUMED_NOISE = (1.0, 0.0, 1.0 / 60.0)
# A material that covers less than this share of the train frames has no albedo nuisance.
_SMALLEST_MATERIAL = 0.002
# At most this share of an expected value is taken from the measurement itself.
_MOST_MEASURED = 0.5


def gather(capture: Capture, layers: LayersOfFrames, seed: int = 0, geometry: Geometry | None = None) -> Evidence:
    """Returns the Evidence of a capture from its rendered layers {frame id: {side: Layers}}. Frames without layers are
    left out.

    seed: seeds every random choice. geometry: the corrections that the capture already contains; None = none.
    """
    geometry = geometry or Geometry.as_stated(capture)
    measured_images = _measured_images(capture, layers, seed)
    train = [s for s in measured_images if s.frame.split == "train"]
    blind = {s.side for s in train} - {s.side for s in train if (s.view.depth_m > 0.0).any()}
    if blind:
        told = f"the {' and the '.join(sorted(blind))} camera sees no surface of the scene in any train frame"
        raise ValueError(f"{capture.path}: {told}: check camera_to_world, and the scene's place and units")
    seen = [(s.frame, s.layers, s.where_known()) for s in train]
    nuisances = fit_nuisances(seen, capture.rig.max_dn, capture.rig.black_dn).nuisances
    predicted = _predicted(train, nuisances)
    noise, shown = noise_of_images(capture, measured_images, predicted, nuisances.black_dn)
    noise_model = shown or NoiseModel(*_ASSUMED_NOISE, nuisances.black_dn)
    noise_variances = {key: variance for key, (variance, _) in noise.items()}
    if shown is None:
        noise_variances = {s.key: noise_model.image_variance(s) for s in measured_images}
    tiles, count = _tiles(train)
    evidence = Evidence(
        capture, (), (), nuisances, noise_model, noise_variances, shown is not None, 0, count, geometry, seed
    )
    observed, materials = _observed(evidence, measured_images, tiles, train)
    of = {split: tuple(o for o in observed if o.frame.split == split) for split in SPLITS}
    return replace(evidence, materials=materials, **of)


def held_out(evidence: Evidence, capture: Capture, layers: LayersOfFrames) -> tuple[Observation, ...]:
    """Returns observations of the frames that have layers. Noise model and materials are those of the evidence's train
    frames."""
    images = _measured_images(capture, layers, evidence.seed)
    variances = {s.key: evidence.noise_model.image_variance(s) for s in images} | evidence.noise_variances
    return _observed(replace(evidence, noise_variances=variances), images, {}, evidence.train)[0]


def _measured_images(capture: Capture, layers: LayersOfFrames, seed: int) -> list[MeasuredImage]:
    return [
        MeasuredImage(
            f, side, View.of(capture, f, side, layers[f.id][side], seed), layers[f.id][side], capture.ir(f, side)
        )
        for f in capture.frames
        for side in SIDES
        if f.id in layers
    ]


def _predicted(images: Sequence[MeasuredImage], nuisances: Nuisances) -> dict[ImageKey, np.ndarray]:
    return {s.key: predict(s.frame, s.layers, nuisances, s.view.max_dn) for s in images}


def _observed(
    evidence: Evidence,
    images: Sequence[MeasuredImage],
    tiles: Mapping[ImageKey, np.ndarray],
    train: Sequence[MeasuredImage],
) -> tuple[tuple[Observation, ...], int]:
    """Returns (observations of images with weights, slopes and materials; number of albedo nuisances). tiles: each
    pixel's tile, for train images only. train: the images that show how far edges are misplaced and which materials are
    large. Each large material except the largest has an albedo nuisance; the largest one's albedo is part of the
    scales."""
    nuisances, noise_model, places = evidence.nuisances, evidence.noise_model, evidence.geometry.places()
    edge_discrepancy_m = edge_discrepancy(train, _predicted(train, nuisances), noise_model)
    expected = _expected(images, evidence.noise_variances, nuisances)
    growing, moving = (derivatives_in_dn(images, nuisances, of) for of in (focal_slopes, geometry_slopes))
    material_of = np.array([s.material for s in scene_surfaces(evidence.capture.scene_path)], dtype=np.int64)

    def material(s: MeasuredImage) -> np.ndarray:
        """Returns the material of each pixel's surface, [height][width]. All objects of one material share an albedo
        error. An index that is no surface of the scene file is returned unchanged."""
        surface = np.asarray(s.layers.material).astype(np.int64)
        known = surface < len(material_of)
        return np.where(known, material_of[np.where(known, surface, 0)] if len(material_of) else surface, surface)

    seen_by_train = [material(s)[s.view.known_mask()] for s in train]
    ids, counts = np.unique(np.concatenate(seen_by_train), return_counts=True)
    least = _SMALLEST_MATERIAL * counts.sum()
    materials = [ids[i] for i in np.argsort(-counts) if counts[i] > least][1:]

    def observation(s: MeasuredImage) -> Observation:
        tile = tiles.get(s.key)
        index, seen = np.full(s.measured.shape, -1, np.int16), material(s)
        for number, name in enumerate(materials):
            index[seen == name] = number
        return Observation(
            s.frame,
            s.side,
            s.view,
            s.layers,
            s.measured,
            weight_of(noise_model, edge_discrepancy_m, s, expected[s.key]),
            np.full(s.measured.shape, -1, np.int32) if tile is None else tile,
            index,
            growing[s.key],
            moving[s.key],
            len(SIDES) + len(materials) + places[s.frame.id],
            None if s.view.known is None else np.flatnonzero(s.view.known),
        )

    return tuple(map(observation, images)), len(materials)


def _expected(
    measured_images: Sequence[MeasuredImage], noise_variances: Mapping[ImageKey, float], nuisances: Nuisances
) -> dict[ImageKey, np.ndarray]:
    """Returns the expected values in DN from which weights are computed. They are the model's prediction, mixed with
    the mean of repeated images. The mean's share grows with the error of the prediction, up to half.

    A weight that depends on its own pixel's noise biases fits downwards, since bright grains get too little weight.
    Therefore a prediction that is as good as the noise allows is used alone.
    """
    keys = repeat_keys(s.frame for s in measured_images)
    expected: dict[ImageKey, np.ndarray] = {}
    for group in grouped(((keys.get(s.frame.id, s.frame.id), s.side), s) for s in measured_images):
        images = [predict(s.frame, s.layers, nuisances, s.view.max_dn) for s in group]
        mean = np.mean([s.measured for s in group], axis=0)
        noise = np.mean([noise_variances[s.key] for s in group])
        square = np.mean([np.nanmean((s.where_known() - image) ** 2) for s, image in zip(group, images, strict=True)])
        share = _MOST_MEASURED * max(0.0, 1.0 - noise / max(square, 1e-12))
        expected |= {s.key: image + share * (mean - image) for s, image in zip(group, images, strict=True)}
    return expected


def _tiles(train: Sequence[MeasuredImage]) -> tuple[dict[ImageKey, np.ndarray], int]:
    """Numbers the tiles of all train images; returns ({image key: each pixel's tile}, number of tiles)."""
    first, out = 0, {}
    for s in train:
        tile = block_numbers(s.measured.shape, TILE_PX)
        out[s.key] = (first + tile).astype(np.int32)
        first += int(tile[-1, -1]) + 1
    return out, first


def weighed_again(evidence: Evidence, model: Model, black_dn: float, rows: Sequence[ImageResidual]) -> Evidence:
    """Returns the Evidence with noise and weights of the train images estimated again under a model. rows: residuals of
    the train images under that model."""
    train, expected = evidence.train, {row.observation.key: row.expected for row in rows}
    above_dn = max(black_dn, 0.0)  # digital numbers end at 0, so a black level below would pass for dark signal
    dark = {o.key: model.digital(np.zeros(o.view.shape), o.view, above_dn) - above_dn for o in train}
    noise_model, variances = evidence.noise_model, evidence.noise_variances
    lit_train = [replace(o, measured=o.measured - dark[o.key]) for o in train]
    lit = {key: image - dark[key] for key, image in expected.items()}
    if evidence.has_floor:
        groups = by_repeats((o.frame, o.side, o.key) for o in train)
        means = ((keys, np.mean([expected[k] for k in keys], axis=0)) for keys in groups)
        no_noise = dark | {key: expected[key] - mean for keys, mean in means for key in keys}
        own, found = frame_noise_variances(evidence.capture, evidence.nuisances.black_dn, no_noise)
        if found is not None:
            own_variances = {key: max(variance, ROUNDING_VARIANCE) for key, (variance, _) in own.items()}
            noise_model, others = noise_at_other_gains(found, lit_train, lit)
            variances = own_variances | others
    edges_m = edge_discrepancy(lit_train, lit, noise_model)
    weighed = tuple(replace(o, weight=weight_of(noise_model, edges_m, o, lit[o.key])) for o in train)
    return replace(
        evidence, train=weighed, noise_model=noise_model, noise_variances=evidence.noise_variances | variances,
    )  # fmt: skip


def no_infrared(capture_path: str | Path) -> str | None:
    """Returns the reason why a capture without infrared images cannot be judged; None if it has some or cannot be read.

    Depth alone cannot distinguish effects: nearly all of them fit it.
    """
    folder = Path(capture_path)
    file = folder if folder.name == "capture.json" else folder / "capture.json"
    if not file.is_file():
        return None  # read_capture reports the error
    try:
        frames = read_json(file)["frames"]
        missing = frames and all(frame.get("left") is None and frame.get("right") is None for frame in frames)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return "the capture has no infrared images: depth alone fits nearly every effect" if missing else None
