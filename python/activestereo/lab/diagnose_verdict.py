"""What a ranking allows to say: which entries pass, which cannot be told apart, how sure the first is, and the verdict."""

import numpy as np

# Gates of acceptance. Log-likelihood: the largest of K null gains grows with log K, and five nats more are asked for.
_MARGIN_NATS = 5.0
# Practical size: share of the error above the floor that must go, and the least fall of the mean square in units of the floor's. Right
# effects leave next to nothing but the survey's errors, stand-ins most; of random fields other frames foretell a part only.
_SMALLEST_SHARE, _SMALLEST_FIELD_SHARE = 0.20, 0.10
_SMALLEST_GAIN_FLOORS = 0.01
# The same of the error in DN as it is: what only the brightest pixels show is little beside their noise, and much of the picture's
# error. And what leaves that error as it was is a patch for something else.
_SMALLEST_PLAIN_FLOORS, _PATCH_SHARE = 0.05, 0.03
# Of the disparity error's mean square: engines differ by themselves.
_SMALLEST_DEPTH_SHARE = 0.03
_CONSISTENT = 0.7
# What an effect's trace explains beyond its own with an amplitude that varies over the pictures (diagnose_constancy.py), as a share of what it
# explains with one. From the first on nothing is named: survey errors that look like an effect a little give one and more, right
# effects 0.03 and less under other formulas. From the second on another law is at work, where these are so many floors.
_LARGEST_VARIATION = 0.5
_OTHER_LAW_SHARE, _OTHER_LAW_FLOORS = 0.1, 0.012
# What stays after the best explanation is unexplained where it is so many floors above the floor, of which as many are structure (see
# goodness.py), and this share of the structure that was there at first. Surveys leave a structure of 0.02 to 0.09 floors where nothing is
# hidden, and formulas that are right but not the world's own one tenth of the first; stand-ins leave a quarter and more.
_UNEXPLAINED_FLOORS, _UNEXPLAINED_SHARE = 0.12, 0.2
_STRUCTURE_OF_NAMED = 0.075
# And whatever its shape (stripes finer than a tile are no structure), where nothing is named and so much stays: surveys leave a third.
_LARGEST_OF_SURVEYS = 0.5
# Rounding errors are even within a step, but for dark pictures that only use a few steps.
_ROUNDING_KNOWN_TO = 0.2
# Equivalence: as much left above the floor, within these, cannot be told apart by a model that is itself approximate.
_SAME_EXCESS_RATIO, _SAME_EXCESS_FLOORS = 1.2, 0.002
# How often the truth is among what may be named; temperature of the confidence's softmax over log excess, and how well the floor
# itself is known. Likelihoods of approximate models are worth less than they say (so many nats of gain count as one), and Laplace's
# evidence is good to a few. Fitted to what was right in worlds of generation 1 (tests/bank).
_NAMED = 0.97
_TEMPERATURE, _FLOOR_KNOWN_TO = 0.1, 0.01
_GAIN_NATS, _OCCAM_NATS = 20.0, 3.0


def is_significant(ranking, entry):
    """Whether an entry's gain is beyond chance among all tried, and an improvement wherever it acts."""
    threshold = _MARGIN_NATS + np.log(max(len(ranking.entries), 1)) + entry.choice
    return entry.nats > threshold and entry.consistency >= _CONSISTENT and entry.varying <= _LARGEST_VARIATION * entry.gain_floors


def passes(ranking, entry):
    """Whether an entry may be named: significant, and of practical size."""
    if entry.channel == "depth" and not ranking.at_floor:
        return False  # first what the images show: the engine matched those
    share = _SMALLEST_SHARE if entry.solution is not None else _SMALLEST_FIELD_SHARE
    share = _SMALLEST_DEPTH_SHARE if entry.channel == "depth" else share
    large = entry.explained >= share and entry.gain_floors >= _SMALLEST_GAIN_FLOORS
    if entry.plain_share is not None:
        large = large and entry.plain_share >= _PATCH_SHARE
        large = large or (entry.plain_share >= _SMALLEST_SHARE and entry.plain_floors >= _SMALLEST_PLAIN_FLOORS)
    return large and is_significant(ranking, entry)


