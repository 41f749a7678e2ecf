"""Every threshold of a diagnosis, in one frozen table: value, unit, what it decides, and where the value comes
from.

Sources: *theory* is a law or a count; *convention* is a round number that a user may want otherwise; *calibrated* was
fitted to worlds of the bank's generation 1 (tests/bank), which the reported figures never use. How much the bank's figures
move with a gate was found on 325 worlds of generation 0: named and right 0.932, false alarms 0, outside said so 0.778.
"""

from dataclasses import dataclass, field, fields
from typing import Any

_GENERATION_1 = "calibrated: worlds of generation 1"


_NO_FIGURE = "no figure"
_EARLIER = "acts before the verdict"


def _gate(value: float, unit: str, decides: str, source: str, moves: str = _NO_FIGURE) -> Any:
    """moves: figures of the bank when the gate is halved and doubled, as tests/bank/gate_study.py prints them."""
    return field(default=value, metadata={"unit": unit, "decides": decides, "source": source, "moves": moves})


def _earlier(value: float, unit: str, decides: str, source: str) -> Any:
    """A gate that decides what is fitted: verdicts passed again on what was fitted do not show it."""
    return _gate(value, unit, decides, source, _EARLIER)


@dataclass(frozen=True)
class Gates:
    """Floors: mean squares in units of the noise floor. Shares: of the error above the floor, unless said otherwise."""

    # May it be named?
    margin_nats: float = _gate(
        5.0,
        "nats",
        "gain asked for beyond the logarithm of how many effects were tried",
        "theory: the largest of K null gains grows with log K; the margin is a convention",
    )
    smallest_share: float = _gate(
        0.20,
        "1",
        "least share that a named effect explains",
        _GENERATION_1,
        moves="halved: false alarms +0.051, outside -0.037; doubled: named -0.014",
    )
    smallest_field_share: float = _gate(
        0.10, "1", "the same of random fields, of which other frames foretell a part only", _GENERATION_1
    )
    smallest_depth_share: float = _gate(
        0.03, "1", "the same of the disparity error's mean square: engines differ by themselves", _GENERATION_1
    )
    smallest_gain_floors: float = _gate(
        0.01, "floors", "least fall of the mean square", _GENERATION_1, moves="halved: false alarms +0.010"
    )
    smallest_plain_floors: float = _gate(
        0.05, "floors", "least fall of the unweighted error where that alone makes an effect large", _GENERATION_1
    )
    patch_share: float = _gate(
        0.03, "1", "an effect that removes less of the unweighted error is a patch for something else", _GENERATION_1
    )
    consistent_share: float = _gate(
        0.7,
        "1",
        "least share of the touched images that get better",
        "convention: seven of ten",
        moves="halved: outside -0.111; doubled: nothing is named",
    )
    largest_variation: float = _gate(
        0.5,
        "1",
        "what a varying amplitude may explain beyond one, as a share of that, where something is named",
        _GENERATION_1,
        moves="doubled: outside -0.037",
    )
    # Is it the whole truth?
    other_law_share: float = _gate(
        0.1, "1", "the same, from which on another law is at work", _GENERATION_1, moves="doubled: named +0.014"
    )
    other_law_floors: float = _gate(
        0.012, "floors", "where it is at least so much", _GENERATION_1, moves="doubled: named +0.014"
    )
    unexplained_floors: float = _gate(
        0.12,
        "floors",
        "structure and excess from which on something is missing where nothing is named",
        _GENERATION_1,
        moves="halved: named -0.041, outside +0.074; doubled: outside -0.148",
    )
    structure_of_named_floors: float = _gate(
        0.075,
        "floors",
        "the same of structure beside a name",
        _GENERATION_1,
        moves="halved: named -0.054, outside +0.037; doubled: outside -0.037",
    )
    unexplained_share: float = _gate(
        0.2, "1", "and of the structure that was there at first", _GENERATION_1, moves="halved: named -0.027"
    )
    largest_of_surveys_floors: float = _gate(
        0.5,
        "floors",
        "excess of any shape that surveys leave where nothing is named",
        _GENERATION_1,
        moves="doubled: outside -0.037",
    )
    rounding_known_to: float = _gate(
        0.2, "1", "share by which the error of coarse steps is uncertain", "theory: few steps in dark pictures"
    )
    images_at_floor: float = _gate(
        0.12, "floors", "excess below which the images lack nothing, so that depth is judged", _GENERATION_1
    )
    # Can it be told from others?
    same_excess_ratio: float = _gate(1.2, "1", "explanations that leave so many times as much are alike", _GENERATION_1)
    same_excess_floors: float = _gate(0.002, "floors", "or so much more", _GENERATION_1)
    same_gain_share: float = _gate(0.25, "1", "if they gain this share at least", "convention")
    paired_errors: float = _gate(
        2.0, "1", "explanations within so many paired standard errors are alike", "theory: a two-sided 95 % interval"
    )
    paired_nats: float = _gate(2.0, "nats", "beyond this difference", "convention")
    # How sure is it?
    named_probability: float = _gate(0.97, "1", "probability that the truth is among what may be named", _GENERATION_1)
    temperature: float = _gate(0.1, "1", "of the softmax over the logarithm of what is left", _GENERATION_1)
    floor_known_to: float = _gate(0.01, "floors", "how well the floor itself is known", _GENERATION_1)
    nats_per_unit: float = _gate(20.0, "nats", "so many nats of an approximate likelihood count as one", _GENERATION_1)
    occam_nats_per_unit: float = _gate(3.0, "nats", "the same of Laplace's evidence", _GENERATION_1)
    # Adding further effects.
    most_effects: int = _earlier(4, "1", "effects that --greedy adds at most", "convention")
    needless_nats: float = _earlier(
        5.0, "nats", "an effect whose removal costs less is needless, a swap that gains more is made", "as margin_nats"
    )
    needless_floors: float = _earlier(0.005, "floors", "the same in floors", _GENERATION_1)
    formulas_share: float = _earlier(
        0.015, "1", "share of what earlier effects explained that their formulas may have left", _GENERATION_1
    )
    enough_share: float = _earlier(
        0.95, "1", "share of the first excess that, once gone, leaves nothing worth another ranking", "convention"
    )
    smooth_floors: float = _earlier(0.06, "floors", "unless neighbours in one image share so much", _GENERATION_1)
    needless_parameter_share: float = _earlier(
        0.03, "1", "share of its effect's gain that a parameter must be worth", _GENERATION_1
    )
    needless_parameter_floors: float = _earlier(0.005, "floors", "or so much", _GENERATION_1)
    # Random fields.
    white_share: float = _earlier(
        0.35, "1", "covariance of neighbours over variance below which a residual is white", _GENERATION_1
    )
    largest_white_floors: float = _earlier(
        0.06, "floors", "most that a renderer's own noise leaves", "theory: Monte Carlo noise of 32 samples"
    )
    field_correlation: float = _earlier(
        0.4, "1", "correlation beyond which draws are no random field", "convention: draws are independent"
    )
    hot_sigma: float = _earlier(
        5.0, "1", "deviations beyond which a place has a sparse draw", "theory: one pixel in four million by chance"
    )
    clear_of_ends: float = _earlier(
        2.0, "1", "deviations that a pixel's draws must stay clear of the range's ends", "convention"
    )
    component_sigmas: float = _earlier(
        3.0, "1", "standard errors that a variance component must be worth", "theory: 99.7 %"
    )
    component_share: float = _earlier(0.1, "1", "share of all fields' variance that it must be worth", "convention")
    # Noise.
    comb_share: float = _earlier(
        0.995, "1", "share of the pixels that lie on the steps of coarse digital numbers", "convention"
    )
    row_correlation: float = _earlier(
        0.4,
        "1",
        "correlation of neighbouring rows beyond which they are bands of light",
        "theory: rows are independent",
    )
    # The depth engine.
    engines_differ: float = _earlier(
        1.7, "1", "factor within which two engines' differences of neighbours agree", _GENERATION_1
    )
    poses_known_to_rad: float = _earlier(
        0.0025, "rad", "angle to which surveyed poses are known", "convention: an eighth of a degree"
    )
    # What to measure next.
    worth_nats: float = _earlier(2.0, "nats", "a measurement that separates by less is not proposed", "convention")
    # Effort: what is worth another look.
    out_of_reach: float = _earlier(
        0.03, "1", "share of the best scan's gain below which an effect is not fitted", _GENERATION_1
    )
    worth_polishing: float = _earlier(
        2e-4, "1", "share of chi2 that a scan's fit must gain to be fitted on all images", _GENERATION_1
    )
    worth_steps: float = _earlier(4e-3, "1", "and to take steps there", _GENERATION_1)
    close_share: float = _earlier(
        0.4, "1", "share of the best gain from which on an effect is polished, or refined by rendering", _GENERATION_1
    )
    hopeless_share: float = _earlier(0.01, "1", "share of it below which an effect is left out", _GENERATION_1)
    polished: int = _earlier(3, "1", "effects that are polished in any case", "convention")
    close_nats: float = _earlier(10.0, "nats", "explanations so close to the best may come first yet", "convention")
    rendered: int = _earlier(
        2, "1", "explanations that are refined by the engine's images, where it renders them", "convention"
    )
    sized: int = _earlier(5, "1", "explanations whose fall of the error in DN is looked at", "convention")
    looked_at: int = _earlier(8, "1", "explanations whose constancy is looked at", "convention")


GATES = Gates()


def gates_table(gates: Gates = GATES) -> str:
    """The table as Markdown: name, value, unit, what it decides, source, what moves with it."""
    lines = ["| gate | value | unit | decides | source | halved or doubled it moves |", "|---|---|---|---|---|---|"]
    for f in fields(gates):
        unit = "" if f.metadata["unit"] == "1" else f.metadata["unit"]
        lines.append(
            f"| `{f.name}` | {getattr(gates, f.name):g} | {unit} | {f.metadata['decides']} | {f.metadata['source']} | "
            f"{f.metadata['moves']} |"
        )
    return "\n".join(lines)


def share_words(share: float) -> str:
    """A share for a sentence: 'a fifth', 'a tenth', else '3 %'."""
    words = {1 / 2: "half", 1 / 3: "a third", 1 / 4: "a quarter", 1 / 5: "a fifth", 1 / 10: "a tenth"}
    return words.get(share, f"{100 * share:g} %")


if __name__ == "__main__":
    print(gates_table())
