"""What vobench info prints of a recording."""

import numpy as np
import pytest

from tests.dataset.test_bag import Bag
from vobench.cli import info


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "k none"),
        (0.123456789, "k 0.123457"),
        (3, "k 3"),
        ("a", "k a"),
        ({"x": 1, "y": None}, "k: x 1, y none"),
        ({"x": {"y": 2.0}}, "k: x: y 2"),
    ],
)
def test_an_entry_is_its_key_and_value(value, text):
    assert info._format_entry("k", value) == text


def test_ground_truth_is_counted_and_measured_or_none():
    assert info._format_truth(None) == "none"
    assert info._format_truth({"poses": 3, "path_m": 1.23456, "duration_s": 2.0}) == "3 poses, 1.235 m, 2.000 s"


@pytest.mark.parametrize(
    ("facts", "cells"),
    [
        ({"rate_hz": 20.0, "start_ns": 10**9, "end_ns": 3 * 10**9}, ["20.00", "2.000"]),
        ({"rate_hz": None, "start_ns": None, "end_ns": None}, ["", ""]),
        ({"rate_hz": None, "start_ns": 5, "end_ns": 5}, ["", "0.000"]),
    ],
)
def test_a_topic_without_a_rate_or_a_stamp_has_empty_cells(facts, cells):
    row = info._topic_row({"name": "/cam", "type_name": "image", "count": 4, **facts})
    assert row == ["/cam", "image", "4", *cells]


def test_no_truth_has_no_facts():
    assert info._truth_facts(None) is None


def test_info_prints_topics_cameras_and_truth_of_a_simulated_case(vobench, ran):
    (case,) = (ran / "latest" / "cases").iterdir()
    printed = vobench("info", case / "sequence").out
    assert "form 'vobench', " in printed
    for part in ("left camera: model", "right camera: model", "baseline_m", "ground truth: ", "payload SHA-256: "):
        assert part in printed
    facts = vobench("info", case / "sequence", "--json").json
    assert facts["ground_truth"]["poses"] > 1
    assert set(facts["files"]) == {"sensors.mcap", "truth.mcap"}


def test_the_topics_of_a_bag_without_a_calibration_are_printed_before_the_error(vobench, tmp_path):
    bag = Bag()
    for t_ns in (0, 10**8):
        bag.image("/fisheye/image_raw", t_ns, "optical", np.zeros((4, 6), np.uint8), "mono8")
    path = bag.write(tmp_path / "bag")
    told = vobench("info", path)
    assert told.code == 1
    assert "/fisheye/image_raw" in told.out
    assert "sensor_msgs/msg/Image" in told.out
    assert "no camera_info for /fisheye/image_raw" in told.err
