"""Files scored one by one and together."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import AlignmentError, InputError
from vobench.metric.score import score
from vobench.metric.settings import ScoreSettings
from vobench.runner.consistency import format_covariances
from vobench.runner.score_files import FilePair, read_pair_list, score_files
from vobench.runner.trajectory_pair import TrajectorySource
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum, parse_tum


def path_with(noise_m, n=80, seed=1):
    """A path that turns in all directions, with noise on its positions."""
    s = np.linspace(0, 4, n)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, 3] = np.stack([s, np.sin(s), np.cos(2 * s)], -1)
    poses[:, :3, 3] += noise_m * np.random.default_rng(seed).normal(size=(n, 3))
    return Trajectory(np.arange(n, dtype=np.int64) * 10**8, poses)


@pytest.fixture
def pair(tmp_path):
    """Writes an estimate of one path, and gives the pair of their files."""
    (tmp_path / "gt.tum").write_text(format_tum(path_with(0.0)))

    def write(name, noise_m=0.02, trajectory=None):
        (tmp_path / name).write_text(format_tum(trajectory or path_with(noise_m, seed=len(name))))
        return FilePair(TrajectorySource(tmp_path / "gt.tum"), TrajectorySource(tmp_path / name))

    return write


def test_one_pair_scores_as_its_trajectories_do_and_has_no_pool(pair):
    asked = pair("est.tum")
    found = score_files([asked])
    gt, est = (parse_tum(source.path.read_text(), name="") for source in (asked.gt, asked.est))
    assert found.pool is None
    assert found.scores[0].as_dict() == score(gt, est).as_dict()
    assert found.as_dict()["metrics"] == score(gt, est).as_dict()["metrics"]


def test_of_several_pairs_all_errors_are_pooled(pair):
    found = score_files([pair("one.tum", 0.01), pair("other.tum", 0.03)])
    squares = [each.metric("ate_trans").statistics for each in found.scores]
    expected = np.sqrt(sum(each.sse for each in squares) / sum(each.n for each in squares))
    pooled = next(metric for metric in found.pool.metrics if metric.name == "ate_trans")
    assert pooled.statistics.rmse == pytest.approx(expected)
    content = found.as_dict()
    assert [part["est"].rpartition("/")[2] for part in content["sequences"]] == ["one.tum", "other.tum"]
    assert content["pooled"]["metrics"][0] == found.pool.metrics[0].as_dict()


def test_estimates_that_are_compared_are_not_pooled(pair):
    found = score_files([pair("one.tum", 0.01), pair("other.tum", 0.03)], pool=False)
    assert found.pool is None
    assert list(found.as_dict()) == ["gt", "estimates"]
    frame = found.to_frame()
    assert frame.columns[0] == "estimate"
    assert len(frame) == sum(len(each.metrics) for each in found.scores)


def test_the_table_has_every_metric_of_every_sequence_and_of_all_together(pair):
    found = score_files([pair("one.tum", 0.01), pair("other.tum", 0.03)])
    frame = found.to_frame()
    ates = frame[frame["name"] == "ate_trans"].set_index("sequence")
    assert len(ates) == 3
    assert ates.loc["pooled", "n"] == 160
    assert ates.iloc[0]["rmse"] < ates.loc["pooled", "rmse"] < ates.iloc[1]["rmse"]
    assert len(score_files([pair("one.tum")]).to_frame()) == len(found.scores[0].metrics)


def test_covariances_that_an_estimate_states_are_compared_with_its_errors(pair, tmp_path):
    plain = pair("est.tum", 0.02)
    t_ns = path_with(0.0).t_ns.tolist()
    (tmp_path / "cov").write_text(format_covariances((t, np.eye(6) * 4e-4) for t in t_ns))
    stated = FilePair(plain.gt, plain.est, tmp_path / "cov")
    (scored,) = score_files([stated]).pairs
    assert scored.consistency.poses == 80
    assert scored.as_dict()["consistency"]["sentence"] == scored.consistency.sentence
    assert "consistency" not in score_files([plain]).as_dict()


def test_files_without_stamps_say_how_they_were_paired_before_all_other_warnings(tmp_path):
    rows = "".join(f"1 0 0 {x} 0 1 0 {x * x} 0 0 1 0\n" for x in np.linspace(0, 2, 20))
    (tmp_path / "kitti.txt").write_text(rows)
    source = TrajectorySource(tmp_path / "kitti.txt")
    content = score_files([FilePair(source, source)]).as_dict()
    assert "paired by row" in content["warnings"][0]
    with pytest.raises(InputError, match="a delta in seconds needs stamps"):
        score_files([FilePair(source, source)], settings=ScoreSettings(rpe_unit="s"))
    (tmp_path / "times").write_text("".join(f"{k / 10}\n" for k in range(20)))
    stamped = score_files([FilePair(source, source)], times=[tmp_path / "times"])
    assert not any("paired by" in warning for warning in stamped.as_dict()["warnings"])


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_a_statistic_that_is_not_finite_is_refused(pair, value):
    found = score_files([pair("est.tum")])
    (scored,) = found.pairs
    first, *others = scored.score.metrics
    broken = replace(first, statistics=replace(first.statistics, std=value))
    broken_score = replace(scored.score, metrics=(broken, *others))
    with pytest.raises(AlignmentError, match=f"the std of ate_trans is {value}: positions are too far apart"):
        replace(found, pairs=(replace(scored, score=broken_score),)).require_finite()


def test_no_pair_is_refused():
    with pytest.raises(InputError, match="one pair of files or more"):
        score_files([])


def test_a_list_names_pairs_from_its_own_folder(tmp_path):
    (tmp_path / "list").write_text("# truth, estimate\na.tum 'b c.tum'\n\n/d.tum e.tum # last\n")
    assert read_pair_list(tmp_path / "list") == [
        (tmp_path / "a.tum", tmp_path / "b c.tum"),
        (type(tmp_path)("/d.tum"), tmp_path / "e.tum"),
    ]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a b\nc\n", "list:2: a line should name a truth and an estimate, but has 1 words"),
        ("# none\n", "no line names"),
    ],
)
def test_a_list_that_names_no_pairs_is_refused(tmp_path, text, sentence):
    (tmp_path / "list").write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_pair_list(tmp_path / "list")
