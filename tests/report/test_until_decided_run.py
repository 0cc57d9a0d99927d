"""Looks at draws run in a folder that is removed, without reports; the whole run has them."""

from vobench.report import until_decided_run
from vobench.report.until_decided_run import run_draws


def test_looks_are_temporary_and_the_last_run_is_recorded_and_reported(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(until_decided_run, "record", lambda folder, *, ratio: calls.append(("record", folder, ratio)))
    monkeypatch.setattr(until_decided_run.page, "write_reports", lambda *given: calls.append(("reports", *given)))

    def run(plan, parent, finish):
        assert parent.exists()
        calls.append(("run", plan, parent))
        finish("folder", ["score"])
        return "folder"

    def fake_until_decided(draw, *, look, finish, ratio, budget_s, tell):
        assert (ratio, budget_s) == (1.5, 60.0)
        look(draw(0))
        looked = list(calls)
        assert [call[0] for call in looked] == ["run"], "a look writes no reports"
        return finish(draw(1))

    monkeypatch.setattr(until_decided_run, "run_until_decided", fake_until_decided)
    ended = run_draws(lambda number: f"plan {number}", run, out=tmp_path, ratio=1.5, budget_s=60.0, tell=print)
    assert ended == "folder"
    (_, _, looks), whole, *finished = calls
    assert not looks.exists()
    assert whole == ("run", "plan 1", tmp_path)
    assert finished == [("record", "folder", 1.5), ("reports", "folder", ["score"])]
