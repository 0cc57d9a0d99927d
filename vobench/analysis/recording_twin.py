"""Repeats a recording in simulation, and measures how far estimators agree on both."""

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vobench.analysis.camera_fit import CameraLook, Lights, fit_camera, look_of
from vobench.analysis.image_statistics import evenly_spaced
from vobench.analysis.path_placement import Placement, WantedDisparities, levelled, wanted_disparities
from vobench.analysis.rank_agreement import Agreement, agreement, segment_errors
from vobench.analysis.realism import Realism, all_errors, shots_of
from vobench.analysis.realism_report import RealismReport, realism_of
from vobench.analysis.recorded_place import RECORDED, own_placement, rebuild_place
from vobench.analysis.request_folder import claim
from vobench.analysis.stereo_fit import StereoFit
from vobench.analysis.twin_estimators import twin_estimators
from vobench.analysis.twin_places import PlacedPath, find_places
from vobench.analysis.twin_prediction import TwinPrediction, common_names, predict
from vobench.dataset.recording import ReadOptions, Recording
from vobench.errors import InputError
from vobench.estimator.stereo import stereo_pair
from vobench.geometry.camera import pixel_grid
from vobench.geometry.rig import CalibrationError, CameraError, custom_stereo_pair, true_rig
from vobench.geometry.se3 import Array, inverse
from vobench.runner.data_frame import data_frame
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import RunFolder, TrialScore, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.import_recording import read_all
from vobench.runner.key import cache_folder
from vobench.runner.motion import body_motion
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.recording import DEFAULT_OPTIONS, read_recording, sequence_path
from vobench.runner.score import NO_SCALE
from vobench.runner.store import SILENT, Progress
from vobench.runner.task import bake_task, perform
from vobench.sensor import lens
from vobench.sensor.image_sensor import CameraSettings
from vobench.suite import catalog
from vobench.suite.axis import RigSettings
from vobench.suite.suite import read_plan
from vobench.suite.yaml_file import plain
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at
from vobench.trajectory.tum import format_tum

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

# The names of the two cases of a twin's suite; TWIN also names its rig, trajectory and camera.
REAL = "real"
TWIN = "twin"
SUITE_FILE = "twin.yaml"
PLACE_FILE = "place.yaml"
PATH_FILE = "path.tum"
MODEL_FILE = "recorded.glb"
PLACEMENT_FILE = "placement.json"
REPORT_FILE = "twin.json"

PLACEMENTS = 3  # in different places, if there are so many
MOST_PLACEMENTS = 20
FEWEST_PICTURES = 12  # a replayed path needs as many poses
LEAST_EXTENT_M = 0.05
FITTED_PICTURES = 12  # that the camera is fitted to
KNOTS_PER_PICTURE = 0.5  # of the smoothed path
CALIBRATION_SEED = 0  # of the calibration errors that are drawn for places after the first
QUANTILES = (0.1, 0.5, 0.9)


@dataclass(frozen=True, slots=True)
class TwinSuite:
    """The suite of a recording and its twin, written to a folder.

    `file` is the suite, and `more` are those of further places, in which only the twin is. `placed` are the placements
    of the path in the places of all suites, none if they are not known. `realism` is that of the recording.
    """

    file: Path
    placed: tuple[PlacedPath, ...]
    realism: Realism
    more: tuple[Path, ...] = ()

    @property
    def is_rebuilt(self) -> bool:
        """Whether the twin is in the recorded place."""
        return bool(self.placed) and all(placed.model for placed in self.placed)


