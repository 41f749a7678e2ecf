"""What a diagnosis looks at: measured images with their light layers, expected variances and tiles.

Everything random is judged against the photon-transfer law of the repeats, everything correlated by tiles of 16 pixels.
"""

from dataclasses import dataclass, field

import numpy as np

from activestereo.capture import EYES
from activestereo.effects import Model, View
from activestereo.lab.diagnose_inadequacy import edge_slopes, law_at_other_gains, place_error
from activestereo.lab.fit import fit_nuisances, predict
from activestereo.lab.noise import NoiseLaw, frame_floors

TILE_PX = 16
# What lies closer may share an error: folds and standard errors go by blocks.
BLOCK_PX = 32
FOLDS = 4
_SIDE = BLOCK_PX // TILE_PX
# Noise of captures without repeats: the paper's gamma speckle (k = 60) and a read noise of 1 DN; never used to name an effect.
_ASSUMED_NOISE = (1.0, 0.0, 1.0 / 60.0)
_QUANTISATION_VARIANCE = 1.0 / 12.0
# A material's nominal albedo is believed to this relative deviation.
ALBEDO_SIGMA = 0.03
# A calibration's focal length is, too.
_FOCAL_SIGMA = 6e-4
_FOCAL_STEP = 2e-3
_SMALLEST_MATERIAL = 0.002
# Of an expected value, so much at most is taken from the measurement itself.
_MOST_MEASURED = 0.5


@dataclass
class Observation:
    """One eye of one frame. weight: 1 / variance, [height][width]; tile: index of each pixel's tile, from 0, over all
    observations; fold: the tile's cross-validation fold; material: index into the albedo nuisances, -1 = none; focal_slope: DN per
    relative change of the focal length; pick: flat indices of the pixels that count, None = all."""

    frame: object
    eye: str
    view: object
    layers: object
    measured: np.ndarray
    weight: np.ndarray = None
    tile: np.ndarray = None
    fold: np.ndarray = None
    material: np.ndarray = None
    focal_slope: np.ndarray = None
    pick: object = None

    @property
    def key(self):
        return self.frame.id, self.eye


@dataclass
class Evidence:
    """train, test: Observations; floors: {(frame id, eye): DN^2}; law: NoiseLaw; has_floor: whether repeats told it."""

    capture: object
    train: list
    test: list
    nuisances: object
    law: NoiseLaw
    floors: dict
    has_floor: bool
    materials: int = 0
    tiles: int = 0
    place_error_m: float = 0.0
    _memory: dict = field(default_factory=dict, repr=False)

    def once(self, name, make):
        """make(), computed the first time that it is asked for: rankings of one capture share fitters and base fits."""
        if name not in self._memory:
            self._memory[name] = make()
        return self._memory[name]

    @property
    def held_sigma(self):
        """Prior deviations of the nuisances that a calibration or survey tells: focal lengths of both eyes, then albedos."""
        return np.concatenate([np.full(len(EYES), _FOCAL_SIGMA), np.full(self.materials, ALBEDO_SIGMA)])

    def floor_variance(self, observations):
        """Mean temporal variance of their pixels, DN^2."""
        return float(np.mean([self.floors[o.key] for o in observations]))

    def weight(self, o, expected):
        """1 / variance of an Observation's pixels, float32, from their expected values in DN."""
        variance = np.maximum(self.law.variance(expected, o.frame.gain), _QUANTISATION_VARIANCE)
        if self.place_error_m > 0:
            variance = variance + (self.place_error_m * edge_slopes(o, expected)) ** 2
        return (1.0 / variance).astype(np.float32)


def gather(capture, layers):
    """The Evidence of a capture and its rendered layers {frame id: {eye: Layers}}."""
    observations = [
        Observation(f, eye, View.of(capture, f, eye, layers[f.id][eye]), layers[f.id][eye], capture.ir(f, eye))
        for f in capture.frames
        for eye in EYES
    ]
    train = [o for o in observations if o.frame.split == "train"]
    test = [o for o in observations if o.frame.split == "test"]
    fit = fit_nuisances([(o.frame, o.layers, o.measured) for o in train], capture.rig.max_dn)
    floors, law = frame_floors(capture, fit.nuisances.black_dn)
    has_floor = law is not None
    if not has_floor:
        law = NoiseLaw(*_ASSUMED_NOISE, fit.nuisances.black_dn)
        floors = {o.key: (law.mean_variance(o.measured, o.frame.gain), "assumed") for o in observations}
    evidence = Evidence(
        capture, train, test, fit.nuisances, law, {key: max(v[0], _QUANTISATION_VARIANCE) for key, v in floors.items()}, has_floor
    )
    _number_tiles(evidence)
    _number_materials(evidence)
    for o in observations:
        o.focal_slope = _focal_slope(o, fit.nuisances)
    expected = _expected(observations, evidence)
    _allow_for_inadequacy(evidence, observations, expected)
    for o in observations:
        o.weight = evidence.weight(o, expected[o.key])
    return evidence


