# SPDX-License-Identifier: Apache-2.0
"""Reads real views (an infrared pair, the device's depth, the scene) and simulates their depth by nine methods.
Compares depth with the device's and with the scene's, and measures infrared pairs on flat patches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Capture, Frame
from activestereo.capture.images import read_gray
from activestereo.common.accuracy import is_invented
from activestereo.common.lens import disparity_of
from activestereo.common.pose import CAMERA_TO_BODY, Pose, body_pose
from activestereo.effects.engines.loaded_scene import RoomLight, has_room_light, light_by_room
from activestereo.scene_io.scene_files import load_scene_file
from activestereo.sensor.depth_modes import OF_TRUTH, make_lambertian, one_view_depth
from activestereo.sensor.sensor import StereoDepthSensor

Map = NDArray[np.float32]


@dataclass(frozen=True)
class RealView:
    """A recorded view. left, right: infrared images, DN. device_m, truth_m: depth in the left camera in metres, 0 =
    none; the device measured the first, and the second is rendered from the scene. room: the room's light as measured
    on the surfaces; None if the scene has lights of its own."""

    name: str
    capture: Capture
    frame: Frame
    left: Map
    right: Map
    device_m: Map
    truth_m: Map
    scene: kuafu.Scene
    room: RoomLight | None = None

    @property
    def focal_baseline_px_m(self) -> float:
        return float(self.capture.rig.left.K[0, 0]) * self.capture.rig.baseline_m

    def disparity(self, depth_m: Map) -> Map:
        """Converts depth in metres to disparity in pixels, NaN without depth."""
        return disparity_of(depth_m, self.focal_baseline_px_m)


def real_views(capture: Capture, device_depth: Path | None, device: str | int) -> list[RealView]:
    """Reads the views of a capture that have a pair and depth. device_depth: a folder with the device's depth as 16-bit
    PNG files in millimetres, in order of the frames; give it if the capture's own depth is from a better instrument.
    None: the capture's depth is the device's. Raises ValueError if the numbers of files and frames differ."""
    frames = [frame for frame in capture.frames if frame.has_infrared]
    files: list[Path] | None = None
    if device_depth is not None:
        files = sorted(device_depth.glob("*.png"))
        if len(files) != len(frames):
            raise ValueError(f"{device_depth}: has {len(files)} PNG files, {capture.path} {len(frames)} pairs")
    scene = kuafu.Scene(kuafu.Device(device))
    load_scene_file(scene, capture.scene_path)
    has_room = has_room_light(capture.scene_path)
    room = light_by_room(scene, scene.device, capture.scene_path) if has_room else None
    renderer, views = kuafu.Renderer(scene.device), []
    camera = capture.rig.left
    for number, frame in enumerate(frames):
        if files is not None:
            depth = read_gray(files[number], camera.size, "depth").astype(np.float32) * 1e-3
        else:
            found = capture.depth(frame)
            if found is None:
                continue
            depth = found.astype(np.float32)
        eye = kuafu.Camera(camera.width, camera.height, camera.K, frame.camera_to_world)
        truth = renderer.render(scene, eye, ["depth"], band="infrared", spp=1)["depth"].reshape(depth.shape)
        left, right = (capture.ir(frame, side) for side in ("left", "right"))
        name = f"{capture.path.name} {frame.id}"
        depth_m = np.nan_to_num(depth)
        views.append(RealView(name, capture, frame, left, right, depth_m, np.array(truth), scene, room))
    if not views:
        raise ValueError(f"{capture.path}: has no frame with an infrared pair and depth")
    return views


OF_PAIRS = ("raster", "preset", "calibrated")
METHODS = (*OF_TRUTH, *OF_PAIRS)
_FIT_STEP_PX = 7  # the fit of the light's two levels takes every seventh row and column


@dataclass(frozen=True)
class Simulated:
    """A method's simulation of a real view. depth_m: its depth in the left camera, metres, in two exposures that differ
    only by noise. left, right: infrared images, DN; None for methods without a pair."""

    depth_m: tuple[Map, Map]
    left: Map | None = None
    right: Map | None = None


def simulated(view: RealView, method: str, sensor: str, samples: int, seed: int) -> Simulated:
    """Simulates a real view by a method of METHODS. sensor: a preset's name. samples: samples per pixel. The method
    'raster' makes the scene's materials Lambertian for good, so simulate it last."""
    if method in OF_TRUTH:
        gray, lens = (view.left / view.capture.rig.max_dn)[None], float(view.capture.rig.left.K[0, 0])
        randoms = (np.random.default_rng(seed + number) for number in range(2))
        truth, focal_baseline = view.truth_m[None], view.focal_baseline_px_m
        first, second = (one_view_depth(method, truth, gray, lens, focal_baseline, own)[0] for own in randoms)
        return Simulated((first, second))
    config = rig_config(view, sensor, method == "calibrated")
    config.samples_per_pixel, config.noise_seed = samples, seed
    if method == "raster":
        make_lambertian(view.scene)
        config.max_bounces = 0
    place = Pose(body_pose(view.frame.camera_to_world).to_transformation_matrix())
    with StereoDepthSensor(config, view.scene, pose=place) as taken:
        taken.take_picture(infrared_only=True)
        light, laser = fitted_light(view, taken)
        wanted = ("depth", "ir_left", "ir_right")
        found = [taken.compute_depth_from(light[0], light[1], laser[0], laser[1], wanted, frame) for frame in range(2)]
    depths = [np.array(one["depth"], np.float32) for one in found]
    pair = (np.array(found[0][f"ir_{side}"], np.float32) for side in ("left", "right"))
    return Simulated((depths[0], depths[1]), *pair)


