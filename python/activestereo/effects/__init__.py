# SPDX-License-Identifier: Apache-2.0
"""Defines physical effects: a descriptor (id, stage, parameters with units, ranges, priors, sources) over a function.

    from activestereo.effects import Parameter, Stage, effect

    @effect("filter_haze", stage=Stage.OPTICS, family="glare", source="my bench, May",
            parameters=[Parameter("fraction", unit="1", neutral=0.0, low=0.0, high=0.3, typical=0.05)])
    def filter_haze(image, view, fraction):
        '''Stray light from the whole picture.'''
        return (1 - fraction) * image + fraction * image.mean()

core/descriptor.py says what a function takes and returns at each stage. The modules of this folder hold the built-in
effects, by what they act on.
"""

import importlib
import json
import pkgutil
from functools import cache
from pathlib import Path

from activestereo.effects.core.descriptor import Effect, Parameter, Randomness, Stage, effect
from activestereo.effects.core.laws import broken_laws
from activestereo.effects.core.light import Light
from activestereo.effects.core.load import load_effects
from activestereo.effects.core.model import Model
from activestereo.effects.core.view import View


def builtin() -> dict[str, Effect]:
    """Returns the built-in effects in the order of the pipeline, {id: Effect}."""
    return dict(_found())


@cache
def _found() -> dict[str, Effect]:
    modules = [importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__) if not m.ispkg]
    found = [value for module in modules for value in vars(module).values() if isinstance(value, Effect)]
    return {e.id: e for e in sorted(found, key=lambda e: (e.stage, e.id))}


def known_differences() -> dict[str, float]:
    """Returns {effect id: relative difference between its fast image and the engines' image}, as `activestereo effect
    check --all --out` last measured it."""
    file = Path(__file__).parent / "differences.json"
    return json.loads(file.read_text(encoding="utf-8"))


__all__ = [
    "Effect",
    "Light",
    "Model",
    "Parameter",
    "Randomness",
    "Stage",
    "View",
    "broken_laws",
    "builtin",
    "effect",
    "known_differences",
    "load_effects",
]
