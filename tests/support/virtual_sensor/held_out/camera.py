# SPDX-License-Identifier: Apache-2.0
"""Computes rays of a camera's subpixel grid, with hidden effects of its place, lens geometry and timing."""

import numpy as np

from virtual_sensor.held_out.rig import HEIGHT, WIDTH, moved


def rays(rig, frame, side, hidden, sub, dt_s=0.0, offset=(0.0, 0.0)):
    """Returns (origins [n][3], directions [n][3], index of each ray's grid row [n], left camera's pose at each row's
    time [rows][4][4]). The grid has sub x sub rays per pixel, row by row. offset: shift of the grid within its
    cells."""
    columns = (np.arange(WIDTH * sub) + 0.5 + offset[0]) / sub - 0.5
    rows = (np.arange(HEIGHT * sub) + 0.5 + offset[1]) / sub - 0.5
    u, v = np.meshgrid(columns, rows)
    local = _turned(_directions(rig, frame, side, hidden, u, v), side, hidden)
    poses = _poses_by_row(frame, side, hidden, dt_s, sub)
    centre = np.array([_camera_x(rig, side, hidden), 0.0, 0.0])
    directions = np.einsum("rij,rcj->rci", poses[:, :3, :3], local).reshape(-1, 3)
    origins = np.repeat(poses[:, :3, :3] @ centre + poses[:, :3, 3], WIDTH * sub, axis=0)
    return origins, directions, np.repeat(np.arange(len(poses)), WIDTH * sub), poses


def axis_cosine(directions, poses, row):
    """Returns each ray's cosine to the optical axis: depth per distance. poses[row]: each ray's pose."""
    return np.einsum("ni,ni->n", directions, poses[row, :3, 2])


def _directions(rig, frame, side, hidden, u, v):
    K = rig.camera_K()
    fx = fy = K[0, 0]
    cx, cy = K[0, 2], K[1, 2]
    if "thermal_drift" in hidden:
        growth = 1.0 + hidden["thermal_drift"]["focal_per_k"] * frame.warming_k
        fx, fy = fx * growth, fy * growth
        cx += hidden["thermal_drift"]["cx_px_per_k"] * frame.warming_k * (side == "right")
    if "thermal_lens" in hidden:  # Grows with time since power-on, independent of the stated temperature.
        p = hidden["thermal_lens"]
        growth = 1.0 + p["growth"] * (1.0 - np.exp(-frame.timestamp_s / p["time_constant_s"]))
        fx, fy = fx * growth, fy * growth
    if "principal_point_offset" in hidden and side == "right":
        cx, cy = cx + hidden["principal_point_offset"]["cx_px"], cy + hidden["principal_point_offset"]["cy_px"]
    if "rectification_resampling" in hidden:  # The raw pixel grid is offset from the rectified one.
        u, v = (
            u + hidden["rectification_resampling"]["phase_u_px"],
            v + hidden["rectification_resampling"]["phase_v_px"],
        )
    x, y = (u - cx) / fx, (v - cy) / fy
    if "radial_distortion" in hidden:  # Division model (Fitzgibbon 2001); k1 to first order.
        ratio = 1.0 / (1.0 + hidden["radial_distortion"]["k1"] * (x * x + y * y))
        x, y = x * ratio, y * ratio
    if "tangential_distortion" in hidden:
        p, r2 = hidden["tangential_distortion"], x * x + y * y
        x, y = (
            x - 2 * p["p1"] * x * y - p["p2"] * (r2 + 2 * x * x),
            y - p["p1"] * (r2 + 2 * y * y) - 2 * p["p2"] * x * y,
        )
    if "thin_prism" in hidden:  # A wedge deflects the ray itself.
        p, r2 = hidden["thin_prism"], x * x + y * y
        x, y = x - p["s1"] * r2, y - p["s3"] * r2
    if "imager_tilt" in hidden:  # A tilt moves each point of the imager towards the lens or away from it.
        p = hidden["imager_tilt"]
        depth = 1.0 - x * np.sin(p["tau_y_rad"]) + y * np.sin(p["tau_x_rad"])
        x, y = x * np.cos(p["tau_y_rad"]) / depth, y * np.cos(p["tau_x_rad"]) / depth
    directions = np.stack([x, y, np.ones_like(x)], axis=-1)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def _turned(directions, side, hidden):
    """Applies the right camera's hidden rotation, roll then pitch, to ray directions."""
    if side == "left":
        return directions
    for name, (a, b) in (("stereo_roll", (0, 1)), ("stereo_pitch", (1, 2))):
        if name in hidden:
            angle = hidden[name]["angle_rad"]
            turned = directions.copy()
            turned[..., a] = np.cos(angle) * directions[..., a] - np.sin(angle) * directions[..., b]
            turned[..., b] = np.sin(angle) * directions[..., a] + np.cos(angle) * directions[..., b]
            directions = turned
    return directions


def _camera_x(rig, side, hidden):
    if side == "left":
        return 0.0
    return rig.baseline_m + hidden.get("baseline_drift", {}).get("offset_m", 0.0)


def _poses_by_row(frame, side, hidden, dt_s, sub):
    """Returns the left camera's pose [rows][4][4] at the time of each row. dt_s: time from mid-exposure."""
    row = np.repeat(np.arange(HEIGHT) - (HEIGHT - 1) / 2, sub)
    times = np.full(len(row), dt_s)
    if "rolling_shutter" in hidden:
        times += hidden["rolling_shutter"]["line_time_s"] * row
    if side == "right" and "exposure_desync" in hidden:
        times += hidden["exposure_desync"]["delay_s"]
    if side == "right" and "row_desync" in hidden:  # The delay grows from the middle row both ways, as no shutter does.
        times += hidden["row_desync"]["delay_s"] * (2 * row / HEIGHT) ** 2
    if not frame.is_moving or not times.any():
        return np.broadcast_to(frame.camera_to_world, (len(row), 4, 4))
    return moved(frame.camera_to_world, frame.twist, times)