def rig_config(view: RealView, sensor: str, is_calibrated: bool) -> StereoDepthSensorConfig:
    """Returns the preset's configuration with the capture's cameras. is_calibrated: whether to also take over the
    capture's projector, pattern, black level and vignetting."""
    rig, config = view.capture.rig, StereoDepthSensorConfig(sensor).seen_from_left()
    config.ir_resolution = rig.left.size
    config.ir_intrinsic = np.array(rig.left.K)
    config.trans_pose_r = Pose((0.0, -rig.baseline_m, 0.0))
    config.max_depth_m = float("inf")
    config.ir_exposure_mode = "fixed"  # the light is fitted to the real image's
    if view.room is not None:  # measured with all its bounces, and without noise
        config.max_bounces, config.denoise = 1, "none"
    if not is_calibrated:
        return config
    there = CAMERA_TO_BODY @ np.linalg.inv(rig.projector.left_to_projector) @ CAMERA_TO_BODY.T
    config.pose_rgb_irproj = Pose(there)
    config.pattern_intrinsic = np.array(rig.projector.K)
    config.light_pattern = np.rint(255.0 * rig.projector.pattern()).astype(np.uint8)
    # The calibrated pattern is already blurred by the camera's lens, so neither beam nor lens blurs it again.
    config.projector_beam_radius_m = 0.0
    config.ir_optics = {name: value for name, value in (config.ir_optics or {}).items() if name != "psf_sigma_px"}
    if rig.black_dn is not None:
        config.ir_black_level_dn = rig.black_dn[0]
    exposure = view.capture.measured.get("exposure", view.capture.measured.get("light", {}))
    if "vignetting_exponent" in exposure:
        config.ir_optics["vignetting_exponent"] = exposure["vignetting_exponent"][0]
    return config


def fitted_light(view: RealView, taken: StereoDepthSensor) -> tuple[list[Map], list[Map]]:
    """Renders the radiance at both cameras, [height, width] W/(sr m^2). A preset does not know how bright the laser and
    the room are, so two factors for them are fitted to the real left image. Returns ([left, right] radiance, [left,
    right] of the laser's part alone)."""
    config = taken.get_config()
    per_radiance = config.ir_camera_exposure * config.ir_camera_gain * config.ir_responsivity_dn
    laser = [
        taken.get_picture("projector_direct", side)[..., 0] + taken.get_picture("projector_indirect", side)[..., 0]
        for side in ("left", "right")
    ]
    if view.room is not None:
        renderer, options = kuafu.Renderer(view.scene.device), {"spp": config.samples_per_pixel}
        room = [image[..., 0] for image in view.room.images(renderer, list(taken.ir_cameras()), **options)]
    else:
        sides = zip(("left", "right"), laser, strict=True)
        room = [taken.get_picture("radiance", side)[..., 0] - own for side, own in sides]
    part = np.s_[::_FIT_STEP_PX, ::_FIT_STEP_PX]
    known = (view.truth_m > 0)[part] & (view.left < view.capture.rig.max_dn)[part]
    terms = np.stack([laser[0][part][known], room[0][part][known]], axis=1).astype(np.float64) * per_radiance
    counts = view.left[part][known].astype(np.float64) - config.ir_black_level_dn
    weights, levels = np.ones(len(counts)), np.zeros(2)
    for _ in range(10):  # least squares of factors, all at least 0, with Huber's weights
        root = np.sqrt(weights)
        levels = np.maximum(np.linalg.lstsq(terms * root[:, None], counts * root, rcond=None)[0], 0.0)
        error = np.abs(counts - terms @ levels)
        weights = np.minimum(1.0, 1.5 * np.median(error) / np.maximum(error, 1e-9))
    own = [(levels[0] * one).astype(np.float32) for one in laser]
    return [one + (levels[1] * rest).astype(np.float32) for one, rest in zip(own, room, strict=True)], own


