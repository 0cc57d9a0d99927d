"""A saved run reads back with everything in it, at the right frames and pixels."""

from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from vobench.report import rerun
from vobench.report.blueprint import ESTIMATOR_COLORS
from vobench.report.rerun import application_id, first_failure, rerun_matrix, save_trial
from vobench.sequence import EncodedFrame
from vobench.sequence.picture import BAYER, encode
from vobench.trajectory.trajectory import Trajectory

LEFT, RIGHT = "/world/ground_truth/left", "/world/ground_truth/right"


def rows(path, entity, *, static=False):
    """Every row of an entity as a dict of its columns."""
    chunks = [c for c in RrdReader(path).stream() if c.entity_path == entity and c.is_static == static]
    return [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]


def values(path, entity, column):
    """What a column holds at each frame that has it."""
    return {row["frame"]: row[column] for row in rows(path, entity) if row.get(column) is not None}


def test_every_entity_has_its_rows(rrd):
    found = Counter()
    for chunk in RrdReader(rrd).stream():
        found[chunk.entity_path, chunk.is_static] += chunk.num_rows
    for entity in ("left/image", "left/tracks/estimate", "right/image"):
        assert found[f"/world/ground_truth/{entity}", False] == 12
    assert found["/position_error/estimate", False] == found["/world/error/estimate", False] == 12
    assert found["/status/estimate", False] == 3
    for entity in ("/world/ground_truth/path", "/world/estimate/path", "/summary/estimate", "/status/estimate"):
        assert found[entity, True] == 1


def test_recording_opens_with_a_layout_of_its_own(rrd):
    reader = RrdReader(rrd)
    (layout,) = reader.blueprints()
    assert layout.application_id == reader.recordings()[0].application_id == "vobench-room-stereo-0"
    entities = {chunk.entity_path.split("/")[-1] for chunk in reader.stream(store=layout)}
    assert {"EyeControls3D", "time_panel"} <= entities


def test_an_estimator_has_the_colour_of_its_position_in_the_run(run_viewer, tmp_path):
    first, second = replace(run_viewer, label="a", position=2), replace(run_viewer, label="b", position=0)
    save_trial(tmp_path / "two.rrd", first, second)
    for label, name in (("a", "cyan"), ("b", "blue")):
        (row,) = rows(tmp_path / "two.rrd", f"/world/{label}/path", static=True)
        (color,) = row["LineStrips3D:colors"]
        assert (color >> 24, color >> 16 & 255, color >> 8 & 255) == ESTIMATOR_COLORS[name]


def test_tracks_move_by_half_a_pixel_because_rerun_counts_from_the_corner(rrd):
    points = values(rrd, f"{LEFT}/tracks/estimate", "Points2D:positions")
    assert points[1] == [[0.5, 0.5], [3.5, 2.5], [47.5, 31.5]]
    colors = values(rrd, f"{LEFT}/tracks/estimate", "Points2D:colors")[1]
    assert colors[0] == colors[1] != colors[2]


def test_what_an_estimator_says_in_numbers_and_points_is_there(run_viewer, tmp_path):
    cloud, numbers = np.arange(6.0).reshape(2, 3), np.where(np.arange(12) == 4, np.nan, np.arange(12.0))
    save_trial(tmp_path / "more.rrd", replace(run_viewer, points={2: cloud, 7: cloud[:1]}, stats={"depth_m": numbers}))
    points = values(tmp_path / "more.rrd", "/world/estimate/points", "Points3D:positions")
    assert points == {2: cloud.tolist(), 7: cloud[:1].tolist()}
    depths = values(tmp_path / "more.rrd", "/stats/estimate/depth_m", "Scalars:scalars")
    assert depths == {index: [float(index)] for index in range(12) if index != 4}


def test_frame_without_tracks_clears_those_before_it(rrd):
    points = values(rrd, f"{LEFT}/tracks/estimate", "Points2D:positions")
    assert {frame: len(p) for frame, p in points.items()} == {i: 3 if i in {1, 3} else 0 for i in range(12)}


def test_camera_matrix_projects_to_rerun_pixels(run_viewer):
    camera, point = run_viewer.rig.left, np.array([0.3, -0.2, 2.0])
    projected = rerun_matrix(camera) @ point
    np.testing.assert_allclose(projected[:2] / projected[2], camera.project(point) + 0.5)


def test_pictures_are_small_or_the_png_bytes_of_the_sequence(run_viewer, rrd, tmp_path):
    (blob,) = values(rrd, f"{LEFT}/image", "EncodedImage:blob")[4]
    assert bytes(blob).startswith(b"\xff\xd8")
    save_trial(tmp_path / "png.rrd", run_viewer, form="png")
    (blob,) = values(tmp_path / "png.rrd", f"{LEFT}/image", "EncodedImage:blob")[4]
    assert bytes(blob) == next(iter(run_viewer.frames())).left


