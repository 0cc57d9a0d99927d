"""How two trajectories are read, by the options of the command line."""

from pathlib import Path

from vobench.cli.trajectory_option import TrajectoryOptions
from vobench.runner.trajectory_pair import TrajectorySource


def test_options_of_truth_and_estimate_do_not_mix():
    options = TrajectoryOptions(gt_topic="/gt", est_topic="/est", gt_as=["ms"], est_as=["wxyz", "inverse"])
    assert options.truth(Path("a")) == TrajectorySource(Path("a"), "/gt", ("ms",))
    assert options.estimate(Path("b")) == TrajectorySource(Path("b"), "/est", ("wxyz", "inverse"))


def test_without_options_a_file_is_read_as_it_is():
    assert TrajectoryOptions().truth(Path("a")) == TrajectorySource(Path("a"), None, ())
    assert TrajectoryOptions().time_files == []
    assert TrajectoryOptions(times=[Path("t")]).time_files == [Path("t")]
