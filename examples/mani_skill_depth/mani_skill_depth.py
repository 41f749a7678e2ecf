# SPDX-License-Identifier: Apache-2.0
"""A ManiSkill environment whose camera is an active stereo sensor.

    PYTHONPATH=build/python python3 examples/mani_skill_depth/mani_skill_depth.py --out out/mani_skill_depth

Needs the package mani_skill (pip install mani_skill) and a Vulkan device that SAPIEN renders with.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from PIL import Image

try:
    import gymnasium
    import mani_skill.envs  # noqa: F401 (its environments)
except ImportError as error:
    sys.exit(f"this example needs the package {error.name}: pip install mani_skill")

import activestereo.integrations.mani_skill  # noqa: F401 (its camera takes ManiSkill's place)


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
    grey = [255.0 * np.clip((1800.0 - d) / 1500.0, 0.0, 1.0) * (d > 0) for d in (depth_mm, truth_mm)]
    picture = np.hstack([rgb, *(np.repeat(g[..., None], 3, axis=2) for g in grey)]).astype(np.uint8)
    Image.fromarray(picture).save(out / "mani_skill_depth.png")
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