def left(ranking, entry):
    """What an entry leaves above the floor, in floors."""
    return max(entry.chi2 / ranking.pixels - ranking.floor_chi2 / ranking.pixels, 0.0)


def equivalents(ranking, entry):
    """Other entries that explain the data as well, within their paired error or the models' own inadequacy."""
    if entry.nats <= 0 or entry.channel != "infrared":
        return []
    limit = _SAME_EXCESS_RATIO * left(ranking, entry) + _SAME_EXCESS_FLOORS
    chosen = []
    for other in ranking.entries:
        if other is entry or other.channel != "infrared" or other.nats <= 0 or other.gain_floors < 0.25 * entry.gain_floors:
            continue
        close = entry.nats - other.nats <= 2.0 * ranking.difference_error(entry, other) + 2.0
        if close or left(ranking, other) <= limit:
            chosen.append(other.id)
    return chosen


def confidences(ranking):
    """{id: probability of being what is missing}: a softmax of minus log of what each leaves above the floor, of its gain and of what its
    freedom costs, among those that may be named, which together have _NAMED; the others share the rest with 'none', or all where nothing may be
    named.

    Noise and the depth engine have evidence of their own: no rivals of what is missing in the expected images."""
    rivals = [e for e in ranking.entries if e.channel == "infrared"]
    named = np.array([passes(ranking, e) for e in rivals] + [False])
    logits = _logits(ranking, [*rivals, ranking.base], named)
    weights = np.empty(len(logits))
    for group, share in ((named, _NAMED), (~named, 1.0 - _NAMED)) if named.any() else ((~named, 1.0),):
        likely = np.exp(logits[group] - logits[group].max())
        weights[group] = share * likely / likely.sum()
    out = {e.id: float(w) for e, w in zip(rivals, weights, strict=False)}
    return out | {e.id: _NAMED if passes(ranking, e) else 0.0 for e in ranking.entries if e.channel != "infrared"}


def _logits(ranking, entries, named):
    """Of the confidence. The gain of what may not be named is not believed: survey errors gain, too."""
    left_over, gains, costs = (np.array(x) for x in zip(*((left(ranking, e), e.nats, e.occam) for e in entries), strict=True))
    return -np.log(left_over + _FLOOR_KNOWN_TO) / _TEMPERATURE + np.where(named, gains, 0.0) / _GAIN_NATS + costs / _OCCAM_NATS


def follows_other_law(ranking, entry, first):
    """Whether the trace of an effect that an entry adds to the first Ranking's model is there, but not as large everywhere as its law says."""
    solution = entry.solution or ranking.base.solution
    given = {e.id for e, _ in first.base.solution.model.effects}
    limit = max(_OTHER_LAW_SHARE * (first.base.chi2 - entry.chi2) / ranking.pixels, _OTHER_LAW_FLOORS)
    return any(ranking.varying(solution, e) > limit for e in solution.effects if e.id not in given)


def is_unexplained(ranking, entry, first=None):
    """Whether what an entry leaves (the base for none) asks for another effect; first: the Ranking without effects.

    Noise of single pixels asks for none: its level is a nuisance, and what is random and stays has candidates of its own. Those explain
    no structure: it is the base's that counts beside them. Where nothing is named, more than surveys leave does, too; what is named has to
    follow its own law."""
    excess = entry.chi2 / ranking.pixels - 1.0 - (1.0 + _ROUNDING_KNOWN_TO) * entry.repeats
    if first is None and excess - ranking.white > _LARGEST_OF_SURVEYS:
        return True
    if first is not None and excess > 0.0 and follows_other_law(ranking, entry, first):
        return True
    if excess <= _UNEXPLAINED_FLOORS:
        return False
    structure = ranking.structure_after(entry)
    if structure <= (_UNEXPLAINED_FLOORS if first is None else _STRUCTURE_OF_NAMED):
        return False
    return first is None or structure > _UNEXPLAINED_SHARE * first.structure_after(first.base)
