"""Every metric is found by its name and by the identity of its scores."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import UnknownNameError
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.score import score
from vobench.metric.settings import ScoreSettings
from vobench.runner import metric_catalog
from vobench.runner.metric_catalog import all_metrics, find_metric
from vobench.trajectory.trajectory import Trajectory


def test_every_metric_is_found_by_its_name_in_any_case():
    for metric in all_metrics():
        assert find_metric(metric.id) is metric
        assert find_metric(metric.id.upper()) is metric


def test_the_identity_of_each_score_leads_to_its_metric():
    s = np.linspace(0, 4, 60)
    poses = np.tile(np.eye(4), (60, 1, 1))
    poses[:, :3, 3] = np.stack([s, np.sin(s), np.cos(2 * s)], -1)
    path = Trajectory(np.arange(60, dtype=np.int64) * 10**8, poses)
    metrics = score(path, path, settings=ScoreSettings(full=True)).metrics
    assert len(metrics) > 5
    for metric in metrics:
        assert find_metric(metric.id).id == metric.name


def test_a_misspelt_name_gets_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'ate_trans'"):
        find_metric("ate_tran")


def test_an_installed_metric_comes_after_ours_and_cannot_take_the_name_of_one(monkeypatch):
    ours = DEFINITIONS["ate_trans"]
    mine = replace(ours, id="mine")

    class Point:
        def __init__(self, metric):
            self.load = lambda: metric

    monkeypatch.setattr(metric_catalog, "entry_points", lambda group: [Point(mine), Point(replace(ours, title="Fake"))])
    assert all_metrics()[-1] is mine
    assert find_metric("ate_trans") is ours
