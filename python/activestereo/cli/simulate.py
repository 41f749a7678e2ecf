# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo simulate`: simulates one frame of a depth sensor in a scene file. Reports its depth, its
infrared light, and the bodies that the sensor cannot measure."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import kuafu
from activestereo.camera.plan import remove_noise
from activestereo.camera.presets import OF_THE_CAMERA, SAPIEN_DEFAULTS, StereoDepthSensorConfig
from activestereo.capture.capture import Frame, read_capture
from activestereo.cli import arguments as cli
from activestereo.cli import sensor_options as options
from activestereo.common.accuracy import INVENTED, NOTHING, Accuracy, accuracy_by_material, accuracy_table
from activestereo.common.output_files import write_depth_png, write_json, write_ply, write_png, written_together
from activestereo.common.parameter import MATCHER, RENDER, RENDERER, RIG
from activestereo.common.pose import Pose, body_pose, camera_to_camera, camera_to_world
from activestereo.common.progress_bar import ProgressBar
from activestereo.common.shown import counted, listed
from activestereo.report.lettering import write_figure
from activestereo.report.screen import Figure, command, screen
from activestereo.scene_io import OWN_ENDINGS, USD_ENDINGS
from activestereo.scene_io.staging import (
    ALL_SIDES,
    INFRARED_SHARES,
    ROOM_LUX,
    has_lamps,
    infrared_share,
    part_light,
    room_radiance,
    set_infrared_share,
)

if TYPE_CHECKING:
    from activestereo.effects.core.descriptor import Effect
    from activestereo.model import SensorModel
    from activestereo.sensor.explain import LightShare
    from activestereo.sensor.sensor import StereoDepthSensor

_TEXT = f"""\
Puts a depth sensor into a scene and takes one frame: path-traced RGB picture and
infrared pair with projected dots, imager noise, stereo matching, registration to
the RGB camera.

SCENE is a file in metres ({" ".join(OWN_ENDINGS)}), one of
USD ({" ".join(USD_ENDINGS)}; needs: pip install usd-core), or a capture's folder. The sensor stands at the file's
first camera, at a capture's first view, at --camera-to-world, or before the scene, in a
closed room inside. Lamps have the units of the file's format. A scene without lights is a room of 400 lux (--ambient).

Writes into DIR:
  rgb.png                   RGB picture
  ir_left.png ir_right.png  infrared pair, as the sensor gives it
  depth.png                 measured depth, uint16 millimetres in the RGB camera, 0 = no measurement
  depth_true.png            true depth, likewise
  camera.json               K, lenses, baseline and poses of the cameras, frames, units
  cloud.ply                 coloured points, metres (x right, y down, z forward)
  overview.png              all on one page, with the error of each material

examples:
  activestereo simulate table_top.gltf --sensor d435 --out out/table_top
  activestereo simulate captures/table --model out/diagnosis/model.json --out out/as_measured
  activestereo simulate table_top.gltf --velocity 0.5,0,0 --ir-distortion -0.06,0.01,0,0 --out out/moving
"""

