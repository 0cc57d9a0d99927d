"""vobench report, compare and bundle with bundles of other people."""

import json
import shutil
import subprocess
from zipfile import ZipFile

import pytest

from tests.forgery import forged


def test_a_forged_score_is_reported_and_does_not_rank(vobench, ran, here):
    assert vobench("bundle", ran, "honest.zip").code == 0
    forged(here / "honest.zip", here / "forged.zip")
    honest = vobench("report", "honest.zip")
    assert (honest.code, honest.err) == (0, "")
    said = vobench("report", "forged.zip")
    assert said.code == 0
    assert "stand_still on short, 0: another score than its run states" in said.err
    kept = [line for line in said.out.splitlines() if "stand_still" in line and "another score" not in line]
    assert [line for line in honest.out.splitlines() if "stand_still" in line] == kept
    assert "another score than its run states" in said.out  # below the board, too
    assert "another score" in vobench("report", "forged.zip", "--format", "csv").err
    compared = vobench("compare", "honest.zip", "forged.zip", "--json")
    assert {change["verdict"] for change in compared.json["changes"]} == {"same"}
    assert "forged.zip: stand_still on short, 0: another score" in compared.err


def test_what_only_claims_a_score_is_listed_apart(vobench, ran, here):
    vobench("bundle", ran, "honest.zip")
    with ZipFile(here / "honest.zip") as old, ZipFile(here / "less.zip", "w") as new:
        names = [name for name in old.namelist() if not ("stand_still" in name and name.endswith("estimate.tum"))]
        hashes = json.loads(old.read("hashes.json"))
        for name in names:
            kept = json.dumps({key: value for key, value in hashes.items() if key in names})
            new.writestr(name, kept if name == "hashes.json" else old.read(name))
    said = vobench("report", "less.zip")
    assert said.code == 0
    assert "claimed, not ranked" in said.out
    assert "there is no estimate.tum" in said.err


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="no OpenSSH")
def test_a_bundle_is_signed_and_its_board_says_by_whom(vobench, ran, here):
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", here / "key"], check=True)
    (here / "allowed").write_text(f"ada@example.org {(here / 'key.pub').read_text()}")
    assert vobench("bundle", ran, "a.zip", "--sign", "key", "--json").json["signature"] == "a.zip.sig"
    said = vobench("report", "a.zip", "--allowed-signers", "allowed")
    assert "a.zip: signed by ada@example.org, verified" in said.err
    assert "a.zip: signed by ada@example.org, verified" in said.out