def test_a_noisy_pair_of_pictures_takes_sixty_kilobytes_at_most(run_viewer, tmp_path):
    rng = np.random.default_rng(0)
    noisy = [encode(rng.integers(0, 256, (240, 376), dtype=np.uint8), None, "noise") for _ in range(4)]
    frames = [EncodedFrame(i, i * 10**8, "png", noisy[i % 2], noisy[2]) for i in range(12)]
    save_trial(tmp_path / "noisy.rrd", replace(run_viewer, frames=lambda: frames))
    for index in range(2):
        sizes = [
            len(values(tmp_path / "noisy.rrd", f"{s}/image", "EncodedImage:blob")[index][0]) for s in (LEFT, RIGHT)
        ]
        assert sum(sizes) <= 60_000


def test_two_estimators_are_in_one_recording_each_with_entities_and_a_left_picture_of_its_own(run_viewer, tmp_path):
    other = replace(run_viewer, label="other", title="other on room", rotation_deg=np.full(12, 2.0))
    save_trial(tmp_path / "two.rrd", run_viewer, other)
    for label in ("estimate", "other"):
        assert len(values(tmp_path / "two.rrd", f"/position_error/{label}", "Scalars:scalars")) == 12
        assert rows(tmp_path / "two.rrd", f"/world/{label}/path", static=True)
    turned = values(tmp_path / "two.rrd", "/rotation_error/other", "Scalars:scalars")
    assert [turned[index][0] for index in range(12)] == [2.0] * 12
    (layout,) = RrdReader(tmp_path / "two.rrd").blueprints()
    found = [
        row for c in RrdReader(tmp_path / "two.rrd").stream(store=layout) for row in c.to_record_batch().to_pylist()
    ]
    origins = [origin for row in found for origin in row.get("ViewBlueprint:space_origin") or []]
    assert origins.count(LEFT[1:]) == 2


def test_tails_follow_tracks_back_and_epipolar_lines_pass_through_points_that_stand_still(run_viewer, tmp_path):
    camera, gt = run_viewer.rig.left, run_viewer.ground_truth
    ahead = gt.T_world_frame[0] @ [0.2, 0.1, 30.0, 1.0]
    seen = [camera.project((np.linalg.inv(T) @ ahead)[None, :3])[0] for T in gt.T_world_frame]
    tracks = {i: (seen[i][None], np.ones(1, bool)) for i in range(1, 12)}
    steps = {i: seen[i - 1][None] for i in range(1, 12)}
    save_trial(tmp_path / "t.rrd", replace(run_viewer, tracks=tracks, steps=steps))
    tails = values(tmp_path / "t.rrd", f"{LEFT}/tracks/estimate/tails", "LineStrips2D:strips")
    assert [len(tails[i][0]) for i in range(1, 12)] == [2, 3, 4, 5, *[6] * 7]
    np.testing.assert_allclose(tails[7][0], np.array(seen[2:8]) + 0.5, atol=1e-4)
    lines = values(tmp_path / "t.rrd", f"{LEFT}/tracks/estimate/epipolar_lines", "LineStrips2D:strips")
    inside = {
        i
        for i in lines
        if lines[i] and (seen[i] > 1).all() and (seen[i] < [camera.width_px - 2, camera.height_px - 2]).all()
    }
    assert inside
    for index in inside:
        line, point = np.array(lines[index][0]), seen[index] + 0.5
        along = np.diff(line, axis=0)
        share = np.clip(((point - line[:-1]) * along).sum(1) / np.maximum((along**2).sum(1), 1e-12), 0, 1)
        assert np.linalg.norm(line[:-1] + share[:, None] * along - point, axis=1).min() < 0.05


def test_a_window_keeps_its_frames_numbers(run_viewer, tmp_path):
    frames = list(run_viewer.frames())[5:9]
    t_ns, T = run_viewer.ground_truth.t_ns[5:9], run_viewer.ground_truth.T_world_frame[5:9]
    part = Trajectory(t_ns, T)
    shown = replace(
        run_viewer,
        frames=lambda: frames,
        ground_truth=part,
        estimate=part,
        error_m=np.zeros(4),
        statuses=["ok"] * 4,
        tracks={},
        first=5,
    )
    save_trial(tmp_path / "w.rrd", shown)
    assert sorted(values(tmp_path / "w.rrd", LEFT, "Transform3D:translation")) == [5, 6, 7, 8]
    assert sorted(values(tmp_path / "w.rrd", "/position_error/estimate", "Scalars:scalars")) == [5, 6, 7, 8]


