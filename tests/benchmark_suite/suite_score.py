# SPDX-License-Identifier: Apache-2.0
"""Scores the tool's answers against the answer keys. Every rate comes with its Wilson interval (95 %)."""

import json
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import binomtest
from suite_sets import OUTSIDE

# {library's name: the case's name} of the same physics: a case's ambient infrared light is a lamp in the room.
SAME_PHYSICS = {"external_light": "ambient_ir"}
# Detectable: the error above the noise floor, on test frames, has this ratio to the floor (see oracle.py).
DETECTABLE = 0.5


@dataclass(frozen=True)
class Result:
    """The outcome of one case. key: the answer key; answer: diagnose.json's contents, None if the tool failed; run:
    times and return code. followed: {"asked" or "random": diagnose.json after one more measurement}, see
    run_next.py."""

    key: dict
    answer: dict | None
    run: dict
    followed: dict = field(default_factory=dict)

    @property
    def failed(self):
        return self.answer is None

    @property
    def truth(self):
        return set(self.key["hidden"])

    @property
    def _asked(self):
        """Returns the part that is scored: the depth engine's if its fault is hidden beside infrared images."""
        asks_for_depth = self.key["set"] == "depth" and self.key["infrared"]
        return self.answer.get("depth", self.answer) if asks_for_depth else self.answer

    @property
    def verdict(self):
        return "failed" if self.failed else self._asked["verdict"]

    @property
    def ranking(self):
        return [] if self.failed else self._asked["ranking"]

    @property
    def added(self):
        """Returns the effects that the tool added, on the images and behind the matcher, under the case's names."""
        return (
            set()
            if self.failed
            else {*map(self.case_name, self.answer["added"]), *self.answer.get("depth", {}).get("added", ())}
        )

    @property
    def detectable(self):
        """Returns whether every hidden effect, alone, raises the error enough to be detectable."""
        oracle = self.key["oracle"]
        return min(oracle.get("alone", {"": oracle["test"]["ratio"]}).values()) >= DETECTABLE

    def names(self, count):
        return [self.case_name(entry["effect"]) for entry in self.ranking[:count]]

    def case_name(self, effect):
        """Returns the case's name of an effect of the library. room_projector means the case's second_projector only if
        the key says that the second unit stands in the room."""
        stands_in_room = self.key["hidden"].get("second_projector", {}).get("on_rig", 1.0) <= 0.0
        if effect == "room_projector" and stands_in_room:
            return "second_projector"
        return SAME_PHYSICS.get(effect, effect)

    @property
    def right(self):
        """Returns whether the answer names all that is hidden and nothing else."""
        if not self.key["infrared"]:
            return self.verdict == "undetermined" and not self.added
        if self.key["set"] == "filters":
            return self.verdict == "none" and not self.added
        if self.is_outside:
            return self.verdict == "unknown" and not self.added
        if any(entry.get("nuisance") for entry in self.ranking if entry["effect"] in self.truth):
            return (
                self.verdict == "none" and not self.added and set(self.names(1)) == self.truth
            )  # not a fault of the sensor
        return self.verdict == ("effect" if self.truth else "none") and self.added == self.truth

    @property
    def is_ambiguous(self):
        """Returns whether a single hidden effect is named, among others that fit as well."""
        return (
            self.verdict == "effect" and len(self.truth) == 1 and len(_set_of(self)) > 1 and self.truth <= _set_of(self)
        )

    @property
    def is_outside(self):
        """Returns whether a hidden effect is outside of the tool's library."""
        return bool(self.truth & set(OUTSIDE))

    @property
    def named(self):
        """Returns whether the tool names any effect."""
        return self.verdict == "effect" or bool(self.added)


def read_results(folder, ids):
    """Reads the Results of those test cases in `folder` that were run. ids: the cases to look for."""
    results = []
    for item_id in ids:
        place = folder / "answers" / item_id
        if not (place / "run.json").is_file():
            continue
        run, answer = json.loads((place / "run.json").read_text()), place / "diagnose.json"
        read = json.loads(answer.read_text()) if answer.is_file() and run["returncode"] == 0 else None
        more = {how: folder / "next" / item_id / how / "diagnose.json" for how in ("asked", "random")}
        followed = {how: json.loads(path.read_text()) for how, path in more.items() if path.is_file()}
        results.append(Result(json.loads((folder / "keys" / f"{item_id}.json").read_text()), read, run, followed))
    return results


