# SPDX-License-Identifier: Apache-2.0
"""Runs the cells of notebooks in order, without Jupyter, and stores what they print and draw in them; writes each as a
page of the site, with its pictures beside it.

    PYTHONPATH=build/python /usr/bin/python3 examples/notebooks/run.py examples/notebooks/*.ipynb
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

JPEG, HTML, TEXT = "image/jpeg", "text/html", "text/plain"
DPI, QUALITY = 72, 82


def run_cells(notebook: dict[str, Any]) -> None:
    """Runs all cells in one namespace and an empty folder; their outputs take the place of the stored ones."""
    names: dict[str, Any] = {"__name__": "__main__"}
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
            for count, cell in enumerate(cells, 1):
                cell["execution_count"], cell["outputs"] = count, _outputs("".join(cell["source"]), names, count)
        finally:
            os.chdir(before)


def _outputs(source: str, names: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """The outputs of a cell: what it prints, and its last line where that is an expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    said, value = io.StringIO(), None
    with contextlib.redirect_stdout(said):
        exec(compile(tree, "cell", "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    outputs: list[dict[str, Any]] = []
    if said.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": said.getvalue().splitlines(keepends=True)})
    if value is not None:
        result = {"output_type": "execute_result", "execution_count": count, "metadata": {}, "data": _shown(value)}
        outputs.append(result)
    return outputs


def _shown(value: Any) -> dict[str, Any]:
    if isinstance(value, Figure):
        file = io.BytesIO()
        value.savefig(file, format="jpeg", dpi=DPI, pil_kwargs={"quality": QUALITY, "optimize": True})
        return {JPEG: base64.b64encode(file.getvalue()).decode(), TEXT: ["a figure"]}
    if hasattr(value, "_repr_html_"):
        return {HTML: value._repr_html_().splitlines(keepends=True), TEXT: [type(value).__name__]}
    return {TEXT: repr(value).splitlines(keepends=True)}


def write_page(notebook: dict[str, Any], path: Path) -> None:
    """The notebook as Markdown, its pictures as PATH-N.jpg."""
    parts = []
    for number, cell in enumerate(notebook["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {TEXT: output.get("text", [])})
            if JPEG in data:
                picture = path.with_name(f"{path.stem}-{number}.jpg")
                picture.write_bytes(base64.b64decode(data[JPEG]))
                parts.append(f"![what the cell draws]({picture.name})")
            elif HTML in data:
                parts.append("".join(data[HTML]).strip())
            else:
                parts.append(f"```text\n{''.join(data[TEXT]).rstrip()}\n```")
    path.write_text("\n\n".join(parts) + "\n")


def main() -> int:
    for name in sys.argv[1:]:
        path = Path(name).resolve()
        notebook = json.loads(path.read_text())
        run_cells(notebook)
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n")
        write_page(notebook, path.with_suffix(".md"))
        print(f"written: {path.name} and its page")
    return 0


if __name__ == "__main__":
    sys.exit(main())
