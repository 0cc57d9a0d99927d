"""Pages of the site that are not files in docs/, as hooks of MkDocs (mkdocs.yml).

- The README is the first page; CONTRIBUTING, CHANGELOG, SECURITY and results/README are pages, too.
- `leaderboard.md` has the boards of the bundles in results/, scored again.
- `commands.md` has the help of every command, and `api.md` the docstrings of the Python interface.
- Other files of the repository that a page links to are part of the site, below `files/`.
"""

import re
from pathlib import Path
from typing import Any

import click
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import vobench
from vobench.cli.command_group import COMMANDS, CommandGroup
from vobench.errors import InputError
from vobench.report.board_table import DEFAULT_METRIC
from vobench.report.published import boards_text, published_boards

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES_OF_ROOT = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "CONTRIBUTING.md",
    "CHANGELOG.md": "CHANGELOG.md",
    "SECURITY.md": "SECURITY.md",
    "results/README.md": "results.md",
}
FILES = "files"
HEADING = re.compile(r"^(#+ )", re.MULTILINE)
LINK = re.compile(r"(\]\()([^)\s#]+)(#[^)\s]*)?(\))")
HELP_WIDTH = 72  # characters, of a code block beside the contents


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages, and the files that pages link to."""
    for source, page in PAGES_OF_ROOT.items():
        files.append(File.generated(config, page, content=_page_of_root(source)))
    files.append(File.generated(config, "leaderboard.md", content=_leaderboard()))
    files.append(File.generated(config, "commands.md", content=_commands()))
    files.append(File.generated(config, "api.md", content=_api()))
    for path in sorted(_linked_files()):
        files.append(File.generated(config, f"{FILES}/{path}", abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Let links of a page in docs/ lead to the pages and files of the site."""
    is_of_docs = page.file.generated_by is None
    return _with_site_links(markdown, DOCS) if is_of_docs else markdown


def _page_of_root(source: str) -> str:
    path = ROOT / source
    return _with_site_links(path.read_text(encoding="utf-8"), path.parent)


def _with_site_links(markdown: str, folder: Path) -> str:
    """The text of a page that lies in a folder, with links that are right in the site."""

    def replaced(match: re.Match[str]) -> str:
        before, target, anchor, after = match.groups(default="")
        return f"{before}{_site_path(target, folder)}{anchor}{after}"

    return LINK.sub(replaced, markdown)


def _site_path(target: str, folder: Path) -> str:
    """Where a link of a page in a folder leads to in the site; other links stay as they are."""
    if "://" in target:
        return target
    path = (folder / target).resolve()
    if not path.is_relative_to(ROOT) or not path.exists():
        return target
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS).as_posix()
    name = path.relative_to(ROOT).as_posix()
    return PAGES_OF_ROOT.get(name, f"{FILES}/{name}")


def _linked_files() -> set[str]:
    """The files outside docs/ that a page links to and that are no pages, relative to the repository."""
    pages = [*DOCS.glob("*.md"), *(ROOT / source for source in PAGES_OF_ROOT)]
    found = set[str]()
    for page in pages:
        for _, target, _, _ in LINK.findall(page.read_text(encoding="utf-8")):
            path = _site_path(target, page.parent)
            if path.startswith(f"{FILES}/"):
                found.add(path.removeprefix(f"{FILES}/"))
    return found


def _leaderboard() -> str:
    """The boards of all published results. Raises InputError if one of them is refused."""
    with published_boards() as published:
        if published.refused:
            raise InputError("; ".join(published.refused))
        boards = boards_text(published, "md", DEFAULT_METRIC)
    title = "# Leaderboard\n\nThe [published results](results.md), scored again when this page was made.\n\n"
    return title + HEADING.sub(r"#\1", boards)


def _commands() -> str:
    """The help of every command of vobench."""
    group = CommandGroup(name="vobench")
    context = click.Context(group, info_name="vobench", max_content_width=HELP_WIDTH, terminal_width=HELP_WIDTH)
    parts = ["# Commands\n"]
    for name in COMMANDS:
        command = group.get_command(context, name)
        help_text = command.get_help(click.Context(command, parent=context, info_name=name))
        parts.append(f"## vobench {name}\n\n```text\n{help_text}\n```\n")
    return "\n".join(parts)


def _api() -> str:
    """The docstrings of the names in `vobench`, by MkDocstrings."""
    parts = ["# Python interface\n", "All names are imported from `vobench`.\n"]
    for name in vobench.__all__:
        value = getattr(vobench, name)
        if hasattr(value, "__qualname__"):
            parts.append(f"::: {value.__module__}.{value.__qualname__}\n")
    return "\n".join(parts)