PATCH_PX = 96
_MOST_RMS_PX, _LEAST_KNOWN = 0.05, 0.95


@dataclass(frozen=True)
class Patch:
    """A flat patch of the image. place: its rows and columns. plane: coefficients, disparity = plane @ (x, y, 1) at the
    image's pixel (x, y). depth_m: depth in its middle."""

    place: tuple[slice, slice]
    plane: NDArray[np.float64]
    depth_m: float

    def disparity(self) -> Map:
        v, u = np.mgrid[self.place]
        return (self.plane[0] * u + self.plane[1] * v + self.plane[2]).astype(np.float32)


def planar_patches(truth: Map, focal_baseline_px_m: float) -> list[Patch]:
    """Returns the flat patches of a grid of squares. truth: disparities [height, width], NaN = unknown."""
    height, width = truth.shape
    found = []
    for y in range(0, height - PATCH_PX + 1, PATCH_PX):
        for x in range(0, width - PATCH_PX + 1, PATCH_PX):
            place = slice(y, y + PATCH_PX), slice(x, x + PATCH_PX)
            plane, rms = fitted_plane(truth[place], y, x)
            if rms < _MOST_RMS_PX:
                middle = float(plane @ [x + 0.5 * PATCH_PX, y + 0.5 * PATCH_PX, 1.0])
                found.append(Patch(place, plane, focal_baseline_px_m / middle))
    return found


def fitted_plane(
    disparity: Map, y: int = 0, x: int = 0, least_known: float = _LEAST_KNOWN
) -> tuple[NDArray[np.float64], float]:
    """Fits a plane to disparities; returns (coefficients for (x, y, 1), RMS distance from it) without pixels more than
    1 px off. The RMS is inf if less than least_known of the pixels have a disparity, or most are off. y, x: the first
    pixel's coordinates."""
    rows, columns = np.nonzero(np.isfinite(disparity))
    values = disparity[rows, columns].astype(np.float64)
    if len(values) < least_known * disparity.size:
        return np.zeros(3), np.inf
    terms = np.stack([columns + x, rows + y, np.ones(len(rows))], axis=1).astype(np.float64)
    kept = np.ones(len(values), bool)
    plane = np.zeros(3)
    for _ in range(4):
        plane = np.linalg.lstsq(terms[kept], values[kept], rcond=None)[0]
        kept = np.abs(values - terms @ plane) < 1.0
        if kept.sum() < 0.5 * len(values):
            return plane, np.inf
    return plane, float(np.sqrt(np.mean((values - terms @ plane)[kept] ** 2)))


STATISTICS = ("dots' RMS, DN", "dots' share of light, %", "left-right residual, %", "side peak", "its lag, px")
_BLUR_PX, _BORDER_PX = 6.0, 6
_LEAST_LAG_PX, _LARGEST_LAG_PX = 4.0, 30.0
_MOST_UNEVEN = 0.15  # share of the mean; a patch that varies more has a texture of its own


