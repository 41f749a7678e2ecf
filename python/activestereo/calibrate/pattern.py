# SPDX-License-Identifier: Apache-2.0
"""Measures the projector's pattern from frames of a flat wall: each dot's direction and power, and the projector's
position.

Dots are found in the averaged images of both cameras and lie on the wall's plane (both in wall.py). A dot seen on walls
at two distances gives a line; the lines meet at the projector. With one distance its position stays nominal.

A dot's power follows from its flux in the image, which also depends on the distances and angles of projector and
camera. power_factor() in wall.py corrects that. wall.py also finds the light between the dots."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from activestereo.calibrate import wall as walls_light
from activestereo.calibrate.least_squares import INTERVAL_90, difference
from activestereo.calibrate.repeats import LEAST_REPEATS, Repeats, check_still
from activestereo.calibrate.wall import ProjectorView, Spots, Wall, find_spots, find_wall, power_factor, wall_points
from activestereo.capture.capture import SAME_EXPOSURE, SIDES, Capture, Frame, read_capture
from activestereo.capture.capture import Rig as CaptureRig
from activestereo.capture.images import read_gray
from activestereo.common.pose import rigid_motion
from activestereo.common.progress_bar import Progress, part_of, silent
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.model import Pattern as SensorPattern
from activestereo.model import Rig, SensorModel
from activestereo.model.diagnosed import calibrated

# A dot covers some ten pixels of a hundred: a tenth of the dots may clip at their tops.
_LARGEST_SATURATED = 0.005
_LEAST_DISTANCE_RATIO = 1.2
# Largest distance, in pixels of the pattern, between one dot's directions from two walls; one for each round.
_SAME_DOT_PX = (6.0, 3.0, 1.5, 1.5)
# A spot cut by a border is a new dot if it is farther than this from all known dots, pixels of the pattern.
_OTHER_DOT_PX = 3.0
_ALIKE_POWERS = 0.3
_INTERPOLATED_PX2 = 1.0 / 6.0  # a tent's variance
_LEAST_LINES = 100
# Tolerances of the right camera, above the errors of rectified calibrations. The offset from the row is in baselines:
# 0.25 mm of a D435's move a dot by a tenth of a pixel at half a metre, and matched rows take half of that.
_MOST_TURNED_DEG, _MOST_ASIDE = 0.3, 0.005


@dataclass(frozen=True)
class WallView:
    """The wall at one distance. spots, cut: {side: Spots}, whole ones and those cut by the image's border. wall: its
    plane and points. exposure_gain: seconds times gain."""

    name: str
    spots: dict[str, Spots]
    cut: dict[str, Spots]
    wall: Wall
    exposure_gain: float


@dataclass(frozen=True)
class Pattern:
    """The measured pattern. dots: [n, 3], u, v in pixels of an image of `size` under K, and power in pixels squared.
    All light, background included, sums to the nominal pattern's, or to n without a nominal pattern. position_m: the
    projector's origin in the left camera's frame. position_error_m: its standard deviations; None if it is nominal.
    background: (light between the dots, in the powers' unit per square pixel; half of the cameras' difference), or None
    if not measured. seen_twice: number of dots visible at two distances. rig: the calibration that was assumed."""

    dots: np.ndarray
    size: tuple[int, int]
    K: np.ndarray
    position_m: np.ndarray
    position_error_m: np.ndarray | None
    left_to_projector: np.ndarray
    dot_sigma_px: float
    background: tuple[float, float] | None
    views: tuple[WallView, ...]
    seen_twice: int
    rig: CaptureRig

    def model(self) -> SensorModel:
        """Makes a SensorModel of the pattern and of the assumed rig with the projector's position, for model.json."""
        distances = ", ".join(f"{view.wall.distance_m:.3f} m" for view in self.views)
        place = f"the projector's place is {'nominal' if self.position_error_m is None else 'measured'}"
        pattern = SensorPattern(
            self.K, dots=self.dots, size=self.size, dot_sigma_px=self.dot_sigma_px,
            background=0.0 if self.background is None else self.background[0],
            source=f"calibrate pattern: {len(self.dots)} dots, walls at {distances}; {place}",
        )  # fmt: skip
        nominal = Rig.of_capture(self.rig, source="the rig that calibrate pattern believed")
        return SensorModel(pattern=pattern, rig=replace(nominal, left_to_projector=self.left_to_projector))

    def summary(self) -> str:
        """Describes the pattern and its walls as text, which the command prints."""
        seen = f"{self.seen_twice} of them are seen at two distances"
        lines = [f"{len(self.dots)} dots; {seen}; sigma {self.dot_sigma_px:.2f} px of the pattern"]
        for view in self.views:
            wall, (left, right) = view.wall, (len(view.spots[side]) for side in SIDES)
            matched = f"{left} and {right} dots, {100.0 * np.mean(wall.is_seen_by_both):.0f} % matched"
            lines.append(f"{view.name}: wall at {wall.distance_m:.4f} m, {matched}, flat to {wall.flatness_px:.3f} px")
        place = 1e3 * self.position_m
        if self.position_error_m is None:
            at = ", ".join(f"{value:.2f}" for value in place)
            told = "NOMINAL; a wall at a second distance, 1.5 times as far, would tell it"
            lines.append(f"projector at {at} mm of the left camera: {told}")
        else:
            half = 1e3 * INTERVAL_90 * self.position_error_m
            at = ", ".join(f"{value:.3f} ± {error:.3f}" for value, error in zip(place, half, strict=True))
            lines.append(f"projector at {at} mm of the left camera (90 %)")
        told = "NOT MEASURED, taken as none; it takes walls at two distances, exposed alike"
        if self.background is not None:
            peak = float(self.dots[:, 2].max()) / (2.0 * np.pi * self.dot_sigma_px**2)
            value, differ = 100.0 * self.background[0] / peak, 200.0 * self.background[1] / peak
            told = f"{value:.2f} % of the brightest dot's peak; the cameras differ by {differ:.2f} %"
        return "\n".join([*lines, f"light between the dots: {told}"])


