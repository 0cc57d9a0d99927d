"""Reads an estimator's `estimator.yaml` without importing its code."""

from pathlib import Path

from vobench.errors import SuiteError
from vobench.estimator.manifest import MANIFEST_FILE, Manifest
from vobench.suite import yaml_file
from vobench.suite.catalog import builtin_root


def read_manifest(folder: Path) -> Manifest:
    """The manifest in an estimator's folder. Raises SuiteError with all mistakes in it."""
    path = folder / MANIFEST_FILE
    manifest = yaml_file.read(path, Manifest, kind="estimator")
    is_builtin = folder.resolve().parent == builtin_root() / "estimators"
    if manifest.oracle and not is_builtin:
        raise SuiteError(f"{path}: oracle: only estimators included with vobench may use the ground truth")
    return manifest
