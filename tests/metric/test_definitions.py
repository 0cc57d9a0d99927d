"""Definitions: every metric of a score has one, and every one is of a metric."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.metric.comparison import POSES, MetricDefinition
from vobench.metric.definitions import DEFINITIONS, identity
from vobench.metric.score import score
from vobench.metric.settings import ScoreSettings, settled
from vobench.trajectory.trajectory import Trajectory

N = 200
S = np.linspace(0, 2 * np.pi, N)
T = se3.transform(se3.rotation_z(S), np.stack([np.sin(S), np.sin(2 * S), 0.1 * np.sin(3 * S)], -1))
PATH = Trajectory(np.arange(N) * 10**8, T)
OF_RECORDINGS = {"coverage", "lost_aware"}
COVARIANCE = np.broadcast_to(np.eye(6), (N, 6, 6))


@pytest.mark.parametrize("full", [False, True])
def test_a_score_holds_the_defined_metrics_with_their_units_and_names(full):
    found = score(PATH, PATH, settings=ScoreSettings(full=full), covariance=COVARIANCE if full else None)
    wanted = [d for d in DEFINITIONS.values() if full or not d.full]
    assert {m.name for m in found.metrics} == {d.id for d in wanted} - OF_RECORDINGS
    for metric in found.metrics:
        defined = DEFINITIONS[metric.name]
        assert metric.unit == defined.unit
        assert metric.id.startswith(f"{defined.identity}.{defined.headline}[")


@pytest.mark.parametrize("name", sorted(DEFINITIONS))
def test_a_definition_is_complete_and_names_settings_that_there_are(name):
    defined = DEFINITIONS[name]
    assert defined.id == name
    assert all((defined.title, defined.unit, defined.formula, defined.source, defined.blind))
    assert set(defined.settings) <= {field.name for field in fields(ScoreSettings)}


LENGTHS = st.floats(1e-6, 1e6)
COMMON = {
    "alignment": st.sampled_from(["none", "origin", "se3", "sim3", "scale", "yaw"]),
    "align_n": st.none() | st.integers(1, 10**6),
    "association": st.sampled_from(["nearest", "evo", "interpolate", "greedy", "in_order"]),
    "max_diff_ns": st.integers(0, 10**15),
    "offset_ns": st.integers(-(10**18), 10**18),
    "project": st.sampled_from([None, "xy", "xz", "yz"]),
    "std_ddof": st.integers(0, 1),
}
OF_RPE = {
    "rpe_delta": st.integers(1, 10**6).map(float),
    "rpe_unit": st.sampled_from(["f", "m", "s"]),
    "rpe_all_pairs": st.booleans(),
    "rpe_pairs_from": st.sampled_from(["gt", "est"]),
    "rpe_rule": st.sampled_from(["spanning", "evo"]),
}
OF_SEGMENTS = {
    "segment_lengths_m": st.lists(LENGTHS, min_size=1, max_size=9).map(tuple),
    "segment_step_frames": st.integers(1, 10**6),
    "segment_precision": st.sampled_from(["float64", "devkit"]),
    "segment_mean": st.sampled_from(["micro", "macro"]),
}
FAMILIES = [
    ("ate_trans", {}),
    ("rpe_rot", OF_RPE),
    ("kitti_t_rel", OF_SEGMENTS),
    ("lost_aware", {"fail_ratio": st.floats(1e-3, 1e3), "coverage_of": st.sampled_from(["auto", "frames"])}),
    ("rel_yaw", {"relative_rule": st.sampled_from(["rpg", "openvins"])}),
]


@pytest.mark.parametrize(("metric", "own"), FAMILIES)
@given(data=st.data(), n=st.integers(0, 10**9), of=st.integers(0, 10**9))
def test_what_differs_in_a_setting_that_shapes_a_number_differs_in_its_identity(metric, own, data, n, of):
    drawn = COMMON | own
    settings = ScoreSettings(**{name: data.draw(values) for name, values in drawn.items()})
    name = data.draw(st.sampled_from(sorted(drawn)))
    other = replace(settings, **{name: data.draw(drawn[name])})
    first, second = (identity(DEFINITIONS[metric], one, n=n, of=of) for one in (settings, other))
    assert (first == second) == (settings == other)
    assert identity(DEFINITIONS[metric], settings, n=n + 1, of=of) != first


def test_an_identity_looks_like_this():
    settings = replace(ScoreSettings(), align_n=100, offset_ns=-1_500_000)
    text = "ate.trans.rmse[align=se3/first100; assoc=nearest<=10ms; offset=-1.5ms; n=785/798]"
    assert identity(DEFINITIONS["ate_trans"], settings, n=785, of=798) == text
    assert identity(DEFINITIONS["ate_trans"], ScoreSettings(), n=785, of=798) == (
        "ate.trans.rmse[align=se3; assoc=nearest<=10ms; n=785/798]"
    )


def test_segments_suit_the_path_unless_they_are_given():
    assert settled(ScoreSettings(), 3.0).segment_lengths_m == (0.5, 1.0, 1.5, 2.0)
    assert settled(ScoreSettings(), 100.0).segment_lengths_m[-1] == 40.0
    kitti = settled(ScoreSettings(), 3000.0)
    assert (kitti.segment_lengths_m[-1], kitti.segment_step_frames) == (800.0, 10)
    given_m = settled(ScoreSettings(segment_lengths_m=(7.0,), segment_step_frames=3), 3000.0)
    assert (given_m.segment_lengths_m, given_m.segment_step_frames) == ((7.0,), 3)


def test_a_metric_from_outside_is_one_definition():
    height = MetricDefinition(
        "ate_height",
        "error of the height alone",
        "m",
        "|z of p_est - p_gt|",
        "a test",
        POSES,
        "errors along the floor",
        full=False,
        measure=lambda of: np.abs(of.T_aligned[:, 2, 3] - of.matched.T_gt[:, 2, 3]),
    )
    raised = Trajectory(PATH.t_ns, PATH.T_world_frame.copy())
    raised.T_world_frame[:, 2, 3] += 0.25
    found = score(PATH, raised, settings=ScoreSettings(alignment="none"), metrics=[*DEFINITIONS.values(), height])
    metric = found.metric("ate_height")
    assert (metric.unit, metric.statistics.n, metric.statistics.rmse) == ("m", N, pytest.approx(0.25))
    assert metric.id == f"ate.height.rmse[align=none; assoc=nearest<=10ms; n={N}/{N}]"
