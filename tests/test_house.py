"""The house keeps to its plan: no import leads back to where it began."""

from graphlib import TopologicalSorter

import pytest


def test_no_import_leads_back_to_where_it_began() -> None:
    grimp = pytest.importorskip("grimp")
    graph = grimp.build_graph("vobench", cache_dir=None, exclude_type_checking_imports=True)
    # The package's own names are looked up when they are asked for.
    modules = {m: graph.find_modules_directly_imported_by(m) - {"vobench"} for m in graph.modules if m != "vobench"}
    TopologicalSorter(modules).prepare()