def calibrate_pattern(path: Path, progress: Progress = silent, model: SensorModel | None = None) -> Pattern:
    """Measures the Pattern from a capture whose repeat groups show one flat, matt wall, each group from one distance,
    with the projector on.

    K, the baseline and the projector's K are `model`'s if it has a rig, else the capture's nominal ones. The
    projector's rotation is always the capture's nominal one. Its position is measured from two distances, and nominal
    for one. Dots' directions are computed with this rig and are wrong for another. Raises ValueError with file, number
    and remedy: too few or moving repeats, a saturated wall, a distorted lens, a surface that is not flat."""
    capture, source = read_capture(path), f"{path}/capture.json"
    if model is not None and model.rig is not None:
        nominal, own = capture.rig.projector.left_to_projector, model.rig
        # The projector's position is measured here, so the model's is not used.
        capture = calibrated(capture, SensorModel(rig=replace(own, left_to_projector=nominal)))
        source = "the model"
    _check_rig(capture.rig, source)
    groups = capture.repeats()
    if not groups:
        told = f"no frames share a repeat_group: record {LEAST_REPEATS} or more frames of the wall at each distance"
        raise ValueError(f"{capture.path}: {told}")
    views = []
    for number, frames in enumerate(groups):
        share = part_of(progress, 0.95 * number / len(groups), 0.95 * (number + 1) / len(groups))
        views.append(_wall_view(capture, f"{capture.path}: repeat group {frames[0].repeat_group}", frames, share))
    views.sort(key=lambda view: view.wall.distance_m)
    pattern = _merged(tuple(views), capture.rig)
    progress(1.0)
    return pattern


