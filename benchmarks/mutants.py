"""Mutation sample: how many small changes of a room's code are noticed by that room's own tests.

    python benchmarks/mutants.py analysis                    # twenty mutants of one room
    python benchmarks/mutants.py report suite --count 10 --seed 3
    python benchmarks/mutants.py analysis --only 7           # one of them again

Each mutant changes one operator, constant or condition of one file, in a copy of the repository. The tests of that
module (``tests/<room>/test_<module>.py``) run first, then the rest of the room's tests. A mutant survives if all of
them pass; a survivor is either a missing test or an equivalent change, which a reader must decide.
"""

import argparse
import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("vobench", "tests", "scenes", "estimators", "suites", "docs", "examples", "benchmarks")
TEST_TIME_LIMIT_S = 900.0  # a mutant that makes the tests hang counts as noticed
# A changed line may kill the wrong processes, so the tests run in a process namespace of their own (unshare(1)).
# Its first process is a shell, which reaps orphans.
NAMESPACE = ("unshare", "--pid", "--fork", "--mount-proc", "--kill-child", "sh", "-c", '"$@"; exit $?', "sh")

COMPARISONS = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
}
OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "+", ast.Pow: "*"}
FUNCTIONS = {"min": "max", "max": "min", "any": "all", "all": "any"}


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one file: the text between two offsets (bytes) is replaced."""

    path: Path  # relative to the repository
    line: int
    first: int
    last: int
    replacement: str

    def apply(self, source: bytes) -> bytes:
        """The changed file."""
        return source[: self.first] + self.replacement.encode() + source[self.last :]

    def describe(self, source: bytes) -> str:
        """File, line and the line's text with the change in it."""
        line_start = source.rfind(b"\n", 0, self.first) + 1
        line_end = source.find(b"\n", self.last)
        before = source[line_start : self.first].decode()
        after = source[self.last : line_end].decode()
        changed = source[self.first : self.last].decode()
        text = f"{before}[[{changed} -> {self.replacement}]]{after}"
        return f"{self.path}:{self.line}: {' '.join(text.split())}"


class Source:
    """The syntax tree of one file, with positions as offsets into its bytes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.text = (ROOT / path).read_bytes()
        self.tree = ast.parse(self.text)
        self.line_starts = [0]
        for line in self.text.splitlines(keepends=True):
            self.line_starts.append(self.line_starts[-1] + len(line))

    def start(self, node: ast.expr) -> int:
        """Offset of the first byte of an expression."""
        return self.line_starts[node.lineno - 1] + node.col_offset

    def end(self, node: ast.expr) -> int:
        """Offset behind the last byte of an expression."""
        return self.line_starts[node.end_lineno - 1] + node.end_col_offset

    def segment(self, node: ast.expr) -> str:
        """The text of an expression."""
        return self.text[self.start(node) : self.end(node)].decode()

    def between(self, left: ast.expr, right: ast.expr, replacement: str) -> Mutant:
        """Replaces the operator between two operands, keeping brackets that stand around them."""
        first = self.end(left)
        last = self.start(right)
        gap = self.text[first:last].decode()
        closing = gap[: len(gap) - len(gap.lstrip(" )\n"))]
        opening = gap[len(gap.rstrip(" (\n")) :]
        return Mutant(self.path, left.end_lineno or left.lineno, first, last, f"{closing} {replacement} {opening}")

    def whole(self, node: ast.expr, replacement: str) -> Mutant:
        """Replaces an expression."""
        return Mutant(self.path, node.lineno, self.start(node), self.end(node), replacement)

    def mutants(self) -> Iterator[Mutant]:
        """All mutants of this file, in the order of the tree."""
        for node in _statements_and_expressions(self.tree):
            if isinstance(node, ast.Compare) and len(node.ops) == 1:
                yield self.between(node.left, node.comparators[0], COMPARISONS[type(node.ops[0])])
            elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS and not _is_text_or_type(node):
                yield self.between(node.left, node.right, OPERATORS[type(node.op)])
            elif isinstance(node, ast.BoolOp):
                replacement = "or" if isinstance(node.op, ast.And) else "and"
                yield self.between(node.values[0], node.values[1], replacement)
            elif isinstance(node, ast.If | ast.IfExp | ast.While):
                yield self.whole(node.test, f"(not ({self.segment(node.test)}))")
            elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
                yield self.whole(node, f"({self.segment(node.operand)})")
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS:
                yield self.whole(node.func, FUNCTIONS[node.func.id])
            elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
                yield self.whole(
                    node, f"({self.segment(node)} + 1)" if node.value == 0 else f"(2 * {self.segment(node)})"
                )
            elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
                yield self.whole(node, str(not node.value))


def _statements_and_expressions(root: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those of decorators, annotations and assertions, which no test of behaviour can notice."""
    yield root
    for field, value in ast.iter_fields(root):
        if field in ("decorator_list", "annotation", "returns"):
            continue
        children = value if isinstance(value, list) else [value]
        for child in children:
            if isinstance(child, ast.AST) and not isinstance(child, ast.Assert):
                yield from _statements_and_expressions(child)


def _is_text_or_type(node: ast.BinOp) -> bool:
    operands = (node.left, node.right)
    return any(
        isinstance(operand, ast.JoinedStr) or (isinstance(operand, ast.Constant) and isinstance(operand.value, str))
        for operand in operands
    )


