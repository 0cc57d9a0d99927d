"""vobench cache."""

import math
import time
from collections.abc import Sequence
from itertools import groupby
from typing import Annotated, Any

import typer

from vobench import stop
from vobench.cli import terminal
from vobench.cli.option import Json
from vobench.errors import InputError, require_known
from vobench.runner.key import cache_folder
from vobench.runner.store import GB, Store, StoreEntry

ACTIONS = ("ls", "gc", "verify")
DAY_S = 86400.0
HEADINGS = ("kind", "entries", "damaged", "GB", "oldest, days", "last used, days ago")


def cache_command(
    action: Annotated[
        str,
        typer.Argument(
            metavar="[ls|gc|verify]",
            help="List the entries; remove damaged, unfinished or unwanted ones; check the hash of every file.",
        ),
    ] = "ls",
    *,
    keep_gb: Annotated[
        float | None, typer.Option(min=0, help="gc: remove the least recently used entries until this size is left.")
    ] = None,
    older: Annotated[float | None, typer.Option(min=0, help="gc: remove entries not used for this many days.")] = None,
    json: Json = False,
) -> None:
    """List the content of the cache, make it smaller, or check all of it; exit code 1 if anything is damaged."""
    require_known("action", action, ACTIONS)
    has_limits = keep_gb is not None or older is not None
    if has_limits and action != "gc":
        raise InputError(f"--keep-gb and --older require gc, not {action}")
    store = Store(cache_folder())
    if action == "verify":
        _verify(store, as_json=json)
        return
    removed = _collect(store, keep_gb, older) if action == "gc" else None
    _list(store, removed, as_json=json)


def _collect(store: Store, keep_gb: float | None, older_days: float | None) -> list[StoreEntry]:
    """Remove the entries that exceed the limits; return those that were removed."""
    keep_bytes = math.inf if keep_gb is None else keep_gb * GB
    older_s = math.inf if older_days is None else older_days * DAY_S
    return store.collect(keep_bytes=keep_bytes, older_s=older_s)


def _list(store: Store, removed: Sequence[StoreEntry] | None, *, as_json: bool) -> None:
    """Print the entries of each kind, and the entries that gc removed; `removed` is None without gc."""
    entries_by_kind = groupby(store.entries(), key=lambda entry: entry.kind)
    kinds = [_facts(kind, list(entries)) for kind, entries in entries_by_kind]
    removed_bytes = sum(entry.bytes for entry in removed or ())

    if as_json:
        content: dict[str, Any] = {"path": str(store.root)}
        if removed is not None:
            content["removed"] = {"count": len(removed), "bytes": removed_bytes}
        content["kinds"] = kinds
        terminal.print_json(content)
        return

    rows = [_cells(facts) for facts in kinds]
    terminal.console().print(terminal.table(str(store.root), HEADINGS, rows))
    if removed is not None:
        print(f"removed {len(removed)} entries of {removed_bytes / GB:.3g} GB")


def _facts(kind: str, entries: Sequence[StoreEntry]) -> dict[str, Any]:
    """Number, size and age of the entries of one kind."""
    now_s = time.time()
    oldest_s = min(entry.made_s for entry in entries)
    last_used_s = max(entry.used_s for entry in entries)
    return {
        "kind": kind,
        "count": len(entries),
        "damaged": sum(entry.is_damaged for entry in entries),
        "bytes": sum(entry.bytes for entry in entries),
        "oldest_days": (now_s - oldest_s) / DAY_S,
        "used_days": (now_s - last_used_s) / DAY_S,
    }


def _cells(facts: dict[str, Any]) -> list[str]:
    """A row of the table, in the order of HEADINGS."""
    counts = [str(facts[name]) for name in ("kind", "count", "damaged")]
    size = f"{facts['bytes'] / GB:.3g}"
    ages = [f"{facts[name]:.1f}" for name in ("oldest_days", "used_days")]
    return [*counts, size, *ages]


def _verify(store: Store, *, as_json: bool) -> None:
    """Hash every file of the complete entries; exit code 1 if one differs from its manifest."""
    entries = [entry for entry in store.entries() if entry.path.is_dir() and not entry.is_damaged]
    faults = list[dict[str, str]]()
    for entry in entries:
        stop.check()
        fault = store.fault(entry.key, anew=True)
        if fault:
            faults.append({"path": str(entry.path), "wrong": fault})

    if as_json:
        terminal.print_json({"path": str(store.root), "entries": len(entries), "wrong": faults})
    else:
        for fault_facts in faults:
            print(f"{fault_facts['wrong']}: {fault_facts['path']}")
        unchanged = len(entries) - len(faults)
        print(f"{unchanged} of {len(entries)} entries unchanged: {store.root}")
    if faults:
        raise typer.Exit(1)
