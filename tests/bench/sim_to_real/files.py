# SPDX-License-Identifier: Apache-2.0
"""The folder of a run. Each file is whole or not there, so a run that was ended goes on where it was.

DIR/settings.json                   what everything here depends on
DIR/depth/WORLD/test-0003.npz       depth [objects, height, width] metres and k, of a round of views
DIR/errors/WORLD/test-0003.npz      errors [candidates, objects, 2] mm and degrees, and which candidates
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.input_files import checked_file, read_json
from activestereo.common.output_files import replace_file, write_text

Candidate = tuple[str, int]  # a method and the number of its setting


@dataclass(frozen=True)
class RunFolder:
    path: Path

    def depth_path(self, world: str, split: str, number: int) -> Path:
        return self.path / "depth" / world / f"{split}-{number:04d}.npz"

    def errors_path(self, world: str, split: str, number: int) -> Path:
        return self.path / "errors" / world / f"{split}-{number:04d}.npz"

    def write_depth(
        self, world: str, split: str, number: int, depth: NDArray[np.float32], k: NDArray[np.float64]
    ) -> None:
        _write(self.depth_path(world, split, number), depth=depth, k=k)

    def read_depth(self, world: str, split: str, number: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        found = _read(self.depth_path(world, split, number), ("depth", "k"))
        return found["depth"], found["k"]

    def write_errors(
        self, world: str, split: str, number: int, candidates: list[Candidate], errors: NDArray[np.float64]
    ) -> None:
        _write(self.errors_path(world, split, number), errors=errors, candidates=np.array(_names(candidates)))

    def read_errors(
        self, world: str, split: str, number: int, candidates: list[Candidate]
    ) -> NDArray[np.float64] | None:
        """Errors [candidates, objects, 2], or None if the file lacks one of these candidates."""
        path = self.errors_path(world, split, number)
        if not path.exists():
            return None
        found = _read(path, ("errors", "candidates"))
        rows = {name: row for row, name in enumerate(found["candidates"].tolist())}
        wanted = _names(candidates)
        return found["errors"][[rows[name] for name in wanted]] if set(wanted) <= set(rows) else None

    def rounds(self, world: str, split: str) -> int:
        """Number of rounds with errors, without a gap from the first on."""
        count = 0
        while self.errors_path(world, split, count).exists():
            count += 1
        return count

    def keep_settings(self, settings: dict[str, Any]) -> None:
        """Raises ValueError if the folder has results of other settings."""
        settings = json.loads(json.dumps(settings))
        if (self.path / "settings.json").exists():
            before = self.settings()
            different = [key for key in settings if before.get(key) != settings[key]]
            if different:
                key = different[0]
                text = f"{self.path} has results of other settings: {key} was {before.get(key)} and is {settings[key]}"
                raise ValueError(f"{text}; choose another folder, or the same settings")
            return
        self.path.mkdir(parents=True, exist_ok=True)
        write_text(self.path / "settings.json", json.dumps(settings, indent=2) + "\n")

    def settings(self) -> dict[str, Any]:
        """The settings of a run. Raises ValueError without a run."""
        path = self.path / "settings.json"
        try:
            found = read_json(path)
        except FileNotFoundError:
            advice = "make one with 'bench_sim_to_real.py run DIR'"
            raise ValueError(f"{self.path} has no run: {advice}") from None
        if not isinstance(found, dict):
            raise ValueError(f"{path}: is not an object of settings")
        return found


def _names(candidates: list[Candidate]) -> list[str]:
    return [f"{method} {setting}" for method, setting in candidates]


def _write(path: Path, **arrays: NDArray[Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, lambda file: np.savez_compressed(file, **arrays))


def _read(path: Path, names: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    try:
        with np.load(checked_file(path)) as file:
            return {name: file[name] for name in names}
    except FileNotFoundError:
        raise
    except Exception as error:  # errors of zipfile, zlib and numpy, by the damaged part of the file
        raise ValueError(f"{path}: cannot be read ({error}); delete it and run the same again") from error
