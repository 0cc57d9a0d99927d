"""The code blocks of the documentation, and the commands in its blocks and prose."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "results" / "README.md",
    *sorted((ROOT / "examples").glob("*/README.md")),
]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
PROMPT = "$ "
SHELL = ("sh", "")  # blocks without a language show sessions, with a prompt before each command
ENDS_OF_COMMANDS = ("|", "&&", ";", ">")
PROGRAM = "vobench"
VARIABLE = re.compile(r"[A-Z_]+=.*")


@dataclass(frozen=True)
class Block:
    page: Path
    number: int  # on the page
    language: str
    text: str

    @property
    def name(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.number}"


@dataclass(frozen=True)
class Command:
    """A command of a page: its words, the variables before it, and the lines that the page shows as its output."""

    page: str
    place: str  # the name of a block, or "prose"
    words: tuple[str, ...]
    variables: tuple[str, ...] = ()
    output: tuple[str, ...] = ()

    @property
    def is_vobench(self) -> bool:
        return Path(self.words[0]).name == PROGRAM

    @property
    def arguments(self) -> list[str]:
        return list(self.words[1:])

    @property
    def text(self) -> str:
        """What tables of commands have: the command, without `vobench` if it is one of vobench."""
        words = self.words[1:] if self.is_vobench else self.words
        return " ".join([*self.variables, *words])


def blocks_of(page: Path) -> list[Block]:
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [Block(page, number, language, text) for number, (language, text) in enumerate(found)]


def block_of(page: str, language: str, number: int = 0) -> str:
    """The text of a block, by its number among those of a language on a page."""
    return [block.text for block in blocks_of(ROOT / page) if block.language == language][number]


def commands_of(line: str) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
    """The variables and the words of each command in a line of a shell. Files of redirections are left out."""
    part: list[str] = []
    is_file = False
    for word in [*shlex.split(line, comments=True), "&&"]:
        if word not in ENDS_OF_COMMANDS:
            part.append(word)
            continue
        variables = [name for name in part if VARIABLE.fullmatch(name)]
        words = part[len(variables) :]
        is_call = [Path(name).name == PROGRAM for name in words]
        if any(is_call):  # perhaps after a program that starts it, as in `uvx vobench`
            words = words[is_call.index(True) :]
        if words and not is_file:
            yield tuple(variables), tuple(words)
        part = []
        is_file = word == ">"


def commands_of_block(block: Block) -> Iterator[Command]:
    page = str(block.page.relative_to(ROOT))
    lines = block.text.splitlines()
    is_session = block.language == ""
    starts = [number for number, line in enumerate(lines) if line.startswith(PROMPT) or not is_session]
    for start, end in pairwise([*starts, len(lines)]):
        for variables, words in commands_of(lines[start].removeprefix(PROMPT)):
            yield Command(page, block.name, words, variables, tuple(lines[start + 1 : end]))


def commands_of_page(page: Path) -> list[Command]:
    """The commands in the blocks of shells, and those of vobench in the prose, in the order of the page."""
    text = page.read_text(encoding="utf-8")
    found: list[tuple[int, Command]] = []
    for block, match in zip(blocks_of(page), BLOCK.finditer(text), strict=True):
        if block.language in SHELL:
            found += [(match.start(), command) for command in commands_of_block(block)]
    prose = BLOCK.sub(lambda match: " " * len(match.group()), text)
    for match in INLINE.finditer(prose):
        if "vobench " in match.group(1):
            for variables, words in commands_of(match.group(1)):
                command = Command(str(page.relative_to(ROOT)), "prose", words, variables)
                if command.is_vobench:
                    found.append((match.start(), command))
    return [command for _, command in sorted(found, key=lambda item: item[0])]
