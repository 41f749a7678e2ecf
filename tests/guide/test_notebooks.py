# SPDX-License-Identifier: Apache-2.0
"""The notebooks' pages are what the notebooks hold; test_code_blocks.py runs their cells."""

import json
import pathlib
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = ROOT / "examples/notebooks"
sys.path.insert(0, str(FOLDER))
import run  # noqa: E402

MOST_BYTES = 200_000


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_page_is_what_its_notebook_holds(path: pathlib.Path, tmp_path: pathlib.Path) -> None:
    notebook = json.loads(path.read_text())
    run.write_page(notebook, tmp_path / f"{path.stem}.md")
    written = {made.name: made.read_bytes() for made in tmp_path.iterdir()}
    assert {name: (FOLDER / name).read_bytes() for name in written} == written
    assert any(name.endswith(".jpg") for name in written)
    assert notebook["cells"][-1]["outputs"]
    assert path.stat().st_size < MOST_BYTES


def test_cells_run_in_order_in_one_namespace() -> None:
    cells = ["x = 20 + 1", "print(x)\n2 * x", "from matplotlib.figure import Figure\nFigure((1, 1))"]
    notebook = {"cells": [{"cell_type": "code", "source": [cell]} for cell in cells]}
    run.run_cells(notebook)
    first, second, third = (cell["outputs"] for cell in notebook["cells"])
    assert first == []
    assert second[0]["text"] == ["21\n"] and second[1]["data"]["text/plain"] == ["42"]
    assert set(third[0]["data"]) == {"image/jpeg", "text/plain"}