def score(results):
    """Returns {measures: {name: {value, low, high, n}} with 95 % intervals, by_strength, calibration} of Results."""
    sets = ("single", "pairs", "outside", "none", "depth", "wider", "filters", "mitsuba")
    of = {name: [r for r in results if r.key["set"] == name] for name in sets}
    clear = [r for r in of["single"] if r.detectable]
    foreign = [r for r in of["mitsuba"] if r.detectable or not r.truth]
    foreign_single = [r for r in foreign if r.truth and not r.is_outside]
    measures = {
        "top-1": rate([_first(r) for r in clear]),
        "top-3": rate([bool(r.truth & set(r.names(3))) for r in clear]),
        "family": rate([_family_right(r) for r in clear]),
        "equivalence set holds the truth": rate([bool(r.truth & _set_of(r)) for r in clear]),
        "equivalence set size (median)": median([len(_set_of(r)) for r in clear if r.ranking]),
        "named and right": rate([r.added == r.truth for r in clear]),
        "wider library: named and right": rate([r.added == r.truth for r in of["wider"] if r.detectable]),
        "false alarms": rate([r.named for r in of["none"]]),
        "filters of the depth: named as a fault": rate([r.named for r in of["filters"]]),
        "no effect: said so": rate([r.verdict == "none" for r in of["none"]]),
        "outside the library: said so": rate([r.verdict == "unknown" for r in of["outside"]]),
        "outside the library: wrong name": rate([r.verdict == "effect" for r in of["outside"]]),
        "pairs: both found": rate([r.added == r.truth for r in of["pairs"] if r.detectable]),
        "pairs: each named, or in a name's set": rate([_all_told(r) for r in of["pairs"] if r.detectable]),
        "pairs: one of two first": rate([_first(r) for r in of["pairs"] if r.detectable]),
        "another renderer: first name": rate([_first(r) for r in foreign_single]),
        "another renderer: named and right": rate([r.added == r.truth for r in foreign_single]),
        "another renderer: false alarms": rate([r.named for r in foreign if not r.truth]),
        "another renderer, outside: said so": rate([r.verdict == "unknown" for r in foreign if r.is_outside]),
        "parameter error (median)": median([e for r in clear for e in _parameter_errors(r)]),
        "90 % intervals hold the truth": rate([c for r in clear for c in _covered(r)]),
        "calibration error (ECE)": _ece(results),
        "error fall F (median)": median([f for r in clear if (f := _fall(r)) is not None]),
        "next measurement resolves": rate([_resolved(r, "asked") for r in results if r.followed]),
        "a random one resolves": rate([_resolved(r, "random") for r in results if r.followed]),
        "depth alone is undetermined": rate(
            [r.verdict == "undetermined" for r in of["depth"] if not r.key["infrared"]]
        ),
        "depth engine's fault first": rate([_first(r) for r in of["depth"] if r.key["infrared"]]),
        "seconds per diagnosis (median)": median([r.run["diagnose_s"] for r in results]),
        "failed": rate([r.failed for r in results]),
    }
    return {"measures": measures, "by_strength": _by_strength(of["single"]), "calibration": _calibration(results)}


def _measure(value=None, low=None, high=None, n=0):
    return {"value": value, "low": low, "high": high, "n": n}


def rate(outcomes):
    outcomes = [bool(o) for o in outcomes]
    if not outcomes:
        return _measure()
    interval = binomtest(sum(outcomes), len(outcomes)).proportion_ci(method="wilson")
    return _measure(sum(outcomes) / len(outcomes), interval.low, interval.high, len(outcomes))


