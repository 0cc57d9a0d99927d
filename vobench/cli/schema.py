"""vobench schema."""

from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.errors import require_known
from vobench.estimator.manifest import Manifest
from vobench.suite.scenario import ScenarioFile
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite_spec import Suite
from vobench.suite.yaml_file import json_schema

SETTINGS_CLASSES = {"suite": Suite, "scenario": ScenarioFile, "scene": SceneFile, "estimator": Manifest}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema_command(
    kind: Annotated[
        str, typer.Argument(metavar="[suite|scenario|scene|estimator]", help="The kind of file.")
    ] = "suite",
    *,
    json: Annotated[
        bool, typer.Option("--json", help="Accepted as in other commands; the output is always JSON.")
    ] = False,
) -> None:
    """Print the JSON Schema of a suite's, scenario's, scene's or estimator's YAML, for editors and other programs."""
    del json  # the output is always JSON
    require_known("schema", kind, SETTINGS_CLASSES)
    settings_class = SETTINGS_CLASSES[kind]
    terminal.print_json({"$schema": DIALECT, **json_schema(settings_class)})
