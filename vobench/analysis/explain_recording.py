"""Explains why an estimator fails on a recording: what differs in the worst part, and what a twin does without it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from vobench.analysis.camera_fit import look_of
from vobench.analysis.explain import Effort, effort, explain
from vobench.analysis.explanation import Removal
from vobench.analysis.frame_failure import (
    FrameRange,
    failing_loss,
    frame_losses,
    twin_coincidence,
    worst_window,
)
from vobench.analysis.image_statistics import evenly_spaced
from vobench.analysis.nuisance import Nuisance
from vobench.analysis.path_placement import ANY_SCALE, Placement, place_path, wanted_disparities
from vobench.analysis.picture_change import INSTEAD
from vobench.analysis.picture_evidence import CHUNK_FRAMES, ImageEvidence, RecordingPart, find_changes
from vobench.analysis.recording_explanation import FailingFrames, RecordingExplanation, TwinTrials
from vobench.analysis.recording_part import frames_of_run, read_parts, reference_runs
from vobench.analysis.recording_twin import (
    PATH_FILE,
    PLACE_FILE,
    SUITE_FILE,
    TWIN,
    RecordedPath,
    fitted_camera,
    recorded_path,
    recording_source,
    write_json,
)
from vobench.analysis.recording_variants import TwinImages, TwinVariant
from vobench.analysis.request_folder import claim
from vobench.analysis.segment_loss import Outcome
from vobench.analysis.stereo_fit import fit_pair
from vobench.analysis.trial_data import TrialPaths, read_outcome, read_paths
from vobench.analysis.trial_forecast import TrialForecast, estimator_seconds
from vobench.dataset.recording import ReadOptions, Recording
from vobench.errors import InputError
from vobench.estimator.stereo import StereoPair, stereo_pair
from vobench.geometry import se3
from vobench.geometry.rig import rectification
from vobench.geometry.se3 import Array
from vobench.runner.folder import SEQUENCE, RunFolder, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.import_recording import import_recording
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.recording import DEFAULT_OPTIONS, read_recording
from vobench.runner.store import SILENT, Progress
from vobench.runner.trajectory_pair import TrajectorySource, read_one
from vobench.sequence import Sequence as RecordedSequence
from vobench.suite import catalog
from vobench.suite.manifest import read_manifest
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite import read_plan
from vobench.suite.yaml_file import plain
from vobench.trajectory.associate import nearest
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at
from vobench.trajectory.tum import format_tum

WINDOW_S = 5.0
LOOK_IMAGES = 12  # that the camera of the twin is fitted to
STAND_IN = "lk_epipolar"  # that is run in the twin of a recording of which only an estimate is known
TIMES = "times.txt"  # of KITTI
SEQUENCES = "sequences"  # the folder of the variants of the twin
# To compare the images, simulate the twin and explain one difference, for each image pair of the worst part and each
# 10⁶ pixels of an image: measured by benchmarks/damaged_recordings.py.
SECONDS_PER_MEGAPIXEL = 20.0
PIXELS_PER_MEGAPIXEL = 1e6
START_S = 1.5  # to start an estimator and to write the images of a trial


def explain_recording(
    recording: Path,
    *,
    run_plan: PlanRunner,
    estimate: Path | None = None,
    estimator: str | None = None,
    place: str = "office",
    out: Path = Path("explained"),
    repeats: int = 3,
    form: str | None = None,
    options: ReadOptions = DEFAULT_OPTIONS,
    progress: Progress = SILENT,
) -> RecordingExplanation:
    """Explain why an estimator fails in the worst five seconds of a recording.

    The images there are compared with those of the rest of the recording. A twin of the part is simulated, with what
    differs and without each of it. The answer counts if the twin fails at the same times as the recording.

    Args:
        recording: a recording of a stereo pair with ground truth, or the folder of a run's case.
        run_plan: runs estimators.
        estimate: the estimate of the recording in metres, of the body of its ground truth or of its left camera; if
            None, the estimator is run.
        estimator: the name or the folder of the estimator, which is run in the twin; lk_epipolar if None.
        place: the name of the scene, or the path of its file or model, in which the twin is.
        out: the folder for the twin, new or of the same request when it was interrupted.
        repeats: how many seeds each variant of the twin is screened with.
        form: the form of the recording, if its content does not determine it.
        options: what the recording does not state itself: calibration, ground truth, rate, topics.
        progress: shows what is being done.

    Raises:
        InputError: the folder is in use for something else; the recording has no stereo pair, no ground truth, no
            frames in which the estimator fails or too few in which it does not; or no free path was found in the place.
        UnknownNameError: there is no such place or estimator.
    """
    name = estimator or STAND_IN
    seeds = _seeds(name, repeats)
    scene = read_scene(catalog.find("scene", place).path)
    recorded = read_recording(recording, form=form, options=options)
    pair = _required_pair(recorded)
    gt = _true_frames(recorded)
    t_ns = gt.t_ns
    gt_left = gt.of_mounted(recorded.rig.T_body_left)
    request = {
        "explain": str(recording.resolve()),
        "form": form,
        "options": str(options),
        "estimate": None if estimate is None else str(estimate.resolve()),
        "estimator": name,
        "place": place,
        "repeats": repeats,
    }
    claim(out, request, regenerated=(SEQUENCES,))
    period_ns = int(np.median(np.diff(recorded.t_ns)))
    progress.say(_cost_sentence(name, seeds, pair, t_ns, period_ns=period_ns, is_run=estimate is None))
    seconds_per_frame = None
    if estimate is None:
        source = recording_source(recording, form, options)
        trial = _run_on_recording(source, name, out, gt_left, run_plan)
        loss = frame_losses(gt_left, trial.est, scale=trial.scale)
        seconds_per_frame = trial.seconds / len(recorded.t_ns)
    else:
        est = _read_estimate(estimate, recording, t_ns)
        loss = _smaller_losses(est, gt, gt_left)

    window = worst_window(t_ns, loss, WINDOW_S)
    frames = _failing_frames(t_ns - recorded.t_ns[0], loss, window)
    runs = reference_runs(window, loss > failing_loss(frames.typical), frames_of_run(period_ns))
    part, *reference = read_parts(recorded, t_ns, [window, *runs])
    begin_s, end_s = frames.span_s
    progress.say(f"the worst part: {begin_s:.1f} to {end_s:.1f} s; comparing its images with {len(runs)} other parts")

    evidence = find_changes(part, reference, pair, period_ns=period_ns)
    twin = None
    if evidence.changes:
        names = ", ".join(change.name for change in evidence.changes)
        progress.say(f"found {names}; simulating the twin")
        images, placement = _simulate_twin(
            recorded, part, reference, evidence, pair, period_ns=period_ns, scene=scene, out=out,
            run_plan=run_plan, progress=progress,
        )  # fmt: skip
        seconds_per_trial = None if seconds_per_frame is None else START_S + seconds_per_frame * len(images.t_ns)
        forecast = TrialForecast(progress, seeds, len(images.changes), seconds_per_trial, removed="differences")
        runner = _VariantRunner(images, name, out, run_plan, forecast)
        twin = _twin_trials(runner, placement, frames, seeds=seeds)
    return RecordingExplanation(
        estimator=name,
        is_stand_in=estimator is None and estimate is not None,
        frames=frames,
        changes=evidence.changes,
        twin=twin,
    )


# --- The cost ---


def _cost_sentence(name: str, seeds: Effort, pair: StereoPair, t_ns: Stamps, *, period_ns: int, is_run: bool) -> str:
    """What will be done, and about how long it takes; the trials are forecast again when the differences are known."""
    duration_s = min(WINDOW_S, int(t_ns[-1] - t_ns[0]) / NS_PER_S)
    frame_count = duration_s * NS_PER_S / period_ns
    camera = pair.left.camera
    megapixels = frame_count * camera.width_px * camera.height_px / PIXELS_PER_MEGAPIXEL
    seconds = SECONDS_PER_MEGAPIXEL * megapixels
    on_recording = f"{name} runs on {len(t_ns)} frames; then " if is_run else ""
    return (
        f"{on_recording}the images of the worst {duration_s:.0f} s are compared with others and, if they differ, "
        f"{name} runs in a twin of them, {seeds.most_trials(1)} times for one difference: about {seconds:.0f} s on one "
        "core, and a minute or more for the light of a new place"
    )


# --- The recording and its errors ---


def _required_pair(recorded: Recording) -> StereoPair:
    """The stereo pair of a recording. Raises InputError if it has none that can be rectified."""
    if recorded.rig.right is None or not rectification(recorded.rig):
        raise InputError("a twin needs a stereo pair that can be rectified, and this recording has none")
    return stereo_pair(recorded.rig, "the twin")


def _true_frames(recorded: Recording) -> Trajectory:
    """The true poses of the body at the frames that have one. Raises InputError without ground truth."""
    truth = recorded.truth
    if truth is None:
        raise InputError("the worst part is found by errors, which takes ground truth; give a trajectory with --truth")
    has_pose = (recorded.t_ns >= truth.t_ns[0]) & (recorded.t_ns <= truth.t_ns[-1])
    t_ns = recorded.t_ns[has_pose]
    if len(t_ns) < CHUNK_FRAMES:
        raise InputError(
            f"{CHUNK_FRAMES} frames with a true pose or more are needed, and this recording has {len(t_ns)}"
        )
    return Trajectory(t_ns, poses_at(truth, t_ns))


def _smaller_losses(est: Trajectory, gt: Trajectory, gt_left: Trajectory) -> Array:
    """The errors (N,) of an estimate, which is of the body or of the left camera: whichever it fits better."""
    as_body = frame_losses(gt, est)
    as_left = frame_losses(gt_left, est)
    return as_body if np.median(as_body) <= np.median(as_left) else as_left


def _read_estimate(estimate: Path, recording: Path, t_ns: Stamps) -> Trajectory:
    """An estimate with the stamps of the nearest frames (N,)."""
    times = [recording / TIMES] if (recording / TIMES).is_file() else []
    est = read_one(TrajectorySource(estimate), times=times, any_unit=True).trajectory
    largest_ns = int(np.median(np.diff(t_ns))) // 2
    frame_of_pose = nearest(est.t_ns, t_ns)
    is_close = np.abs(t_ns[frame_of_pose] - est.t_ns) <= largest_ns
    frames, rows = np.unique(frame_of_pose[is_close], return_index=True)
    if not len(frames):
        raise InputError(f"no pose is at the time of a frame of the recording: {estimate}")
    return Trajectory(t_ns[frames], est.T_world_frame[is_close][rows])


@dataclass(frozen=True, slots=True)
class _RecordingTrial:
    """An estimate of a recording, the scale of its alignment, and the seconds that the estimator took for it."""

    est: Trajectory
    scale: float
    seconds: float


def _run_on_recording(
    source: Mapping[str, Any], name: str, out: Path, gt_left: Trajectory, run_plan: PlanRunner
) -> _RecordingTrial:
    """Run an estimator on a recording; the estimate is of the left camera."""
    folder = _run_suite("recording", [source], name, out, run_plan)
    (score,) = folder.scores()
    paths = read_paths(folder, score)
    seconds = estimator_seconds(folder.estimate(score.case, score.estimator, score.repeat))
    est = paths.est
    if not len(est):
        return _RecordingTrial(est, 1.0, seconds)
    known = np.isin(est.t_ns, gt_left.t_ns)
    return _RecordingTrial(Trajectory(est.t_ns[known], est.T_world_frame[known]), paths.scale, seconds)


def _failing_frames(since_start_ns: Stamps, loss: Array, window: FrameRange) -> FailingFrames:
    """The failing frames of the worst part. Raises InputError if there are none."""
    is_outside = np.ones(len(loss), bool)
    is_outside[window.frames] = False
    typical = float(np.median(loss[is_outside] if is_outside.any() else loss))
    limit = failing_loss(typical)
    inside = loss[window.frames]
    if not (inside > limit).any():
        raise InputError(
            f"no frame has an error that is far above the others': the largest is {inside.max():.1%} of the path, and "
            f"typical is {typical:.1%}; ask `vobench twin` about errors that are alike throughout"
        )
    time_s = since_start_ns[window.frames] / NS_PER_S
    return FailingFrames(time_s, inside, typical, inside > limit)


# --- The twin ---


def _simulate_twin(
    recorded: Recording,
    part: RecordingPart,
    reference: Sequence[RecordingPart],
    evidence: ImageEvidence,
    pair: StereoPair,
    *,
    period_ns: int,
    scene: SceneFile,
    out: Path,
    run_plan: PlanRunner,
    progress: Progress,
) -> tuple[TwinImages, Placement]:
    """Simulate the images of the twin of a part, with the camera of the reference and without noise."""
    count = round((int(part.t_ns[-1]) - int(part.t_ns[0])) / period_ns) + 1
    t_ns = part.t_ns[0] + np.arange(count) * period_ns
    shot_runs = [part.shots[first : first + CHUNK_FRAMES] for first in range(0, len(part), CHUNK_FRAMES)]
    fit = fit_pair(shot_runs, pair) or evidence.fit
    path = recorded_path(replace(recorded, t_ns=t_ns), fit)
    wanted = wanted_disparities(path.fit, pair)
    (placement,) = place_path(build(scene, {}), path.T_world_left, pair, wanted, limits=ANY_SCALE)

    write_json(out / PLACE_FILE, {**plain(scene), "scale": scene.scale * placement.scale})
    (out / PATH_FILE).write_text(format_tum(path.in_place(placement)), encoding="utf-8")
    suite: dict[str, Any] = {
        "name": "twin",
        "summary": f"The worst part of a recording, repeated in {scene.name}",
        "scenes": [str((out / PLACE_FILE).resolve())],
        "rigs": {TWIN: _usual_rig(path, evidence)},
        "trajectories": {TWIN: path.trajectory_settings()},
        "estimators": ["stand_still"],
    }
    file = (out / SUITE_FILE).resolve()
    write_json(file, suite)
    usual = [shot.left for run in reference for shot in run.shots]
    gain = 1.0 if evidence.fit is None else evidence.fit.gain
    camera = fitted_camera(file, look_of(evenly_spaced(usual, LOOK_IMAGES)), gain=gain, progress=progress)
    suite["cameras"] = {TWIN: _without_noise(camera)}
    write_json(file, suite)

    folder = run_plan(read_plan(str(file)))
    return _read_twin(folder, recorded, part, evidence, period_ns=period_ns), placement


def _usual_rig(path: RecordedPath, evidence: ImageEvidence) -> dict[str, Any]:
    """The rig with the calibration errors of the rest of the recording."""
    usual = path if evidence.fit is None else replace(path, fit=evidence.fit)
    return usual.rig_settings()


def _without_noise(camera: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a camera whose chip has no noise."""
    chip = {key: camera["chip"][key] for key in ("full_well_e", "response")}
    return {**camera, "chip": chip}


