"""The names that a notebook uses, the page that shows them, and what they look like."""

import re
from pathlib import Path

import numpy as np
import pytest

import vobench
from vobench.errors import InputError
from vobench.metric.comparison import compare
from vobench.sequence import Sequence
from vobench.trajectory.tum import format_tum

PAGE = Path(__file__).parents[2] / "docs" / "python.md"
LINE = 120


@pytest.fixture
def case(ran):
    """The folder of a case, in a run of a suite that is called as the page has it."""
    return next((ran.rename(ran.with_name("quickstart")) / "latest" / "cases").iterdir())


def moving(n=60):
    """A trajectory (N,) that turns in all directions, which leaves nothing open."""
    t_ns = np.arange(n, dtype=np.int64) * 10**8
    s = np.linspace(0, 4, n)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, 3] = np.stack([s, np.sin(s), np.cos(2 * s)], -1)
    return vobench.Trajectory(t_ns, poses)


def test_the_example_of_the_page_runs_as_it_stands(case, capsys):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 1
    exec(compile(blocks[0], str(PAGE), "exec"), {})
    printed = capsys.readouterr().out
    assert all(word in printed for word in ("Trajectory(", "Score(", "Sequence(", "ate_trans", "wheel_odometry"))


def test_every_name_of_the_package_is_on_the_page_and_there():
    page = PAGE.read_text(encoding="utf-8")
    for name in set(vobench.__all__) - {"__version__"}:
        assert re.search(rf"^- .*`{name}\b", page, re.MULTILINE), name
        assert getattr(vobench, name) is not None
        assert name in dir(vobench)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'scroe'"):
        _ = vobench.scroe


def test_files_and_trajectories_score_alike(tmp_path):
    path = moving()
    (tmp_path / "path.tum").write_text(format_tum(path))
    shifted = vobench.Trajectory(path.t_ns, path.T_world_frame.copy())
    shifted.T_world_frame[::2, 0, 3] += 0.1
    by_file = vobench.score(str(tmp_path / "path.tum"), shifted)
    assert by_file.as_dict() == vobench.score(tmp_path / "path.tum", shifted).as_dict()
    np.testing.assert_allclose(
        by_file.to_frame()["rmse"].astype(float), vobench.score(path, shifted).to_frame()["rmse"], rtol=1e-12
    )


def test_the_frame_of_a_score_has_every_statistic_of_every_metric():
    path = moving()
    scored = vobench.score(path, path, settings=vobench.ScoreSettings(full=True))
    frame = scored.to_frame()
    assert list(frame.index) == [metric.name for metric in scored.metrics]
    for metric in scored.metrics:
        expected = metric.as_dict()
        del expected["name"]
        assert frame.loc[metric.name].to_dict() == expected


def test_files_without_stamps_pair_by_row_and_say_so_but_need_times_alone(tmp_path):
    rows = "".join(f"1 0 0 {x} 0 1 0 {x * x} 0 0 1 0\n" for x in np.linspace(0, 2, 20))
    (tmp_path / "gt.txt").write_text(rows)
    assert "paired by row" in vobench.score(tmp_path / "gt.txt", tmp_path / "gt.txt").warnings[0]
    with pytest.raises(InputError, match="no stamps"):
        vobench.read_trajectory(tmp_path / "gt.txt")
    (tmp_path / "times.txt").write_text("".join(f"{k / 10}\n" for k in range(20)))
    read = vobench.read_trajectory(tmp_path / "gt.txt", times=tmp_path / "times.txt")
    assert read.t_ns[-1] == 1_900_000_000


def test_words_of_the_command_line_are_known_from_python(tmp_path):
    (tmp_path / "ns.tum").write_text("0 0 0 0 1 0 0 0\n100 1 0 0 1 0 0 0\n")
    read = vobench.read_trajectory(tmp_path / "ns.tum", read_as=("ns", "wxyz"))
    assert read.t_ns.tolist() == [0, 100]
    np.testing.assert_array_equal(read.T_world_frame[:, :3, :3], np.tile(np.eye(3), (2, 1, 1)))


def test_a_diagnosis_of_trajectories_finds_what_theirs_of_files_does(tmp_path):
    path = moving()
    large = vobench.Trajectory(path.t_ns, path.T_world_frame.copy())
    large.T_world_frame[:, :3, 3] *= 3
    for name, trajectory in (("gt.tum", path), ("est.tum", large)):
        (tmp_path / name).write_text(format_tum(trajectory))
    mixed = vobench.diagnose(path, tmp_path / "est.tum")
    assert [f.fault for f in vobench.diagnose(path, large)] == ["scale"]
    assert [f.fault for f in mixed] == ["scale"]
    assert [f.fault for f in vobench.diagnose(tmp_path / "gt.tum", tmp_path / "est.tum")] == ["scale"]


def test_what_is_shown_in_a_notebook_fits_a_line(case):
    path, still = moving(), moving(1)
    large = vobench.Trajectory(path.t_ns, path.T_world_frame.copy())
    large.T_world_frame[:, :3, 3] *= 3
    shown = [
        path,
        still,
        vobench.score(path, path),
        vobench.score(still, still),
        compare(path, path),
        vobench.read_sequence(case / "sequence"),
        *vobench.diagnose(path, large),
    ]
    for thing in shown:
        assert repr(thing).startswith(f"{type(thing).__name__}(")
        assert len(repr(thing)) < LINE
        assert "\n" not in repr(thing)
    assert isinstance(shown[5], Sequence)
    assert "60 poses from 0.000 s to 5.900 s" in repr(path)