_USUAL = [p for p in RENDER if p.name in ("samples_per_pixel", "max_bounces")]
_OF_THE_CAMERA = dict.fromkeys(OF_THE_CAMERA, "the camera's")
# Below this share of the projector in the infrared light at the dots, depth is coarser. (In the example scene of
# 300 lux it is a sixth; the projector's share of all pixels' light is a twenty-fifth.)
LEAST_SHARE = 0.05
# Above this share of pixels at full scale an image is overexposed. (A real D435's has 4.8 %: examples/real_pair.)
MOST_FULL = 0.1
_MOST_NAMED = 3
_MOST_MATERIALS = 3


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "simulate", "what a depth sensor gives in a scene", _TEXT, run)
    parser.add_argument("scene", type=Path, metavar="SCENE", help="scene file, or a capture for its scene")
    text = "the scene as its animations pose it then (default: without animation)"
    parser.add_argument("--time", type=cli.positive, metavar="SECONDS", help=text)
    cli.add_shared(parser, unit="SCENE", keep_transparent=True)
    cli.add_shared(parser, sensor="a camera of 'activestereo presets', or the path of a .toml file")
    text = "a sensor model of 'activestereo diagnose': its rig, pattern, imager and effects; --sensor has what it does "
    cli.add_shared(parser, model=f"{text}not say")
    cli.add_shared(parser, effects=", where the model has some", out=True, json=True, device=True)
    cli.add_shared(parser, verbose="times of the stages, matching, and the error of each material")
    view = parser.add_argument_group("view")
    view.add_argument(
        "--camera", type=cli.integer_from(0), metavar="N", help="which of the scene's cameras (default: 0)"
    )
    text = "the RGB camera's pose instead: 16 numbers, row-major 4x4; camera axes x right, y down, z forward; "
    text += "world axes those of the file"
    view.add_argument("--camera-to-world", type=cli.transform, metavar="M00,...,M33", help=text)
    text = "size of the infrared images; the RGB picture and the disparity range scale along"
    view.add_argument("--resolution", type=cli.size, metavar="WxH", help=text)
    _add_light(parser.add_argument_group("light and noise"))
    options.add_camera_options(parser.rare_group("lenses, shutters and motion"))
    rendering = parser.rare_group("rendering and records")
    options.add_options(rendering, RENDERER, _OF_THE_CAMERA)
    options.add_options(rendering, [p for p in RENDER if p not in _USUAL], _OF_THE_CAMERA)
    options.add_records(rendering)
    options.add_matching(parser, SAPIEN_DEFAULTS | _OF_THE_CAMERA)


def _add_light(group: argparse._ArgumentGroup) -> None:
    options.add_options(group, _USUAL, _OF_THE_CAMERA)
    cli.add_shared(group, seed="of rendering and noise; same seed, same files")
    text = "uniform visible radiance from all sides, W/(sr m^2); 0 is dark in infrared, too (default: 0.1; 0.19, a "
    text += "room of 400 lux, where a scene has no light)"
    group.add_argument("--ambient", type=cli.positive, metavar="R", help=text)
    text = f"kind of the lamps that do not state one: {', '.join(INFRARED_SHARES)}, or how much more infrared than a "
    group.add_argument("--lamp", type=_lamp, metavar="KIND", help=f"{text}led (default: led)")
    text = "equirectangular map of the light from all sides (.hdr, .exr, .png, .jpg); --ambient multiplies it"
    group.add_argument("--environment", type=Path, metavar="FILE", help=text)
    text = "the laser's setting (default: the sensor's; 0 = off)"
    group.add_argument("--laser-power", type=cli.positive, metavar="MW", help=text)
    text = "exposure of the infrared cameras, seconds: fixed, at gain 1 (default: the sensor's own, often automatic)"
    group.add_argument("--ir-exposure", type=cli.exposure, metavar="S", help=text)
    group.add_argument("--no-noise", action="store_true", help="infrared images without imager noise")


