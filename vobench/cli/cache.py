"""vobench cache."""

import math
import time
from itertools import groupby
from typing import Annotated, Any

import typer

from vobench import stop
from vobench.cli import terminal
from vobench.errors import InputError
from vobench.runner.key import cache_folder
from vobench.runner.store import GB, Entry, Store

ACTIONS = ("ls", "gc", "verify")
DAY_S = 86400.0


def cache_command(
    action: Annotated[
        str,
        typer.Argument(
            metavar="[ls|gc|verify]",
            help="List what is kept; remove what is damaged, unfinished or not wanted; check every file's hash.",
        ),
    ] = "ls",
    *,
    keep_gb: Annotated[
        float | None, typer.Option(min=0, help="gc: remove the least recently used until so much is left.")
    ] = None,
    older: Annotated[float | None, typer.Option(min=0, help="gc: remove what was not used for so many days.")] = None,
    json: terminal.Json = False,
) -> None:
    """Say what the cache holds, make it smaller, or check all of it; exit code 1 where anything is damaged."""
    terminal.known("action", action, ACTIONS)
    if action != "gc" and (keep_gb is not None or older is not None):
        raise InputError(f"--keep-gb and --older go with gc, not with {action}")
    store = Store(cache_folder())
    if action == "verify":
        _verify(store, as_json=json)
        return
    removed = list[Entry]()
    if action == "gc":
        limits = math.inf if keep_gb is None else keep_gb * GB, math.inf if older is None else older * DAY_S
        removed = store.collect(keep_bytes=limits[0], older_s=limits[1])
    kinds = [_facts(kind, list(found)) for kind, found in groupby(store.entries(), key=lambda entry: entry.kind)]
    gone = {"count": len(removed), "bytes": sum(entry.bytes for entry in removed)}
    if json:
        said = {"removed": gone} if action == "gc" else {}
        terminal.print_json({"path": str(store.root), **said, "kinds": kinds})
        return
    rows = [_cells(fact) for fact in kinds]
    headings = ["kind", "entries", "damaged", "GB", "oldest, days", "last used, days ago"]
    terminal.console().print(terminal.table(str(store.root), headings, rows))
    if action == "gc":
        print(f"removed {gone['count']} entries of {gone['bytes'] / GB:.3g} GB")


def _facts(kind: str, entries: list[Entry]) -> dict[str, Any]:
    now_s = time.time()
    return {
        "kind": kind,
        "count": len(entries),
        "damaged": sum(entry.is_damaged for entry in entries),
        "bytes": sum(entry.bytes for entry in entries),
        "oldest_days": (now_s - min(entry.made_s for entry in entries)) / DAY_S,
        "used_days": (now_s - max(entry.used_s for entry in entries)) / DAY_S,
    }


def _cells(fact: dict[str, Any]) -> list[str]:
    counts = [str(fact[name]) for name in ("kind", "count", "damaged")]
    return [*counts, f"{fact['bytes'] / GB:.3g}", *(f"{fact[name]:.1f}" for name in ("oldest_days", "used_days"))]


def _verify(store: Store, *, as_json: bool) -> None:
    """Hash every file that a manifest names."""
    found = [entry for entry in store.entries() if entry.path.is_dir() and not entry.is_damaged]
    wrong = list[dict[str, str]]()
    for entry in found:
        stop.check()
        if why := store.fault(entry.key, anew=True):
            wrong.append({"path": str(entry.path), "wrong": why})
    if as_json:
        terminal.print_json({"path": str(store.root), "entries": len(found), "wrong": wrong})
    else:
        for each in wrong:
            print(f"{each['wrong']}: {each['path']}")
        print(f"{len(found) - len(wrong)} of {len(found)} entries as they were: {store.root}")
    if wrong:
        raise typer.Exit(1)
