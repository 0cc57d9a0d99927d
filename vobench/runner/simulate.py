"""Case to sequence: light is computed, the body moves, cameras and other sensors measure, the recording keeps."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.errors import InputError
from vobench.geometry.rig import SIDES
from vobench.runner.key import canonical, versions
from vobench.runner.last_renderer import LastRenderer
from vobench.runner.motion import BodyMotion, body_motion, generator, require_possible
from vobench.suite.scene_file import scene_content
from vobench.suite.yaml_file import plain

if TYPE_CHECKING:
    from vobench.rendering.renderer import Renderer
    from vobench.runner.sensors import PixelTruth, SensorFeed
    from vobench.runner.stereo_camera import ExposedPair, StereoCamera
    from vobench.runner.store import Progress
    from vobench.scene.scene import Scene
    from vobench.sensor.timing import Schedule
    from vobench.sequence import SequenceWriter
    from vobench.suite.case import Case
    from vobench.suite.scene_spec import SceneFile
    from vobench.suite.suite_spec import Rendering

# Settings of a case that the simulation does not depend on: names, and the file of a replay's poses.
UNSIMULATED: dict[str, Any] = {
    "name": True,
    "variant": True,
    "scenario": True,
    "severity": True,
    "repeat": True,
    "repeat_of": True,
    "truth_noise": True,
    "scene": {"summary"},
    "trajectory": {"file", "times", "recorded_hz", "axes"},
}
LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "embreex", "mcap", "rosbags")
ENGINE_LIBRARIES = {"raster": ("PyOpenGL",), "path": ("mitsuba",), "pyrender": ("PyOpenGL", "pyrender2")}

last_renderer = LastRenderer()  # of the sequences that this process simulates


def libraries(rendering: "Rendering") -> tuple[str, ...]:
    """The distributions whose release can change the bytes of a sequence drawn by an engine."""
    return LIBRARIES + ENGINE_LIBRARIES[rendering.engine]


def content(case: "Case") -> dict[str, Any]:
    """The settings that are simulated, without names: the same for equal cases of two suites."""
    settings: dict[str, Any] = plain(case, exclude=UNSIMULATED)
    scene = scene_content(case.scene, exclude=UNSIMULATED["scene"])
    return {**settings, "scene": scene}


# The modules that render and write are imported when they are used, because looking up a sequence needs none of them.


def bake_scene(spec: "SceneFile", folder: Path, progress: "Progress") -> None:
    """Compute the light of a scene, under whatever levels, and what cameras see of it, into a folder.

    Raises MissingDependencyError if this machine cannot render, before any light is computed.
    """
    from vobench.rendering import freed_memory
    from vobench.rendering.bake import bake
    from vobench.rendering.baked_file import save_baked
    from vobench.rendering.baked_scene import BakeSettings
    from vobench.rendering.raster import require_drawing
    from vobench.rendering.wet_ground import wetted
    from vobench.suite.scene_build import build
    from vobench.suite.white import look_around

    require_drawing()
    freed_memory.collect()  # what is left of the place before
    scene = build(spec, {})
    with progress.step(f"light of {scene.name}") as tell:
        baked = bake(wetted(scene), BakeSettings(), tell)
        save_baked(folder, baked)
        look_around(baked).save(folder)


def open_renderer(
    scene: "Scene", rendering: "Rendering", light: Path | None, *, white_cd_m2: float | None = None
) -> "Renderer":
    """The renderer of a scene. The caller must close it.

    `light` is the folder with the light of the scene, for the engine raster. `white_cd_m2` is the luminance of white,
    for the engine pyrender, which renders 8 bits.

    Raises MissingDependencyError if this machine cannot render, and InputError if the engine does not draw the scene's
    fog, rain or wind.
    """
    if rendering.engine != "raster":
        _require_clear_air(scene, rendering.engine)
    if rendering.engine == "path":
        from vobench.rendering.path import SAMPLES, PathRenderer

        return PathRenderer(scene, samples=rendering.samples or SAMPLES)
    if rendering.engine == "pyrender":
        from vobench.rendering.pyrender_engine import PyrenderRenderer

        if white_cd_m2 is None:
            raise ValueError("the engine pyrender needs white_cd_m2")
        return PyrenderRenderer(scene, white_cd_m2=white_cd_m2)
    from vobench.rendering import freed_memory
    from vobench.rendering.baked_file import load_baked
    from vobench.rendering.raster import USUAL_SAMPLES, RasterRenderer
    from vobench.rendering.wet_ground import wetted

    if light is None:
        raise ValueError("the engine raster needs the light of the scene")
    freed_memory.collect()  # what is left of the place before
    return RasterRenderer(load_baked(light, wetted(scene)), samples=rendering.samples or USUAL_SAMPLES)


def _require_clear_air(scene: "Scene", engine: str) -> None:
    """Raise InputError if a scene has fog, rain or wind, which only the engine raster draws."""
    for weather, is_there in (("fog", scene.fog), ("rain", scene.rain), ("wind", scene.wind)):
        if is_there:
            raise InputError(f"{scene.name}: {weather} requires engine raster, but the engine is {engine}")


def simulate(case: "Case", folder: Path, *, light: Path | None, progress: "Progress") -> None:
    """Render the sequence of a case, and write it to a folder. `light` is the light of its scene, if it is needed.

    Raises MotionError if the body cannot move so in a place of a generator.
    """
    from vobench.runner.sensors import PixelTruth, SensorFeed
    from vobench.runner.stereo_camera import StereoCamera, World
    from vobench.suite.white import white_of

    travel = body_motion(case)
    if case.scene.generated:
        require_possible(case, travel)  # a generator is not run before, so the plan has not been checked
    scene = case.build_scene()
    truth = PixelTruth(case, scene, travel.motion) if case.truth else None
    white_cd_m2 = white_of(case.scene, light)
    opened = partial(open_renderer, scene, case.rendering, light, white_cd_m2=white_cd_m2)
    with last_renderer.using(_shown(case, light, white_cd_m2), opened) as renderer:
        camera = StereoCamera(case, World(scene, renderer, travel.motion, white_cd_m2))
        camera.skip(travel.first)
        frames = frames_of(case, travel)
        watched = progress.track(_pairs(camera, frames), f"simulate {case.name}", total=len(frames.t_ns))
        with _writer(case, folder, truth) as writer:
            _write(writer, travel, frames, feed=SensorFeed(case, travel), pairs=watched, truth=truth)


def _shown(case: "Case", light: Path | None, white_cd_m2: float) -> str:
    """What the renderer of a case depends on, as a text."""
    settings = content(case)
    shown = {name: settings[name] for name in ("scene", "lighting", "rendering")}
    return canonical({**shown, "light": str(light), "white_cd_m2": white_cd_m2})


def frames_of(case: "Case", travel: BodyMotion) -> "Schedule":
    """The schedule of a case: its frames, and the times of their pictures."""
    from vobench.sensor.timing import STREAMS, schedule

    rngs = {stream: generator(case.seed, f"camera.{stream}") for stream in STREAMS}
    return schedule(case.camera.timing, travel.t_ns, rngs, before=travel.first)


def _pairs(camera: "StereoCamera", frames: "Schedule") -> "Iterator[ExposedPair]":
    """The pictures of each frame. A repeated frame has the pictures of the frame before it."""
    pair = None
    for left_ns, right_ns, is_repeated in zip(frames.left_ns, frames.right_ns, frames.repeats, strict=True):
        if pair is None or not is_repeated:
            pair = camera.shoot(int(left_ns), int(right_ns))
        yield pair


def _writer(case: "Case", folder: Path, truth: "PixelTruth | None") -> "SequenceWriter":
    from vobench.sequence import SequenceWriter
    from vobench.sequence.picture import BAYER, MONO, RGB

    return SequenceWriter(
        folder,
        case.build_rig(),
        case_json=canonical(content(case)).encode(),
        true_rig=case.build_true_rig(),
        jpeg_quality=case.camera.jpeg_quality,
        colour={"mono": MONO, "rgb": RGB, "bayer": BAYER}[case.camera.colour],
        truth_channels=case.truth,
        truth_names=truth.names if truth else None,
        provenance=versions(*libraries(case.rendering)),
    )


def _write(
    writer: "SequenceWriter",
    travel: BodyMotion,
    frames: "Schedule",
    *,
    feed: "SensorFeed",
    pairs: "Iterator[ExposedPair]",
    truth: "PixelTruth | None",
) -> None:
    body = travel.at_frames()
    # The stamps of the pictures of each side. Flow is that from one picture to the next; the last one has none.
    taken_ns = {
        "left": [*frames.left_ns.tolist(), None],
        "right": [*frames.right_ns.tolist(), None],
    }
    rows = zip(pairs, frames.index, frames.t_ns.tolist(), strict=True)
    for number, (pair, index, t_ns) in enumerate(rows):
        feed.write_until(t_ns, writer)
        writer.write_frame(t_ns, pair.left, pair.right)
        writer.write_exposure(t_ns, pair.exposure.time_s, pair.exposure.gain_db)
        writer.write_truth(t_ns, body.T_world_body[index], body.twist[index])
        if travel.drive:
            step = travel.first + index
            writer.write_disturbance(t_ns, travel.drive.slip[step], travel.drive.delta[step])
        if truth:
            for side in SIDES:
                picture_ns = taken_ns[side][number]
                next_picture_ns = taken_ns[side][number + 1]
                writer.write_truth_frame(t_ns, side, truth.frame(side, picture_ns, next_picture_ns))
