# SPDX-License-Identifier: Apache-2.0
"""Tables of C plug-ins changed at random, under a seed: each is read, or one error names the library. Pointers are NULL
or right: C cannot tell others."""

import ctypes as c
import random
import subprocess
from pathlib import Path
from typing import Any

import pytest

from activestereo.effects.core import load as plugin
from activestereo.effects.core.load import load_plugin

LIBRARY = """
#include <stdint.h>
const void* table;
uint32_t count;
const void* ks_effect_plugin(uint32_t* out) { return *out = count, table; }
"""
TEXTS = [b"a", b"effect", b"", None, b"\xff\xfe", b"lambda", b"two words", b"a\nb", b"x" * 5000, "\u00e4".encode()]
NUMBERS = [0.0, 1.0, -1.0, 0.5, float("nan"), float("inf"), -float("inf"), 1e308, 5e-324]
COUNTS = [0, 1, 2, 3, 65, 2**31, 2**32 - 1]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plugin")
    (folder / "table.c").write_text(LIBRARY)
    subprocess.run(["cc", "-shared", "-fPIC", folder / "table.c", "-o", folder / "table.so"], check=True)
    return folder / "table.so"


def record(dice: random.Random, count: int, terms: Any) -> plugin.records.Effect:
    """A sound effect."""
    parameters = (plugin.records.Parameter * 3)(
        *(plugin.records.Parameter(n, b"1", b"", 0.0, 0.0, 1.0, 0.5) for n in (b"p", b"q", b"r"))
    )
    header = plugin.records.Header(c.sizeof(plugin.records.Effect), plugin.records.TYPE_EFFECT)
    apply = plugin.records.Apply(lambda *_: 0)
    texts = (b"effect", b"f", b"s", b"s")
    return plugin.records.Effect(header, *texts, 7, dice.randrange(3), count, 1, parameters, apply, terms)


def disturb(dice: random.Random, struct: Any) -> None:
    """Another value in one of the struct's fields."""
    name, kind = dice.choice([field[:2] for field in struct._fields_])
    if kind is c.c_char_p:
        setattr(struct, name, dice.choice(TEXTS))
    elif kind is c.c_double:
        setattr(struct, name, dice.choice(NUMBERS))
    elif kind is c.c_uint32:
        setattr(struct, name, dice.choice(COUNTS))
    elif kind is plugin.records.Header:
        setattr(getattr(struct, name), dice.choice(["type", "size_bytes"]), dice.choice(COUNTS))
    else:
        setattr(struct, name, kind())  # NULL


def test_changed_tables(library: Path) -> None:
    dice = random.Random(1)
    own = c.CDLL(str(library))
    outcomes = {"read": 0, "refused": 0}
    for _ in range(3000):
        term = plugin.records.RandomTerm(b"p", None, 0, 0)
        count = dice.randrange(1, 4)
        effects = (plugin.records.Effect * 3)(*(record(dice, count, c.pointer(term)) for _ in range(3)))
        for _ in range(dice.randrange(3)):
            first = effects[0]
            disturb(dice, dice.choice([first, first, term, first.parameters[0]]) if first.parameters else first)
        if effects[0].random_terms and 1 < effects[0].random_term_count <= 64:
            effects[0].random_term_count = 1  # more than there are, C cannot tell
        if effects[0].parameters and 3 < effects[0].parameter_count <= 64:
            effects[0].parameter_count = 3
        c.c_void_p.in_dll(own, "table").value = dice.choice([c.addressof(effects)] * 9 + [None])
        c.c_uint32.in_dll(own, "count").value = dice.choice([1, 1, 1, 1, 3, 0, 257, 2**32 - 1])
        try:
            assert load_plugin(library)
            outcomes["read"] += 1
        except ValueError as error:
            assert str(error).startswith(f"{library}: ") and "\n" not in str(error) and len(str(error)) < 6000, error
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 300, outcomes
