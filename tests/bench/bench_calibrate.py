# SPDX-License-Identifier: Apache-2.0
"""Figures of `activestereo calibrate`, counted.

    PYTHONPATH=build/python:tests/python/shared python3 tests/bench/bench_calibrate.py models [--draws 20]
    PYTHONPATH=build/python:tests/python/shared python3 tests/bench/bench_calibrate.py wall [--scale 0.5] [--spp 256]

models: how often `calibrate noise` names the noise model that frames were drawn from, shot noise and gamma noise in
turns, with drawn parameters; asked: 19 of 20. wall: walls that kuafu renders are measured by `calibrate pattern` and
rendered again from the same pose through the model; the residual of a frame over its noise floor, asked: 1.2.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from wall_worlds import WallWorld

import kuafu
from activestereo.calibrate.noise import NoiseModel, calibrate_noise
from activestereo.calibrate.pattern import calibrate_pattern
from activestereo.calibrate.repeats import Repeats
from activestereo.capture.capture import Capture, read_capture
from activestereo.model.diagnosed import calibrated

SIZE = (40, 64)
WALLS = ((1.0, 0.0), (1.7, 0.1))  # metres, yaw


def drawn(noise_model: NoiseModel, repeats: int, rng: np.random.Generator, is_dark: bool = False) -> NDArray[np.uint8]:
    """Repeats of blocks of all levels of an 8-bit camera, or of none."""
    clean = np.zeros(SIZE) if is_dark else np.exp(rng.uniform(np.log(0.4), np.log(110.0), SIZE))
    shape = (repeats, *SIZE)
    if noise_model.kind == "gamma":
        light = clean * rng.gamma(noise_model.shape, 1.0 / noise_model.shape, shape)
    else:
        light = noise_model.shape * rng.poisson(clean / noise_model.shape, shape)
    counts = np.rint(light + noise_model.black_dn + rng.normal(0.0, noise_model.sigma_dn, shape))
    return counts.clip(0, 255).astype(np.uint8)


def models(draws: int, with_dark: bool) -> None:
    right, begin = 0, time.process_time()
    for number in range(draws):
        rng = np.random.default_rng(number)
        sigma, black = rng.uniform(0.4, 1.0), rng.uniform(3.0, 17.0)
        # Deviations of 0.5 to 3 DN at half of the range, by either model.
        at_middle = np.exp(rng.uniform(np.log(0.5), np.log(3.0)))
        if number % 2:
            noise_model = NoiseModel("gamma", (55.0 / at_middle) ** 2, sigma, black)
        else:
            noise_model = NoiseModel("shot", at_middle**2 / 55.0, sigma, black)
        dark = [Repeats("dark", drawn(noise_model, 12, rng, is_dark=True))] if with_dark else []
        found = calibrate_noise([Repeats("view", drawn(noise_model, 20, rng))], dark, seed=number)
        right += found.chosen == noise_model.kind
        if found.chosen != noise_model.kind:
            print(f"draw {number}: {noise_model} was named {found.chosen}")
    print(
        f"the right noise model in {right} of {draws}, {'with' if with_dark else 'without'} dark frames; "
        f"{(time.process_time() - begin) / draws:.1f} CPU s each"
    )


def seen_again(world: WallWorld, capture: Capture, wall: tuple[float, float], spp: int) -> NDArray[np.float64]:
    """Radiance [2][height][width] of a wall under the pattern that was measured, from where it was measured."""
    device = kuafu.Device()
    scene = world.scene(device, wall)
    projector = capture.rig.projector
    light = kuafu.Light(
        kind="projector", ir_intensity=3.0, texture=scene.add_texture(projector.pattern()), k=projector.K
    )
    light.light_to_world = np.linalg.inv(projector.left_to_projector)
    return world.render(device, wall, light, scene, spp)


def walls(scale: float, spp: int, repeats: int, border_px: int) -> None:
    world = WallWorld.make(WALLS, scale)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "walls"
        world.write(path, kuafu.Device(), repeats=repeats, spp=spp)
        capture = read_capture(path)
        measured = calibrated(capture, calibrate_pattern(path).model())
        frames = [
            np.array(
                [[capture.ir(f, side) for side in ("left", "right")] for f in capture.frames if f.repeat_group == k]
            )
            for k in range(len(WALLS))
        ]
    again = [seen_again(world, measured, wall, spp) for wall in WALLS]
    means = [stack.mean(axis=0) for stack in frames]
    rows, columns = (slice(border_px, size - border_px) for size in means[0].shape[1:])
    again, means, frames = ([image[..., rows, columns] for image in part] for part in (again, means, frames))
    # One intensity of the projector, and one of what all pixels have, for both walls.
    light = np.concatenate([image.ravel() for image in again])
    H = np.column_stack([light, np.ones(len(light))])
    gain, black = np.linalg.lstsq(H, np.concatenate([m.ravel() for m in means]), rcond=None)[0]
    print("| wall | floor DN | residual of a frame DN | floors | of the mean of all repeats DN | worst 1 % |")
    print("|" + "--|" * 6)
    for (distance, _), stack, mean, image in zip(WALLS, frames, means, again):
        floor = float(np.sqrt(stack.var(axis=0, ddof=1).mean()))
        off = gain * image + black - mean
        model = float(np.sqrt(max(np.mean(off**2) - floor**2 / repeats, 0.0)))
        worst = np.sort((off**2).ravel())[-off.size // 100 :].sum() / (off**2).sum()
        frame = np.hypot(model, floor)
        print(f"| {distance} m | {floor:.2f} | {frame:.2f} | {frame / floor:.2f} | {model:.2f} | {100 * worst:.0f} % |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", choices=("models", "wall"))
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--scale", type=float, default=0.5, help="of 848x480")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--border", type=int, default=0, metavar="PX", help="left out around the pictures")
    args = parser.parse_args()
    if args.figure == "models":
        models(args.draws, with_dark=True)
        models(args.draws, with_dark=False)
    else:
        walls(args.scale, args.spp, args.repeats, args.border)


if __name__ == "__main__":
    main()
