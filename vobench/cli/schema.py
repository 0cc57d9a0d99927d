"""The JSON Schema of YAML files: vobench schema."""

from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.errors import UnknownNameError, unknown
from vobench.suite.manifest import Manifest
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite import Suite
from vobench.suite.yaml_file import json_schema

FILES = {"suite": Suite, "scene": SceneFile, "estimator": Manifest}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema_command(
    kind: Annotated[str, typer.Argument(metavar="[suite|scene|estimator]", help="Of which kind of file.")] = "suite",
    *,
    json: Annotated[bool, typer.Option("--json", help="It is JSON in any case.")] = False,
) -> None:
    """Print the JSON Schema of a suite's, scene's or estimator's YAML, for editors and other programs."""
    del json
    if kind not in FILES:
        raise UnknownNameError(unknown("schema", kind, list(FILES)))
    terminal.print_json({"$schema": DIALECT, **json_schema(FILES[kind])})