def statistics(left: Map, right: Map, patch: Patch, black_dn: float) -> dict[str, float] | None:
    """Computes the STATISTICS of an infrared pair (DN) on a flat patch; None if the surface has a texture.

    Fine structure is the image less its Gaussian blur of 6 px; dots' RMS is that of the fine structure. The residual is
    the RMS of left less right at the true disparity, divided by sqrt 2 and the dots' RMS. The side peak is the largest
    autocorrelation at lags from 4 to 30 px, relative to that at lag 0."""
    rows, columns = patch.place
    image = left[rows, columns].astype(np.float32)
    coarse = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
    level = float(image.mean()) - black_dn
    if coarse.std() > _MOST_UNEVEN * image.mean() or level <= 0:
        return None
    fine = image - coarse
    v, u = np.mgrid[rows, columns].astype(np.float32)
    inside = np.s_[_BORDER_PX:-_BORDER_PX, _BORDER_PX:-_BORDER_PX]
    rest = np.inf
    for step in np.arange(-0.4, 0.41, 0.1):  # the two cameras' rows differ by a few tenths of a pixel
        seen = cv2.remap(right.astype(np.float32), u - patch.disparity(), v + np.float32(step), cv2.INTER_CUBIC)
        other = seen - cv2.GaussianBlur(seen, (0, 0), _BLUR_PX)
        gain = fine[inside].std() / max(float(other[inside].std()), 1e-6)
        rest = min(rest, float((fine - gain * other)[inside].std()) / float(np.sqrt(1.0 + gain**2)))
    rms = float(fine.std())
    spectrum = np.abs(np.fft.fft2(fine - fine.mean())) ** 2
    correlation = np.fft.fftshift(np.fft.ifft2(spectrum).real)
    correlation /= max(float(correlation.max()), 1e-12)
    middle = PATCH_PX // 2
    y, x = np.mgrid[-middle : PATCH_PX - middle, -middle : PATCH_PX - middle]
    distance = np.hypot(x, y)
    ring = np.where((distance > _LEAST_LAG_PX) & (distance < _LARGEST_LAG_PX), correlation, -1.0)
    at = np.unravel_index(int(ring.argmax()), ring.shape)
    values = rms, 100.0 * rms / level, 100.0 * rest / max(rms, 1e-9), float(ring[at]), float(distance[at])
    return dict(zip(STATISTICS, values, strict=True))


DISTANCES_M = (0.5, 0.8, 1.2, 1.7, 2.3, 3.2)
_DISTANCES = tuple(zip(DISTANCES_M, DISTANCES_M[1:], strict=False))
DISTANCE_NAMES = tuple(f"{low:g}-{high:g} m" for low, high in _DISTANCES)
_STEP_PX, _NEAR_EDGE_PX, _RUN_PX = 3.0, 5, 12
_BETWEEN_PX = 1.0  # least distance of a flying pixel from both surfaces
_LEAST_MEASURED = 0.5  # share of a patch's pixels
_MOST_LAG_PX = 12
_PLAIN = (
    "fill, %", "invented, %", "hole IoU", "edge width, px", "flying pixels, %", "dead band, px",
    "noise's correlation, px",
)  # fmt: skip
BLACK = "black level, DN"


def depth_measures(view: RealView, depth_m: Map, again_m: Map | None, patches: list[Patch]) -> dict[str, float]:
    """Computes {measure: value} of depth_m, [height, width] metres; NaN if the view does not determine it. again_m:
    another exposure of the same view; None: none.

    invented: share of measured pixels off by more than 5 %. hole IoU: intersection over union of its holes and the
    device's, at pixels where the scene is known. edge width: mean run of foreground beyond an edge of the truth. flying
    pixels: share of measured pixels within 5 px of an edge that lie between both surfaces. dead band: unmeasured
    columns at the left, as a median over rows. Spatial noise: RMS from a plane fitted to a flat patch; its correlation:
    the lag at which the autocorrelation falls to 1/e. Temporal noise: standard deviation of the two exposures'
    difference on a patch, over sqrt 2. Bias: median error. Noise and bias are in pixels of disparity, by distance."""
    found, truth = view.disparity(depth_m), view.disparity(view.truth_m)
    is_known, is_measured = np.isfinite(truth), np.isfinite(found)
    holes, device_holes = ~is_measured & is_known, ~(view.device_m > 0) & is_known
    width, flying = _edges(truth, found)
    out = {
        "fill, %": 100.0 * float(is_measured[is_known].mean()),
        "invented, %": 100.0 * float(is_invented(depth_m, view.truth_m)[is_known & is_measured].mean()),
        "hole IoU": float((holes & device_holes).sum() / max(1, (holes | device_holes).sum())),
        "edge width, px": width,
        "flying pixels, %": flying,
        "dead band, px": float(np.median(np.argmax(is_measured, axis=1))),
    }
    change = None if again_m is None else view.disparity(again_m) - found
    lags = []
    for (low, high), name in zip(_DISTANCES, DISTANCE_NAMES, strict=True):
        inside = is_known & is_measured & (view.truth_m >= low) & (view.truth_m < high)
        out[f"bias, px: {name}"] = float(np.median((found - truth)[inside])) if inside.sum() > 1000 else np.nan
        spread, own = [], [patch for patch in patches if low <= patch.depth_m < high]
        for patch in own:
            rows, columns = patch.place
            plane, rms = fitted_plane(found[patch.place], rows.start, columns.start, _LEAST_MEASURED)
            if np.isfinite(rms):
                spread.append(rms)
                v, u = np.mgrid[patch.place]
                lags.append(_correlation_px(found[patch.place] - (plane[0] * u + plane[1] * v + plane[2])))
        out[f"spatial noise, px: {name}"] = float(np.median(spread)) if spread else np.nan
        repeated = []
        for moved in [] if change is None else [change[patch.place] for patch in own]:
            known = moved[np.isfinite(moved)]
            repeated.append(float(np.clip(known, -1.0, 1.0).std()) / np.sqrt(2) if known.size else np.nan)
        out[f"temporal noise, px: {name}"] = float(np.nanmedian(repeated)) if np.isfinite(repeated).any() else np.nan
    out["noise's correlation, px"] = float(np.nanmedian(lags)) if lags else np.nan
    return out


