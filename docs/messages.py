"""Prints all messages that a user can see, and the first sentences of all public docstrings, room by room.

    python docs/messages.py              # all rooms
    python docs/messages.py suite cli    # some of them

An editor can read them in one go. They are found in the source without importing it: the texts of vobench's errors, of
help, of warnings, of printed lines and tables. Values that a message contains are shown as {expression}.
"""

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "vobench"
TOP_LEVEL = "."  # the room of files directly in the package

# Functions and methods whose arguments are printed.
PRINTING = {"print", "warn", "say", "say_hidden", "tell", "note"}
HELP_CALLS = {"Option", "Argument", "Typer"}
MOST_LENGTH = 400  # characters; longer texts are templates of files, not messages
LEAST_WORDS = 2


@dataclass(frozen=True, slots=True, order=True)
class Message:
    """A text for users: the kind of place where it stands, its file and line."""

    kind: str
    file: str
    line: int
    text: str


def rooms(package: Path) -> list[str]:
    """The rooms of the package, and the one of its own files."""
    folders = sorted(path.name for path in package.iterdir() if (path / "__init__.py").is_file())
    return [TOP_LEVEL, *folders]


def room_files(package: Path, room: str) -> list[Path]:
    """The Python files of a room."""
    if room == TOP_LEVEL:
        return sorted(package.glob("*.py"))
    return sorted((package / room).rglob("*.py"))


def messages(path: Path) -> list[Message]:
    """All messages in a file, by kind and line."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = [*_docstrings(tree, path)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            found += _texts_in_call("error", node.exc, path)
        elif isinstance(node, ast.Call):
            found += _messages_of_call(node, path)
    return sorted(set(found))


def _docstrings(tree: ast.Module, path: Path) -> Iterator[Message]:
    """The first sentences of the docstrings of a module, its public classes, functions and methods."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(tree):
        if not isinstance(node, documented):
            continue
        name = getattr(node, "name", path.stem)
        docstring = ast.get_docstring(node)
        if docstring and not name.startswith("_"):
            yield Message("docstring", path.name, getattr(node, "lineno", 1), f"{name}: {first_sentence(docstring)}")


def first_sentence(docstring: str) -> str:
    """The first sentence of a docstring, on one line."""
    paragraph = " ".join(docstring.split("\n\n", maxsplit=1)[0].split())
    sentence, full_stop, _ = paragraph.partition(". ")
    return f"{sentence}{full_stop}".strip()


def _messages_of_call(call: ast.Call, path: Path) -> list[Message]:
    name = called_name(call)
    if name in HELP_CALLS:
        return [*_help_texts(call, path)]
    if name.endswith("Error"):
        return _texts_in_call("error", call, path)
    if name in PRINTING:
        return _texts_in_call("printed", call, path)
    return []


def called_name(call: ast.Call) -> str:
    """The last part of the name of the called function."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


def _help_texts(call: ast.Call, path: Path) -> Iterator[Message]:
    for keyword in call.keywords:
        text = text_of(keyword.value) if keyword.arg == "help" else None
        if text:
            yield Message("help", path.name, keyword.value.lineno, text)


def _texts_in_call(kind: str, call: ast.Call, path: Path) -> list[Message]:
    """The texts among the arguments of a call, also those inside of other calls."""
    found = list[Message]()
    for argument in call.args:
        for node in _outermost_texts(argument):
            text = text_of(node)
            if text and len(text.split()) >= LEAST_WORDS and len(text) <= MOST_LENGTH:
                found.append(Message(kind, path.name, node.lineno, " ".join(text.split())))
    return found


def _outermost_texts(node: ast.expr) -> Iterator[ast.expr]:
    """The texts in an expression, without those that are parts of another text."""
    if text_of(node) is not None:
        yield node
        return
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr):
            yield from _outermost_texts(child)


def text_of(node: ast.expr) -> str | None:
    """The text of a constant or a formatted string, with {expression} for its values; None for anything else."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if not isinstance(node, ast.JoinedStr):
        return None
    parts = list[str]()
    for value in node.values:
        if isinstance(value, ast.Constant):
            parts.append(str(value.value))
        elif isinstance(value, ast.FormattedValue):
            parts.append(f"{{{ast.unparse(value.value)}}}")
    return "".join(parts)


def main() -> None:
    """Print the messages of the rooms that are named, or of all rooms."""
    for room in sys.argv[1:] or rooms(PACKAGE):
        print(f"# {room}\n")
        for path in room_files(PACKAGE, room):
            for message in messages(path):
                print(f"{message.kind:10} {message.file}:{message.line}: {message.text}")
        print()


if __name__ == "__main__":
    main()