def draw(room: str, count: int, seed: int) -> list[Mutant]:
    """``count`` mutants of a room: files in proportion to their size, at most one mutant a line."""
    mutants: list[Mutant] = []
    for path in sorted((ROOT / "vobench" / room).glob("*.py")):
        mutants += Source(path.relative_to(ROOT)).mutants()
    random.Random(f"{room}-{seed}").shuffle(mutants)

    chosen: list[Mutant] = []
    lines: set[tuple[Path, int]] = set()
    for mutant in mutants:
        if (mutant.path, mutant.line) in lines or not _still_parses(mutant):
            continue
        lines.add((mutant.path, mutant.line))
        chosen.append(mutant)
        if len(chosen) == count:
            break
    return chosen


def _still_parses(mutant: Mutant) -> bool:
    try:
        compile(mutant.apply((ROOT / mutant.path).read_bytes()), str(mutant.path), "exec", dont_inherit=True)
    except (SyntaxError, SyntaxWarning):
        return False
    return True


def copy_of_the_repository(folder: Path) -> Path:
    """Copies what the tests need into a folder, so that the working tree stays untouched."""
    copy = folder / "vobench"
    copy.mkdir()
    for name in COPIED:
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ROOT.glob("*.*"):
        if file.is_file():
            shutil.copy2(file, copy / file.name)
    return copy


def is_noticed(copy: Path, room: str, mutant: Mutant) -> str:
    """The first failing test (or ``timeout``); empty if every test of the room passes.

    A test that also fails without the mutant, or that passes when it is repeated, does not count.
    """
    room_tests = Path("tests") / room
    module_tests = room_tests / f"test_{mutant.path.stem}.py"
    stages = [[str(room_tests)]]
    if (copy / module_tests).exists():
        stages = [[str(module_tests)], [str(room_tests), f"--ignore={module_tests}"]]
    for stage in stages:
        unreliable: list[str] = []
        while failure := _first_failure(copy, [*stage, *unreliable]):
            test = _failed_test(failure)
            if not test or _is_caused_by(mutant, copy, test):
                return failure
            unreliable.append(f"--deselect={test}")
    return ""


def _failed_test(failure: str) -> str:
    """The id of the failing test; empty if the failure is not of one test."""
    match = re.match(r"(?:FAILED|ERROR) (\S+::.*?)(?: - |$)", failure)
    return match[1] if match else ""


def _is_caused_by(mutant: Mutant, copy: Path, test: str) -> bool:
    """Whether a test fails again with the mutant, which is in the copy, and passes without it."""
    if not _first_failure(copy, [test]):
        return False
    file = copy / mutant.path
    original = (ROOT / mutant.path).read_bytes()
    changed = file.read_bytes()
    file.write_bytes(original)
    fails_without = bool(_first_failure(copy, [test]))
    file.write_bytes(changed)
    return not fails_without


def _first_failure(copy: Path, arguments: list[str]) -> str:
    options = ["-x", "-q", "-n", "0", "-m", "", "-p", "no:cacheprovider", "--no-header", "--tb=no"]
    command = [*_namespace(), sys.executable, "-m", "pytest", *options, *arguments]
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        result = subprocess.run(
            command,
            check=False,
            cwd=copy,
            env=environment,
            capture_output=True,
            text=True,
            timeout=TEST_TIME_LIMIT_S,
        )
    except subprocess.TimeoutExpired:
        return "timeout"
    if result.returncode in (0, 5):  # 5: no test collected
        return ""
    for line in result.stdout.splitlines():
        if line.startswith(("FAILED", "ERROR")):
            return line
    return (result.stdout + result.stderr).strip().splitlines()[-1]


@cache
def _namespace() -> tuple[str, ...]:
    """The start of a command that runs in its own process namespace; empty if this user may not create one."""
    try:
        result = subprocess.run([*NAMESPACE, "true"], check=False, capture_output=True)
    except FileNotFoundError:
        return ()
    return NAMESPACE if result.returncode == 0 else ()


def main() -> int:
    """Reads the command line, tries each mutant and prints one line for it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+", help="folders of vobench/, as in analysis")
    parser.add_argument("--count", type=int, default=20, help="mutants a room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="number of one mutant (from 1)")
    parser.add_argument("--list", action="store_true", help="print the mutants and run nothing")
    parser.add_argument("--json", type=Path, help="write the outcomes here, too")
    options = parser.parse_args()

    outcomes = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = copy_of_the_repository(Path(folder))
        for room in options.rooms:
            killed = 0
            tried = 0
            for number, mutant in enumerate(draw(room, options.count, options.seed), start=1):
                if options.only not in (None, number):
                    continue
                original = (ROOT / mutant.path).read_bytes()
                description = mutant.describe(original)
                if options.list:
                    print(f"{number:3d} {description}")
                    continue

                (copy / mutant.path).write_bytes(mutant.apply(original))
                try:
                    failure = is_noticed(copy, room, mutant)
                finally:
                    (copy / mutant.path).write_bytes(original)

                tried += 1
                killed += bool(failure)
                outcomes.append({"room": room, "number": number, "mutant": description, "killed_by": failure})
                print(f"{number:3d} {'killed  ' if failure else 'SURVIVED'} {description}", flush=True)
            if tried:
                print(f"{room}: {killed} of {tried} mutants killed", flush=True)
    if options.json:
        options.json.write_text(json.dumps(outcomes, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
