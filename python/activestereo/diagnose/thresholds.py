# SPDX-License-Identifier: Apache-2.0
"""Every threshold of a diagnosis, in one frozen table: value, unit, what it decides, and where the value comes
from.

Sources: *theory* is a formula or a count; *convention* is a round number that a user may want otherwise; *calibrated*
was fitted to test cases of generation 1 of the benchmark suite (tests/benchmark_suite), which the reported figures
never use. How its figures change with a threshold was found on 284 cases of generation 35383: right name 0.967, false
alarms 0.000, 'unknown' where the library lacks the effect 0.812.
"""

from dataclasses import dataclass, field, fields
from math import log
from typing import Any

_CALIBRATED = "calibrated"
_NOTHING_MOVES = "none"
_NOT_JUDGED = "not judged"


def _threshold(value: float, unit: str, decides: str, source: str, moves: str = _NOTHING_MOVES) -> Any:
    """moves: figures of the benchmark suite when the threshold is halved and doubled, as
    tests/benchmark_suite/threshold_study.py prints them."""
    return field(default=value, metadata={"unit": unit, "decides": decides, "source": source, "moves": moves})


def _fitting(value: float, unit: str, decides: str, source: str) -> Any:
    """A threshold that decides what is fitted, which the study of verdicts on finished fits cannot judge."""
    return _threshold(value, unit, decides, source, _NOT_JUDGED)


