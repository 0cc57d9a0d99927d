"""Definitions: every metric of a score has one, and every one is of a metric."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import InputError, SettingError
from vobench.geometry import se3
from vobench.metric.comparison import POSES, MetricDefinition
from vobench.metric.definitions import DEFINITIONS, identity, parse_identity
from vobench.metric.score import score
from vobench.metric.settings import LIKE, ScoreSettings, settled
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
def test_an_identity_reads_back_as_the_settings_it_was_made_of(metric, own, data, n, of):
    settings = ScoreSettings(**{name: data.draw(values) for name, values in (COMMON | own).items()})
    defined = DEFINITIONS[metric]
    back = parse_identity(identity(defined, settings, n=n, of=of))
    assert back.metric == f"{defined.identity}.{defined.headline}"
    assert (back.settings, back.n, back.of) == (settings, n, of)


@pytest.mark.parametrize("like", sorted(LIKE))
def test_every_metric_of_every_tool_has_an_identity_that_reads_back(like):
    for defined in DEFINITIONS.values():
        text = identity(defined, settled(LIKE[like], 10.0), n=7, of=9)
        back = parse_identity(text)
        assert identity(defined, back.settings, n=back.n, of=back.of) == text


def test_an_identity_looks_like_this():
    settings = replace(ScoreSettings(), align_n=100, offset_ns=-1_500_000)
    text = "ate.trans.rmse[align=se3/first100; assoc=nearest<=10ms; offset=-1.5ms; n=785/798]"
    assert identity(DEFINITIONS["ate_trans"], settings, n=785, of=798) == text
    assert identity(DEFINITIONS["ate_trans"], ScoreSettings(), n=785, of=798) == (
        "ate.trans.rmse[align=se3; assoc=nearest<=10ms; n=785/798]"
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "ate.trans.rmse",
        "ate.trans.rmse[]",
        "ate.trans.rmse[align=se3; assoc=nearest<=10ms]",
        "ate.trans.rmse[align=se3; assoc=nearest<=10ms; n=785]",
        "ate.trans.rmse[align=se3; assoc=nearest<=ten; n=1/2]",
        "ate.trans.rmse[colour=blue; n=1/2]",
        "rpe.trans.rmse[delta=f; n=1/2]",
        "rpe.trans.rmse[pairs=some/gt; n=1/2]",
        "ate.trans.rmse[align=se3; n=1/2] and more",
    ],
)
def test_what_is_no_identity_is_an_error_of_ours(text):
    with pytest.raises(InputError, match="identity"):
        parse_identity(text)


def test_settings_that_measure_nothing_are_refused_in_identities_too():
    with pytest.raises(SettingError, match="alignment: should be 'none', 'origin', 'se3'"):
        parse_identity("ate.trans.rmse[align=so3; assoc=nearest<=10ms; n=1/2]")


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
