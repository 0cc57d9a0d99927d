"""Signatures of bundles by OpenSSH: `ssh-keygen -Y` signs and verifies with the SSH keys that users already have."""

import shutil
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, TimeoutExpired, run

from vobench.errors import InputError, MissingDependencyError, printable

NAMESPACE = "vobench-bundle"  # ssh-keygen rejects a signature that was created for another namespace
ENDING = ".sig"  # of the signature file beside the bundle, as ssh-keygen names it
TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class _KeygenResult:
    """Whether ssh-keygen succeeded, and its output as it was printed."""

    succeeded: bool
    output: str

    @property
    def message(self) -> str:
        """The output in one line, without control characters."""
        return " ".join(printable(self.output).split())


def sign(bundle: Path, key: Path) -> Path:
    """Sign a bundle and return the path of the signature file.

    `key` is a private SSH key, or a public one whose private key the SSH agent holds.
    Raises InputError if the key cannot sign, and MissingDependencyError if OpenSSH is missing.
    """
    signature = _signature_path(bundle)
    signature.unlink(missing_ok=True)  # ssh-keygen asks before it overwrites a file
    result = _ssh_keygen("sign", "-f", str(key), "-n", NAMESPACE, str(bundle.absolute()))
    if not signature.is_file():
        raise InputError(f"the bundle could not be signed ({result.message}): {key}")
    return signature


def signature_sentence(bundle: Path, allowed_signers: Path | None) -> str:
    """A sentence about the signature of a bundle; empty if there is no signature file beside it.

    `allowed_signers` is a file that lists who may sign, in the format of ssh-keygen(1).
    Raises InputError if that file does not exist, and MissingDependencyError if OpenSSH is missing.
    """
    if allowed_signers is not None and not allowed_signers.is_file():
        raise InputError(f"there is no such allowed-signers file: {allowed_signers}")
    signature = _signature_path(bundle)
    if not signature.is_file():
        return ""
    if allowed_signers is None:
        return _sentence_on_key(bundle, signature)
    return _sentence_on_signer(bundle, signature, allowed_signers)


def _signature_path(bundle: Path) -> Path:
    return bundle.with_name(bundle.name + ENDING)


def _sentence_on_key(bundle: Path, signature: Path) -> str:
    """The key that signed the bundle; nothing is known about its owner."""
    result = _ssh_keygen("check-novalidate", "-n", NAMESPACE, "-s", str(signature.absolute()), stdin=bundle)
    if not result.succeeded:
        return f"its signature is NOT that of this file ({result.message})"
    # OpenSSH prints: Good "vobench-bundle" signature with ED25519 key SHA256:uNiVztksCsDhcc0u9e8BrqXhK...
    _, separator, key = result.message.rpartition(" key ")
    if not separator or not key:
        return f"its signature is NOT verified: ssh-keygen names no key ({result.message})"
    return f"signed by {key}, not verified: pass --allowed-signers to verify"


def _sentence_on_signer(bundle: Path, signature: Path, allowed_signers: Path) -> str:
    """The listed signer whose key signed the bundle, and whether the signature is valid."""
    files = ("-f", str(allowed_signers.absolute()), "-s", str(signature.absolute()))
    principals = _ssh_keygen("find-principals", *files)
    principal = principals.output.strip().partition("\n")[0].strip()  # one per line; a name may contain spaces
    if not principals.succeeded or not principal:
        return f"its signature is NOT verified: its key is not in {allowed_signers}"

    name = printable(principal)
    verification = _ssh_keygen("verify", *files, "-I", principal, "-n", NAMESPACE, stdin=bundle)
    if not verification.succeeded:
        return f"signed by {name}, NOT verified ({verification.message})"
    return f"signed by {name}, verified"


def _ssh_keygen(operation: str, *arguments: str, stdin: Path | None = None) -> _KeygenResult:
    """Run `ssh-keygen -Y` with a file as its standard input. Raises InputError if it exceeds TIMEOUT_S."""
    program = shutil.which("ssh-keygen")
    if program is None:
        raise MissingDependencyError("signatures need OpenSSH's ssh-keygen; run: apt install openssh-client")
    command = [program, "-Y", operation, *arguments]
    opened_file = stdin.open("rb") if stdin else nullcontext(DEVNULL)
    with opened_file as source:
        try:
            completed = run(command, stdin=source, capture_output=True, timeout=TIMEOUT_S, check=False)
        except TimeoutExpired:
            raise InputError(f"ssh-keygen took more than {TIMEOUT_S:g} s") from None
    output = completed.stdout or completed.stderr
    return _KeygenResult(completed.returncode == 0, output.decode("utf-8", "replace"))
