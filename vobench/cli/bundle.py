"""vobench bundle, and the score of a bundle."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, RunPath
from vobench.runner.bundle import bundle, opened, require_zip, scored_again
from vobench.runner.folder import TrialScore, open_run
from vobench.runner.rescore import wrong_truths
from vobench.runner.signature import sign as write_signature

BYTES_PER_MB = 1e6
MOST_PRINTED = 60


def bundle_command(
    run: RunPath,
    out: Annotated[Path, typer.Argument(metavar="OUT.zip", help="The file to write.")],
    *,
    sign: Annotated[
        Path | None, typer.Option(metavar="KEY", help="Sign the bundle with this SSH key, in a file beside it.")
    ] = None,
    json: Json = False,
) -> None:
    """Pack a run's suite, versions, truth, estimates, scores and hashes, for others to score again and to merge."""
    require_zip(out)
    file_count = bundle(open_run(run), out)
    size_bytes = out.stat().st_size
    signature = write_signature(out, sign) if sign else None
    if json:
        content = {"path": str(out), "files": file_count, "bytes": size_bytes}
        if signature:
            content["signature"] = str(signature)
        terminal.print_json(content)
        return
    print(f"{file_count} files, {size_bytes / BYTES_PER_MB:.1f} MB: {out}")
    if signature:
        print(f"signature: {signature}")
    print(f"score it again: vobench score {out}")


def score_bundle(path: Path, *, as_json: bool) -> None:
    """Score a bundle again and print the board of the new scores; exit code 1 if they differ from its own."""
    from vobench.report import page

    differing = list[TrialScore]()
    scores = list[TrialScore]()
    with opened(path, terminal.warn) as folder:
        for score, is_same in scored_again(folder, wrong_truths(folder)):
            scores.append(score)
            if not is_same:
                differing.append(score)
        board = page.run_board(folder, scores)

    if as_json:
        terminal.print_json({"trials": len(scores), "differ": [_trial_name(score) for score in differing]})
    else:
        from vobench.cli.board import print_board

        print_board(board)
        same_count = len(scores) - len(differing)
        terminal.console().print(f"{same_count} of {len(scores)} scores are the same as in the bundle")
    for score in differing[:MOST_PRINTED]:
        terminal.warn(f"the score differs from the bundle's: {_trial_name(score)}")
    if differing:
        raise SystemExit(1)


def _trial_name(score: TrialScore) -> str:
    return f"{score.estimator} on {score.case}, {score.repeat}"
