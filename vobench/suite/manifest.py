"""An estimator's `estimator.yaml`, read without importing its code."""

from pathlib import Path

from vobench.errors import SuiteError
from vobench.estimator.manifest import MANIFEST_FILE, Manifest
from vobench.suite import yaml_file
from vobench.suite.catalog import builtin_root


def read_manifest(folder: Path) -> Manifest:
    """The manifest in an estimator's folder. Raises SuiteError, one line, where it is wrong."""
    manifest = yaml_file.read(folder / MANIFEST_FILE, Manifest, kind="estimator")
    if manifest.oracle and folder.resolve().parent != builtin_root() / "estimators":
        raise SuiteError(f"{folder / MANIFEST_FILE}: oracle: only vobench's own estimators may be drawn from the truth")
    return manifest
