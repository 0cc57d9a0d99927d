"""Mutation sample: how many small changes of a room's code are noticed by that room's own tests.

    python benchmarks/mutants.py analysis                    # twenty mutants of one room
    python benchmarks/mutants.py report suite --count 10 --seed 3
    python benchmarks/mutants.py analysis --only 7 12        # two of them again

Each mutant changes one operator, constant or condition of one file, in a copy of the repository. The tests of that
module (``tests/<room>/test_<module>.py``) run first, then the quick tests of the room, then its slow ones, until one
fails. The verdict is

- killed: a test fails, or runs for more than five minutes. The same test passes on the unchanged code.
- SURVIVED: all tests of the room pass. A test is missing, or the change is equivalent; that is for a reader to decide.
- INVALID: the test that fails also fails on the unchanged code. Repair it, then try the mutant again.
"""

import argparse
import ast
import compileall
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from py_compile import PycInvalidationMode
from typing import Any, Literal

Verdict = Literal["killed", "SURVIVED", "INVALID"]

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("vobench", "tests", "scenes", "estimators", "suites", "docs", "examples", "benchmarks")
TEST_TIME_LIMIT_S = 300.0  # a test that runs longer hangs, and counts as failed
LOOK_S = 0.1  # between looks whether pytest has ended
NO_TESTS_COLLECTED = 5  # the exit code of pytest

# A mutant of the estimator room kills every process that it sees. In this namespace it sees only those of its tests.
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

    def describe(self) -> str:
        """File, line and the line's text with the change in it."""
        return f"{self.path}:{self.line}: {self.changed_line()}"

    def changed_line(self) -> str:
        """The line's text with the change in it."""
        source = (ROOT / self.path).read_bytes()
        line_start = source.rfind(b"\n", 0, self.first) + 1
        line_end = source.find(b"\n", self.last)
        before = source[line_start : self.first].decode()
        after = source[self.last : line_end].decode()
        changed = source[self.first : self.last].decode()
        text = f"{before}[[{changed} -> {self.replacement}]]{after}"
        return " ".join(text.split())


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
    """``count`` mutants of a room: files in proportion to their size, at most one mutant a line.

    The order is random and depends on nothing but the seed and the changed lines themselves. So the sample stays the
    same while other lines are edited, and a line that is rewritten leaves it alone.
    """
    in_order: list[tuple[str, Mutant]] = []
    for path in sorted((ROOT / "vobench" / room).glob("*.py")):
        occurrences: Counter[str] = Counter()
        for mutant in Source(path.relative_to(ROOT)).mutants():
            text = mutant.changed_line()
            occurrences[text] += 1
            identity = f"{seed} {path.name} {occurrences[text]} {text}"
            in_order.append((hashlib.sha256(identity.encode()).hexdigest(), mutant))
    in_order.sort(key=lambda item: item[0])

    chosen: list[Mutant] = []
    lines: set[tuple[Path, int]] = set()
    for _, mutant in in_order:
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
    """Copies what the tests need into a folder, so that the working tree stays untouched.

    The copy is compiled once. Python compares the compiled files with hashes of their sources, so that it never uses
    the compiled file of another mutant.
    """
    copy = folder / "vobench"
    copy.mkdir()
    for name in COPIED:
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ROOT.glob("*.*"):
        if file.is_file():
            shutil.copy2(file, copy / file.name)
    compileall.compile_dir(copy / "vobench", quiet=1, invalidation_mode=PycInvalidationMode.CHECKED_HASH)
    return copy


