# SPDX-License-Identifier: Apache-2.0
"""Makes one test case: a capture folder for the tool under test, and the answer key that it must not see."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from virtual_sensor.held_out import camera, imager, oracle
from virtual_sensor.held_out.depth import MAX_DISPARITY, device_depth
from virtual_sensor.held_out.emitter import Emitter
from virtual_sensor.held_out.files import write_capture
from virtual_sensor.held_out.lightmap import Lightmap
from virtual_sensor.held_out.more import more_frames
from virtual_sensor.held_out.optics import on_pixels
from virtual_sensor.held_out.rig import HEIGHT, WIDTH, Rig, believed, draw_frames, draw_rig
from virtual_sensor.held_out.scene import draw_scene, measured_solids, texel_spacing
from virtual_sensor.held_out.surface import Layers, projector_irradiance, shade

SIDES = ("left", "right")
SUB = 4
_BLUR_INSTANTS, _BLUR_SUB = 8, 2
_FRAMES_BEFORE = 8
# Effects on rays and surfaces; all others act on images.
RAY_EFFECTS = frozenset(
    "projector_defocus pattern_scale_drift pattern_shear dot_gain_spread dot_astigmatism projector_vignetting "
    "laser_power_drift"
    " emitter_bands second_projector ambient_ir specular transmission subsurface interreflection haze radial_distortion"
    " tangential_distortion thin_prism imager_tilt dim_dots rectification_resampling"
    " thermal_drift thermal_lens principal_point_offset baseline_drift"
    " stereo_pitch stereo_roll rolling_shutter exposure_desync row_desync motion_blur".split()
)
_BY_FRAME = frozenset({"dim_dots", "pattern_scale_drift", "laser_power_drift", "thermal_drift", "thermal_lens"})


@dataclass(frozen=True)
class Hardware:
    """The physical world that rays meet: the scene, the rig and the hidden effects on them."""

    solids: tuple
    rig: Rig
    emitter: Emitter
    lightmap: Lightmap
    hidden: dict

    def is_glossy(self, solid):
        return self.hidden["specular"]["everywhere"] > 0 or solid.name in ("ball", "can", "box1")

    def is_wax(self, solid):
        return self.hidden["subsurface"]["everywhere"] > 0 or solid.name in ("ball", "box1", "pipe")

    def is_clear(self, solid):
        return solid.name in ("ball", "can", "box1", "box2")


class Case:
    """A test case, set by its seed, hidden effects {id: {parameter: value}} and scene errors. more: see more.py."""

    def __init__(self, seed, hidden, scene_errors=1.0, sub=SUB, moving_exposure=1 / 8, more=None):
        self.seed, self.hidden, self._scene_errors, self._sub = seed, hidden, scene_errors, sub
        draw = np.random.Generator(np.random.PCG64([seed, 0]))
        self.solids, self.rig = draw_scene(draw), draw_rig(draw)
        self.frames = draw_frames(draw, moving_exposure)
        if more is not None:
            self.frames = more_frames(self.frames, more)
        self._noise = draw.standard_normal(6)
        self._layers, self._ambient, self._hardwares = {}, {}, {}

    def in_scene(self, scene_seed):
        """Returns a case of the same sensor, with the same hidden effects, in front of another scene."""
        other = Case(self.seed, self.hidden, self._scene_errors, self._sub)
        other.solids = draw_scene(np.random.Generator(np.random.PCG64([scene_seed, 0])))
        other.frames = tuple(frame for frame in other.frames if frame.power > 0 and not frame.is_moving)
        other.__dict__.update(sensor=self.sensor)
        return other

    def hiding(self, hidden):
        """Returns the same world with other hidden effects; it shares what this case has computed already."""
        other = Case(self.seed, hidden, self._scene_errors, self._sub)
        other._layers, other._ambient, other._hardwares = self._layers, self._ambient, self._hardwares
        other.__dict__.update(lightmap=self.lightmap, sensor=self.sensor)
        return other

    @cached_property
    def lightmap(self):
        return Lightmap(self.solids, np.random.Generator(np.random.PCG64([self.seed, 1])), texel_spacing(self.solids))

    @cached_property
    def sensor(self):
        """The imager, exposed so that 0.1 % of the first frame's pixels exceed about half of the range."""
        lights = on_pixels(self.layers(self.frames[0], "left", {}), self.frames[0], "left", {}, self.rig)
        n, exposure = self._noise, self.frames[0].exposure_s
        target = 0.45 * imager.MAX_DN / np.quantile(lights[0], 0.999)
        return imager.Sensor(
            projector_scale=target * (1 + 0.05 * n[0]) / exposure,
            ambient_scale=7.0 / lights[1].mean() * (1 + 0.08 * n[1]) / exposure,
            black_dn=4.0 + 0.5 * n[2],
            read_dn=0.9 * (1 + 0.1 * n[3]),
            shot=0.012 * (1 + 0.13 * n[4]),
            speckle=0.12 * (1 + 0.1 * n[5]),
            seed=self.seed,
        )

    def hardware(self, hidden):
        return self._hardware(
            tuple(sorted((k, tuple(sorted(v.items()))) for k, v in hidden.items() if k in RAY_EFFECTS))
        )

    def _hardware(self, key):
        if key not in self._hardwares:
            hidden = {name: dict(values) for name, values in key}
            self._hardwares[key] = Hardware(
                self.solids, self.rig, Emitter(self.rig, hidden, self.seed), self.lightmap, hidden
            )
        return self._hardwares[key]

    def layers(self, frame, side, hidden):
        """Returns a frame's radiance Layers on the subpixel grid; frames with equal poses and timing share them."""
        hardware = self.hardware(hidden)
        timing = (frame.warming_k, frame.timestamp_s) if _BY_FRAME & set(hardware.hidden) else ()
        key = (id(hardware), side, frame.camera_to_world.tobytes(), timing)
        if key not in self._layers:
            self._layers[key] = self._render(hardware, frame, side)
        return self._layers[key]

    def _render(self, hardware, frame, side):
        bounced, ambient = self._indirect(hardware, frame)
        if "motion_blur" not in hardware.hidden or not frame.is_moving:
            return self._cast(hardware, frame, side, self._sub, 0.0, (0.0, 0.0), bounced, ambient)
        span = hardware.hidden["motion_blur"]["exposure_fraction"] * frame.exposure_s
        sums = None
        for i in range(_BLUR_INSTANTS):  # Each instant sees its own subpixel places.
            offset = ((i * 0.7549) % 1.0 - 0.5, (i * 0.5698) % 1.0 - 0.5)
            seen = self._cast(
                hardware, frame, side, _BLUR_SUB, ((i + 0.5) / _BLUR_INSTANTS - 0.5) * span, offset, bounced, ambient
            )
            lights = [seen.direct, seen.indirect, seen.sky, seen.other, seen.lamp]
            sums = lights if sums is None else [a + b for a, b in zip(sums, lights, strict=True)]
        return Layers(*(s / _BLUR_INSTANTS for s in sums), seen.depth)

    def _cast(self, hardware, frame, side, sub, dt_s, offset, bounced, ambient):
        bundle = camera.rays(self.rig, frame, side, hardware.hidden, sub, dt_s, offset)
        return shade(hardware, frame, bundle, (HEIGHT * sub, WIDTH * sub), bounced, ambient)

    def _indirect(self, hardware, frame):
        """Returns two sets of lightmap values: the projector's bounced light at the frame's pose, and ambient light."""
        gain = hardware.hidden.get("interreflection", {}).get("gain", 0.0)
        if id(hardware) not in self._ambient:
            self._ambient[id(hardware)] = self.lightmap.ambient(gain)
        texels = self.lightmap
        poses, row = frame.camera_to_world[None], np.zeros(len(texels.points), dtype=int)
        first = projector_irradiance(
            hardware, frame, texels.points + 1e-6 * texels.normals, texels.normals, poses, row, coarse=True
        )
        return (1.0 + gain) * texels.bounced(np.where(texels.exposed, first, 0.0)), self._ambient[id(hardware)]

    def lights(self, frame, side, hidden):
        return on_pixels(self.layers(frame, side, hidden), frame, side, hidden, self.rig)

    def _residue(self, frame, side, hidden):
        """Returns the charge in DN that the frame before leaves (image lag), or None."""
        if "image_lag" not in hidden or frame.id == 0:
            return None
        before = self.frames[frame.id - 1]
        left = imager.collected(self.sensor, self.lights(before, side, hidden), before, side, hidden)
        return hidden["image_lag"]["fraction"] * left

    def expected(self, frame, side, hidden):
        """Returns the noise-free image in DN under the given hidden effects, which may be fewer than the world's."""
        return imager.expected(
            self.sensor, self.lights(frame, side, hidden), frame, side, hidden, self._residue(frame, side, hidden)
        )

    def measured(self, frame, side, age=0):
        lights = self.lights(frame, side, self.hidden)
        residue = self._residue(frame, side, self.hidden)
        return imager.exposed(self.sensor, lights, frame, side, self.hidden, residue, age)

    def depth(self, frame, pair, rig):
        """Returns the device's depth of a pair in metres, [height][width]. rig: as the device believes."""
        ages = range(1, 1 + _FRAMES_BEFORE * ("temporal_filter" in self.hidden))
        earlier = [[self.measured(frame, side, age) for side in SIDES] for age in ages]
        return device_depth(*pair, rig.focal_px, rig.baseline_m, self.hidden, earlier)

    def capture(self, folder, name):
        """Writes the capture into `folder` and returns the oracle's bounds on it."""
        images = {(frame.id, side): self.measured(frame, side) for frame in self.frames for side in SIDES}
        errors = np.random.Generator(np.random.PCG64([self.seed, 2]))
        rig, solids = (
            believed(self.rig, errors, self._scene_errors),
            measured_solids(self.solids, errors, self._scene_errors),
        )
        # The second frame only repeats the first, and without dots there is nothing to match.
        depths = {
            frame.id: self.depth(frame, (images[frame.id, "left"], images[frame.id, "right"]), rig)
            for frame in self.frames
            if frame.power > 0 and frame.id != 1
        }
        write_capture(
            folder, name, rig, solids, self.frames, images, depths, MAX_DISPARITY, survey=self._scene_errors or 1.0
        )
        figures = oracle.errors(self, images)
        if len(self.hidden) > 1:
            figures["alone"] = {
                name: oracle.ratio_alone(self, name, figures["test"]["floor_dn"]) for name in self.hidden
            }
        return figures
