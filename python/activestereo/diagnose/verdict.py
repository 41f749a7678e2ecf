# SPDX-License-Identifier: Apache-2.0
"""Decides the verdict and its probability from the explained error, the remaining error and its structure."""

from dataclasses import dataclass

from activestereo.diagnose.numbers import Numbers

EFFECT, NONE, UNKNOWN, UNDETERMINED = "effect", "none", "unknown", "undetermined"
# Beside a name the errors of train frames, which test frames confirm, count by this share, and those of test frames by
# the other: of pairs of round shares, these told the most names from effects of no library, in 161 training cases of
# generations 68526 and 4304.
_TRAIN, _TEST = 0.8, 0.5
# How often first names were right in training cases of the benchmark suite that hide something, outside of the library
# too: of generations 50525, 81119 and 82612, by missing() before test frames had weights. A set of
# black_level and dark_signal counts as right where the truth is one of the two.
# (upper end of missing(), first names that were right, all first names)
_COUNTED = ((0.5, 264, 264), (1.0, 30, 31), (2.0, 5, 16), (float("inf"), 3, 22))
# The same for searches without a name: they are right if a case hides nothing, or less than counts as detectable.
_NONE_COUNTED = ((1.0, 239, 245), (float("inf"), 0, 7))


@dataclass(frozen=True)
class Remainder:
    """The numbers behind a verdict, in noise variances unless stated otherwise.

    explained: fall of the mean square by all named effects. drawn: its part due to random fields. left: mean square
    beyond the noise. structure, structure_before: of the residual with and without the named effects (goodness.py).
    strain: the farthest that named effects move the rig or an albedo from its stated value, in stated deviations. If no
    effect is named, it is the second farthest albedo. test_explained, test_left: explained and left on test frames;
    None if these show nothing. test_unlike: the largest ratio, over test frames, of left to explained (at least
    scene_error). names: the number of named effects of expected images. is_full: whether the search reached its largest
    number of names, or names together absorb any error of the projector's light (takes_any_light() of outcome.py).
    by_frame: the largest other_law() (selection.py) of a named drift; beyond 1 its law over frames is another.
    """

    explained: float
    left: float
    structure: float
    structure_before: float
    strain: float = 0.0
    drawn: float = 0.0
    test_explained: float | None = None
    test_left: float | None = None
    test_unlike: float = 0.0
    names: int = 1
    is_full: bool = False
    by_frame: float = 0.0


def missing(rest: Remainder, numbers: Numbers) -> float:
    """Returns the remaining error relative to the error that may remain. Beyond 1 an effect is still missing.

    Each number of `rest` is divided by its limit, and the largest ratio is returned. The limit of `strain` is always
    the same. Without a named effect of expected images, `left` may reach the error of the scene measurement, and
    `structure` must be near 0. The same holds if named effects explain little of expected images, as random fields and
    temporal noise do. Otherwise, `left` may reach what the named effects explain in expected images. `structure` may
    then be larger, as formulas are not exact. It counts less, the smaller it is relative to structure_before / names.
    Names that share out an effect outside the library leave more structure. Of what random fields explain, predictions
    of their draws may miss formula_error. Test frames must always confirm: test_left may reach test_explained. With
    effects of expected images named, no test frame may exceed its own limit, and a weighted sum of train and test
    ratios counts.
    """
    if rest.is_full:
        return float("inf")
    is_tested, test_left = rest.test_left is not None, max(rest.test_left or 0.0, 0.0)
    in_images, left = rest.explained - rest.drawn, rest.left - numbers.formula_error * max(rest.drawn, 0.0)
    if not rest.names or in_images < numbers.least_excess:
        structure = min(rest.structure, max(left, 0.0)) / numbers.structure
        unconfirmed = test_left / max(rest.test_explained or 0.0, numbers.scene_error)
        return max(left / numbers.scene_error, structure, rest.strain / numbers.strain, unconfirmed)
    structure = max(rest.structure, 0.0)
    structure *= min(1.0, rest.names * structure / max(rest.structure_before, 1e-9)) / numbers.structure_kept
    train = max(structure, left / max(in_images, numbers.structure))
    unconfirmed = test_left / max(rest.test_explained or 0.0, numbers.structure)
    beside = _TRAIN * train + _TEST * unconfirmed if is_tested else train
    return max(beside, rest.strain / numbers.strain, unconfirmed, rest.test_unlike, rest.by_frame)


def verdict_of(rest: Remainder, is_named: bool, has_floor: bool, numbers: Numbers) -> str:
    """Returns EFFECT, NONE, UNKNOWN or UNDETERMINED. is_named: whether an effect was named. has_floor: whether the
    noise was measured."""
    if not is_named and not has_floor:
        return UNDETERMINED
    if missing(rest, numbers) > 1.0:
        return UNKNOWN
    return EFFECT if is_named else NONE


def probability_right(beyond: float, is_named: bool) -> float:
    """Returns the probability that the first named effect is right (or, without a name, that none is missing), by
    Laplace's rule of succession. beyond: the result of missing(). is_named: whether an effect was named."""
    counted = _COUNTED if is_named else _NONE_COUNTED
    right, all_of_them = next((right, n) for limit, right, n in counted if beyond <= limit)
    return (right + 1) / (all_of_them + 2)