@dataclass(frozen=True, slots=True)
class TwinReport:
    """The agreement of a recording and its twin: the order of estimators, their errors, and the images.

    `errors` are those of segments (8, N) by estimator, then by case ("real" or "twin"), in percent of their length;
    NaN where there is no segment.
    """

    suite: TwinSuite
    run: RunFolder
    agreement: Agreement
    errors: Mapping[str, Mapping[str, Array]]
    twin: Realism
    prediction: TwinPrediction

    def rows(self) -> list[dict[str, Any]]:
        """One row per estimator, by error on the recording, with mean and quantiles of errors on both cases."""
        mean_errors = self.agreement.errors
        ordered = sorted(mean_errors, key=lambda name: mean_errors[name][0])
        rows = []
        for name in ordered:
            sides = self.errors[name]
            rows.append({"estimator": name, REAL: _spread(sides[REAL]), TWIN: _spread(sides[TWIN])})
        return rows

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench twin --json` prints them and twin.json holds them."""
        real = self.suite.realism
        real_means = {name: means[0] for name, means in self.agreement.errors.items()}
        covered, counted = self.prediction.covered(real_means)
        here = self.suite.file.parent
        against_real = RealismReport(here, self.twin, here, real).rows()
        return {
            "tau": self.agreement.tau,
            "interval": [self.agreement.low, self.agreement.high],
            "estimators": self.rows(),
            "statistics": [row for row in against_real if row["against"] is not None],
            "also": _compared(real, self.twin),
            "prediction": {**self.prediction.as_dict(), "in_intervals": [covered, counted]},
            "places": [_place_facts(placed) for placed in self.suite.placed],
            "real": RealismReport(here, real).as_dict(),
            "twin": RealismReport(here, self.twin).as_dict(),
        }

    def to_frame(self) -> "DataFrame":
        """A pandas table of `rows`, with columns such as `real_mean` and `twin_p90`, in percent."""
        flat = []
        for row in self.rows():
            cells = {"estimator": row["estimator"]}
            for side in (REAL, TWIN):
                for name, value in row[side].items():
                    cells[f"{side}_{name}"] = value
            flat.append(cells)
        return data_frame(flat)


def _place_facts(placed: PlacedPath) -> dict[str, Any]:
    placement = placed.placement
    return {
        "place": placed.title,
        "scale": placement.scale,
        "misfit": placement.misfit,
        "nearness": placement.nearness,
    }


def write_twin_suite(
    recording: Path,
    *,
    out: Path = Path("twin"),
    place: str = RECORDED,
    placements: int = PLACEMENTS,
    estimators: Sequence[str] = (),
    form: str | None = None,
    options: ReadOptions = DEFAULT_OPTIONS,
    progress: Progress = SILENT,
) -> TwinSuite:
    """Write the suite of a recording and of its repetition in a simulated place.

    The place is rebuilt from the recording's images, or the recorded path is placed at its own scale where it is free
    and disparities agree best, in several places. The rig gets the calibration errors of the recording, and the camera
    gets its exposure, contrast, blur and noise.

    Args:
        recording: a recording with ground truth, or the folder of a run's case.
        out: the folder for the suite, new or of the same request when it was interrupted. The placement and the suite
            in it are used again, also if the suite was edited.
        place: "recorded" for the place of the recording, as in `rebuild_place`, or the name of the first scene that is
            tried, or the path of its file or model.
        placements: the number of times that the place is rebuilt, or the largest number of places, as in
            `find_places`.
        estimators: three estimators or more, instead of the default seven, as in `twin_estimators`.
        form: the form of the recording, if its content does not determine it.
        options: what the recording does not state itself: calibration, ground truth, rate, topics.
        progress: shows what is being done.

    Raises:
        InputError: the folder is in use for something else; fewer than three estimators; or the recording has no stereo
            pair that can be matched, no ground truth, too few pictures, or no motion; or it is too long for its place
            to be rebuilt; or no free path was found in the place.
        UnknownNameError: there is no such place.
    """
    entries = twin_estimators(estimators)
    if place != RECORDED:
        catalog.find("scene", place)

    recorded = read_recording(recording, form=form, options=options)
    _required_truth(recorded)  # before the folder is claimed, since a request with --truth is another one
    request = {
        "twin": str(recording.resolve()),
        "form": form,
        "options": str(options),
        "place": place,
        "placements": placements,
        "estimators": list(estimators),
    }
    claim(out, request)
    with progress.step("measuring the recording"):
        realism = realism_of(recorded)
    path = recorded_path(recorded, realism.pair)
    placed = _read_placements(out)
    if not placed:
        pair = stereo_pair(recorded.rig, "the twin")
        wanted_px = wanted_disparities(path.fit, pair)
        if place == RECORDED:
            placed = _rebuilt_places(recorded, path, wanted_px, count=placements, out=out, progress=progress)
        else:
            placed = tuple(find_places(place, path.T_world_left, pair, wanted_px, most=placements, progress=progress))
        write_json(out / PLACEMENT_FILE, [each.as_dict() for each in placed])

    wanted = look_of_recording(recorded)
    source = recording_source(recording, form, options)
    files = []
    for index, each in enumerate(placed):
        file = _numbered(out / SUITE_FILE, index).resolve()
        files.append(file)
        if _has_camera(file):
            continue
        suite = _suite_of_place(out, path, each, index=index)
        suite["estimators"] = entries
        if index == 0:
            suite["source"] = [source]
        write_json(file, suite)
        # The camera is fitted to pictures of this suite's twin, so the suite is read without a camera first.
        camera = fitted_camera(file, wanted, gain=path.fit.gain, vignetting=each.vignetting, progress=progress)
        suite["cameras"] = {TWIN: camera}
        write_json(file, suite)
    return TwinSuite(files[0], placed, realism, tuple(files[1:]))


def _rebuilt_places(
    recorded: Recording,
    path: "RecordedPath",
    wanted_px: WantedDisparities,
    *,
    count: int,
    out: Path,
    progress: Progress,
) -> tuple[PlacedPath, ...]:
    """The place of the recording, rebuilt with the calibration errors of each of some twins."""
    pair = stereo_pair(recorded.rig, "the twin")
    placed = []
    for index in range(count):
        model = _numbered(out / MODEL_FILE, index).resolve()
        rig = true_rig(recorded.rig, path.calibration_error(index))
        rebuilt = rebuild_place(recorded, path.t_ns, path.T_world_left, rig, path.fit, model=model, progress=progress)
        placement = own_placement(rebuilt, path.T_world_left, pair, wanted_px)
        placed.append(PlacedPath(RECORDED, None, placement, str(model), rebuilt.vignetting))
    return tuple(placed)


def _suite_of_place(out: Path, path: "RecordedPath", placed: PlacedPath, *, index: int) -> dict[str, Any]:
    """The suite of the twin in one place, without estimators and camera; its place and path are written."""
    place_file = _numbered(out / PLACE_FILE, index)
    path_file = _numbered(out / PATH_FILE, index)
    write_json(place_file, plain(placed.scene()))
    path_file.write_text(format_tum(path.in_place(placed.placement)), encoding="utf-8")
    return {
        "name": "twin",
        "summary": f"A recording repeated in {placed.title}",
        "seed": index,
        "scenes": [str(place_file.resolve())],
        "rigs": {TWIN: path.rig_settings(index)},
        "trajectories": {TWIN: {**path.trajectory_settings(), "file": path_file.name}},
    }


def _numbered(file: Path, index: int) -> Path:
    """The file of the place with an index: the first one has no number, the others have 2, 3 and so on."""
    return file if index == 0 else file.with_stem(f"{file.stem}-{index + 1}")


def _has_camera(file: Path) -> bool:
    """Whether the suite of a twin is complete: the camera is written last."""
    if not file.is_file():
        return False
    return bool(read_plan(str(file)).source.plain.get("cameras"))


def _read_placements(out: Path) -> tuple[PlacedPath, ...]:
    """The placements that were found before."""
    file = out / PLACEMENT_FILE
    if not file.is_file():
        return ()
    return tuple(PlacedPath.of_dict(facts) for facts in json.loads(file.read_text(encoding="utf-8")))


def read_twin_suite(folder: Path, *, progress: Progress = SILENT) -> TwinSuite:
    """The suite of a twin in a folder, as `write_twin_suite` wrote it or as it was edited since.

    Raises InputError if the folder has no suite of a recording and a twin, and SuiteError if the suite is wrong.
    """
    file = (folder / SUITE_FILE).resolve()
    if not file.is_file():
        raise InputError(f"should be the folder of a twin, with {SUITE_FILE} in it: {folder}")
    plan = read_plan(str(file))
    names = [case.name for case in plan.cases]
    if TWIN not in names or REAL not in names:
        raise InputError(
            f"the suite of a twin has the cases {REAL} and {TWIN}, and this one {', '.join(names)}: {file}"
        )
    recorded = read_all(plan)[REAL]
    with progress.step("measuring the recording"):
        realism = realism_of(recorded)
    more = []
    for index in range(1, MOST_PLACEMENTS):
        further = _numbered(file, index)
        if not further.is_file():
            break
        more.append(further)
    return TwinSuite(file, _read_placements(folder), realism, tuple(more))


def compare_twin(
    suite: TwinSuite,
    *,
    run_plan: PlanRunner,
    prediction: "PredictedTwin | None" = None,
    progress: Progress = SILENT,
) -> TwinReport:
    """Run the estimators of a twin's suite on both cases, compare them, and write twin.json beside the suite.

    `prediction` is that of `predict_twin`, which is called if it is not given.

    Raises InputError if fewer than three estimators ran on both.
    """
    prediction = predict_twin(suite, run_plan=run_plan) if prediction is None else prediction
    folder = run_plan(read_plan(str(suite.file)))
    with progress.step("measuring the twin"):
        twin = realism_of(read_recording(folder.case(TWIN)))
    real_errors = case_errors(folder, REAL)
    twin_errors = prediction.twin_errors()
    orders = agreement(real_errors, twin_errors)
    errors = {}
    for name in orders.errors:
        errors[name] = {REAL: real_errors[name], TWIN: twin_errors[name]}
    report = TwinReport(suite, folder, orders, errors, twin, prediction.prediction)
    write_json(suite.file.parent / REPORT_FILE, report.as_dict())
    return report


@dataclass(frozen=True, slots=True)
class PredictedTwin:
    """The prediction of a twin, and the errors of segments (8, N) by estimator in each place."""

    prediction: TwinPrediction
    errors: tuple[Mapping[str, Array], ...]

    def twin_errors(self) -> dict[str, Array]:
        """The errors of segments in all places, side by side, of the estimators that ran in all of them."""
        side_by_side = {}
        for name in common_names(self.errors):
            side_by_side[name] = np.concatenate([errors[name] for errors in self.errors], axis=1)
        return side_by_side


def predict_twin(suite: TwinSuite, *, run_plan: PlanRunner) -> PredictedTwin:
    """Run the estimators on the twin in all places, and predict their errors and order on the recording from that.

    The estimators do not run on the recording, whose errors are therefore not used.
    """
    errors = []
    for file in (suite.file, *suite.more):
        folder = run_plan(read_plan(str(file)).only([TWIN], []))
        errors.append(case_errors(folder, TWIN))
    return PredictedTwin(predict(errors, expects_first=suite.is_rebuilt, basis=_basis(suite)), tuple(errors))


def _basis(suite: TwinSuite) -> str:
    """On what a prediction rests."""
    if suite.is_rebuilt:
        places = "the recorded place, rebuilt from its images"
        covered = "errors of the rebuilt place"
        lacking = "what moves there"
    else:
        titles = ", ".join(each.title for each in suite.placed)
        places = f"the recording's path in {titles}" if titles else "the recording's path in a place"
        covered = "other places"
        lacking = "what a simulation lacks"
    basis = (
        f"The prediction rests on {places}, on a camera and a calibration error that were fitted to the recording, and "
        f"on the recorded path being true. Intervals cover {covered}, noise and the uncertainty of the calibration, "
        f"not {lacking}."
    )
    if suite.realism.pair is None or suite.realism.pair.offset_px is None:
        basis += " The offset of disparity could not be determined and is 0 in the twin, so errors may be far larger."
    return basis


def make_twin(
    recording: Path,
    *,
    run_plan: PlanRunner,
    out: Path = Path("twin"),
    place: str = RECORDED,
    placements: int = PLACEMENTS,
    estimators: Sequence[str] = (),
    form: str | None = None,
    options: ReadOptions = DEFAULT_OPTIONS,
    progress: Progress = SILENT,
) -> TwinReport:
    """Repeat a recording in simulation, run the same estimators on both, and compare.

    It calls `write_twin_suite` and `compare_twin`. See them for the arguments and errors.
    """
    suite = write_twin_suite(
        recording,
        out=out,
        place=place,
        placements=placements,
        estimators=estimators,
        form=form,
        options=options,
        progress=progress,
    )
    return compare_twin(suite, run_plan=run_plan, progress=progress)


# --- The path and its placement ---


@dataclass(frozen=True, slots=True)
class RecordedPath:
    """The data that a twin repeats: poses T_world_left (N, 4, 4) at t_ns (N,), the rig, and the fit of the rig."""

    t_ns: Stamps
    T_world_left: Array
    rig: RigSettings
    fit: StereoFit

    def in_place(self, placement: Placement) -> Trajectory:
        """The path of the body in the scene, from time 0."""
        T_body_left = self.rig.build().T_body_left
        T_place_body = placement.T_place_world @ self.T_world_left @ inverse(T_body_left)
        return Trajectory(self.t_ns - self.t_ns[0], T_place_body)

    def rig_settings(self, index: int = 0) -> dict[str, Any]:
        """The rig for the suite of a place, with the calibration errors that were found.

        In places after the first, errors are drawn from the distribution of those that were found, so that predictions
        from several places differ by the uncertainty of the calibration too.
        """
        settings: Any = plain(self.rig)
        stated = {key: settings[key] for key in ("own", "pitch_deg", "forward_m", "height_m")}
        return {**stated, "calibration_error": self._errors(index)}

    def calibration_error(self, index: int) -> CalibrationError:
        """The calibration errors in `rig_settings`."""
        errors = self._errors(index)
        right = CameraError(**errors.pop("right", {}))
        return CalibrationError(**errors, right=right)

    def _errors(self, index: int) -> dict[str, Any]:
        rng = np.random.default_rng([CALIBRATION_SEED, index]) if index else None
        return all_errors(self.fit, rng)

    def trajectory_settings(self) -> dict[str, Any]:
        """The replay of this path for a suite."""
        rate_hz = round(NS_PER_S / float(np.median(np.diff(self.t_ns))), 3)
        return {"kind": "replay", "file": PATH_FILE, "rate_hz": rate_hz, "knot_hz": rate_hz * KNOTS_PER_PICTURE}


def _required_truth(recording: Recording) -> Trajectory:
    """The ground truth of a recording. Raises InputError if it has none."""
    if recording.truth is None:
        raise InputError(
            "a twin needs a path, and this recording has none; give an estimate with --truth, and add --predict, so "
            "that nothing is compared with it"
        )
    return recording.truth


def recorded_path(recording: Recording, fit: StereoFit | None) -> RecordedPath:
    """The path of a recording's images that have a true pose. Raises InputError if it cannot be repeated."""
    if fit is None:
        raise InputError("a twin needs a stereo pair that can be rectified and matched, and this recording has none")
    truth = _required_truth(recording)
    has_pose = (recording.t_ns >= truth.t_ns[0]) & (recording.t_ns <= truth.t_ns[-1])
    t_ns = recording.t_ns[has_pose]
    if len(t_ns) < FEWEST_PICTURES:
        raise InputError(
            f"a twin takes {FEWEST_PICTURES} images or more with a truth, and this recording has {len(t_ns)}"
        )

    T_world_left = poses_at(truth, t_ns) @ recording.rig.T_body_left
    extent_m = np.linalg.norm(np.ptp(T_world_left[:, :3, 3], axis=0))
    if extent_m < LEAST_EXTENT_M:
        raise InputError(
            "a twin ranks estimators by errors per length of path, and this recording is stationary; use one that moves"
        )
    if recording.form == "kitti":  # its world is the first camera, which need not be level
        T_world_left = levelled(T_world_left)

    rig = RigSettings(own=custom_stereo_pair(recording.rig), pitch_deg=0, forward_m=0, height_m=0)
    return RecordedPath(t_ns, T_world_left, rig, fit)


def recording_source(
    recording: Path,
    form: str | None,
    options: ReadOptions,
) -> dict[str, Any]:
    """The recording as the `source` of a suite, without the options that are not given."""
    topics = {name: getattr(options.topics, name) for name in type(options.topics).__dataclass_fields__}
    source = {
        "path": str(sequence_path(recording).resolve()),
        "name": REAL,
        "form": form,
        "rate_hz": options.rate_hz,
        "calibration": None if options.calibration is None else str(options.calibration.resolve()),
        "truth": None if options.truth is None else str(options.truth.resolve()),
        "topics": {name: topic for name, topic in topics.items() if topic},
        "frames": options.frames,
    }
    return {key: value for key, value in source.items() if value}


def write_json(path: Path, content: Any) -> None:
    """Write JSON, which YAML readers take too."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


# --- The camera ---


def fitted_camera(
    file: Path,
    wanted: CameraLook,
    *,
    gain: float,
    vignetting: float = 0.0,
    progress: Progress,
) -> dict[str, Any]:
    """The camera for a suite whose images of the twin have the wanted look most nearly.

    `file` is the suite of the twin, still without a camera. `gain` is the ratio of grey values of the right image to
    those of the left one. `vignetting` is its strength.
    """
    from vobench.runner.simulate import open_renderer
    from vobench.runner.stereo_camera import World, left_lights
    from vobench.suite.white import white_of

    case = read_plan(str(file)).simulated[0]
    motion = body_motion(case)
    scene = case.build_scene()
    light = perform(bake_task(case.scene), cache_folder(), progress=progress)
    fitted_t_ns = evenly_spaced(motion.t_ns.tolist(), FITTED_PICTURES)
    white_cd_m2 = white_of(case.scene, light)
    with closing(open_renderer(scene, case.rendering, light, white_cd_m2=white_cd_m2)) as renderer:
        lights = left_lights(case, World(scene, renderer, motion.motion, white_cd_m2), fitted_t_ns)
    left = case.build_rig().left
    shade = lens.vignetting(left.rays(pixel_grid(left)), strength=vignetting).astype(np.float32)
    settings, _ = fit_camera(wanted, Lights([light * shade for light in lights], seed=case.seed), progress=progress)
    return {**_camera_settings(settings, gain=gain), "vignetting": round(vignetting, 4)}


def look_of_recording(recording: Recording) -> CameraLook:
    """The look of a recording's images, from some that are spread over it."""
    pictures = [shot.left for run in shots_of(recording) for shot in run]
    return look_of(evenly_spaced(pictures, FITTED_PICTURES))


def _camera_settings(settings: CameraSettings, *, gain: float) -> dict[str, Any]:
    """A fitted camera for a suite, with the gain of the right camera in the linear signal."""
    chip = settings.chip
    linear_gain = gain ** float(str(chip.response))
    return {
        "chip": {
            "full_well_e": chip.full_well_e,
            "read_noise_e": chip.read_noise_e,
            "shot_noise": True,
            "adc_bits": chip.adc_bits,
            "response": chip.response,
        },
        "exposure_gain": settings.exposure_gain,
        "blur_sigma_px": settings.blur_sigma_px,
        "unlike": {"right": {"gain": round(linear_gain, 4)}},
    }


# --- The comparison ---


def case_errors(folder: RunFolder, case: str) -> dict[str, Array]:
    """The errors (8, N) of segments of each estimator on a case, in its first trial there."""
    gt = read_tum(folder.case(case) / GROUND_TRUTH)
    errors = dict[str, Array]()
    for score in folder.scores():
        if score.case == case and score.estimator not in errors:
            errors[score.estimator] = _trial_errors(folder, gt, score)
    return errors


def _trial_errors(folder: RunFolder, gt: Trajectory, score: TrialScore) -> Array:
    est = read_tum(folder.estimate(score.case, score.estimator, score.repeat) / ESTIMATE)
    has_no_scale = any(NO_SCALE in claim for claim in score.claims)
    return segment_errors(gt, est, scaled=has_no_scale)


def _spread(errors: Array) -> dict[str, float]:
    """Mean and quantiles of known errors."""
    known = errors[np.isfinite(errors)]
    p10, p50, p90 = np.quantile(known, QUANTILES).tolist()
    return {"mean": float(known.mean()), "p10": p10, "p50": p50, "p90": p90}


def _compared(real: Realism, twin: Realism) -> dict[str, tuple[float, float]]:
    """The statistics without a range, of the recording and its twin, by title with unit."""
    compared = {}
    for key, title in (
        ("noise_dn", "noise where flat, DN"),
        ("grey_mean", "mean of grey, DN"),
        ("edge_px", "sharpest edges, px"),
        ("flow_px", "flow, px per image"),
    ):
        compared[title] = (real.also[key], twin.also[key])
    if real.pair and twin.pair:
        compared |= _compared_pairs(real.pair, twin.pair)
    return compared


def _compared_pairs(real: StereoFit, twin: StereoFit) -> dict[str, tuple[float, float]]:
    """The rotations of the right camera if both are known, and the quantiles of disparity."""
    compared = {}
    for name, unit in (("yaw_deg", "°"), ("roll_deg", "°"), ("pitch_deg", "°"), ("offset_px", " px")):
        of_real = getattr(real, name)
        of_twin = getattr(twin, name)
        if of_real and of_twin:
            quantity, _, _ = name.partition("_")
            compared[f"{quantity} of the right eye,{unit}"] = (of_real.value, of_twin.value)
    for quantile, below_real, below_twin in zip(QUANTILES, real.disparity_px, twin.disparity_px, strict=True):
        compared[f"disparity, {100 * quantile:.0f} % are below, px"] = (below_real, below_twin)
    return compared
