"""What vobench diagnose prints of a finding."""

import pytest

from vobench.cli import diagnose as cli_diagnose
from vobench.cli import terminal


def finding(*options, before=2.0, unit="m", fault="scale"):
    figures = [{"name": "ATE", "before": before, "after": 0.5, "unit": unit}]
    return {"fault": fault, "sentence": "the scale differs", "evidence": figures, "options": list(options)}


@pytest.mark.parametrize(
    ("unit", "before", "line"),
    [
        ("m", 2.0, "  ATE: 2 m, corrected 0.5 m"),
        ("1", 2.0, "  ATE: 2, corrected 0.5"),
        ("m", None, "  ATE: none, corrected 0.5 m"),
    ],
)
def test_a_figure_has_its_unit_before_and_after_the_correction(capsys, unit, before, line):
    cli_diagnose._print_finding(finding("-a", "sim3", before=before, unit=unit), terminal.console())
    printed = capsys.readouterr().out.splitlines()
    assert printed == ["scale: the scale differs", line, "  correction: -a sim3"]


def test_a_fault_without_an_option_has_a_sentence_and_a_long_correction_stays_on_one_line(capsys):
    cli_diagnose._print_finding(finding(fault="swapped_inputs"), terminal.console())
    assert capsys.readouterr().out.endswith("  correction: give the two files in the other order\n")
    words = ["--est-as", "axes:z,-x,-y"] * 12
    cli_diagnose._print_finding(finding(*words), terminal.console())
    assert capsys.readouterr().out.endswith(f"  correction: {' '.join(words)}\n")


def test_without_a_finding_the_differences_are_errors_and_with_several_one_command_corrects_all(capsys):
    cli_diagnose._print_diagnosis({"warnings": ["few poses"], "findings": [], "command": ""})
    assert capsys.readouterr().out == (
        "warning: few poses\nno fault was found: the differences are errors of the estimate\n"
    )
    cli_diagnose._print_diagnosis({"warnings": [], "findings": [finding("-a", "sim3")], "command": "vobench score a b"})
    assert capsys.readouterr().out.endswith("all corrections: vobench score a b\n")