def infrared_measures(view: RealView, left: Map, right: Map, patches: list[Patch], black_dn: float) -> dict[str, float]:
    """Returns medians of statistics() over the untextured patches, by distance, and the black level: the 0.1 % quantile
    of the left image, DN."""
    out = {BLACK: float(np.percentile(left, 0.1))}
    found = [(patch.depth_m, statistics(left, right, patch, black_dn)) for patch in patches]
    for (low, high), name in zip(_DISTANCES, DISTANCE_NAMES, strict=True):
        own = [one for depth_m, one in found if one is not None and low <= depth_m < high]
        for statistic in STATISTICS:
            out[f"{statistic}: {name}"] = float(np.median([one[statistic] for one in own])) if own else np.nan
    return out


def _edges(truth: Map, found: Map) -> tuple[float, float]:
    """Measures depth at left and right edges of objects. Returns (mean run of the foreground's depth beyond the edge in
    pixels, percentage of measured pixels near edges that lie between both surfaces). truth, found: disparities in
    pixels."""
    runs, between, near = [], 0, 0
    for turn in (1, -1):
        t, d = truth[:, ::turn], found[:, ::turn]
        y, x = np.nonzero(t[:, 41:-39] - t[:, 40:-40] > _STEP_PX)
        x += 40  # the background's last pixel
        behind, before = t[y, x - _RUN_PX], t[y, x + _NEAR_EDGE_PX]
        is_clean = (before - behind > _STEP_PX) & (abs(t[y, x] - behind) < 1.5) & (abs(t[y, x + 1] - before) < 1.5)
        y, x, behind, before = y[is_clean], x[is_clean], behind[is_clean], before[is_clean]
        goes_on, run = np.ones(len(y), bool), np.zeros(len(y))
        for k in range(_RUN_PX):
            goes_on &= d[y, x - k] > 0.5 * (behind + before)
            run += goes_on
        runs.append(run)
        for k in range(-_NEAR_EDGE_PX, _NEAR_EDGE_PX + 1):
            beside = d[y, x + k]
            near += int(np.isfinite(beside).sum())
            between += int(((beside > behind + _BETWEEN_PX) & (beside < before - _BETWEEN_PX)).sum())
    every = np.concatenate(runs)
    return (float(every.mean()) if len(every) else np.nan), (100.0 * between / near if near else np.nan)


def _correlation_px(residual: Map) -> float:
    """Returns the lag, in pixels, at which the autocorrelation of a disparity residual falls to 1/e; 12 if it does not.
    Lags along rows and along columns count alike."""
    values = np.where(np.abs(residual) < 1.0, residual, np.nan)
    values = values - np.nanmean(values)
    variance = np.nanmean(values**2)
    if not variance > 0:
        return np.nan
    before = 1.0
    for lag in range(1, _MOST_LAG_PX + 1):
        across, down = values[:, lag:] * values[:, :-lag], values[lag:] * values[:-lag]
        now = float(0.5 * (np.nanmean(across) + np.nanmean(down)) / variance)
        if now < np.exp(-1.0):
            return lag - 1 + (before - np.exp(-1.0)) / (before - now)
        before = now
    return float(_MOST_LAG_PX)
