# SPDX-License-Identifier: Apache-2.0
"""SensorEngine simulates depth sensors of one configuration on one device, S in each of E environments. All share one
render and one match. StereoDepthSensor and StereoDepthSensorBatch are its public interfaces."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import Setting
from activestereo.camera.plan import SensorPlan
from activestereo.common.progress_bar import Progress, part_of
from activestereo.model import SensorModel
from activestereo.sensor.foreign_matcher import MatcherLike, as_matcher, foreign_maps
from activestereo.sensor.image_effects import ImageEffects
from activestereo.sensor.maps import Maps
from activestereo.sensor.pictures import RGB_OUTPUTS, IrLink, Picture, PictureMemory, Taken, expose_each
from activestereo.sensor.rig import RigInputs


class SensorEngine:
    """Renders the pictures of identical depth sensors in one scene, and computes their depth.

    environments: number of the environment of each sensor. [None]: one sensor in a scene without environments; only
    such a sensor supports velocity, conditions, 'converging' exposure and effects that change images. shape: leading
    axes of results: () for one sensor, (E,) or (E, S). source: the scene file's path, by which a model can tell objects
    of one material apart; any other object is ignored. matcher: computes disparities, see foreign_matcher.py.

    Raises ValueError for a model or an exposure mode that does not fit the scene or the sensors. Nothing has changed
    then."""

    def __init__(
        self, plan: SensorPlan, scene: kuafu.Scene, environments: Sequence[int | None] = (None,),
        shape: tuple[int, ...] = (), *, model: SensorModel | str | PathLike[str] | None = None, source: object = None,
        on_cuda: bool = False, matcher: MatcherLike = "simsense",
    ) -> None:  # fmt: skip
        self.scene, self.shape, self._count = scene, shape, len(environments)
        if on_cuda and matcher != "simsense":
            raise ValueError("results in CUDA's memory are simsense's own matcher's: leave out on_cuda or matcher")
        takes_image_effects = not on_cuda and matcher == "simsense" and list(environments) == [None]
        self.rig = RigInputs(plan, scene, environments, model, source, takes_image_effects)
        self._next_setting: Setting | None = None
        if plan.exposure.mode == "converging" and not self.rig.is_one:
            raise ValueError("ir_exposure_mode of a batch is 'fixed' or 'settled', not 'converging'")
        self._renderer = kuafu.Renderer(scene.device, **plan.renderer)
        self.matcher = self.rig.make_matcher(self._count)
        self._foreign = as_matcher(matcher, self.matcher)
        (width, height), (rgb_width, rgb_height) = ((c["width"], c["height"]) for c in (plan.left, plan.rgb))
        self._picture = Picture(
            IrLink(scene.device, self.matcher.device, width, height, count=self._count),
            PictureMemory(scene.device, (self._count, rgb_height, rgb_width), RGB_OUTPUTS, on_cuda=on_cuda),
        )
        self.ir_memory = self._picture.link.memory  # how the depth engine gets the pairs: 'opaque_fd' or 'host'
        # State of the current pictures.
        self.maps = Maps(weakref.proxy(self), on_cuda)
        self.light_share = np.ones(self._count)  # factors on each sensor's own exposure
        self._told_signals: list[dict[str, float]] = []
        self._noise_seeds: list[int] | None = None
        self._place: NDArray[np.float64] | None = None
        self._speckle_draw = -1
        self.frame = -1
        self.stage_times: dict[str, float] = {}
        self.image_effects: ImageEffects | None = None
        weakref.finalize(self, self.rig.in_scene.leave).atexit = False
        self.rig.enter()

    @property
    def plan(self) -> SensorPlan:
        return self.rig.plan

    # ---- pictures ----

    def drop_pictures(self) -> None:
        """Forgets the last pictures and their maps; call it before take_pictures(). Raises RuntimeError after close."""
        self.rig.require_open()
        self.maps.clear()
        self._picture.taken = None

    def take_pictures(self, rigs: NDArray[np.float64], infrared_only: bool, progress: Progress | None = None) -> None:
        """Renders the infrared pairs, and before them the RGB pictures unless infrared_only. Then it applies effects on
        light, scales each infrared pair to its exposure and hands the pairs to the depth engine.

        rigs: poses of the RGB cameras, [sensors, 4, 4], body axes; if they differ from the last call's, new static
        laser speckle is drawn. A failed picture leaves no result."""
        picture = self._picture
        # 1. Exposure, emitter, and static speckle if a sensor has moved.
        if self._next_setting is not None:
            self.rig.set_exposure(self._next_setting)
            self._next_setting = None
        if self._place is None or not np.array_equal(rigs, self._place):
            self._place, self._speckle_draw = rigs.copy(), self._speckle_draw + 1
        frame = self.frame + 1
        taken = Taken(frame, self._speckle_draw, self.rig.begin(frame).speckle_of_laser)
        # 2. The renders.
        share = 0.0 if infrared_only else 0.5
        try:
            self.rig.shine(rigs)
            picture.has_rgb = False
            if not infrared_only:
                picture.rgb.forget()
                cameras, seen = self.rig.rgb_cameras(rigs), self.rig.visible()
                self._render("rgb", cameras, picture.rgb.targets, taken, part_of(progress, 0.0, share), seen)
                picture.has_rgb = True
            cameras, seen = self.rig.ir_cameras(rigs), self.rig.infrared()
            targets = {"radiance": picture.link.target}
            if taken.is_laser_apart:
                targets["projector"] = picture.link.laser().target
            if self.image_effects is None or not self.image_effects.make_light:
                self._render("ir", cameras, targets, taken, part_of(progress, share, 1.0), seen)
        finally:
            self.rig.darken()
        # 3. Effects on light, and exposure.
        if self.image_effects is not None:
            self.image_effects.on_light(picture.link, taken.is_laser_apart)
        auto, inputs = self.plan.exposure, self.rig.inputs()
        if not self.rig.is_one:
            expose_each(picture.link, self.light_share, taken.is_laser_apart, auto, inputs)
        elif auto.mode != "fixed":  # 'settled': for this picture; 'converging': the next
            after = auto.after(self.rig.setting, inputs.left.signal, picture.link.images(1)[0], inputs.max_dn)
            if auto.mode == "settled":
                self.rig.set_exposure(after)
            else:
                self._next_setting = after
        picture.setting, picture.signals = self.rig.setting, self.rig.signals()
        self._set_signals(picture.signals)
        picture.taken, self.frame = taken, frame

    def picture(self) -> Picture:
        """Returns the current picture. Raises RuntimeError if there is none."""
        if self._picture.taken is None:
            raise RuntimeError("no picture yet: call take_picture() first")
        return self._picture

    def rgb_picture(self) -> PictureMemory:
        """Returns the memory of the current picture's RGB images. Raises RuntimeError if there are none."""
        if not self.picture().has_rgb:
            raise RuntimeError("the last picture has no RGB: call take_picture() without infrared_only")
        return self._picture.rgb

    def rgb_output(self, name: str) -> NDArray[Any]:
        """Returns one of kuafu's outputs of the RGB pictures, [*shape, height, width, channels]."""
        image = self.rgb_picture().read(name)
        return image.reshape(*self.shape, *image.shape[1:])

    def light(self) -> NDArray[np.float32]:
        """Returns the current pictures' radiance at the imagers, left then right, float32 [2, *shape, height, width]
        W/(sr m^2)."""
        images = self.picture().link.images()
        return images.reshape(2, *self.shape, *images.shape[1:])

    def render_true_depth(self, rigs: NDArray[np.float64]) -> NDArray[np.float32]:
        """Renders depth float32 [*shape, height, width], metres in the RGB cameras, of the scene as it is now. Takes no
        picture."""
        self.rig.require_open()
        seen: dict[str, Any] = self.rig.visible() | {"optics": None, "spp": 1}
        depth = self._renderer.render(self.scene, self.rig.rgb_cameras(rigs), ["depth"], **seen)["depth"]
        return depth.reshape(*self.shape, *depth.shape[1:3])

    def render_now(
        self, rigs: NDArray[np.float64], names: Sequence[str], side: int | None, **options: Any
    ) -> dict[str, NDArray[Any]]:
        """Renders {output name: [height, width, channels]} now, with the projectors on, by one sensor's camera. side: 0
        left, 1 right, None RGB. options: arguments of kuafu.Renderer.render that override the sensor's own."""
        self.rig.require_open()
        self.rig.shine(rigs)
        try:
            cameras = self.rig.rgb_cameras(rigs) if side is None else [self.rig.ir_cameras(rigs)[side]]
            seen = self.rig.visible() if side is None else self.rig.infrared(side)
            seen |= self._settings(names, max(self.frame, 0)) | {"projector": self.rig.in_scene.projector} | options
            images = self._renderer.render(self.scene, cameras, list(names), **seen)
            return {name: image[0] for name, image in images.items()}
        finally:
            self.rig.darken()

    # ---- maps ----

    def match(self, maps: Sequence[str] = ()) -> None:
        """Applies noise to the current pictures, matches them and registers the depth to the RGB cameras. Computes the
        named maps and those that were read earlier; any other map is computed when first read."""
        self.rig.require_open()
        self.picture()
        self.maps.begin(maps)
        self._keep_times("depth", self.matcher)

    def compute(self, outputs: Any) -> dict[str, NDArray[Any]]:
        """Computes {name: map} of the current pictures by the depth engine. outputs: names such as 'disparity', or
        {name: array to write into}."""
        picture = self._picture
        taken = picture.taken or Taken()
        self._set_signals(picture.signals)  # those of the picture, not of a setting for the next
        self.matcher.set_parameters(frame_index=taken.frame, scene_index=taken.speckle_draw)
        own: dict[str, Any] = dict(picture.link.lasers(taken.is_laser_apart))
        if self._noise_seeds is not None:
            own["noise_seeds"] = self._noise_seeds
        return self._computed((picture.link.left, picture.link.right), outputs, own)

    def compute_from(
        self, pair: tuple[Any, Any], outputs: tuple[str, ...], lasers: dict[str, Any], frame_index: int
    ) -> dict[str, NDArray[Any]]:
        """Computes {name: map} by the depth engine from given radiance images (left, right) instead of rendered ones.
        frame_index: number of the picture whose noise is used. lasers: simsense.Engine.compute()'s arguments for the
        projector's part of the light."""
        self.rig.require_open()
        self.maps.complete()
        self._set_signals(self.rig.signals())
        self.matcher.set_parameters(frame_index=frame_index, scene_index=0)
        return self._computed(pair, outputs, lasers)

    # ---- settings between pictures ----

    def set(self, matcher: Mapping[str, Any], signal: dict[str, float]) -> None:
        """Changes parameters of the matcher and of the imagers (signal), by simsense's names. They hold for the current
        pictures and for later ones; exposure and gain stay as they are. Maps of matched pictures keep their values.
        Raises simsense.ArgumentError for an invalid value; nothing has changed then."""
        self.rig.require_open()
        self.maps.complete()
        now = self.rig.setting
        told: dict[str, Any] = {**matcher, **now.applied_to(signal)}
        self.matcher.set_parameters(**told)
        exposure = replace(self.plan.exposure, start=now)
        self._told_signals = []
        self.rig.set_plan(replace(self.plan, engine=self.plan.engine | matcher, signal=signal, exposure=exposure))
        if self._picture.setting is not None:
            self.rig.set_exposure(self._picture.setting)
            self._picture.signals = self.rig.signals()
        self.rig.set_exposure(now)
        self._set_signals(self.rig.signals())

    def set_conditions(self, temperature_c: float | None, time_s: float) -> None:
        """Sets the sensor's temperature and the seconds since it was switched on, on which effects may depend. Maps of
        matched pictures keep their values."""
        self.rig.require_open()
        self.maps.complete()
        self.rig.set_conditions(temperature_c, time_s)

    def restart(self, seed: int, noise_seeds: list[int] | None = None) -> None:
        """Drops the current pictures, numbers the next ones 0, and seeds render and noise. noise_seeds: a noise seed
        for each sensor; None: all use `seed`."""
        self.rig.require_open()
        self._noise_seeds = noise_seeds
        self.rig.set_seed(seed)
        self.matcher.set_parameters(noise_seed=seed)
        self.frame, self._place, self._speckle_draw = -1, None, -1
        self._picture.taken, self._picture.has_rgb = None, False
        self.maps.clear()

    # ---- inside ----

    def _computed(self, pair: tuple[Any, Any], outputs: Any, lasers: dict[str, Any]) -> dict[str, NDArray[Any]]:
        if self._foreign is not None:
            return foreign_maps(self._foreign, self.matcher, self.plan, pair, outputs, lasers)
        if self.image_effects is None:
            return self.matcher.compute(*pair, outputs, **lasers)
        return self.image_effects.depth(self.matcher, pair, outputs, **lasers)

    def _settings(self, outputs: Any, frame: int) -> dict[str, Any]:
        """Returns the arguments of kuafu.Renderer.render that RGB and infrared cameras share. outputs: names of the
        images to render; frame: the picture's number, which seeds the render."""
        scales = {"srgb": self.plan.config.rgb_exposure or 0.0} if "srgb" in outputs else {}
        return self.plan.render | {"seed": (self.plan.render_seed << 32) + frame, "scales": scales}

    def _render(
        self, group: str, cameras: list[kuafu.Camera], targets: Any, taken: Taken, progress: Any, seen: dict[str, Any]
    ) -> None:
        """Renders the cameras into targets, {output: image}. group: 'rgb' or 'ir'. seen: render()'s arguments for these
        cameras alone."""
        options = self._settings(targets, taken.frame) | seen
        self._renderer.render(self.scene, cameras, targets, progress=progress, **options)
        self._keep_times(group, self._renderer)

    def _set_signals(self, signals: list[dict[str, float]]) -> None:
        if signals != self._told_signals:
            self.matcher.set_signal(*signals)
            self._told_signals = signals

    def _keep_times(self, group: str, worker: kuafu.Renderer | simsense.Engine) -> None:
        kept = {name: t for name, t in self.stage_times.items() if not name.startswith(f"{group}: ")}
        self.stage_times = kept | {f"{group}: {name}": t for name, t in worker.stage_times.items()}
