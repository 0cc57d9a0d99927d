"""Signatures of bundles: who signed, whether that is verified, and what stops ssh-keygen."""

import shutil
import subprocess

import pytest

from vobench.errors import InputError
from vobench.runner import signature
from vobench.runner.signature import sign, signature_sentence

needs_openssh = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="no OpenSSH")


@pytest.fixture
def bundle(tmp_path):
    path = tmp_path / "run.zip"
    path.write_bytes(b"content")
    return path


@pytest.fixture
def key(tmp_path):
    path = tmp_path / "key"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", path], check=True)
    return path


@needs_openssh
@pytest.mark.parametrize("principals", ["ada@example.org", '"Ada Lovelace"', '"Ada Lovelace,ada@example.org"'])
def test_a_principal_is_named_whole(bundle, key, tmp_path, principals):
    allowed = tmp_path / "allowed"
    allowed.write_text(f"{principals} {key.with_suffix('.pub').read_text()}")
    sign(bundle, key)
    first = principals.strip('"').partition(",")[0]
    assert signature_sentence(bundle, allowed) == f"signed by {first}, verified"
    bundle.write_bytes(b"other content")
    assert signature_sentence(bundle, allowed).startswith(f"signed by {first}, NOT verified (")


@needs_openssh
def test_without_a_list_of_signers_only_the_key_is_named(bundle, key):
    sign(bundle, key)
    assert signature_sentence(bundle, None).startswith("signed by SHA256:")
    bundle.write_bytes(b"other content")
    assert signature_sentence(bundle, None).startswith("its signature is NOT that of this file (")


def test_a_missing_list_of_signers_is_reported(bundle, tmp_path):
    with pytest.raises(InputError, match=r"there is no such allowed-signers file: .*allowed$"):
        signature_sentence(bundle, tmp_path / "allowed")


def test_an_ssh_keygen_that_hangs_is_stopped(bundle, tmp_path, monkeypatch):
    programs = tmp_path / "programs"
    programs.mkdir()
    hanging = programs / "ssh-keygen"
    hanging.write_text("#!/bin/sh\nexec /bin/sleep 60\n")
    hanging.chmod(0o755)
    monkeypatch.setenv("PATH", str(programs))
    monkeypatch.setattr(signature, "TIMEOUT_S", 0.2)
    with pytest.raises(InputError, match=r"^ssh-keygen took more than 0\.2 s$"):
        sign(bundle, tmp_path / "key")
