from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vobench.dataset.export_trajectory import TRAJECTORY_FORMS, export_trajectory
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.trajectory.form import parse_any
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.unstamped import parse_times


def random_path(seed: int, count: int, start_ns: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    t_ns = start_ns + np.cumsum(rng.integers(1, 10**8, count))
    R = Rotation.from_rotvec(rng.normal(size=(count, 3)) * rng.choice([1e-9, 1.0, 10.0])).as_matrix()
    return Trajectory(t_ns, se3.transform(R, rng.normal(size=(count, 3)) * rng.choice([1e-6, 1.0, 1e4])))


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 30),
    start_ns=st.sampled_from([0, 1_403_636_579_763_555_584, 10**18]),
    form=st.sampled_from(TRAJECTORY_FORMS),
)
def test_every_form_returns_stamps_exactly_and_poses_to_1e_9(
    seed: int, count: int, start_ns: int, form: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path, file = random_path(seed, count, start_ns), tmp_path_factory.mktemp("path") / "path.txt"
    written = export_trajectory(path, file, form)
    found = parse_any(file.read_text(encoding="utf-8"), name="path")
    stamps = parse_times(written[1].read_text(encoding="utf-8"), name="times") if form == "kitti" else found.t_ns
    np.testing.assert_array_equal(stamps, path.t_ns)
    scale = max(1.0, float(np.abs(path.positions_m).max()))
    np.testing.assert_allclose(found.T, path.T_world_frame, atol=1e-9 * scale, rtol=0)
    np.testing.assert_array_equal(found.T[:, :3, 3], path.positions_m)


def test_euroc_says_its_unit_and_order_and_tum_is_what_evo_reads(tmp_path: Path) -> None:
    path = random_path(1, 4, 10**18)
    export_trajectory(path, tmp_path / "path.csv", "euroc")
    header, first, *_ = (tmp_path / "path.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("#timestamp [ns], p_RS_R_x [m]")
    assert [name.split("_")[-1][0] for name in header.split(", ")[4:]] == list("wxyz")
    assert int(first.split(",")[0]) == path.t_ns[0]
    export_trajectory(path, tmp_path / "path.tum", "tum")
    rows = np.loadtxt(tmp_path / "path.tum")
    np.testing.assert_allclose(Rotation.from_quat(rows[:, 4:]).as_matrix(), path.T_world_frame[:, :3, :3], atol=1e-12)


def test_a_file_that_is_there_and_an_unknown_form_are_sentences(tmp_path: Path) -> None:
    path, file = random_path(2, 3, 0), tmp_path / "path.txt"
    with pytest.raises(InputError, match=r"no form of trajectory 'csv'\. Known: tum, kitti, euroc"):
        export_trajectory(path, file, "csv")
    assert not list(tmp_path.iterdir())
    export_trajectory(path, file, "kitti")
    before = {one: one.read_bytes() for one in tmp_path.iterdir()}
    assert {one.name for one in before} == {"path.txt", "path.times.txt"}
    file.unlink()
    for form in ("kitti", "tum"):
        if form == "tum":
            file.write_text("mine")
        with pytest.raises(InputError, match="there is a file already"):
            export_trajectory(path, file, form)
    assert (tmp_path / "path.times.txt").read_bytes() == before[tmp_path / "path.times.txt"]
