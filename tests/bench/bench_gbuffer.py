#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""GBufferStereo beside the path tracer, on random tables of matt, glossy and metal things, one for each seed.

    PYTHONPATH=build/python /usr/bin/python3 tests/bench/bench_gbuffer.py --seeds 1:41

The reference is the mean of two pictures that are traced with other samples. Differences of disparity are medians over
what both measure; the squared share of the reference's samples, a quarter of what they part two pictures by, is taken
from their squares. Each is divided by what noise alone parts two results of the reference's light by, so that a picture
of the true light is at 1; of these ratios the median over all worlds is printed, with the tenth and the ninetieth
percentile. holes: intersection over union; truth: the error to the true disparity, over the reference's own.
systematic: px on matt things, the imagers' noise switched off. seen: 'left' has the left camera's images alone, 'all'
also the right camera's and the projector's; 'x2' with twice the rows and columns; 'samples' are the two pictures
themselves, with their samples' share.
Afterwards both take --environments pictures of 128x128 in turns, the tracer with 4 samples; the least of the rounds
counts for each. 'on the device' has images there and leaves depth there.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gbuffer_worlds import KINDS, World
from numpy.typing import NDArray

import kuafu
import simsense
from activestereo import GBufferStereo, Mounts, StereoDepthSensor, StereoDepthSensorBatch, StereoDepthSensorConfig

from activestereo.effects.engines.capture_inputs import copy_record
from activestereo.common.pose import as_matrix

Image = NDArray[Any]
_OTHER_NOISE = 1_000_003
_NO_NOISE = {"shot_noise": 0.0, "adc_noise_dn": 0.0, "prnu": 0.0, "speckle_shape": 0.0, "speckle_scale": 0.0}
_LEAST_PX = 50  # of a kind, for a median


def compared(
    seed: int, scale: float, samples: int, finer: Sequence[int], device: str | int
) -> dict[str, dict[str, float]]:
    """{seen: {measure: ratio}} of one world. finer: supersamplings."""
    config = StereoDepthSensorConfig("D435").scaled(scale)
    config.samples_per_pixel = samples
    world, pictures = World.draw(seed, device), []
    for _ in range(2):
        config.render_seed += 1
        with StereoDepthSensor(config, world.scene, pose=world.pose) as sensor:
            sensor.take_picture(infrared_only=True)
            link = sensor._engine.picture().link
            pictures.append([image.copy() for image in (*link.images(), *link.laser().images())])
            if len(pictures) == 1:
                continue
            mean = [(one + other) / 2 for one, other in zip(*pictures, strict=True)]
            traced, again, *apart = (
                sensor.compute_depth_from(*light, frame_index=_OTHER_NOISE + n)["disparity"]
                for n, light in enumerate((mean, mean, *pictures))
            )
            quiet = _without_noise(sensor, mean[:2], mean[2:])
            left = world.gbuffers(sensor)
    kind, pixels = world.kind_of(left), left["depth"] > 0
    truth = np.divide(config.focal_baseline_px_m, left["depth"], where=pixels, out=np.zeros_like(left["depth"]))
    silent = StereoDepthSensorConfig("D435").scaled(scale)
    silent.ir_signal = dict(silent.ir_signal) | _NO_NOISE
    found = {
        "samples": {name: _apart(*apart, kind == n) / _apart(again, traced, kind == n) for n, name in enumerate(KINDS)}
    }
    for seen, n in (("left", 1), *((f"all x{n}", n) for n in finer)):
        own = {"ambient": config.ir_ambient_radiance + world.room_w_per_sr_m2, **_seen(world, config, n, "all" in seen)}
        sensors = (
            GBufferStereo(c, materials=world.materials(), device=device, supersampling=n) for c in (config, silent)
        )
        taken, still = (sensor(**own, outputs=("disparity",))["disparity"][0] for sensor in sensors)
        found[seen] = _ratios(taken, traced, again, apart, truth, kind)
        both = (still > 0) & (quiet > 0) & (kind == 0)
        found[seen]["systematic, px"] = float(np.median(np.abs(still - quiet)[both]))
    return {seen: {name: ratio for name, ratio in of.items() if np.isfinite(ratio)} for seen, of in found.items()}


def _without_noise(sensor: StereoDepthSensor, light: list[Image], lasers: list[Image]) -> Image:
    signals = [dict(side.signal) | _NO_NOISE for side in sensor.engine_inputs().sides]
    engine = sensor.make_engine()
    engine.set_signal(*signals)
    return engine.compute(*light, ("disparity",), left_laser=lasers[0], right_laser=lasers[1])["disparity"]


