"""Case to sequence: the body moves, cameras and other sensors measure, the recording keeps."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.geometry.rig import SIDES
from vobench.render.bake import BakedScene, BakeSettings, bake, load_baked, save_baked
from vobench.render.opengl import require_drawing
from vobench.render.renderer import Renderer
from vobench.run.motion import BodyMotion, body_motion
from vobench.run.store import Context, Store, canonical, code_digest, library_versions, versions
from vobench.scene.scene import Scene
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite import Case, Rendering
from vobench.suite.yaml_file import plain

BAKE = BakeSettings()
# What of a scene's file its light does not depend on; levels weigh the light of each lamp later.
UNLIT: dict[str, Any] = {
    "summary": True,
    "white_cd_m2": True,
    "lamps": {"__all__": {"level"}},
    "sun": {"level"},
    "sky": {"level"},
}


def open_renderer(spec: SceneFile, scene: Scene, rendering: Rendering, shop: Context) -> Renderer:
    """The renderer of a scene that was built from `spec`; the caller closes it.

    Raises MissingDependencyError where this machine cannot draw, before any light is computed.
    """
    # Neither OpenGL nor Mitsuba is loaded where no picture is drawn, so that cached cases need none.
    if rendering.engine == "path":
        from vobench.render.path import SAMPLES, PathRenderer

        return PathRenderer(scene, samples=rendering.samples or SAMPLES)
    from vobench.render.raster import RasterRenderer

    require_drawing()
    return RasterRenderer(_baked(spec, scene, shop))


def _baked(spec: SceneFile, scene: Scene, shop: Context) -> BakedScene:
    """The scene with its light, from the store where it has been computed before, under whatever levels."""
    inputs = {
        "scene": plain(spec, exclude=UNLIT),
        "settings": repr(BAKE),
        "code": code_digest("geometry", "scene", "render", "suite"),
        "libraries": library_versions("numpy", "scipy", "embreex"),
    }

    def build(folder: Path) -> None:
        with shop.progress.step(f"light of {scene.name}") as tell:
            save_baked(folder, bake(scene, BAKE, tell))

    return load_baked(shop.store.get("bakes", inputs, build), scene)


if TYPE_CHECKING:
    from vobench.run.sensors import PixelTruth, SensorFeed
    from vobench.run.stereo_camera import StereoPair
    from vobench.sequence import SequenceWriter

# What of a case is for people: names, and where the poses of a replay were found.
UNSIMULATED: dict[str, Any] = {
    "name": True,
    "variant": True,
    "scene": {"summary"},
    "trajectory": {"file", "times", "recorded_hz", "axes"},
}
LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "pyrender", "embreex", "mcap", "rosbags")


def simulate(case: Case, shop: Context) -> Path:
    """The folder of the case's sequence; made where the store has none of these inputs."""
    return shop.store.get("sequences", sequence_inputs(case), lambda folder: _record(case, folder, shop))


def is_simulated(case: Case, store: Store) -> bool:
    """Whether the store has the case's sequence already."""
    return store.path("sequences", sequence_inputs(case)).is_dir()


def sequence_inputs(case: Case) -> dict[str, Any]:
    """All that a sequence's bytes depend on; the names of the variants are not among it."""
    return {
        "case": _content(case),
        "bake": repr(BAKE),
        "code": code_digest(
            "geometry", "trajectory", "motion", "scene", "sensor", "render", "sequence", "suite", "run"
        ),
        "libraries": library_versions(*LIBRARIES, *(["mitsuba"] if case.rendering.engine == "path" else [])),
    }


def _content(case: Case) -> dict[str, Any]:
    """What is simulated, without what the suite calls it: the same for equal cases of two suites."""
    content: dict[str, Any] = plain(case, exclude=UNSIMULATED)
    return content


def _record(case: Case, folder: Path, shop: Context) -> None:
    # What draws and writes is imported here: whoever asks whether a sequence is there needs none of it.
    from vobench.run.sensors import PixelTruth, SensorFeed
    from vobench.run.stereo_camera import StereoCamera, World

    travel, scene = body_motion(case), case.build_scene()
    truth = PixelTruth(case, scene, travel.motion) if case.truth else None
    renderer = open_renderer(case.scene, scene, case.rendering, shop)
    try:
        camera = StereoCamera(case, World(scene, renderer, travel.motion))
        pairs = (camera.shoot(t_ns) for t_ns in travel.t_ns.tolist())
        watched = shop.progress.track(pairs, f"simulate {case.name}", total=len(travel.t_ns))
        with _writer(case, folder, truth) as writer:
            _write(writer, travel, SensorFeed(case, travel), watched, truth)
    finally:
        renderer.close()


def _writer(case: Case, folder: Path, truth: "PixelTruth | None") -> "SequenceWriter":
    from vobench.sequence import SequenceWriter

    return SequenceWriter(
        folder,
        case.build_rig(),
        case_json=canonical(_content(case)).encode(),
        true_rig=case.build_true_rig(),
        jpeg_quality=case.camera.jpeg_quality,
        truth_channels=case.truth,
        truth_names=truth.names if truth else None,
        provenance=versions(*LIBRARIES),
    )


def _write(
    writer: "SequenceWriter",
    travel: BodyMotion,
    feed: "SensorFeed",
    pairs: "Iterator[StereoPair]",
    truth: "PixelTruth | None",
) -> None:
    body = travel.at_frames()
    stamps = [*travel.t_ns.tolist(), None]
    for index, pair in enumerate(pairs):
        t_ns = stamps[index]
        feed.write_until(t_ns, writer)
        writer.write_frame(t_ns, pair.left, pair.right)
        writer.write_exposure(t_ns, pair.exposure.time_s, pair.exposure.gain_db)
        writer.write_truth(t_ns, body.T_world_body[index], body.twist[index])
        if travel.drive:
            writer.write_disturbance(t_ns, travel.drive.slip[index], travel.drive.delta[index])
        if truth:
            _write_pixel_truth(writer, truth, t_ns, stamps[index + 1])


def _write_pixel_truth(writer: "SequenceWriter", truth: "PixelTruth", t_ns: int, next_t_ns: int | None) -> None:
    for side in SIDES:
        writer.write_truth_frame(t_ns, side, truth.frame(side, t_ns, next_t_ns))
