"""Parses YAML 1.2, with limits that make hostile files harmless, and reports duplicate keys."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import ConstructorError, RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.scanner import RoundTripScanner, ScannerError

from vobench.errors import FilePlace, Mistake, SuiteError
from vobench.regular_file import read_regular
from vobench.suite.file_kind import MOST_BYTES

# The limits are far above what a person writes. A file that exceeds one of them is reported in one line.
MOST_NODES = 100_000
MOST_DEPTH = 100
MOST_DIGITS = 400  # the largest number of characters of a number; every float is shorter

NUMBER_TAGS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
TOO_DEEP = "brackets or indents are nested too deep"
CACHED_FILES = 64  # scenarios read the same scene many times


@dataclass(frozen=True, slots=True)
class ParsedYaml:
    """The tree of a YAML text, whose mappings and lists contain their line numbers, and its duplicate keys."""

    tree: Any
    duplicates: tuple[Mistake, ...]


def parse_file(path: Path) -> ParsedYaml:
    """The content of a file. Raises SuiteError if it cannot be read or is not YAML."""
    try:
        return parse_text(path, _read_text(path))
    except RecursionError:
        raise SuiteError(Mistake(TOO_DEEP, (FilePlace(str(path)),))) from None


def _read_text(path: Path) -> str:
    """The text of a file. Raises SuiteError if it is too long or not text."""
    try:
        content = read_regular(path, most_bytes=MOST_BYTES + 1)
    except OSError as error:
        raise SuiteError(f"cannot read {path}: {error.strerror}") from None
    if len(content) > MOST_BYTES:
        raise SuiteError(Mistake(f"should be text of at most {MOST_BYTES >> 20} MiB", (FilePlace(str(path)),)))
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        raise SuiteError(Mistake("not a text file in UTF-8", (FilePlace(str(path)),))) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


@lru_cache(CACHED_FILES)
def parse_text(path: Path, text: str) -> ParsedYaml:
    """The content of a YAML text. `path` is the file to name in mistakes. Raises SuiteError if it is not YAML.

    The tree is shared between calls, so it must not be changed.
    """
    # In YAML 1.2, 1e-3 is a number and 'no' is text.
    yaml = YAML(typ="rt", pure=True)
    yaml.Scanner = _Scanner
    yaml.Constructor = _Constructor
    try:
        tree = yaml.load(text)
    except MarkedYAMLError as error:
        problem = " ".join(str(error.problem).split())
        raise SuiteError(_mistake_at(path, error.problem_mark, problem)) from None
    except YAMLError as error:
        raise SuiteError(Mistake(" ".join(str(error).split()), (FilePlace(str(path)),))) from None
    except RecursionError:
        raise SuiteError(Mistake(TOO_DEEP, (FilePlace(str(path)),))) from None
    except Exception as error:  # the library raises other exceptions for content that it does not expect
        problem = " ".join(str(error).split())
        sentence = f"not readable as YAML ({type(error).__name__}: {problem})"
        raise SuiteError(_mistake_at(path, yaml.constructor.mark, sentence)) from None
    duplicates = tuple(_mistake_at(path, mark, sentence) for mark, sentence in yaml.constructor.duplicates)
    return ParsedYaml(tree, duplicates)


def _mistake_at(path: Path, mark: Any, sentence: str) -> Mistake:
    """A mistake at a mark of the parser, which may be None."""
    place = FilePlace(str(path), mark.line + 1, mark.column + 1) if mark else FilePlace(str(path))
    return Mistake(sentence, (place,))


class _Scanner(RoundTripScanner):
    """Splits a file into tokens. It refuses deep brackets at once, as its time grows with the square of their depth."""

    def fetch_flow_collection_start(self, *args: Any, **options: Any) -> None:
        """Read an opening bracket. Raises ScannerError if it is nested too deep."""
        if self.flow_level >= MOST_DEPTH:
            raise ScannerError(None, None, _depth_sentence(), self.reader.get_mark())
        super().fetch_flow_collection_start(*args, **options)


class _Constructor(RoundTripConstructor):
    """Builds the tree of a file. Of duplicate keys, the first is used and the others are recorded.

    A document whose aliases would expand to too many values is refused before the tree is built.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.duplicates: list[tuple[Any, str]] = []  # mark and sentence
        self.mark: Any = None  # the mark of the node that is being built

    def construct_document(self, node: Any) -> Any:
        """The content of a document. Raises ConstructorError if it exceeds a limit."""
        _require_limits(node)
        return super().construct_document(node)

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        """The content of a node. Its mark is recorded for errors that have none."""
        self.mark = node.start_mark
        return super().construct_object(node, deep=deep)

    def check_mapping_key(self, node: Any, key_node: Any, mapping: Any, key: Any, value: Any) -> bool:
        """Whether a key is new."""
        del node
        if key not in mapping:
            return True
        sentence = f'found duplicate key "{key}" with value "{value}" (original value: "{mapping[key]}")'
        self.duplicates.append((key_node.start_mark, sentence))
        return False


def _require_limits(root: Node) -> None:
    """Raise ConstructorError if a document is too large or contains itself. An alias counts as the repeated value."""
    size_by_id = dict[int, int]()  # the number of nodes in the subtree of each node
    open_ids = set[int]()  # the nodes between the root and the current node
    pending = [(root, False)]  # nodes to visit, and whether their children have been measured
    while pending:
        node, is_measured = pending.pop()
        children = _children(node)
        if is_measured:
            open_ids.discard(id(node))
            size_by_id[id(node)] = _subtree_size(node, children, size_by_id)
            continue
        if id(node) in open_ids:
            raise _refusal("an alias is inside what it repeats", node)
        if id(node) in size_by_id:
            continue
        _require_node_limits(node, depth=len(open_ids))
        open_ids.add(id(node))
        pending.append((node, True))
        pending += [(child, False) for child in children]


def _subtree_size(node: Node, children: list[Node], size_by_id: dict[int, int]) -> int:
    """The number of nodes below and including a node. Raises ConstructorError if there are too many."""
    size = 1 + sum(size_by_id[id(child)] for child in children)
    if size > MOST_NODES:
        raise _refusal(f"holds more than {MOST_NODES} values, including those that aliases repeat", node)
    return size


def _require_node_limits(node: Node, *, depth: int) -> None:
    """Raise ConstructorError if a node is nested too deep, or is a number that is too long."""
    if depth >= MOST_DEPTH:
        raise _refusal(_depth_sentence(), node)
    is_number = isinstance(node, ScalarNode) and node.tag in NUMBER_TAGS
    if is_number and len(node.value) > MOST_DIGITS:
        raise _refusal(f"a number has more than {MOST_DIGITS} characters", node)


def _depth_sentence() -> str:
    return f"is nested more than {MOST_DEPTH} deep"


def _children(node: Node) -> list[Node]:
    if isinstance(node, MappingNode):
        return [each for pair in node.value for each in pair]
    if isinstance(node, SequenceNode):
        return list(node.value)
    return []


def _refusal(sentence: str, node: Node) -> ConstructorError:
    return ConstructorError(None, None, sentence, node.start_mark)
