"""What vobench verify prints, and how it ends."""

import pytest

from vobench.cli import verify
from vobench.report.verify import VerifiedItem

RIGHT = VerifiedItem("hash", "a.tum")
WRONG = VerifiedItem("hash", "b.tum", "has another hash")
SCORE = VerifiedItem("score", "trial")


@pytest.fixture
def ended(monkeypatch, capsys):
    """Verifies a run with these findings; the exit code and what was printed."""

    def run(*findings, json=False):
        monkeypatch.setattr(verify, "open_run", lambda path: path)
        monkeypatch.setattr(verify, "verify_run", lambda _: iter(findings))
        with pytest.raises(SystemExit) as end:
            verify.verify_command("runs/tiny", json=json)
        return end.value.code, capsys.readouterr().out

    return run


def test_what_is_right_is_counted_by_kind(ended):
    assert ended(RIGHT, RIGHT, SCORE) == (0, "hash: 2 of 2 unchanged\nscore: 1 of 1 unchanged\n")


def test_what_is_wrong_is_named_and_ends_with_1(ended):
    code, printed = ended(RIGHT, WRONG, SCORE)
    assert code == 1
    assert printed == "hash: b.tum: has another hash\nhash: 1 of 2 unchanged\nscore: 1 of 1 unchanged\n"


@pytest.mark.parametrize(("findings", "code"), [((RIGHT,), 0), ((RIGHT, WRONG), 1)])
def test_json_has_every_finding_and_ends_alike(ended, findings, code):
    ended_with, printed = ended(*findings, json=True)
    assert ended_with == code
    assert f'"checked": {len(findings)}' in printed
    assert f'"wrong": {code}' in printed
