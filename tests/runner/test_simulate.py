"""A case becomes one sequence: its content is all that it depends on, and its files agree with its motion.

The light is that of a stand-in renderer, so that nothing is baked or drawn.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.geometry.camera import Camera
from vobench.rendering.renderer import Radiance, View
from vobench.runner import simulate as simulate_file
from vobench.runner.motion import body_motion
from vobench.runner.simulate import content, frames_of, libraries, open_renderer, simulate
from vobench.runner.store import SilentProgress
from vobench.scene.fog import Fog
from vobench.scene.material import Rgb
from vobench.scene.rain import Rain
from vobench.scene.scene import Scene
from vobench.scene.wind import Wind
from vobench.sequence import reader
from vobench.suite.case import Case
from vobench.suite.suite import read_plan
from vobench.suite.suite_spec import Rendering

SCENE = """name: cell
white_cd_m2: 50
materials: {m: {pattern: plain, albedo: 0.5, resolution_px: 8}}
room: {size_m: [6, 6, 3], floor: m, wall: m, ceiling: m}
lamps: [{name: lamp, center_m: [0, 0, 2.9], size_m: [0.4, 0.4], power_lm: 600}]
"""
SUITE = """name: one
seed: 3
scenes: [cell]
rigs: {down: {pitch_deg: 90, picture_scale: 0.05, imu: adis16448}}
trajectories: {way: {targets_m: [[0.3, 0]], tolerance_m: 0.03, rate_hz: 20}}
cameras: {it: {exposure_ms: 2, chip: {shot_noise: true, read_noise_e: 7}}}
estimators: [stand_still]
"""
EXPOSURE = "{exposure_ms: 2, "


class Gradient:
    """A renderer whose light tells the x of the camera, from dark at -1 m to bright at 1 m."""

    def __init__(self) -> None:
        self.is_closed = False

    def radiance(self, camera: Camera, views: Sequence[View], *, weights: Rgb | None = None) -> Radiance:
        x_m = views[0].T_world_camera[0, 0, 3]
        shape = (camera.height_px, camera.width_px)
        return np.full(shape, 25 + 20 * x_m, np.float32)

    def close(self) -> None:
        self.is_closed = True


@pytest.fixture
def renderer(monkeypatch: pytest.MonkeyPatch) -> Gradient:
    """The renderer that all cases get."""
    gradient = Gradient()
    monkeypatch.setattr(simulate_file, "open_renderer", lambda *_, **__: gradient)
    return gradient


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Case]:
    """Reads the case of the suite, with some of its text replaced."""

    def read(*changes: tuple[str, str], summary: str = "") -> Case:
        text = SUITE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "cell.yaml").write_text(SCENE + summary)
        (tmp_path / "one.yaml").write_text(text)
        return read_plan(str(tmp_path / "one.yaml")).simulated[0]

    return read


@pytest.fixture
def simulated(read, renderer, tmp_path: Path) -> Callable[..., tuple[Case, Path]]:
    """Simulates the case of the suite, and returns it with the folder of its sequence."""

    def run(*changes: tuple[str, str]) -> tuple[Case, Path]:
        case = read(*changes)
        folder = tmp_path / f"sequence{len(list(tmp_path.glob('sequence*')))}"
        simulate(case, folder, light=None, progress=SilentProgress())
        return case, folder

    return run


def pictures(folder: Path) -> np.ndarray:
    """The left and right pictures (N, 2, H, W) of a sequence."""
    frames = reader.Sequence.open(folder)
    return np.array([[frame.left, frame.right] for frame in frames])


def test_names_and_summaries_are_no_part_of_the_content(read) -> None:
    one = content(read())
    renamed = content(read(("way:", "path:"), ("it:", "camera:"), summary="summary: Another\n"))
    assert renamed == one


@pytest.mark.parametrize(
    "change",
    [
        ("seed: 3", "seed: 4"),
        ("pitch_deg: 90", "pitch_deg: 80"),
        ("exposure_ms: 2", "exposure_ms: 3"),
        ("0.3, 0]", "0.4, 0]"),
        ("name: one", "name: one\nrendering: {engine: path}"),
        ("name: one", "name: one\nframes: [0, 2]"),
        ("name: one", "name: one\ntruth: [depth]"),
    ],
)
def test_what_is_simulated_is_part_of_the_content(read, change) -> None:
    assert content(read(change)) != content(read())


def test_a_sequence_depends_on_the_libraries_of_its_own_engine_alone() -> None:
    by_engine = {engine: set(libraries(Rendering(engine=engine))) for engine in ("raster", "path", "pyrender")}
    of_all = set.intersection(*by_engine.values())
    assert {"numpy", "scipy", "mcap"} <= of_all
    assert by_engine["path"] - of_all == {"mitsuba"}
    assert by_engine["raster"] - of_all == {"PyOpenGL"}
    assert by_engine["pyrender"] - of_all == {"PyOpenGL", "pyrender2"}


def test_an_engine_without_what_it_draws_with_is_refused(read) -> None:
    scene = read().build_scene()
    with pytest.raises(ValueError, match="raster needs the light"):
        open_renderer(scene, Rendering(engine="raster"), None)
    with pytest.raises(ValueError, match="pyrender needs white_cd_m2"):
        open_renderer(scene, Rendering(engine="pyrender"), None)


@pytest.mark.parametrize("engine", ["path", "pyrender"])
def test_an_engine_that_draws_no_fog_refuses_a_scene_with_fog(engine: str) -> None:
    scene = Scene("yard", (), {}, (), fog=Fog(visibility_m=60.0))
    with pytest.raises(InputError, match=f"yard: fog requires engine raster, but the engine is {engine}"):
        open_renderer(scene, Rendering(engine=engine), None, white_cd_m2=50.0)


@pytest.mark.parametrize("engine", ["path", "pyrender"])
def test_an_engine_that_draws_no_rain_refuses_a_scene_with_rain(engine: str) -> None:
    scene = Scene("yard", (), {}, (), rain=Rain(rate_mm_per_h=1.0))
    with pytest.raises(InputError, match=f"yard: rain requires engine raster, but the engine is {engine}"):
        open_renderer(scene, Rendering(engine=engine), None, white_cd_m2=50.0)


@pytest.mark.parametrize("engine", ["path", "pyrender"])
def test_an_engine_that_draws_no_wind_refuses_a_scene_with_wind(engine: str) -> None:
    scene = Scene("yard", (), {}, (), wind=Wind(speed_mps=1.0))
    with pytest.raises(InputError, match=f"yard: wind requires engine raster, but the engine is {engine}"):
        open_renderer(scene, Rendering(engine=engine), None, white_cd_m2=50.0)


def test_the_truth_is_the_motion_at_the_stamps_of_the_pictures(simulated) -> None:
    case, folder = simulated()
    travel = body_motion(case)
    body = travel.at_frames()
    truth = reader.read_truth(folder)
    np.testing.assert_array_equal(reader.Sequence.open(folder).frame_stamps(), travel.t_ns)
    np.testing.assert_array_equal(truth.t_ns, travel.t_ns)
    np.testing.assert_allclose(truth.T_world_frame, body.T_world_body, atol=1e-12)
    np.testing.assert_allclose(reader.read_twist(folder), body.twist, atol=1e-12)


def test_the_disturbances_of_a_drive_are_recorded_at_its_frames(simulated) -> None:
    case, folder = simulated(("rate_hz: 20", "rate_hz: 20, slip: slippery, delta: bumpy"))
    drive = body_motion(case).drive
    t_ns, values = reader.read_disturbances(folder)
    np.testing.assert_array_equal(t_ns, drive.t_ns)
    np.testing.assert_allclose(values, np.concatenate([drive.slip, drive.delta], -1))
    assert np.abs(values).max() > 0


def test_a_picture_is_of_the_place_where_the_body_is_at_its_stamp(simulated) -> None:
    case, folder = simulated()
    x_m = body_motion(case).at_frames().T_world_body[:, 0, 3]
    greys = pictures(folder)[:, 0].mean(axis=(1, 2))
    assert np.corrcoef(x_m, greys)[0, 1] > 0.99


def test_all_readings_come_with_the_frames_and_none_is_later(simulated) -> None:
    _, folder = simulated()
    sequence = reader.Sequence.open(folder)
    last_ns = sequence.frame_stamps()[-1]
    encoder_t_ns, _ = sequence.encoders()
    assert encoder_t_ns[-1] == last_ns
    assert 0 <= last_ns - sequence.imu().t_ns[-1] < 1e9 / 100
    exposure_t_ns, exposures = sequence.exposures()
    np.testing.assert_array_equal(exposure_t_ns, sequence.frame_stamps())
    assert exposures[:, 0] == pytest.approx(0.002)


def test_some_frames_of_a_case_have_the_pictures_and_truth_of_the_whole(simulated) -> None:
    _, whole = simulated()
    _, part = simulated(("name: one", "name: one\nframes: [4, 9]"))
    np.testing.assert_array_equal(pictures(part), pictures(whole)[4:9])
    np.testing.assert_array_equal(reader.read_truth(part).T_world_frame, reader.read_truth(whole).T_world_frame[4:9])
    np.testing.assert_array_equal(reader.read_disturbances(part)[1], reader.read_disturbances(whole)[1][4:9])


def test_equal_cases_make_equal_files_and_another_seed_other_noise(simulated) -> None:
    _, one = simulated()
    _, again = simulated()
    _, other = simulated(("seed: 3", "seed: 4"))
    for name in ("sensors.mcap", "truth.mcap"):
        assert (one / name).read_bytes() == (again / name).read_bytes()
    assert (pictures(one)[0] != pictures(other)[0]).any()


def test_a_repeated_frame_shows_the_pictures_before_it_bit_for_bit(simulated) -> None:
    case, folder = simulated((EXPOSURE, "{exposure_ms: 2, timing: {repeat_share: 0.4}, "))
    repeats = frames_of(case, body_motion(case)).repeats
    assert 0 < repeats.sum() < len(repeats)
    shown = pictures(folder)
    is_same_as_before = (shown[1:] == shown[:-1]).all(axis=(1, 2, 3))
    np.testing.assert_array_equal(is_same_as_before, repeats[1:])


def test_lost_frames_are_those_of_the_schedule_in_part_of_a_case_too(simulated, read) -> None:
    lossy = (EXPOSURE, "{exposure_ms: 2, timing: {drop_share: 0.3}, ")
    case, folder = simulated(lossy)
    frames = frames_of(case, body_motion(case))
    np.testing.assert_array_equal(reader.Sequence.open(folder).frame_stamps(), frames.t_ns)
    part = read(lossy, ("name: one", "name: one\nframes: [5, 25]"))
    stamps = frames_of(part, body_motion(part)).t_ns
    inner = stamps[1:-1]  # the ends of a case are never lost
    is_inside = (frames.t_ns > stamps[0]) & (frames.t_ns < stamps[-1])
    np.testing.assert_array_equal(inner, frames.t_ns[is_inside])


def test_flow_leads_from_each_picture_to_the_next_and_the_last_has_none(simulated) -> None:
    _, folder = simulated(("name: one", "name: one\ntruth: [flow]\nframes: [6, 9]"))
    flows = list(reader.read_truth_frames(folder))
    assert [np.isfinite(frame.left.flow).any() for frame in flows] == [True, True, False]
    assert [np.isfinite(frame.right.flow).any() for frame in flows] == [True, True, False]
    assert np.nanmax(np.abs(flows[0].left.flow)) > 0


def test_a_sequence_has_its_case_and_what_made_it(simulated) -> None:
    case, folder = simulated()
    assert b'"seed":3' in reader.read_case(folder).replace(b" ", b"")
    provenance = reader.read_provenance(folder)
    assert set(libraries(case.rendering)) <= set(provenance)


@pytest.mark.parametrize("is_broken", [False, True])
def test_the_renderer_is_closed_whatever_happens(read, renderer, tmp_path, is_broken) -> None:
    def fail(*_: object, **__: object) -> Radiance:
        raise RuntimeError("no driver")

    case = read(("name: one", "name: one\nframes: [0, 2]"))
    if not is_broken:
        simulate(case, tmp_path / "sequence", light=None, progress=SilentProgress())
    else:
        renderer.radiance = fail
        with pytest.raises(RuntimeError, match="no driver"):
            simulate(case, tmp_path / "sequence", light=None, progress=SilentProgress())
    assert renderer.is_closed