def _seen(world: World, config: StereoDepthSensorConfig, n: int, are_all: bool) -> dict[str, Any]:
    """G-buffers with n times the rows and columns: of the left camera, or of all views."""
    config = config.scaled(n)
    with StereoDepthSensor(config, world.scene, pose=world.pose) as sensor:
        left, right = (world.gbuffers(sensor, side) for side in ("left", "right"))
    config.trans_pose_l = config.pose_rgb_irproj
    with StereoDepthSensor(config, world.scene, pose=world.pose) as beside:  # a camera in the projector's place
        projector = beside.get_picture("depth", "left")[..., 0]
    return left | ({"right": right, "projector": projector} if are_all else {})


def _ratios(
    taken: Image, traced: Image, again: Image, apart: list[Image], truth: Image, kind: Image
) -> dict[str, float]:
    here = kind >= 0
    holes = [(image <= 0) & here for image in (taken, traced, again)]
    out = {"holes": _iou(holes[0], holes[1]) / _iou(holes[2], holes[1])}
    for number, name in enumerate(KINDS):
        own, noise, both = (_apart(*pair, kind == number) for pair in ((taken, traced), (again, traced), apart))
        of_samples = max(both**2 - noise**2, 0.0) / 4  # of the mean of two pictures
        out[name] = max(own**2 - of_samples, 0.0) ** 0.5 / noise
    both = here & (taken > 0) & (traced > 0)
    out["truth"] = float(np.median(np.abs(taken - truth)[both]) / np.median(np.abs(traced - truth)[both]))
    return out


def _apart(one: Image, other: Image, where: Image) -> float:
    """px; NaN where too few pixels are measured for a median."""
    both = where & (one > 0) & (other > 0)
    return float(np.median(np.abs(one - other)[both])) if both.sum() >= _LEAST_PX else float("nan")


def _iou(a: Image, b: Image) -> float:
    return float((a & b).sum() / max((a | b).sum(), 1))


def timed(environments: int, rounds: int, seed: int, device: str | int) -> dict[str, float]:
    """Milliseconds per pair to depth, of 128x128."""
    config = StereoDepthSensorConfig("D435").resized(128, 128)
    config.samples_per_pixel = 4
    world = World.draw(seed, device)
    with StereoDepthSensor(config, world.scene, pose=world.pose) as sensor:
        given = world.gbuffers(sensor)
    batch = StereoDepthSensorBatch(config, Mounts(world.scene, np.stack([as_matrix(world.pose)] * environments)))
    ours = GBufferStereo(config, environments, device=device, materials=world.materials())
    many = {name: np.ascontiguousarray(np.broadcast_to(i, (environments, *i.shape))) for name, i in given.items()}

    def traced() -> None:
        batch.take_picture(infrared_only=True)
        batch.compute_depth()

    turns: dict[str, Callable[[], Any]] = {
        "traced, 4 samples": traced,
        "GBufferStereo": lambda: ours(**many, ambient=0.1, outputs=("depth",)),
        "on the device": _on_the_device(ours, many),
    }
    least = dict.fromkeys(turns, float("inf"))
    for turn in range(rounds + 1):
        for name, work in turns.items():
            work()  # the turns' optics differ, and are prepared at their first picture
            start = time.perf_counter()
            work()
            seconds = time.perf_counter() - start
            least[name] = min(least[name], seconds) if turn else least[name]
    return {name: 1e3 * seconds / environments for name, seconds in least.items()}


def _on_the_device(sensor: GBufferStereo, images: dict[str, Image]) -> Callable[[], dict[str, float]]:
    """Light and depth of images that the renderer has, to depth in the engine's memory; milliseconds by stage."""
    sensor(**images, ambient=0.1, outputs=("depth",))
    engine, link, count = sensor._engine, sensor._link, sensor.shape[0]
    memory = simsense.Buffer(engine.device, 4 * int(np.prod(sensor.shape)), host_visible=link.memory == "host")
    depth = memory.image(np.float32, sensor.shape)
    given = dict(sensor._views[0]._buffers)
    targets = {"radiance": link.target, "projector": link.laser().target}
    cameras = sensor._rig.ir_cameras(np.eye(4)[None])
    optics = [copy_record(one) for one in sensor._rig.infrared()["optics"]]
    for one in optics:
        one.firefly_factor = 0.0

    def work() -> dict[str, float]:
        sensor._renderer.light_gbuffers(
            sensor._scene, cameras, targets, left=given, optics=optics, environment_count=count,
            ambient_radiance=np.full(count, 0.1), supersampling=sensor._supersampling,
        )  # fmt: skip
        engine.compute(link.left, link.right, {"depth": depth}, **link.lasers(True))
        return {**sensor._renderer.stage_times, **engine.stage_times}

    return work


