"""Looks up the scenes, scenarios and estimators that a suite names, and records them."""

from dataclasses import dataclass, field
from pathlib import Path

from vobench.suite import catalog
from vobench.suite.catalog import CatalogEntry
from vobench.suite.file_kind import Kind


@dataclass(frozen=True, slots=True)
class Lookup:
    """Finds entries of the catalog by name for one suite. `entries` lists the entries that were found."""

    suite_file: Path
    entries: list[CatalogEntry] = field(default_factory=list)

    def find(self, kind: Kind, name: str) -> CatalogEntry:
        """The entry that a name of the suite refers to. Raises UnknownNameError."""
        entry = catalog.find(kind, name, suite=self.suite_file)
        self.entries.append(entry)
        return entry

    def find_for(self, scenario_file: Path, scene: str) -> CatalogEntry:
        """The scene that a scenario names. It is recorded only once. Raises UnknownNameError."""
        entry = catalog.find("scene", scene, suite=scenario_file)
        if entry not in self.entries:
            self.entries.append(entry)
        return entry