def median(values):
    """Returns {value, low, high, n}: the median with the order statistics' binomial interval (95 %)."""
    values = np.sort(np.asarray(values, dtype=np.float64))
    if not values.size:
        return _measure()
    middle, half = values.size / 2, 0.98 * np.sqrt(values.size)
    low, high = max(0, int(np.floor(middle - half))), min(values.size - 1, int(np.ceil(middle + half)))
    return _measure(float(np.median(values)), float(values[low]), float(values[high]), int(values.size))


def _first(r):
    return bool(r.names(1)) and r.names(1)[0] in r.truth


def _resolved(r, how):
    """Returns whether the true effect alone is left after one more measurement. how: "asked" or "random"."""
    after = r.followed.get(how)
    return (
        after is not None
        and bool(after["ranking"])
        and {after["ranking"][0]["effect"], *after["ranking"][0]["equivalent"]} == r.truth
    )


def _family_right(r):
    families = {entry["family"] for entry in r.ranking if r.case_name(entry["effect"]) in r.truth}
    return bool(r.ranking) and r.ranking[0]["family"] in families


def _set_of(r):
    first = r.ranking[0] if r.ranking else None
    return {r.case_name(name) for name in (first["effect"], *first["equivalent"])} if first else set()


def _all_told(r):
    """Returns whether each hidden effect is a name or equivalent to one, and every name's set holds a hidden effect."""
    equivalent = {r.case_name(entry["effect"]): map(r.case_name, entry["equivalent"]) for entry in r.ranking}
    sets = [{name, *equivalent.get(name, ())} for name in r.added]
    return bool(sets) and all(found & r.truth for found in sets) and r.truth <= set().union(*sets)


def _own_parameters(r):
    """Returns (true value, the tool's entry) for each scored parameter of a correct first effect."""
    if not _first(r):
        return []
    entry = r.ranking[0]
    scored = r.key["scored"].get(entry["effect"], {})
    return [(true, entry["parameters"][name]) for name, true in scored.items() if true and name in entry["parameters"]]


def _parameter_errors(r):
    return [abs(said["value"] - true) / abs(true) for true, said in _own_parameters(r)]


def _covered(r):
    known = [(true, said) for true, said in _own_parameters(r) if said["low"] is not None and said["high"] is not None]
    return [said["low"] <= true <= said["high"] for true, said in known]


def _fall(r):
    """Returns the share of the held-out square error above the true floor that was removed. None if unknown."""
    if r.failed or r.answer["heldout_ir_rmse_before"] is None:
        return None
    before, after, floor = (
        r.answer["heldout_ir_rmse_before"],
        r.answer["heldout_ir_rmse_after"],
        r.key["oracle"]["test"]["floor_dn"],
    )
    return (before**2 - after**2) / (before**2 - floor**2) if before > floor else None


def _calibration(results):
    """Bins named cases by their stated confidence. Returns [{stated, right, n}], means of each bin."""
    pairs = [(r.ranking[0]["confidence"], _first(r)) for r in results if r.verdict == "effect" and r.ranking]
    if not pairs:
        return []
    stated, right = np.array(pairs, dtype=np.float64).T
    which = np.minimum((stated * 10).astype(int), 9)
    chosen = [which == b for b in range(10) if (which == b).any()]
    return [{"stated": float(stated[c].mean()), "right": float(right[c].mean()), "n": int(c.sum())} for c in chosen]


def _ece(results):
    bins = _calibration(results)
    total = sum(b["n"] for b in bins)
    value = sum(b["n"] * abs(b["stated"] - b["right"]) for b in bins) / total if total else None
    return _measure(value, n=total)


def _by_strength(singles):
    """Returns {strength: {measure: rate, "confusion": {true effect: first name or answer}}} of single effects."""
    table = {}
    for strength in ("below", "weak", "medium", "strong"):
        part = [r for r in singles if strength in r.key["strengths"].values()]
        if part:
            table[strength] = {
                "top-1": rate([_first(r) for r in part]),
                "named and right": rate([r.added == r.truth for r in part]),
                "named and wrong": rate([bool(r.added - r.truth) for r in part]),
                "confusion": {next(iter(r.truth)): _answer_of(r) for r in part},
            }
    return table


def _answer_of(r):
    return (r.names(1) or [r.verdict])[0] if r.named else r.verdict