def _read_twin(
    folder: RunFolder, recorded: Recording, part: RecordingPart, evidence: ImageEvidence, *, period_ns: int
) -> TwinImages:
    """The images of the twin, and the frames of the recording that they correspond to."""
    simulated = list(RecordedSequence.open(folder.case(TWIN) / SEQUENCE).frames())
    shots = []
    for shot in simulated:
        assert shot.right is not None
        shots.append((shot.left, shot.right))
    t_ns = np.array([shot.t_ns for shot in simulated], np.int64)
    in_recording_ns = part.t_ns - part.t_ns[0]
    frame = nearest(t_ns, in_recording_ns)
    is_recorded = np.abs(in_recording_ns[frame] - t_ns) < period_ns / 2
    is_recorded[0] = True
    gt_left = read_tum(folder.case(TWIN) / GROUND_TRUTH)
    return TwinImages(
        rig=recorded.rig,
        t_ns=t_ns,
        shots=tuple(shots),
        truth=gt_left.of_mounted(se3.inverse(recorded.rig.T_body_left)),
        frame=frame,
        is_recorded=is_recorded,
        changes=evidence.changes,
        noise_dn=evidence.noise_dn,
    )


# --- Trials in the twin ---


@dataclass(slots=True)
class _VariantRunner:
    """Runs an estimator on variants of a twin, and collects the errors of their frames."""

    images: TwinImages
    estimator: str
    out: Path
    run_plan: PlanRunner
    forecast: TrialForecast
    stages: int = 0
    paths: dict[str, tuple[TwinVariant, TrialPaths]] = field(default_factory=dict)

    def measure(self, variants: Mapping[str, TwinVariant]) -> dict[str, list[Outcome]]:
        """Run the estimator once on each variant."""
        with self.forecast.stage(len(variants)):
            return self._measure(variants)

    def _measure(self, variants: Mapping[str, TwinVariant]) -> dict[str, list[Outcome]]:
        self.stages += 1
        sources = []
        for name, variant in variants.items():
            folder = self.out / SEQUENCES / name
            import_recording(self.images.recording(variant), folder)
            sources.append({"path": str(folder.resolve()), "name": name})
        folder_of_run = _run_suite(f"variants_{self.stages}", sources, self.estimator, self.out, self.run_plan)
        outcomes = {}
        for score in folder_of_run.scores():
            outcomes[score.case] = [read_outcome(folder_of_run, score)]
            self.paths[score.case] = (variants[score.case], read_paths(folder_of_run, score))
        return outcomes

    def mean_loss(self, removed: Removal, time_s: Array) -> Array:
        """The mean error (F,) around times since the first frame, over repeats without some changes."""
        losses = []
        for variant, paths in self.paths.values():
            if variant.removed == removed:
                loss = frame_losses(paths.gt, paths.est, scale=paths.scale)
                losses.append(np.interp(time_s, paths.gt.t_ns / NS_PER_S, loss))
        return np.asarray(np.mean(losses, axis=0), float)