@dataclass(frozen=True, slots=True)
class Failure:
    """The first test that failed, by its pytest id, and whether it was ended because it hung."""

    test: str
    hung: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of one mutant: a verdict, and the test that failed if there was one."""

    verdict: Verdict
    failure: Failure | None = None

    def describe(self) -> str:
        """A clause about the test; empty if all tests passed."""
        if self.failure is None:
            return ""
        if self.verdict == "INVALID":
            return f"fails without the mutant, too: {self.failure.test}"
        how = "hangs" if self.failure.hung else "fails"
        return f"{how}: {self.failure.test}"


def try_mutant(copy: Path, room: str, mutant: Mutant) -> Outcome:
    """Runs the tests of a room on one mutant until one fails.

    A failure counts only if the same test passes on the unchanged code.
    """
    original = (copy / mutant.path).read_bytes()
    (copy / mutant.path).write_bytes(mutant.apply(original))
    try:
        failure = _first_failure_of_the_room(copy, room, mutant.path.stem)
    finally:
        (copy / mutant.path).write_bytes(original)

    if failure is None:
        return Outcome("SURVIVED")
    fails_unchanged = _first_failure(copy, [failure.test]) is not None
    return Outcome("INVALID" if fails_unchanged else "killed", failure)


def _first_failure_of_the_room(copy: Path, room: str, module: str) -> Failure | None:
    """The first failure, looked for where it is most likely and cheapest: own tests, quick ones, slow ones."""
    own, others = test_files(copy, room, module)
    stages = []
    if own:
        stages.append([*own])
    if others:
        stages.append([*others, "-m", "not slow"])
        stages.append([*others, "-m", "slow"])
    for stage in stages:
        failure = _first_failure(copy, stage)
        if failure:
            return failure
    return None


def test_files(copy: Path, room: str, module: str) -> tuple[list[str], list[str]]:
    """The test file of a module, if there is one, and the others of its room: first those that import the module."""
    imports_it = re.compile(rf"\b{room}\.{module}\b|from vobench\.{room} import .*\b{module}\b")
    own = []
    importing = []
    others = []
    for path in sorted((copy / "tests" / room).glob("test_*.py")):
        name = str(path.relative_to(copy))
        if path.stem == f"test_{module}":
            own.append(name)
        elif imports_it.search(path.read_text(encoding="utf-8")):
            importing.append(name)
        else:
            others.append(name)
    return own, [*importing, *others]


def _first_failure(copy: Path, arguments: Sequence[str]) -> Failure | None:
    """Runs pytest in the copy. Returns its first failing test, or the test that runs longer than the limit."""
    log = copy / "pytest.log"
    cache = copy / ".pytest_cache"
    shutil.rmtree(cache, ignore_errors=True)
    own_files = ["-o", f"cache_dir={cache}", f"--basetemp={copy.parent / 'tests'}"]
    options = ["-x", "-v", "-n", "0", "-m", "", "--no-header", "--tb=no", *own_files]
    environment = {
        **os.environ,
        "PYTHONPATH": str(copy),
        "PYTHONDONTWRITEBYTECODE": "1",
        "VOBENCH_CACHE": str(copy.parent / "cache"),
    }
    with log.open("wb") as output:
        process = subprocess.Popen(
            [*_namespace(), sys.executable, "-m", "pytest", *options, *arguments],
            cwd=copy,
            env=environment,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            hung = _await_end(process, log)
        finally:
            _end_group(process)

    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    if hung:
        started = [line for line in lines if "::" in line]
        return Failure(started[-1].split(" PASSED")[0].strip() if started else arguments[0], hung=True)
    if process.returncode in (0, NO_TESTS_COLLECTED):
        return None
    failed = cache / "v/cache/lastfailed"
    if not failed.is_file():  # pytest itself failed, for example to import conftest.py
        return Failure(arguments[0])
    return Failure(next(iter(json.loads(failed.read_text(encoding="utf-8")))))


def _await_end(process: subprocess.Popen[bytes], log: Path) -> bool:
    """Waits for pytest, which writes a line before and after each test. Returns whether a test exceeds the limit."""
    size = 0
    changed_s = time.monotonic()
    while process.poll() is None:
        time.sleep(LOOK_S)
        if log.stat().st_size != size:
            size = log.stat().st_size
            changed_s = time.monotonic()
        if time.monotonic() - changed_s > TEST_TIME_LIMIT_S:
            return True
    return False


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """Kills pytest and the processes that it started, as far as they have not left its session."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def try_room(copy: Path, room: str, numbered: Iterable[tuple[int, Mutant]]) -> list[dict[str, Any]]:
    """Tries the mutants of a room, and prints the verdict on each one and their count."""
    rows = []
    verdicts: Counter[Verdict] = Counter()
    for number, mutant in numbered:
        outcome = try_mutant(copy, room, mutant)
        verdicts[outcome.verdict] += 1
        print(f"{number:3d} {outcome.verdict:8s} {mutant.describe()}", flush=True)
        if outcome.failure:
            print(f"             {outcome.describe()}", flush=True)
        rows.append(
            {
                "room": room,
                "number": number,
                "mutant": mutant.describe(),
                "verdict": outcome.verdict,
                "test": outcome.failure.test if outcome.failure else "",
            }
        )
    valid = verdicts["killed"] + verdicts["SURVIVED"]
    print(f"{room}: {verdicts['killed']} of {valid} mutants killed", flush=True)
    if verdicts["INVALID"]:
        print(f"{room}: {verdicts['INVALID']} more are not counted, because a test fails on the unchanged code")
    return rows


@cache
def _namespace() -> tuple[str, ...]:
    """The start of a command that runs in its own process namespace; empty if this user may not create one."""
    try:
        result = subprocess.run([*NAMESPACE, "true"], check=False, capture_output=True)
    except FileNotFoundError:
        return ()
    return NAMESPACE if result.returncode == 0 else ()


def main() -> int:
    """Reads the command line, and prints the mutants or tries them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+", help="folders of vobench/, for example analysis")
    parser.add_argument("--count", type=int, default=20, help="number of mutants per room (default 20)")
    parser.add_argument("--seed", type=int, default=1, help="another seed draws other mutants (default 1)")
    parser.add_argument("--only", type=int, nargs="+", metavar="N", help="try only the mutants with these numbers")
    parser.add_argument("--list", action="store_true", help="print the mutants without running tests")
    parser.add_argument("--json", type=Path, help="also write the outcomes to this file")
    options = parser.parse_args()
    for room in options.rooms:
        if not (ROOT / "vobench" / room).is_dir():
            parser.error(f"no such room: vobench/{room}")

    if options.list:
        for room in options.rooms:
            for number, mutant in _chosen(room, options):
                print(f"{number:3d} {mutant.describe()}")
        return 0

    rows = []
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that the copy is removed and pytest is ended
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = copy_of_the_repository(Path(folder))
        for room in options.rooms:
            rows += try_room(copy, room, _chosen(room, options))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")
    return 0


def _chosen(room: str, options: argparse.Namespace) -> list[tuple[int, Mutant]]:
    """The mutants of a room that the command line asks for, with their numbers from 1."""
    numbered = enumerate(draw(room, options.count, options.seed), start=1)
    return [(number, mutant) for number, mutant in numbered if options.only is None or number in options.only]


if __name__ == "__main__":
    sys.exit(main())
