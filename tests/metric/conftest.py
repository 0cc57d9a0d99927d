"""Evo's command lines in our terms."""

import shlex
from dataclasses import replace

import pytest

from vobench.metric.settings import LIKE

PARTS = {"trans_part": "trans", "angle_deg": "rot", "rot_part": "rot_chordal", "full": "full"}
ALIGNED = {("-a",): "se3", ("-a", "-s"): "sim3", ("--align_origin",): "origin", (): "none"}


@pytest.fixture(scope="session")
def asked_of_evo():
    """Of evo's tool and options, the settings that are like it and the metric that it asks for."""

    def asked(tool, flags):
        words = shlex.split(flags)
        after = dict(zip(words, [*words[1:], None], strict=False))
        changes = {
            "alignment": ALIGNED[tuple(w for w in words if w in ("-a", "-s", "--align_origin"))],
            "max_diff_ns": round(float(after.get("--t_max_diff", 0.01)) * 1e9),
            "rpe_delta": float(after.get("-d", 1)),
            "rpe_unit": after.get("-u", "f"),
            "rpe_all_pairs": "--all_pairs" in words,
            "rpe_pairs_from": "gt" if "--pairs_from_reference" in words else "est",
            "project": after.get("--project_to_plane"),
        }
        metric = f"{ {'ape': 'ate', 'rpe': 'rpe'}[tool] }_{PARTS[after.get('-r', 'trans_part')]}"
        return replace(LIKE["evo"], full=True, **changes), metric

    return asked