def _check_rig(rig: CaptureRig, source: str) -> None:
    """Raises ValueError unless the rig has no distortion and parallel cameras. source: the rig's file, for the
    message."""
    for side, camera in (("left", rig.left), ("right", rig.right)):
        if not camera.is_pinhole:
            told = f"has values other than 0, largest {np.abs(camera.distortion).max():g}; dots are matched along rows"
            remedy = "rectify the images, then set it to zeros, or calibrate the rig with --rectified"
            raise ValueError(f"{source}: rig.{side}.distortion: {told}: {remedy}")
    turned = difference(np.eye(4), rig.left_to_right)[1]
    if turned > _MOST_TURNED_DEG:
        told = f"turns the right camera by {turned:.2f} degrees, at most {_MOST_TURNED_DEG:g} are taken"
        raise ValueError(f"{source}: rig.left_to_right: {told} for rectified images: rectify them")
    x, y, z = np.linalg.inv(rig.left_to_right)[:3, 3]
    if x <= 0:
        raise ValueError(f"{source}: rig.left_to_right: x is {-x:g}, expected below 0: left and right are swapped")
    if np.hypot(y, z) > _MOST_ASIDE * x:
        told = f"the right camera stands {1e3 * np.hypot(y, z):.2f} mm beside the left one's row, at most "
        told += f"{1e3 * _MOST_ASIDE * x:.2f} mm are taken for rectified images: rectify them"
        raise ValueError(f"{source}: rig.left_to_right: {told}")


def _wall_view(capture: Capture, name: str, frames: list[Frame], progress: Progress) -> WallView:
    if len(frames) < LEAST_REPEATS:
        told = f"{len(frames)} repeats, at least {LEAST_REPEATS} are needed: record more frames of the wall"
        raise ValueError(f"{name}: {told}")
    rig, spots, cut = capture.rig, {}, {}
    for place, side in enumerate(SIDES):
        counts = np.stack([read_gray(frame.path(side), key=f"frames[id={frame.id}].{side}") for frame in frames])
        check_still(Repeats(f"{name}, {side}", counts))
        saturated = float(np.mean((counts == rig.max_dn).any(axis=0)))
        if saturated > _LARGEST_SATURATED:
            told = f"{100 * saturated:.1f} % of the pixels reach {rig.max_dn} DN: the wall saturates"
            raise ValueError(f"{name}, {side}: {told}: shorten the exposure or lower the laser's power")
        part = part_of(progress, 0.5 * place, 0.5 * place + 0.5)
        found = find_spots(counts.mean(axis=0), _variance_of_mean(counts), part)
        is_whole = found.is_whole
        if side == "right":
            found = _align_right_spots(found, rig)
        spots[side], cut[side] = found.selected(is_whole), found.selected(~is_whole)
    wall = find_wall(spots["left"], spots["right"], rig.left.K, rig.right.K, rig.baseline_m, name)
    return WallView(name, spots, cut, wall, frames[0].exposure_gain)


def _align_right_spots(right: Spots, rig: CaptureRig) -> Spots:
    """Rotates the right camera's spots: returns their pixels in a camera with the same origin and K whose axes are
    parallel to the left one's. A measured rig's cameras are slightly rotated."""
    H = rig.right.K @ rig.left_to_right[:3, :3].T @ np.linalg.inv(rig.right.K)
    u, v, w = H @ np.stack([right.u, right.v, np.ones(len(right))])
    return replace(right, u=u / w, v=v / w)


def _variance_of_mean(counts: np.ndarray) -> np.ndarray:
    """Returns the variance of each pixel's mean over n frames. counts: [n, height, width]. It fits a straight line of
    variance over mean, which is less noisy than the pixels' own variances."""
    mean, variance = counts.mean(axis=0), counts.var(axis=0, ddof=1)
    slope, offset = np.polyfit(mean.ravel(), variance.ravel(), 1)
    return np.maximum(offset + slope * mean, ROUNDING_VARIANCE) / len(counts)


