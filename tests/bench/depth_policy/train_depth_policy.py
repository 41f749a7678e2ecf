# SPDX-License-Identifier: Apache-2.0
"""Behaviour cloning of a grasp from depth: one policy for each mode of depth, all tried in worlds that none has seen.

    PYTHONPATH=build/python:tests/bench:examples/grasp_task python3 tests/bench/depth_policy/train_depth_policy.py

Needs the packages torch and OpenCV (pip install torch opencv-python-headless); the world of Mitsuba needs mitsuba, too.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import torch
from torch import nn

from episodes import film
from foreign_worlds import foreign_renderers, foreign_world
from stereo_grasp import GraspWorld, teacher
from stereo_grasp.scene import THINGS
from stereo_grasp.world import STEP_SCALE, STEPS

# The state's offsets in the network's units, and what the teacher's steps are spread by.
OFFSET_SCALE = np.array([0.05, 0.05, 0.1])
EXPLORATION = 0.5
BATCH, LEARNING_RATE = 64, 1e-3
FILMED, FILM_SEED = 6, 5


class Policy(nn.Module):
    """Depth to where the gripper should close: x, y, z in OFFSET_SCALE, and the doubled angle's sine and cosine."""

    def __init__(self) -> None:
        super().__init__()
        channels, layers = (2, 16, 32, 64, 64), []
        for k, (before, after) in enumerate(zip(channels[:-1], channels[1:], strict=True)):
            layers += [nn.Conv2d(before, after, 5 if k == 0 else 3, stride=2, padding=2 if k == 0 else 1), nn.ReLU()]
        self.layers = nn.Sequential(*layers, nn.Flatten(), nn.Linear(64 * 16, 128), nn.ReLU(), nn.Linear(128, 5))

    def forward(self, depth: torch.Tensor) -> torch.Tensor:
        is_measured = (depth > 0).float()
        return self.layers(torch.stack([(depth - 0.3) * 10.0 * is_measured, is_measured], dim=1))

    def act(self, depth: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            x, y, z, sine, cosine = self(torch.from_numpy(depth)).double().numpy().T
        turn = 0.5 * np.arctan2(sine, cosine)
        offsets = np.stack([x, y, z], axis=1) * OFFSET_SCALE
        return np.clip(np.column_stack([offsets, turn]) / STEP_SCALE, -1.0, 1.0)


def targets(offsets: np.ndarray) -> np.ndarray:
    turn = 2.0 * offsets[:, 3]
    return np.column_stack([offsets[:, :3] / OFFSET_SCALE, np.sin(turn), np.cos(turn)]).astype(np.float32)


def collect(mode: str, episodes: int, environments: int, seed: int, things: str) -> tuple[np.ndarray, np.ndarray]:
    """Depth and targets along the teacher's ways, spread so that the policy sees what its own errors lead to."""
    world, random = GraspWorld(environments, mode, seed=seed, things=things), np.random.default_rng(seed)
    depths, labels = [], []
    for _ in range(-(-episodes // environments)):
        depth = world.reset()
        for _ in range(STEPS):
            depths.append(depth.astype(np.float32))
            labels.append(targets(world.offsets()))
            world.step(teacher(world) + EXPLORATION * random.standard_normal((environments, 4)))
            depth = world.look()
    return np.concatenate(depths), np.concatenate(labels)


def train(depths: np.ndarray, labels: np.ndarray, epochs: int, seed: int) -> Policy:
    torch.manual_seed(seed)
    policy = Policy()
    optimiser = torch.optim.Adam(policy.parameters(), lr=LEARNING_RATE)
    steps = epochs * -(-len(depths) // BATCH)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3 * LEARNING_RATE, total_steps=steps)
    x, y = torch.from_numpy(depths), torch.from_numpy(labels)
    for _ in range(epochs):
        for chosen in torch.randperm(len(x)).split(BATCH):
            loss = nn.functional.smooth_l1_loss(policy(x[chosen]), y[chosen], beta=0.1)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    return policy


def successes(policy: Policy, world: GraspWorld, episodes: int) -> tuple[int, int]:
    """(held, tried)."""
    held = tried = 0
    for _ in range(-(-episodes // world.count)):
        depth = world.reset()
        for step in range(STEPS):
            _, succeeded = world.step(policy.act(depth))
            depth = world.look() if step + 1 < STEPS else depth
        held, tried = held + int(succeeded.sum()), tried + world.count
    return held, tried


def interval(held: int, tried: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a rate (J. Am. Stat. Assoc. 22, 1927)."""
    z2, rate = 1.96**2, held / tried
    middle = (rate + z2 / (2 * tried)) / (1 + z2 / tried)
    half = np.sqrt(z2 * (rate * (1 - rate) / tried + z2 / (4 * tried**2))) / (1 + z2 / tried)
    return middle - half, middle + half


def run(
    out: Path,
    modes: list[str],
    train_episodes: int,
    test_episodes: int,
    epochs: int,
    environments: int,
    things: str = "mixed",
) -> dict:
    """{mode: {"own": (held, tried), "ours": (held, tried), ...}}, the latter in the foreign world of each renderer that
    is installed; also written to results.json. With Mitsuba, episodes.gif shows some in its world."""
    results: dict[str, dict[str, tuple[int, int]]] = {}
    policies: dict[str, Policy] = {}
    renderers = foreign_renderers()
    for mode in modes:
        start = time.perf_counter()
        depths, labels = collect(mode, train_episodes, environments, seed=1, things=things)
        collected = time.perf_counter()
        policy = train(depths, labels, epochs, seed=1)
        trained = time.perf_counter()
        worlds = {"own": GraspWorld(environments, mode, seed=77, things=things)}
        worlds |= {r: foreign_world(environments, seed=99, things=things, renderer=r) for r in renderers}
        results[mode] = {name: successes(policy, world, test_episodes) for name, world in worlds.items()}
        policies[mode] = policy
        shown = [f"{where} {100 * h / n:.1f} % ({100 * interval(h, n)[0]:.1f} to {100 * interval(h, n)[1]:.1f})"
                 for where, (h, n) in results[mode].items()]  # fmt: skip
        spent = f"{len(depths)} images in {collected - start:.0f} s, trained in {trained - collected:.0f} s"
        print(f"{mode}: {', '.join(shown)}; {spent}, tried in {time.perf_counter() - trained:.0f} s", flush=True)
    out.mkdir(parents=True, exist_ok=True)
    (out / "results.json").write_text(json.dumps(results, indent=2) + "\n")
    if "mitsuba" in renderers:
        film(out / "episodes.gif", {mode: policy.act for mode, policy in policies.items()}, FILMED, FILM_SEED, things)
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/train_depth_policy"), help="folder of results.json")
    parser.add_argument("--modes", default="clean,raster,full")
    parser.add_argument("--train", type=int, default=400, help="episodes to learn from")
    parser.add_argument("--test", type=int, default=304, help="episodes to try")
    parser.add_argument("--epochs", type=int, default=30)
    parser.add_argument("--environments", type=int, default=16)
    parser.add_argument("--things", default="mixed", choices=THINGS, help="hard: glass, polished steel, black velvet")
    options = parser.parse_args()
    counts = options.train, options.test, options.epochs, options.environments
    run(options.out, options.modes.split(","), *counts, options.things)


if __name__ == "__main__":
    main()
