"""For each suite: frames, and the peak resident memory in MB of this process once all its cases are estimated."""

import resource
import sys
from pathlib import Path

from vobench.pipeline.estimate import estimate
from vobench.pipeline.progress import Silent
from vobench.pipeline.simulate import simulate
from vobench.pipeline.workshop import Workshop
from vobench.results.store import Store
from vobench.sequence import Sequence
from vobench.suite.expand import read_plan

shop = Workshop(Store(Path(sys.argv[1])), Silent())
for suite in sys.argv[2:]:
    plan = read_plan(suite)
    case = plan.cases[0]
    sequence = simulate(case, shop)
    for run in plan.runs(case):
        estimate(run, sequence, shop)
    print(len(Sequence.open(sequence)), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