def _merged(views: tuple[WallView, ...], rig: CaptureRig) -> Pattern:
    """Merges the dots seen on walls at one or several distances into one pattern, and finds the projector's position.
    views: nearest wall first."""
    image = rig.projector.pattern()
    (height, width), rotation = image.shape, rig.projector.left_to_projector[:3, :3]
    right_m = np.asarray(-rig.left_to_right[:3, :3].T @ rig.left_to_right[:3, 3])
    eyes = {"left": (rig.left.K, np.zeros(3)), "right": (rig.right.K, right_m)}  # K, and the position in the left frame
    nominal_m = -rotation.T @ rig.projector.left_to_projector[:3, 3]
    projector = ProjectorView(nominal_m, rotation, rig.projector.K, (width, height))
    # 1. The projector's position, from the nearest and the farthest wall.
    near, far = views[0], views[-1]
    walls = [near, far] if far.wall.distance_m > _LEAST_DISTANCE_RATIO * near.wall.distance_m else [near]
    error, pairs, scales = None, np.empty((0, 2), dtype=int), [1.0]
    if len(walls) > 1:
        projector, error, pairs = _meeting_point(near.wall, far.wall, projector)
    # 2. The dots of both walls, then spots cut by borders where no dot is known.
    all_dots = []
    for view in walls:
        # The left camera's spots in their order, then the right camera's spots outside the left image.
        left, right = view.spots["left"], view.spots["right"]
        points = wall_points(view.wall.plane, rig.right.K, right_m, right.u, right.v)
        pixel = points[:, :2] / points[:, 2:] * np.diag(rig.left.K)[:2] + rig.left.K[:2, 2]
        end = np.array([rig.left.width, rig.left.height]) - 1 - left.border_px
        outside = ((pixel <= left.border_px) | (pixel >= end)).any(axis=1)
        parts = [(view.wall.points, np.zeros(3), left.flux), (points[outside], right_m, right.flux[outside])]
        all_dots.append(np.vstack([_project_dots(*part, view.wall, projector) for part in parts]))
    dots, *others = all_dots
    for other in others:
        scales.append(float(np.median(dots[pairs[:, 0], 2] / other[pairs[:, 1], 2])))
        other[:, 2] *= scales[-1]
        # Average dots that both walls show, and keep the others. If a dot's powers differ, the far wall's is merged
        # dots that were split wrongly, so the near wall's stays.
        one, two = dots[pairs[:, 0]], other[pairs[:, 1]]
        alike = np.abs(two[:, 2] - one[:, 2]) < _ALIKE_POWERS * one[:, 2]
        dots = dots.copy()
        dots[pairs[alike, 0]] = 0.5 * (one + two)[alike]
        alone = np.setdiff1d(np.arange(len(other)), pairs[:, 1])
        if len(alone):  # a close pair may be one dot on one wall and two merged ones on the other: leave it out
            alone = alone[cKDTree(dots[:, :2]).query(other[alone, :2])[0] > _SAME_DOT_PX[0]]
        dots = np.vstack([dots, other[alone]])
    for view, scale in zip(walls, scales, strict=True):
        for side, spots in view.cut.items():
            points = wall_points(view.wall.plane, *eyes[side], spots.u, spots.v)
            for dot in _project_dots(points, eyes[side][1], spots.flux, view.wall, projector) * [1.0, 1.0, scale]:
                if np.hypot(*(dots[:, :2] - dot[:2]).T).min() > _OTHER_DOT_PX:
                    dots = np.vstack([dots, dot])
    dots = dots[((dots[:, :2] > -0.5) & (dots[:, :2] < [width - 0.5, height - 0.5])).all(axis=1)]
    # 3. The light between them.
    background = None
    if len(walls) > 1 and 1.0 / SAME_EXPOSURE < far.exposure_gain / near.exposure_gain < SAME_EXPOSURE:
        lights = []
        for side in SIDES:
            lit = [(view.spots[side].background, view.wall.plane) for view in walls]
            samples = [
                walls_light.background_samples(*own, *eyes[side], scale, projector)
                for own, scale in zip(lit, scales, strict=True)
            ]
            counts, shares = (np.concatenate(part) for part in zip(*samples, strict=True))
            lights.append(walls_light.light_between_dots(counts, shares))
        background = max(float(np.mean(lights)), 0.0), float(0.5 * np.ptp(lights))
    # 4. Scale dots and background to the nominal pattern's light in the region with dots. Without a nominal pattern the
    # light is scaled to 1 a dot.
    first, top = np.rint(dots[:, :2].min(axis=0)).astype(int)
    last, bottom = np.rint(dots[:, :2].max(axis=0)).astype(int) + 1
    light = dots[:, 2].sum() + (0.0 if background is None else background[0] * (last - first) * (bottom - top))
    unit = (float(image[top:bottom, first:last].sum()) if image.any() else float(len(dots))) / light
    dots[:, 2] *= unit
    if background is not None:
        background = (unit * background[0], unit * background[1])
    # 5. A dot's width: the spot's less the pixel's width, seen from the projector at the wall's middle. Interpolation
    # between the pattern's pixels will widen it when it is projected, so that part is subtracted, too.
    middle = near.wall.points[:, 2].mean()
    to_pattern = projector.K[0, 0] / rig.left.K[0, 0] * middle / (middle - projector.position_m[2])
    variance = np.maximum(near.spots["left"].sigma_px ** 2 - ROUNDING_VARIANCE, 0.05) * to_pattern**2
    sigma = float(np.sqrt(max(variance - _INTERPOLATED_PX2, 0.25 * variance)))
    left_to_projector = rigid_motion(-rotation @ projector.position_m, rotation)
    return Pattern(
        dots, (width, height), projector.K, projector.position_m, error, left_to_projector, sigma, background, views,
        len(pairs), rig,
    )  # fmt: skip