def test_estimated_camera_vanishes_while_lost(rrd):
    entity = "/world/estimate/left"
    assert sorted(values(rrd, entity, "Transform3D:translation")) == [0, 1, 2, 3, 4, 7, 8, 9, 10, 11]
    assert sorted(values(rrd, entity, "Clear:is_recursive")) == [5, 6]


def test_estimated_path_and_error_have_a_gap_where_lost(rrd):
    (path,) = rows(rrd, "/world/estimate/path", static=True)
    assert [len(strip) for strip in path["LineStrips3D:strips"]] == [5, 5]
    error = values(rrd, "/position_error/estimate", "Scalars:scalars")
    assert [frame for frame, (value,) in error.items() if np.isnan(value)] == [5, 6]
    lines = values(rrd, "/world/error/estimate", "LineStrips3D:strips")
    assert [frame for frame, strips in lines.items() if not strips] == [5, 6]
    np.testing.assert_allclose(np.diff(lines[0][0], axis=0), [[0.1, 0, 0]], atol=1e-6)


def test_status_has_a_row_where_it_changes(rrd):
    assert values(rrd, "/status/estimate", "StateChange:state") == {0: ["ok"], 5: ["lost"], 7: ["ok"]}


def test_stamps_off_by_rounding_still_find_their_frame(run_viewer, tmp_path):
    shifted = Trajectory(run_viewer.estimate.t_ns + 333, run_viewer.estimate.T_world_frame)
    save_trial(tmp_path / "run.rrd", replace(run_viewer, estimate=shifted))
    assert 7 in values(tmp_path / "run.rrd", "/world/estimate/left", "Transform3D:translation")


@pytest.mark.parametrize("kept", [0, 1])
def test_trial_that_failed_at_once_can_still_be_looked_at(run_viewer, tmp_path, kept):
    path = tmp_path / "run.rrd"
    estimate = Trajectory(run_viewer.estimate.t_ns[:kept], run_viewer.estimate.T_world_frame[:kept])
    error_m, statuses = np.full(12, np.nan), ["init", *["no output"] * 11]
    error_m[:kept] = 0.0
    failed = replace(run_viewer, estimate=estimate, error_m=error_m, statuses=statuses, tracks={})
    save_trial(path, failed)
    assert values(path, "/status/estimate", "StateChange:state") == {0: ["init"], 1: ["no output"]}
    assert len(values(path, f"{LEFT}/image", "EncodedImage:blob")) == 12
    assert list(tmp_path.iterdir()) == [path]


def test_saving_twice_holds_the_same(run_viewer, rrd, tmp_path):
    save_trial(tmp_path / "again.rrd", run_viewer)
    for entity in (f"{LEFT}/tracks/estimate", LEFT, "/position_error/estimate"):
        again, before = rows(tmp_path / "again.rrd", entity), rows(rrd, entity)
        for row in (*again, *before):
            row.pop("rerun.controls.RowId")
        np.testing.assert_equal(again, before)


def test_first_failure_is_framed_within_the_run():
    assert first_failure(["ok"] * 50) is None
    assert first_failure(["ok"] * 40 + ["lost"] + ["ok"] * 40) == (25, 55)
    assert first_failure(["init", "lost"]) == (0, 1)


def test_application_id_needs_no_mending_by_rerun():
    assert application_id("room/low light × stereo_vo × 0") == "vobench-room-low-light-stereo_vo-0"


def test_right_camera_stands_beside_the_left(run_viewer, rrd):
    left = values(rrd, LEFT, "Transform3D:translation")
    right = values(rrd, "/world/ground_truth/right", "Transform3D:translation")
    gap = np.array([right[i][0] for i in range(12)]) - np.array([left[i][0] for i in range(12)])
    np.testing.assert_allclose(np.linalg.norm(gap, axis=1), run_viewer.rig.baseline_m, atol=1e-6)
    axis = run_viewer.ground_truth.T_world_frame[:, :3, 0]
    np.testing.assert_allclose(gap, run_viewer.rig.baseline_m * axis, atol=1e-6)


@pytest.mark.parametrize(("error_m", "shown", "unit"), [(0.05, 50.0, "mm"), (2.0, 200.0, "cm"), (7.0, 7.0, "m")])
def test_errors_are_in_the_unit_in_which_they_have_few_digits(run_viewer, tmp_path, error_m, shown, unit):
    save_trial(tmp_path / "unit.rrd", replace(run_viewer, error_m=np.full(12, error_m)))
    errors = values(tmp_path / "unit.rrd", "/position_error/estimate", "Scalars:scalars")
    assert errors[3] == [pytest.approx(shown)]
    (style,) = rows(tmp_path / "unit.rrd", "/position_error/estimate", static=True)
    assert style["SeriesLines:names"] == [f"estimate ({unit})"]


