"""vobench try prints each clause of the contract, and its exit code says whether all are kept."""

import json

import pytest

from vobench.cli.try_estimator import try_command
from vobench.report import contract as contract_module
from vobench.report.contract import Clause, Verdict


@pytest.fixture
def clauses(monkeypatch):
    """The clauses that the contract yields, which a test may fill."""
    yielded = []
    monkeypatch.setattr(contract_module, "contract", lambda _: iter(yielded))
    return yielded


def exit_code(**options):
    with pytest.raises(SystemExit) as ended:
        try_command("stand_still", **options)
    return ended.value.code


def test_advice_is_printed_and_is_no_failure(clauses, capsys):
    clauses.append(Clause("imports", Verdict.ADVICE, "a remedy"))
    assert exit_code() == 0
    assert capsys.readouterr().out == "advice     imports: a remedy\n"


def test_a_broken_clause_is_in_capitals_and_fails(clauses, capsys):
    clauses += [Clause("first", Verdict.ADVICE, "a remedy"), Clause("second", Verdict.BROKEN, "no pose")]
    assert exit_code() == 1
    assert "BROKEN     second: no pose" in capsys.readouterr().out


def test_json_has_all_clauses_and_the_verdict(clauses, capsys):
    clauses.append(Clause("second", Verdict.BROKEN, "no pose"))
    assert exit_code(json=True) == 1
    printed = json.loads(capsys.readouterr().out)
    assert printed["kept"] is False
    assert printed["clauses"] == [{"name": "second", "verdict": "broken", "seen": "no pose"}]
