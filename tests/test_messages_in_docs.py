"""docs/messages.py finds the texts that users see, and no others."""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPT = runpy.run_path(str(ROOT / "docs" / "messages.py"))

SOURCE = '''"""A room. It has a door."""

LABEL = "not a message at all"


def draw(out: Annotated[str, typer.Option("--out", help="The file to write.")]) -> None:
    """Draw a picture.

    Not the first paragraph.
    """
    if not out:
        raise InputError(f"--out should be a file, got {out!r}")
    console.print(table("a title of words", ["one two"]))
    print(f"wrote {len(files):d} files")
    compute("not printed either")


def _private() -> None:
    """Not shown."""
    mistakes.append(SuiteError("is wrong in some way"))
'''


@pytest.fixture
def found(tmp_path):
    path = tmp_path / "room.py"
    path.write_text(SOURCE)
    return {(message.kind, message.text) for message in SCRIPT["messages"](path)}


def test_errors_help_printed_lines_and_first_sentences_are_found(found):
    assert found == {
        ("docstring", "room: A room."),
        ("docstring", "draw: Draw a picture."),
        ("error", "--out should be a file, got {out}"),
        ("error", "is wrong in some way"),
        ("help", "The file to write."),
        ("printed", "a title of words"),
        ("printed", "one two"),
        ("printed", "wrote {len(files)} files"),
    }


def test_every_room_has_messages():
    rooms = SCRIPT["rooms"](ROOT / "vobench")
    assert {".", "cli", "suite", "runner"} <= set(rooms)
    for room in rooms:
        files = SCRIPT["room_files"](ROOT / "vobench", room)
        assert any(SCRIPT["messages"](path) for path in files), room


@pytest.mark.parametrize(
    ("docstring", "sentence"),
    [
        ("One. Two.", "One."),
        ("Only one", "Only one"),
        ("A line\nand another. More.", "A line and another."),
        ("Files such as a.txt are read.", "Files such as a.txt are read."),
    ],
)
def test_a_first_sentence_ends_at_a_full_stop_and_a_space(docstring, sentence):
    assert SCRIPT["first_sentence"](docstring) == sentence