@pytest.mark.parametrize(("error_m", "unit"), [(0.1, "cm"), (5.0, "m")])
def test_a_unit_changes_at_a_tenth_of_a_metre_and_at_five(run_viewer, error_m, unit):
    assert rerun._unit([replace(run_viewer, error_m=np.array([error_m, np.nan]))])[1] == unit


def test_a_mosaic_is_shown_in_colour(run_viewer, tmp_path):
    mosaic = np.zeros((32, 48), np.uint8)
    mosaic[::2, ::2] = 200  # red, in a mosaic that begins with it
    png = encode(mosaic, None, "mosaic", colour=BAYER)
    frames = [EncodedFrame(i, i * 10**8, "png", png, None, BAYER) for i in range(12)]
    for form in ("png", "jpeg"):
        save_trial(tmp_path / f"{form}.rrd", replace(run_viewer, frames=lambda: frames), form=form)
        (blob,) = values(tmp_path / f"{form}.rrd", f"{LEFT}/image", "EncodedImage:blob")[4]
        picture = cv2.imdecode(np.frombuffer(bytes(blob), np.uint8), cv2.IMREAD_COLOR)
        blue, green, red = picture[8:-8, 8:-8].reshape(-1, 3).mean(0)
        assert red > 100 > 2 * max(blue, green)


def test_a_recording_opens_at_the_first_failure_of_any_trial_or_where_one_goes_wrong(run_viewer):
    fine = replace(run_viewer, statuses=["ok"] * 60, first=100)
    failed = replace(fine, statuses=["ok"] * 40 + ["lost"] + ["ok"] * 19)
    wrong = replace(fine, wrong_at=50)
    assert rerun._replayed_frames([fine]) is None
    assert rerun._replayed_frames([fine, failed]) == (125, 155)
    assert rerun._replayed_frames([fine, wrong]) == (135, 159)
    assert rerun._replayed_frames([wrong, failed]) == (125, 155)


def test_a_layout_has_a_plot_of_numbers_and_of_costs_where_there_are_some(run_viewer, tmp_path):
    def names(trial):
        save_trial(tmp_path / "it.rrd", trial)
        (layout,) = RrdReader(tmp_path / "it.rrd").blueprints()
        chunks = RrdReader(tmp_path / "it.rrd").stream(store=layout)
        found = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]
        return {name for row in found for name in row.get("ViewBlueprint:display_name") or []}

    numbers = {"a": np.arange(12.0)}
    assert "Numbers reported by the estimator" in names(replace(run_viewer, stats=numbers))
    assert "Latency (ms), exposure (ms), gain (dB)" in names(replace(run_viewer, costs=numbers))
    plain = names(run_viewer)
    assert "Right" in plain
    assert not {"Numbers reported by the estimator", "Latency (ms), exposure (ms), gain (dB)"} & plain
    assert "Truth green, estimate blue, error red" in plain


def test_each_status_has_its_colour_and_an_unknown_one_is_grey(run_viewer, tmp_path):
    save_trial(tmp_path / "it.rrd", replace(run_viewer, statuses=["odd", *["ok"] * 11]))
    (row,) = rows(tmp_path / "it.rrd", "/status/estimate", static=True)
    named = dict(zip(row["StateConfiguration:values"], row["StateConfiguration:colors"], strict=True))
    colors = {name: (value >> 24, value >> 16 & 255, value >> 8 & 255) for name, value in named.items()}
    assert colors["odd"] == (128, 128, 128)
    assert colors["ok"] == (60, 200, 90)
    assert colors["lost"] == (235, 60, 60)
    assert list(colors) == ["init", "ok", "stationary", "degraded", "lost", "no output", "odd"]


def test_the_quality_of_pictures_that_never_fit_ends_at_the_worst(monkeypatch):
    qualities = []

    def recoded(encoded, *, frame, form, quality):
        qualities.append(quality)
        return encoded

    monkeypatch.setattr(rerun, "_recoded", recoded)
    monkeypatch.setattr(rerun, "FRAME_BYTES", 1)
    picture = encode(np.zeros((4, 4), np.uint8), None, "black")
    stream = rr.RecordingStream("quality")
    rerun._log_pictures(stream, [EncodedFrame(0, 0, "png", picture, None)], "jpeg")
    assert qualities[0] == rerun.BEST_QUALITY
    assert min(qualities) == qualities[-1] == rerun.WORST_QUALITY
