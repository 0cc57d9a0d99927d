"""vobench schema."""

from vobench.cli import terminal
from vobench.errors import UnknownNameError, unknown
from vobench.suite.manifest import Manifest
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite import Suite
from vobench.suite.yaml_file import json_schema

FILES = {"suite": Suite, "scene": SceneFile, "estimator": Manifest}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def show(kind: str) -> None:
    """Print the JSON Schema of a kind of YAML file. Raises UnknownNameError."""
    if kind not in FILES:
        raise UnknownNameError(unknown("schema", kind, list(FILES)))
    terminal.print_json({"$schema": DIALECT, **json_schema(FILES[kind])})
