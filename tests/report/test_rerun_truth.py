"""The ground truth of pixels in a recording: the same numbers, with names and colours."""

from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from vobench.report.rerun import save_trial
from vobench.report.rerun_truth import TruthView
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames
from vobench.sequence import StereoTruth

COUNT = 3


def make_truth(index: int) -> TruthFrame:
    rng = np.random.default_rng(index)
    values = {}
    for name, channel in CHANNELS.items():
        shape = channel.shape(32, 48)
        values[name] = rng.uniform(0, 3, shape).astype(channel.dtype)
    values["depth"][0] = np.nan
    return TruthFrame(**values)


@pytest.fixture(scope="module")
def view() -> TruthView:
    names = TruthNames(("", "floor", "cart"), ("", "oak", "glass"))
    frames = [StereoTruth(i, i * 33_000_000, make_truth(i), make_truth(i + 100)) for i in range(COUNT)]
    return TruthView(tuple(CHANNELS), names, lambda: frames)


@pytest.fixture(scope="module")
def path(run_viewer, view, tmp_path_factory):
    path = tmp_path_factory.mktemp("truth") / "run.rrd"
    save_trial(path, replace(run_viewer, truth=view))
    return path


def rows_truth(path, entity, *, static=False):
    chunks = [c for c in RrdReader(path).stream() if c.entity_path == entity and c.is_static == static]
    return [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]


def test_depth_is_the_same_numbers_on_the_frames_time_line(path, view):
    for side in ("left", "right"):
        found = rows_truth(path, f"/truth/{side}/depth")
        assert [row["frame"] for row in found] == list(range(COUNT))
        for row, frame in zip(found, view.frames(), strict=True):
            depth = np.frombuffer(bytes(row["DepthImage:buffer"][0]), np.float32).reshape(32, 48)
            np.testing.assert_array_equal(depth, getattr(frame, side).depth)


@pytest.mark.parametrize("channel", ["instance", "material", "shadow", "occlusion", "mirror", "moving"])
def test_ids_counts_and_masks_are_classes_with_names(path, view, channel):
    (last,) = [row for row in rows_truth(path, f"/truth/left/{channel}") if row["frame"] == COUNT - 1]
    classes = np.frombuffer(bytes(last["SegmentationImage:buffer"][0]), np.uint16).reshape(32, 48)
    np.testing.assert_array_equal(classes, list(view.frames())[-1].left.channels()[channel].astype(np.uint16))
    (context,) = rows_truth(path, f"/truth/left/{channel}", static=True)
    text = str(context)
    named = {"instance": "floor", "material": "glass", "shadow": "one light hidden"}
    assert named.get(channel, channel) in text


@pytest.mark.parametrize("channel", ["flow", "normals"])
def test_directions_are_colours(path, channel):
    buffers = [bytes(row["Image:buffer"][0]) for row in rows_truth(path, f"/truth/right/{channel}")]
    assert [len(b) for b in buffers] == [32 * 48 * 3] * COUNT
    assert len(set(buffers)) == COUNT


def test_layout_has_a_view_for_each_channel_of_each_camera(path, rrd):
    def origins(of):
        reader = RrdReader(of)
        (layout,) = reader.blueprints()
        found = [row for c in reader.stream(store=layout) for row in c.to_record_batch().to_pylist()]
        return [origin for row in found for origin in row.get("ViewBlueprint:space_origin") or []]

    asked = {f"truth/{side}/{channel}" for side in ("left", "right") for channel in CHANNELS}
    assert {origin for origin in origins(path) if origin.startswith("truth/")} == asked
    assert not asked & set(origins(rrd))


def test_run_without_truth_has_no_entity_of_it(rrd):
    assert not [c for c in RrdReader(rrd).stream() if c.entity_path.startswith("/truth")]
