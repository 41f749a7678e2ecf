# SPDX-License-Identifier: Apache-2.0
"""A ManiSkill environment whose camera is an active stereo sensor.

    PYTHONPATH=build/python python3 examples/mani_skill_depth/mani_skill_depth.py --out out/mani_skill_depth

Needs the package mani_skill (pip install mani_skill) and a Vulkan device that SAPIEN renders with.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

try:
    import gymnasium
    import mani_skill.envs  # noqa: F401 (its environments)
except ImportError as error:
    sys.exit(f"this example needs the package {error.name}: pip install mani_skill")

import activestereo.integrations.mani_skill  # noqa: F401 (its camera takes ManiSkill's place)
from activestereo.report.pictures import labelled_figure
from activestereo.report.lettering import write_figure

NEAR_FAR_M = (0.3, 1.8)


def run(out: Path, name: str, size: int, samples: int, steps: int) -> float:
    """Writes mani_skill_depth.png: RGB, measured depth, true depth. Returns the share of measured pixels within 5 % of
    the truth."""
    camera = {"use_stereo_depth": True, "samples_per_pixel": samples, "width": size, "height": size}
    env = gymnasium.make(
        name, obs_mode="rgb+depth", sim_backend="physx_cpu", render_backend="cpu", num_envs=1, sensor_configs=camera
    )
    obs, _ = env.reset(seed=0)
    for _ in range(steps):
        obs, *_ = env.step(env.action_space.sample())
    images = obs["sensor_data"]["base_camera"]
    rgb, depth_mm = images["rgb"][0].numpy(), images["depth"][0, ..., 0].numpy().astype(np.float64)
    truth_mm = 1000.0 * env.unwrapped._sensors["base_camera"].sensors.get_true_depth()[0]
    out.mkdir(parents=True, exist_ok=True)
    pictures = [
        ("colour", rgb / 255.0, None),
        ("depth that the D435 measures", depth_mm / 1000.0, NEAR_FAR_M),
        ("true depth", truth_mm / 1000.0, NEAR_FAR_M),
    ]
    write_figure(out / "mani_skill_depth.png", labelled_figure(pictures, columns=3))
    both = (depth_mm > 0) & (truth_mm > 0)
    good = float((np.abs(depth_mm - truth_mm) < 0.05 * truth_mm)[both].mean())
    print(f"{name}: {100 * (depth_mm > 0).mean():.0f} % measured, of these {100 * good:.0f} % within 5 % of the truth")
    env.close()
    return good


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/mani_skill_depth"), help="folder of the picture")
    parser.add_argument("--environment", default="PickCube-v1")
    parser.add_argument("--size", type=int, default=256, help="of the images, pixels")
    parser.add_argument("--samples", type=int, default=8, help="samples per pixel")
    parser.add_argument("--steps", type=int, default=3)
    options = parser.parse_args()
    run(options.out, options.environment, options.size, options.samples, options.steps)


if __name__ == "__main__":
    main()
