"""Definitions: every metric of a score has one, and every one is of a metric."""

from dataclasses import fields

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.score import ScoreSettings, score
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
