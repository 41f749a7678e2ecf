# SPDX-License-Identifier: Apache-2.0
"""The settings that a run depends on."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from sim_to_real.files import RunFolder
from sim_to_real.objects import objects
from sim_to_real.stage import CameraSettings


@dataclass(frozen=True)
class BenchmarkSettings:
    """views, tuning_views: at least so many, in whole rounds of one view of each object. foreign: one of FOREIGN."""

    views: int = 320
    tuning_views: int = 64
    seed: int = 0
    camera: CameraSettings = CameraSettings()
    foreign: str = "sensor"
    foreign_samples: int = 64

    def rounds(self, split: str) -> int:
        return -(-(self.views if split == "test" else self.tuning_views) // len(objects()))

    def described(self) -> dict[str, Any]:
        """As a dict, without the number of test views, which may grow."""
        out = asdict(self)
        del out["views"]
        return out | {"tuning_views": self.rounds("tuning") * len(objects())}

    @staticmethod
    def read(folder: RunFolder) -> BenchmarkSettings:
        """Reads the settings that described() wrote."""
        told = folder.settings()
        try:
            camera = dict(told["camera"])
            camera["size_px"] = tuple(camera["size_px"])
            own = {name: told[name] for name in ("tuning_views", "seed", "foreign", "foreign_samples")}
            return BenchmarkSettings(camera=CameraSettings(**camera), **own)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{folder.path}/settings.json is not of a run of this version: {error}") from error
