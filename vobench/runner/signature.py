"""Signatures of bundles by OpenSSH: `ssh-keygen -Y` signs and verifies, with the keys that people have already."""

import shutil
from pathlib import Path
from subprocess import DEVNULL, run

from vobench.errors import InputError, MissingDependencyError, printable

NAMESPACE = "vobench-bundle"  # a signature made for something else is none of a bundle
ENDING = ".sig"  # of the file beside the bundle, as ssh-keygen names it
TIMEOUT_S = 60.0


def sign(bundle: Path, key: Path) -> Path:
    """Sign a bundle with a private SSH key, or with the agent's for a public one; the file of the signature.

    Raises InputError if the key does not sign, MissingDependencyError if OpenSSH is missing.
    """
    signature = bundle.with_name(bundle.name + ENDING)
    signature.unlink(missing_ok=True)  # ssh-keygen asks before it writes over a file
    _, told = _ssh_keygen("sign", "-f", str(key), "-n", NAMESPACE, str(bundle.absolute()))
    if not signature.is_file():
        raise InputError(f"the bundle could not be signed ({told}): {key}")
    return signature


def signed_by(bundle: Path, allowed_signers: Path | None) -> str:
    """What is known of a bundle's signature, as one sentence; empty if there is none beside it.

    `allowed_signers` lists who may sign, as ssh-keygen(1) has it. Raises MissingDependencyError if OpenSSH is missing.
    """
    signature = bundle.with_name(bundle.name + ENDING)
    if not signature.is_file():
        return ""
    beside = ("-s", str(signature.absolute()))
    if allowed_signers is None:
        is_whole, told = _ssh_keygen("check-novalidate", "-n", NAMESPACE, *beside, signed=bundle)
        key = told.rpartition(" key ")[2] if is_whole else ""
        if key:
            return f"signed by {key}, not verified: name an allowed-signers file with --allowed-signers"
        return f"its signature is NOT that of this file ({told})"
    listed = ("-f", str(allowed_signers.absolute()))
    is_known, names = _ssh_keygen("find-principals", *listed, *beside)
    if not is_known or not names:
        return f"its signature is NOT verified: its key is not in {allowed_signers}"
    name = names.split()[0]
    is_good, told = _ssh_keygen("verify", *listed, "-I", name, "-n", NAMESPACE, *beside, signed=bundle)
    return f"signed by {name}, verified" if is_good else f"signed by {name}, NOT verified ({told})"


def _ssh_keygen(verb: str, *arguments: str, signed: Path | None = None) -> tuple[bool, str]:
    """Whether `ssh-keygen -Y` succeeds, and what it prints, in one line."""
    program = shutil.which("ssh-keygen")
    if program is None:
        raise MissingDependencyError("signatures need OpenSSH's ssh-keygen; run: apt install openssh-client")
    command = [program, "-Y", verb, *arguments]
    if signed is None:
        done = run(command, stdin=DEVNULL, capture_output=True, timeout=TIMEOUT_S, check=False)
    else:
        with signed.open("rb") as file:
            done = run(command, stdin=file, capture_output=True, timeout=TIMEOUT_S, check=False)
    told = (done.stdout or done.stderr).decode("utf-8", "replace")
    return done.returncode == 0, " ".join(printable(told).split())