@dataclass(frozen=True)
class Thresholds:
    """Noise variances: mean squares over that of the noise (a reduced chi-square). Shares: of the error above the
    floor, unless said otherwise."""

    # fmt: off
    # May it be named?
    alpha: float = _threshold(0.01, "1", "probability of a name by chance: a name needs the logarithm of (number of "
        "effects that were tried / alpha), in nats", "theory: a likelihood ratio exceeds 1 / alpha with a probability "
        "of alpha at most (Markov), one of K with K alpha; the value is a convention")
    least_share: float = _threshold(0.05, "1", "least share of the squared error in DN above the floor that a named "
        "effect of images must remove: the lower end of its interval; of the disparity error, that a fault of the "
        "depth engine must explain; of what others explain, that a field must add to them",
        "convention: with less a name explains nothing")
    smallest_share: float = _threshold(0.20, "1", "least share of the error that a named effect of images must "
        "explain, of its gain that another one needs to count as equal, and of the initial structure that must remain "
        "for something to be missing", _CALIBRATED, moves="halved: named +0.017; doubled: named -0.017, outside -0.188")
    smallest_field_share: float = _threshold(0.1, "1", "the same for random fields and noise, since other frames "
        "predict only a part of them, and of what fields explain that are shown together", "convention: a tenth")
    smallest_gain_reduced_chi2: float = _threshold(0.01, "noise variances", "least decrease of the mean squared "
        "error: the noise floor is known no better", _CALIBRATED, moves="doubled: named -0.017")
    consistent_share: float = _threshold(0.7, "1", "least share of the images affected by the effect that must improve",
        "convention: seven of ten", moves="halved: outside -0.062; doubled: nothing is named")
    largest_variation: float = _threshold(0.5, "1", "most that a varying amplitude may explain for an effect to be "
        "named, relative to what one amplitude explains", _CALIBRATED, moves="doubled: outside -0.062")
    # Is it the whole truth?
    unexplained_reduced_chi2: float = _threshold(0.1, "noise variances", "structure and excess above which something "
        "is missing: of all images, where no effect is named also of one beyond the others and of one frame of a view "
        "beyond the others; with less excess the images lack nothing, so that the depth is judged",
        "convention: a tenth of the noise", moves="doubled: outside -0.188")
    largest_prior_sigmas: float = _threshold(4.0, "1", "farthest that a named effect's fit may take geometry or "
        "an albedo from what is stated beyond where the fit without it takes them, in the stated deviations",
        "theory: one normal error in 16 000 is larger")
    largest_scene_error_reduced_chi2: float = _threshold(0.5, "noise variances", "largest excess of any shape that "
        "errors of the scene measurement leave, where no effect is named", _CALIBRATED,
        moves="halved: outside +0.062; doubled: outside -0.062")
    # Can it be distinguished from others?
    paired_errors: float = _threshold(2.0, "1", "number of paired standard errors within which two explanations count "
        "as equal", "theory: a two-sided 95 % interval")
    # How sure is it?
    named_probability: float = _threshold(0.97, "1", "probability that the true effect is in the list of possible "
        "names", _CALIBRATED)
    nats_per_unit: float = _threshold(20.0, "nats", "nats of likelihood that raise the logarithm of a confidence by "
        "one: no formula is exact (coarsened posterior, Miller and Dunson 2019)", _CALIBRATED)
    missing_exponent: float = _threshold(4.0, "1", "power of what is left, in units of what may be left, that the odds "
        "of something else go with", "convention: odds of 16 to 1 at twice the limit")
    # Adding further effects.
    most_effects: int = _fitting(4, "1", "largest number of effects that --greedy adds", "convention")
    needless_nats: float = _fitting(5.0, "nats", "loss of likelihood below which an effect is removed again",
        "convention: odds of 150 to 1")
    needless_reduced_chi2: float = _fitting(0.005, "noise variances", "the same limit in units of the noise floor, "
        "for effects and for parameters", _CALIBRATED)
    formulas_share: float = _fitting(0.015, "1", "share of what is explained that inexact formulas may leave over, and "
        "by which two explanations may differ and still count as equal", _CALIBRATED)
    drift_share: float = _fitting(0.02, "1", "share by which the noise floor must fall, once the dark signal and drift "
        "of a found effect are removed, for weights to be computed again", "convention")
    needless_parameter_share: float = _fitting(0.03, "1", "least share of its effect's gain that a free parameter must "
        "contribute", _CALIBRATED)
    # Random fields.
    white_share: float = _fitting(0.35, "1", "ratio of the covariance of neighbours to the variance, below which a "
        "residual is white noise", _CALIBRATED)
    largest_white_reduced_chi2: float = _fitting(0.06, "noise variances", "largest error that the renderer's own noise "
        "causes", "theory: Monte Carlo noise of 32 samples")
    neighbour_correlation: float = _fitting(0.4, "1", "correlation of neighbours above which values are no random "
        "field, and rows are bands of light", "convention: draws are independent")
    hot_sigma: float = _fitting(5.0, "1", "standard deviations above which a pixel counts as an outlier, such as a hot "
        "pixel", "theory: one pixel in four million by chance")
    clear_of_ends: float = _fitting(2.0, "1", "standard deviations that a pixel's values must keep from the ends of "
        "the range", "convention")
    component_sigmas: float = _fitting(3.0, "1", "standard errors by which a variance component must differ from zero",
        "theory: 99.7 %")
    # Noise.
    comb_share: float = _fitting(0.995, "1", "share of the pixels that must lie on the steps of coarse digital numbers",
        "convention")
    # The depth engine.
    engines_differ: float = _fitting(1.7, "1", "factor within which the differences of neighbouring disparities of two "
        "depth engines agree", _CALIBRATED)
    poses_known_to_rad: float = _fitting(0.0025, "rad", "uncertainty of measured orientations",
        "convention: an eighth of a degree")
    # What to measure next.
    worth_nats: float = _fitting(2.0, "nats", "least difference of likelihoods that a proposed measurement must be "
        "expected to make", "convention")
    lever_ratio: float = _fitting(2.0, "1", "ratio of what a proposed measurement tells to what the same frames tell "
        "again, below which other views come first", "theory: twice the light doubles the nats of what the views tell "
        "already")
    # Effort: what is worth another look.
    out_of_reach: float = _fitting(0.03, "1", "share of the best gain in the scan below which an effect is not fitted",
        _CALIBRATED)
    worth_polishing: float = _fitting(2e-4, "1", "relative decrease of chi2 that a fit on some pixels needs to be "
        "repeated on all images", _CALIBRATED)
    worth_steps: float = _fitting(4e-3, "1", "relative decrease of chi2 that it needs to take further steps there",
        _CALIBRATED)
    close_share: float = _fitting(0.4, "1", "share of the best gain above which an effect is fitted further, or "
        "refined by rendering", _CALIBRATED)
    hopeless_share: float = _fitting(0.01, "1", "share of the best gain below which an effect is dropped",
        _CALIBRATED)
    polished: int = _fitting(3, "1", "number of effects that are always fitted further", "convention")
    close_nats: float = _fitting(10.0, "nats", "difference of likelihoods within which an explanation may still become "
        "the best", "convention")
    rendered: int = _fitting(2, "1", "number of explanations that are refined by rendering, where the engine can "
        "render them", "convention")
    near_size_share: float = _fitting(0.5, "1", "share of the size that a name needs, which an effect's own formula "
        "must reach for it to be refined by rendering", "convention: formulas miss less than half of what they stand "
        "for")
    sized: int = _fitting(5, "1", "number of explanations for which the decrease of the error in DN is computed",
        "convention")
    # fmt: on

    def chance_nats(self, tried: int) -> float:
        """The gain, in nats, that the largest of so many likelihood ratios exceeds by chance with probability alpha."""
        return log(max(tried, 1) / self.alpha)


THRESHOLDS = Thresholds()


def thresholds_table(thresholds: Thresholds = THRESHOLDS) -> str:
    """The table as Markdown: name, value, unit, what it decides, source, what moves with it."""
    lines = [
        "| threshold | value | unit | decides | source | changes when it is halved or doubled |",
        "|---|---|---|---|---|---|",
    ]
    for f in fields(thresholds):
        unit, source = "" if f.metadata["unit"] == "1" else f.metadata["unit"], f.metadata["source"]
        lines.append(
            f"| `{f.name}` | {getattr(thresholds, f.name):g} | {unit} | {f.metadata['decides']} | {source} | "
            f"{f.metadata['moves']} |"
        )
    return "\n".join(lines)


def share_words(share: float) -> str:
    """A share for a sentence: 'a fifth', 'a tenth', else '3 %'."""
    words = {1 / 2: "half", 1 / 3: "a third", 1 / 4: "a quarter", 1 / 5: "a fifth", 1 / 10: "a tenth"}
    return words.get(share, f"{100 * share:g} %")


if __name__ == "__main__":
    print(thresholds_table())