def _twin_trials(runner: "_VariantRunner", placement: Placement, frames: FailingFrames, *, seeds: Effort) -> TwinTrials:
    """Run the estimator in the twin with all changes, without each and without all, and compare."""
    images = runner.images
    nuisances = [Nuisance(change.name, INSTEAD[change.name], lambda case: case) for change in images.changes]
    explanation = explain(
        TwinVariant(seed=0),
        nuisances,
        runner.measure,
        seeds=seeds,
        remove=_without,
    )
    everything = tuple(change.name for change in images.changes)
    since_first_s = frames.time_s - frames.time_s[0]

    # Errors are compared at regular times, also where frames are missing.
    regular_s = images.t_ns / NS_PER_S
    changed = runner.mean_loss((), regular_s)
    unchanged = runner.mean_loss(everything, regular_s)
    recorded = np.interp(regular_s, since_first_s, frames.loss)
    return TwinTrials(
        loss=runner.mean_loss((), since_first_s),
        unchanged_loss=runner.mean_loss(everything, since_first_s),
        coincidence=twin_coincidence(recorded, changed, unchanged, typical=frames.typical),
        explanation=explanation,
        scale=placement.scale,
        misfit=placement.misfit,
    )


def _without(variant: TwinVariant, removed: Removal) -> TwinVariant:
    return replace(variant, removed=removed)


def _seeds(estimator: str, repeats: int) -> Effort:
    manifest = read_manifest(catalog.find("estimator", estimator).path)
    return effort(repeats, is_deterministic=manifest.deterministic)


def _run_suite(
    name: str, sources: Sequence[Mapping[str, Any]], estimator: str, out: Path, run_plan: PlanRunner
) -> RunFolder:
    """Run an estimator on recordings."""
    suite = {
        "name": name,
        "summary": "Recordings for an explanation",
        "source": list(sources),
        "estimators": [estimator],
    }
    file = (out / f"{name}.yaml").resolve()
    write_json(file, suite)
    return run_plan(read_plan(str(file)))