def print_stages(environments: int, size_px: int, n: int, rounds: int, seed: int, device: str | int) -> None:
    """Pairs/s on the device, beside a traced z-buffer's frames/s, and us per pair by stage. n: supersampling."""
    config = StereoDepthSensorConfig("D435").resized(size_px, size_px)
    world = World.draw(seed, device)
    with StereoDepthSensor(config, world.scene, pose=world.pose) as sensor:
        frames = environments / _z_buffer_s(sensor, world, environments, rounds)
    with StereoDepthSensor(config.resized(n * size_px, n * size_px), world.scene, pose=world.pose) as sensor:
        given = world.gbuffers(sensor)
    many = {name: np.ascontiguousarray(np.broadcast_to(i, (environments, *i.shape))) for name, i in given.items()}
    config.ir_exposure_mode = "fixed"
    ours = GBufferStereo(config, environments, device=device, materials=world.materials(), supersampling=n)
    work, least, stages = _on_the_device(ours, many), float("inf"), {}
    warm = time.perf_counter() + 1
    while time.perf_counter() < warm:
        work()
    for _ in range(rounds + 1):
        start = time.perf_counter()
        times = work()
        seconds = time.perf_counter() - start
        if seconds < least:
            least, stages = seconds, times
    per_pair = 1e6 / environments
    print(f"{environments} of {size_px}x{size_px}, x{n}", end=": ")
    print(f"{environments / least:.0f} pairs/s, z-buffer {frames:.0f} frames/s")
    print(f"us per pair: {per_pair * least:.2f}", end=", ")
    print("; ".join(f"{name} {per_pair * 1e-3 * ms:.2f}" for name, ms in stages.items() if ms > 0), flush=True)


def _z_buffer_s(sensor: StereoDepthSensor, world: World, environments: int, rounds: int) -> float:
    """Seconds of the left cameras' depth alone, to memory of the device, of the fastest round."""
    renderer, shape = kuafu.Renderer(sensor.device), (environments, *sensor.get_config().ir_resolution[::-1], 1)
    memory = kuafu.Buffer(sensor.device, 4 * int(np.prod(shape)), host_visible=False)
    targets, cameras = {"depth": memory.image(np.float32, shape)}, sensor.ir_cameras()[:1] * environments
    least = float("inf")
    for _ in range(rounds + 1):
        start = time.perf_counter()
        renderer.render(world.scene, cameras, targets, band="infrared", samples_per_pixel=1)
        least = min(least, time.perf_counter() - start)
    return least


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1:6", help="FIRST:END, the end not among them (default 1:6)")
    parser.add_argument("--scale", type=float, default=0.4, help="of a D435's images (default 0.4)")
    parser.add_argument("--samples", type=int, default=64, help="of the traced pictures (default 64)")
    parser.add_argument("--supersampling", type=int, nargs="+", default=[1, 2], help="of G-buffers (default 1 2)")
    parser.add_argument("--environments", type=int, default=32, help="of the timed batch (default 32)")
    parser.add_argument("--rounds", type=int, default=5, help="of the timing, 0 = none (default 5)")
    stages = "only times by stage, of N environments of PX x PX, supersampling X (default 1)"
    parser.add_argument("--stages", nargs="+", metavar="N:PX[:X]", help=stages)
    parser.add_argument("--device", default="cpu", help="as kuafu.Device has it (default cpu)")
    args = parser.parse_args()
    device = int(args.device) if args.device.isdigit() else args.device
    for batch in args.stages or ():
        environments, size_px, *n = (int(number) for number in batch.split(":"))
        print_stages(environments, size_px, *(n or [1]), args.rounds, int(args.seeds.split(":")[0]), device)
    if args.stages:
        return
    first, end = (int(number) for number in args.seeds.split(":"))
    worlds = [compared(seed, args.scale, args.samples, args.supersampling, device) for seed in range(first, end)]
    for seen in worlds[0]:
        names = dict.fromkeys(name for world in worlds for name in world[seen])
        print(f"seen: {seen}, {len(worlds)} worlds")
        for name in names:
            low, middle, high = np.percentile([w[seen][name] for w in worlds if name in w[seen]], (10, 50, 90))
            print(f"  {name:16} {middle:7.3f}  ({low:.3f} to {high:.3f})")
    if args.rounds:
        times = timed(args.environments, args.rounds, first, device)
        for name, milliseconds in times.items():
            print(f"{name:18} {milliseconds:9.4f} ms per pair, {1e3 / milliseconds:8.0f} pairs/s")
        print(f"ratio {times['traced, 4 samples'] / times['GBufferStereo']:.2f}")


if __name__ == "__main__":
    main()