def _project_dots(
    points: np.ndarray, camera_m: np.ndarray, flux: np.ndarray, wall: Wall, projector: ProjectorView
) -> np.ndarray:
    """Converts spots on the wall to dots of the pattern [n, 3]: u, v in pattern pixels, and power. points: [n, 3] in
    the left camera's frame. camera_m: position of the camera that sees them. flux: DN px^2."""
    uv, beam = projector.pixels(points)
    return np.column_stack([uv, flux * power_factor(points - camera_m, wall.plane[:3], beam)])


def _meeting_point(near: Wall, far: Wall, projector: ProjectorView) -> tuple[ProjectorView, np.ndarray, np.ndarray]:
    """Finds the projector's position from dots that both walls show: each dot's two points give a line, and the lines
    meet there. Returns (the projector at that position, its standard deviations, pairs [n, 2] of spot indices)."""
    pairs = np.empty((0, 2), dtype=int)
    for reach in _SAME_DOT_PX:
        first, second = (projector.pixels(wall.points)[0] for wall in (near, far))
        distance, other = cKDTree(second).query(first)
        back = cKDTree(first).query(second)[1]
        chosen = np.flatnonzero((distance < reach) & (back[other] == np.arange(len(first))))
        pairs = np.column_stack([chosen, other[chosen]])
        if len(pairs) < _LEAST_LINES:
            told = f"walls at {near.distance_m:.2f} and {far.distance_m:.2f} m share only {len(pairs)} dots"
            raise ValueError(f"{told}, at least {_LEAST_LINES} are needed: check the projector's nominal place and K")
        a, b = near.points[pairs[:, 0]], far.points[pairs[:, 1]]
        place, error = _nearest_to_lines(a, b)
        projector = replace(projector, position_m=place)
    # An error of a wall's plane moves all of its dots at once, which the lines' own scatter does not show.
    moved = [_nearest_to_lines(off[pairs[:, 0]], b)[0] for off in near.points_if_off]
    moved += [_nearest_to_lines(a, off[pairs[:, 1]])[0] for off in far.points_if_off]
    return projector, np.sqrt(error**2 + np.sum((np.array(moved) - place) ** 2, axis=0)), pairs


def _nearest_to_lines(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (point [3] nearest to n lines by least squares, its standard deviations). a, b: [n, 3], two points of
    each line. Outliers are dropped twice."""
    along = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    use = np.ones(len(a), dtype=bool)
    for _ in range(3):
        gram = across[use].sum(axis=0)
        point = np.linalg.solve(gram, (across[use] @ a[use][:, :, None]).sum(axis=0)[:, 0])
        off = np.linalg.norm((across @ (a - point)[:, :, None])[:, :, 0], axis=1)
        use = off < 4.0 * np.median(off)
    variance = float(np.sum(off[use] ** 2)) / max(2 * int(use.sum()) - 3, 1)
    return point, np.sqrt(variance * np.diag(np.linalg.inv(gram)))
