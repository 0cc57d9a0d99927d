"""vobench new."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json
from vobench.errors import InputError, require_known
from vobench.suite.scaffold import new_scene, new_suite, require_free, require_name

# Names that a class in the scaffold cannot have: it imports the first two, and the others are words of Python.
TAKEN_CLASS_NAMES = ("Result", "Status", "None", "True", "False")
SCAFFOLD = Path(__file__).parent / "scaffold"
# The next steps. {0} is the name, or the path if the name would not be found.
NEXT_STEPS = {
    "estimator": "Try it: vobench try {0}\nRun it: vobench run quickstart -e {0} -e lk_epipolar",
    "suite": "Check it: vobench check {0}\nRun it: vobench run {0}",
    "scene": "Inspect it: vobench scene {0}\nRender it: vobench render {0}\nUse it: add it to a suite, scenes: [{0}]",
}


@dataclass(frozen=True, slots=True)
class _Request:
    """The object to create. `source` is the original to copy. `is_command` selects a program in any language."""

    name: str
    folder: Path
    source: str | None
    is_command: bool


def new_command(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="What to create: an estimator, a suite or a scene.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Lower-case letters, digits and _.")],
    *,
    source: Annotated[
        str | None, typer.Option("--from", help="Copy this suite, example or scene: lighting, quickstart, room.")
    ] = None,
    command: Annotated[
        bool, typer.Option("--command", help="An estimator that is a program in any language and reads files.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="The folder in which it is created; estimators, suites or scenes by default."),
    ] = None,
    json: Json = False,
) -> None:
    """Create an estimator, a suite or a scene that works as it is."""
    require_known("kind of thing to create", kind, tuple(CREATE))
    if command and kind != "estimator":
        raise InputError(f"--command requires an estimator, not a {kind}")
    if source and kind == "estimator":
        raise InputError("--from requires a suite or a scene; to copy an estimator, copy its folder")
    default_folder = Path(f"{kind}s")
    folder = out or default_folder
    path = CREATE[kind](_Request(name, folder, source, command))
    if json:
        files = sorted(file.name for file in path.iterdir()) if path.is_dir() else [path.name]
        terminal.print_json({"path": str(path), "files": files})
        return
    is_found_by_name = folder == default_folder
    print(f"Created {path}. {NEXT_STEPS[kind].format(name if is_found_by_name else path)}")


def _create_estimator(request: _Request) -> Path:
    """Write an estimator's folder from the scaffold."""
    require_name(request.name)
    folder = request.folder / request.name
    require_free(folder)
    folder.mkdir(parents=True)
    scaffold = SCAFFOLD / ("command" if request.is_command else "class")
    for template in sorted(scaffold.iterdir()):
        text = template.read_text(encoding="utf-8")
        text = text.replace("NAME", request.name).replace("CLASS", class_name(request.name))
        file = folder / template.name.replace(".txt", ".py")
        file.write_text(text, encoding="utf-8")
    return folder


def class_name(name: str) -> str:
    """The name of an estimator's class: `my_vo` becomes `MyVo`."""
    joined = "".join(word.capitalize() for word in name.split("_"))
    return f"{joined}Estimator" if joined in TAKEN_CLASS_NAMES else joined


def _create_suite(request: _Request) -> Path:
    return new_suite(request.name, out=request.folder, source=request.source)


def _create_scene(request: _Request) -> Path:
    return new_scene(request.name, out=request.folder, source=request.source)


CREATE: dict[str, Callable[[_Request], Path]] = {
    "estimator": _create_estimator,
    "suite": _create_suite,
    "scene": _create_scene,
}
