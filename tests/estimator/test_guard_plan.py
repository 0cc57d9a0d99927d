"""The plan of a program names what it may see, and survives marshal."""

import marshal
from pathlib import Path

from vobench.estimator.guard_plan import guard_plan
from vobench.estimator.manifest import Limits
from vobench.estimator.readable_folders import granted_folders


def test_a_plan_is_the_same_after_marshal_and_has_what_was_asked_for(tmp_path: Path) -> None:
    own = tmp_path / "estimator"
    own.mkdir()
    secret = tmp_path / "secret"
    secret.symlink_to(own)
    plan = guard_plan(
        ["sh", "-c", "true"],
        work_folder=tmp_path / "homes" / "one",
        all_work_folders=tmp_path / "homes",
        estimator_folder=own,
        hidden=[secret],
        limits=Limits(disk_mib=3, memory_mib=65),
        inherited=[7],
    )
    assert marshal.loads(marshal.dumps(plan)) == plan
    assert plan["argv"] == ["sh", "-c", "true"]
    assert plan["program"].endswith("/sh")
    assert (plan["home"], plan["homes"]) == (str(tmp_path / "homes" / "one"), str(tmp_path / "homes"))
    assert plan["read"] == granted_folders(own)
    assert plan["hidden"] == [str(own.resolve())]
    assert plan["file_bytes"] == 3 << 20
    assert plan["disk_bytes"] > plan["file_bytes"]
    assert plan["memory_bytes"] == 65 << 20
    assert plan["inherited"] == [7]