def _lamp(text: str) -> float:
    try:
        return infrared_share(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def run(args: argparse.Namespace) -> None:
    if args.effects and args.model is None:
        raise cli.CommandError(f"--effects {args.effects[0]} defines effects that a model may have: give --model, too")
    if args.camera is not None and args.camera_to_world is not None:
        raise cli.CommandError("--camera and --camera-to-world both state the pose: give one of them")
    model = read_sensor_model(args)
    view = None
    if args.scene.is_dir() or args.scene.name == "capture.json":  # a capture: its scene, from its first frame's pose
        capture = read_capture(args.scene)
        args.scene, view = capture.scene_path, capture.frames[0]
    is_known = model is not None and {"projector_scale", "ambient_scale"} <= set(model.nuisances)
    # The light of the capture's frame, if the model knows it and no option states another.
    is_lit = view is not None and is_known and args.ambient is None and args.environment is None
    config = make_config(args, model, view if is_lit else None)
    if not args.scene.exists():
        raise cli.CommandError(f"{args.scene}: there is no such file")
    from activestereo.sensor.sensor import StereoDepthSensor

    scene, added = _load_scene(args, config, is_lit, set() if model is None else model.surfaces)
    if model is not None:
        warn_of_materials(model, scene)
    pose, chosen = _sensor_pose(args, scene, config, view)
    sensor = StereoDepthSensor(config, scene, pose=pose, model=model)
    if args.velocity is not None:
        sensor.set_velocity(args.velocity[:3], args.velocity[3:])
    cli.make_folder(args.out)
    with ProgressBar(f"rendering on {sensor.device.info.name}") as bar:
        sensor.take_picture(progress=bar)
    sensor.compute_depth()
    depth, truth, ids = sensor.get_depth(), sensor.get_true_depth(), sensor.get_material_ids()
    rows = accuracy_by_material(depth, truth, ids, sensor.scene.material_name, config.max_depth_m)
    _write(args, sensor, rows)
    _report(args, sensor, rows, added, chosen)


def read_sensor_model(args: argparse.Namespace, effects: dict[str, Effect] | None = None) -> SensorModel | None:
    """Reads the model file of --model, or returns None without that option. effects: {id: Effect} that the model may
    name; None: loads the built-in ones and those of --effects."""
    if args.model is None:
        return None
    from activestereo.model import read_model
    from activestereo.model.library import library

    model = read_model(args.model, effects or library(*args.effects))
    if args.resolution and (model.rig or model.pattern or model.effects):
        figures = "its rig, pattern or effects are in pixels of its own images"
        raise cli.CommandError(f"--resolution and --model {args.model} exclude one another: {figures}")
    return model


def sensor_config(
    args: argparse.Namespace, model: SensorModel | None, view: Frame | None = None
) -> StereoDepthSensorConfig:
    """Returns the model's configuration, completed by the --sensor preset; without a model the --sensor preset, scaled
    to --resolution if given. view: the capture's frame under whose light, as the model knows it, to simulate, or None.
    Raises CommandError if --resolution has another shape than the preset, or a side below 32."""
    config = StereoDepthSensorConfig(args.sensor)
    if model is not None:
        config = StereoDepthSensorConfig.from_model(model, args.sensor, view)
    if not args.resolution:
        return config
    width, height = config.ir_resolution
    scaled = config.scaled(args.resolution[0] / width)
    if scaled.ir_resolution != args.resolution:
        asked, fits = ("x".join(map(str, pixels)) for pixels in (args.resolution, scaled.ir_resolution))
        raise cli.CommandError(
            f"--resolution {asked} does not have the shape of the {config.model}'s {width}x{height}; {fits} does"
        )
    if min(args.resolution) < 32:
        raise cli.CommandError("--resolution must be at least 32 in both directions")
    return scaled


def make_config(
    args: argparse.Namespace, model: SensorModel | None = None, view: Frame | None = None
) -> StereoDepthSensorConfig:
    """Returns sensor_config() with the command's options applied and checked."""
    config = sensor_config(args, model, view)
    config.render_seed = config.noise_seed = args.seed
    options.set_cameras(config, args)
    if args.laser_power is not None:
        config.laser_power_mw = args.laser_power
    if args.ir_exposure is not None:
        config.ir_exposure_mode, config.ir_camera_gain = "fixed", 1.0
        config.ir_camera_exposure = args.ir_exposure
    for name, value in options.given_parameters(args, MATCHER, RIG, RENDERER, RENDER).items():
        setattr(config, name, value)
    options.set_records(config, args)
    config.depth_maps = options.wanted_maps(args)
    if args.no_noise:
        remove_noise(config)
    config.check()  # before any work
    return config


def _load_scene(
    args: argparse.Namespace, config: StereoDepthSensorConfig, is_lit: bool, surfaces: set[str]
) -> tuple[kuafu.Scene, float | None]:
    """Loads the scene file and lights it. is_lit: by the capture's light, which the configuration has. surfaces: names
    of those that the model's effects act on. Returns (scene, radiance): W/(sr m^2) of the uniform light that was added
    to a scene without light, None if none was added."""
    from activestereo.effects.core.surfaces import split_surfaces_named
    from activestereo.scene_io.scene_files import keep_transparent, load_scene_file
    from activestereo.scene_io.usd import is_usd

    scene = kuafu.Scene(kuafu.Device(args.device))
    if args.keep_transparent:
        keep_transparent()
    dome = load_scene_file(scene, args.scene, args.time, args.unit)  # the radiance of a USD stage's dome light, if any
    if args.time is not None and not scene.summary.animation_count and not is_usd(args.scene):
        raise cli.CommandError(f"--time {args.time:g}: {args.scene} has no animation")
    if not scene.summary.triangle_count:
        raise cli.CommandError(f"{args.scene}: there is nothing to see in it: no triangles")
    split_surfaces_named(scene, args.scene, surfaces)  # the sensor is given no path
    if args.lamp is not None:
        set_infrared_share(scene, args.lamp)
    if is_lit:
        part_light(scene)
        scene.set_environment((1.0, 1.0, 1.0), config.ir_ambient_radiance, light_group=ALL_SIDES)
        return scene, None
    return scene, _light_scene(scene, args, config, dome)


def _light_scene(
    scene: kuafu.Scene,
    args: argparse.Namespace,
    config: StereoDepthSensorConfig,
    dome: tuple[float, float, float] | None,
) -> float | None:
    """Sets the scene's uniform light or environment map. Returns the radiance in W/(sr m^2) that was added to a scene
    without light, else None. dome: radiance of a USD dome light, or None."""
    from activestereo.scene_io.defaults import light_closed_room
    from activestereo.scene_io.staging import set_environment_map

    part_light(scene)
    is_lit = has_lamps(scene) or dome is not None or args.ambient is not None
    if args.environment is not None:
        set_environment_map(scene, args.environment, 1.0 if args.ambient is None else args.ambient)
        return None
    ambient, infrared = args.ambient, None
    if not is_lit:
        light_closed_room(scene)
    if dome is not None and ambient is None:
        radiance = dome
        if args.lamp is not None:
            infrared = config.ir_ambient_scale * args.lamp * dome[0] + config.ir_ambient_radiance
    else:
        value = room_radiance(scene) if ambient is None else ambient
        radiance = (value, value, value)
        if ambient == 0.0 and args.ir_ambient_radiance is None:
            infrared = 0.0
    scene.set_environment(radiance, infrared, light_group=ALL_SIDES)
    return None if is_lit else radiance[0]


def _sensor_pose(
    args: argparse.Namespace, scene: kuafu.Scene, config: StereoDepthSensorConfig, view: Frame | None
) -> tuple[Pose, str]:
    """Returns (pose, ""), if options, capture or scene state the pose; else (a chosen pose, words on it)."""
    from activestereo.scene_io.defaults import overall_view

    if args.camera_to_world is not None:
        return body_pose(args.camera_to_world), ""
    if view is not None and args.camera is None:
        return body_pose(view.camera_to_world @ camera_to_camera(Pose(), config.trans_pose_l)), ""
    count = scene.summary.camera_count
    if args.camera is not None and args.camera >= count:
        raise cli.CommandError(f"--camera {args.camera}: {args.scene} has {counted(count, 'camera')}")
    if count:
        return body_pose(scene.camera(args.camera or 0).camera_to_world), ""
    place, chosen = overall_view(scene, config.min_depth_m)
    return body_pose(place), chosen


def _write(args: argparse.Namespace, sensor: StereoDepthSensor, rows: list[Accuracy]) -> None:
    from activestereo.report.pictures import simulation_figure

    rgb, ir, depth, true_depth = sensor.get_rgb(), sensor.get_ir_measured(), sensor.get_depth(), sensor.get_true_depth()
    with written_together(args.out) as out:
        write_png(out / "rgb.png", np.rint(255.0 * rgb).astype(np.uint8))
        write_png(out / "ir_left.png", ir[0])
        write_png(out / "ir_right.png", ir[1])
        write_depth_png(out / "depth.png", depth)
        write_depth_png(out / "depth_true.png", true_depth)
        cloud = sensor.get_pointcloud(with_rgb=True)
        write_ply(out / "cloud.ply", cloud[:, :3], cloud[:, 3:])
        write_json(out / "camera.json", _camera(sensor))
        options.write_maps(out, {name: sensor.get_depth_map(name) for name in options.wanted_maps(args)})
        title = f"{_sensor_name(args, sensor)} in {args.scene.name}"
        write_figure(out / "overview.png", simulation_figure(title, rgb, ir, depth, true_depth, rows))


def _sensor_name(args: argparse.Namespace, sensor: StereoDepthSensor) -> str:
    return sensor.get_config().model if args.model is None else f"the sensor of {args.model}"


def _camera(sensor: StereoDepthSensor) -> dict[str, Any]:
    from activestereo.sensor.results import cameras_json

    return cameras_json(sensor.get_config(), camera_to_world(sensor.get_pose()))


def _report(
    args: argparse.Namespace, sensor: StereoDepthSensor, rows: list[Accuracy], added: float | None, chosen: str
) -> None:
    from activestereo.scene_io.scene_files import likely_unit
    from activestereo.sensor.explain import light_share, unseen_bodies

    share, unseen = light_share(sensor), unseen_bodies(sensor)
    if sensor.get_config().light_pattern is not None and any(row.pixels for row in rows):
        warn_of_light(share)
    warn_of_full_pixels(sensor.get_ir_measured()[0], 2 ** int(sensor.plan.signal["bit_depth"]) - 1)
    summary = sensor.scene.summary
    size_m = float(np.max(np.subtract(summary.bounds_max_m, summary.bounds_min_m)))
    warn_of_unseen(unseen, summary.instance_count, size_m, args.unit)
    groups: dict[str, dict[str, float]] = {}
    for name, time in sensor.stage_times.items():
        group, stage = name.split(": ", 1)
        groups.setdefault(group, {})[stage] = time
    info = sensor.device.info
    if args.json:
        accuracy, matching = [asdict(row) for row in rows], options.matching_words(sensor.engine)
        light = None if share is None else asdict(share)
        seen = {"light": light, "added_radiance": added, "unseen": dict(unseen)}
        made = {"device": info.name, "camera": _camera(sensor), "matching": matching, "stages_ms": groups}
        cli.print_json(made | {"accuracy": accuracy} | seen)
        return
    device = f"device: {info.name} ({info.kind}, {info.driver}); infrared pair shared by {sensor.ir_memory}"
    details = "\n".join(
        [device, options.matching_line(sensor.engine), options.stage_table(groups), accuracy_table(rows)]
    )
    sentence = depth_sentence(f"{_sensor_name(args, sensor)} in {args.scene.name} ({size_m:.2g} m large)", rows)
    notes, page = light_lines(share, added, chosen), args.out / "overview.png"
    leads, unit = [command("view", args.out, *cli.carried(args, "device"))], likely_unit(size_m)
    if not rows[-1].pixels and unit != 1.0:
        leads = [command(*args.given, "--unit", f"{args.unit * unit:g}")]
    print(screen(sentence, failing(rows), notes, leads, page, details, args.verbose))


def depth_sentence(name: str, rows: Sequence[Accuracy]) -> str:
    """Returns a sentence with the share of pixels that have depth, their median error, and the share of invented depth.
    rows: accuracy for each material; the last one is for the whole picture."""
    whole = rows[-1]
    if not whole.pixels:
        return f"{name}: nothing is in the sensor's range."
    error = "" if not np.isfinite(whole.median_error_m) else f", median error {1e3 * whole.median_error_m:.1f} mm"
    return f"{name}: {_percent(whole.fill)} of the pixels have depth{error}; {_percent(whole.invented)} are {INVENTED}."


def failing(rows: Sequence[Accuracy]) -> list[Figure]:
    """Returns a bar for each of the materials with most wrong pixels, three at most. Its length is the share of the
    material's pixels that are empty or invented. rows: as in depth_sentence()."""
    known = [row for row in rows[:-1] if row.pixels and row.name != NOTHING]
    faults = sorted(((1.0 - row.fill + row.invented, row) for row in known), key=lambda own: -own[0] * own[1].pixels)
    found = []
    for fault, row in faults[:_MOST_MATERIALS]:
        error = f", {1e3 * row.median_error_m:.1f} mm" if np.isfinite(row.median_error_m) else ""
        text = f"{_percent(1.0 - row.fill)} empty, {_percent(row.invented)} invented{error}"
        found.append(Figure(row.name[:18], text, fault))
    return found


def light_lines(share: LightShare | None, added: float | None, chosen: str) -> list[str]:
    """Returns lines on the light and the view. share: of the infrared light, or None. added: radiance of light added to
    a dark scene, or None. chosen: words on a view that no scene or user stated, else ""."""
    view = [f"view: the scene has no camera: {chosen} (--camera-to-world)"] if chosen else []
    room = [f"light added: a room of {ROOM_LUX:g} lux, for the scene has no light (--ambient)"] if added else []
    if share is None:
        return [*view, *room, "light: no infrared light comes from the picture's middle"]
    other = f", {share.brightest} {_percent(share.brightest_share)}" if share.brightest else ""
    dots = f"infrared at the dots ({share.distance_m:.2f} m): projector {_percent(share.projector)}"
    return [f"{dots}{other}", *view, *room]


def warn_of_light(share: LightShare | None) -> None:
    """Warns on stderr if the projector's dots hardly stand out, and names the brightest other light."""
    if share is None or share.projector >= LEAST_SHARE or share.brightest is None:
        return
    light = f"{share.brightest} gives {_percent(share.brightest_share)} of their light"
    cli.say(f"the dots hardly stand out: {light}, the projector {_percent(share.projector)}")


def warn_of_full_pixels(counts: np.ndarray, full_dn: int) -> None:
    """Warns on stderr if much of the infrared image `counts` is at full scale, full_dn, where no dot is seen."""
    if (full := float((counts >= full_dn).mean())) > MOST_FULL:
        cli.say(f"{_percent(full)} of the left infrared image is at full scale: give a shorter --ir-exposure")


def warn_of_materials(model: SensorModel, scene: kuafu.Scene) -> None:
    """Warns on stderr of materials that the model has values for and the scene lacks. It ignores albedo factors,
    because a diagnosis fits them to the scene of its own capture."""
    from activestereo.effects.core.surfaces import material_of

    own = [scene.material_name(number) or "" for number in range(scene.summary.material_count)]
    stated = {name for name, fields in model.materials.items() if set(fields) - {"ir_albedo_factor"}}
    if absent := sorted(stated - set(own) - set(map(material_of, own))):
        cli.say(f"the model's {listed(absent)}: the scene has no such material (there are: {', '.join(own) or 'none'})")


def warn_of_unseen(unseen: Sequence[tuple[str, str]], count: int, size_m: float, unit_m: float) -> None:
    """Warns on stderr of bodies that the sensor cannot measure. unseen: (name, reason) of each. count: of the scene's
    bodies. size_m: the scene's in units of unit_m, for a hint at wrong units."""
    from activestereo.scene_io.scene_files import size_hint

    if not unseen:
        return
    named = "; ".join(f"'{name}' is {why}" for name, why in unseen[:_MOST_NAMED])
    more = f"; and {len(unseen) - _MOST_NAMED} more" if len(unseen) > _MOST_NAMED else ""
    what = "nothing can" if len(unseen) == count else f"{len(unseen)} of {count} bodies cannot"
    hint = size_hint(size_m, unit_m)
    cli.say(f"{what} be measured in this view: {named}{more}{f'. The scene is {hint}' if hint else ''}")


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.1 else f"{100.0 * share:.0f} %"