def _allow_for_inadequacy(evidence, observations, expected):
    """Noise at gains without repeats, and what the survey of the scene leaves at edges."""
    predicted = {o.key: predict(o.frame, o.layers, evidence.nuisances, evidence.capture.rig.max_dn) for o in evidence.train}
    if evidence.has_floor:
        shown = {o.frame.gain for o in evidence.train if o.frame.repeat_group is not None}
        evidence.law = law_at_other_gains(evidence.law, evidence.train, predicted, shown)
        for o in observations:
            if o.frame.gain not in shown:
                evidence.floors[o.key] = max(evidence.law.mean_variance(o.measured, o.frame.gain), _QUANTISATION_VARIANCE)
    evidence.place_error_m = place_error(evidence.train, predicted, evidence.law)


def _focal_slope(o, nuisances):
    model, (u, v), (cx, cy) = Model(), o.view.pixels(), o.view.K[:2, 2]
    light = model.light(o.layers, o.view, fine=False)
    shorter = 1.0 / (1.0 + _FOCAL_STEP)
    longer = light.warped(cx + (u - cx) * shorter, cy + (v - cy) * shorter)
    change = model.signal(longer, o.view, nuisances) - model.signal(light, o.view, nuisances)
    return (change / _FOCAL_STEP).astype(np.float32)


def _expected(observations, evidence):
    """Expected values: the model's prediction, and of the measurement (the mean of repeats) as much as the prediction lacks.

    A weight that has seen its own pixel's noise pulls fits down: bright grains weigh too little. So a prediction that is as good
    as the noise allows is trusted alone; one that misses something is believed half at least, for its own fit's sake."""
    groups = {}
    for o in observations:
        key = (o.frame.repeat_group, o.eye) if o.frame.repeat_group is not None else o.key
        groups.setdefault(key, []).append(o)
    expected = {}
    for group in groups.values():
        images = [predict(o.frame, o.layers, evidence.nuisances, evidence.capture.rig.max_dn) for o in group]
        mean = np.mean([o.measured for o in group], axis=0)
        share = _missing_share(group, images, mean, evidence)
        expected |= {o.key: image + share * (mean - image) for o, image in zip(group, images, strict=True)}
    return expected


def _missing_share(group, images, mean, evidence):
    """Share of the repeats' mean in an expected value, from none to a half: of the squared residual, what is no noise."""
    noise = np.mean([evidence.floors[o.key] for o in group])
    square = np.mean([(o.measured - image) ** 2 for o, image in zip(group, images, strict=True)])
    return _MOST_MEASURED * max(0.0, 1.0 - noise / max(square, 1e-12))


def _number_tiles(evidence):
    """Folds are blocks of the image, other ones in every pose: a highlight that one place shows is judged by those of other poses."""
    first, poses = 0, {}
    for o in evidence.train:
        turn = poses.setdefault(o.frame.camera_to_world.tobytes(), len(poses))
        height, width = o.measured.shape
        rows, columns = np.arange(height) // TILE_PX, np.arange(width) // TILE_PX
        across = columns[-1] + 1
        o.tile = first + rows[:, None] * across + columns[None]
        o.fold = (((rows[:, None] // _SIDE) % 2 * 2 + (columns[None] // _SIDE) % 2 + turn) % FOLDS).astype(np.int64)
        first += (rows[-1] + 1) * across
    evidence.tiles = first


def _number_materials(evidence):
    """Materials that cover enough of the train frames get an albedo nuisance, but for the largest one: the scales are its own."""
    ids, counts = np.unique(np.concatenate([np.asarray(o.layers.material).ravel() for o in evidence.train]), return_counts=True)
    order = np.argsort(-counts)
    chosen = [ids[i] for i in order if counts[i] > _SMALLEST_MATERIAL * counts.sum()][1:]
    for o in evidence.train + evidence.test:
        o.material = np.full(o.measured.shape, -1)
        for index, name in enumerate(chosen):
            o.material[np.asarray(o.layers.material) == name] = index
    evidence.materials = len(chosen)
