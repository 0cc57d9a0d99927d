"""The words of `vobench score`, `diagnose` and `metrics`."""

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Gt = Annotated[Path, typer.Argument(metavar="GT", help="Ground truth: a file of any form, or a sequence's folder.")]
Est = Annotated[
    Path,
    typer.Argument(metavar="EST", help="Estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, by content."),
]
Topic = Annotated[str | None, typer.Option(help="The topic with the poses, or /tf:parent.child.")]
As = Annotated[
    list[str] | None,
    typer.Option(
        help="s|ms|us|ns, xyzw|wxyz, inverse, rotations:inverse, axes:z,-x,-y, positions:y,x,z or "
        "mount:x,y,z,qx,qy,qz,qw; repeatable."
    ),
]
Times = Annotated[
    list[Path] | None,
    typer.Option(help="Stamps in seconds, one a line, for files without (KITTI); repeatable: each takes what fits it."),
]


def score(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="GT EST",
            help="Ground truth and estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, by content, or the truth "
            "of a sequence's folder. Several pairs are scored one by one and all together.",
        ),
    ] = None,
    *,
    listed: Annotated[
        Path | None, typer.Option("--list", help="A file with GT and EST on each line, besides those given here.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(help="Set what evo, kitti, rpg, tum, openvins, tartanair or tartanair_mono would."),
    ] = None,
    align: Annotated[
        str | None, typer.Option("--align", "-a", help="none, origin, se3 (our default), sim3, scale or yaw.")
    ] = None,
    align_n: Annotated[int | None, typer.Option(min=1, help="Align by the first so many matched poses.")] = None,
    delta: Annotated[
        float | None, typer.Option("--delta", "-d", help="RPE over so much, more than 0; 1 by default.")
    ] = None,
    delta_unit: Annotated[
        str | None, typer.Option("--delta-unit", "-u", help="f (frames), m, s, d (degrees) or r (radians).")
    ] = None,
    all_pairs: Annotated[
        bool | None, typer.Option("--all-pairs/--consecutive", help="RPE over all pairs, or end to end.")
    ] = None,
    pairs_from: Annotated[str | None, typer.Option(help="RPE's pairs are chosen on gt or est.")] = None,
    t_max_diff: Annotated[float | None, typer.Option(help="Poses further apart are no pair, in s; 0.01.")] = None,
    t_offset: Annotated[float | None, typer.Option(help="Added to the estimate's stamps, in s.")] = None,
    assoc: Annotated[str | None, typer.Option(help="nearest, evo, interpolate, greedy or in_order.")] = None,
    project: Annotated[
        str | None, typer.Option(help="Compare in the plane xy, xz or yz of the truth, once aligned.")
    ] = None,
    full: Annotated[bool | None, typer.Option("--full", help="Every metric, not only the headlines.")] = None,
    per_length: Annotated[
        bool, typer.Option("--per-length", help="Segments and parts over each length too; --json always has them.")
    ] = False,
    gt_topic: Topic = None,
    est_topic: Topic = None,
    gt_as: As = None,
    est_as: As = None,
    times: Times = None,
    json: Json = False,
    csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
    md: Annotated[bool, typer.Option("--md", help="Print Markdown.")] = False,
) -> None:
    """Score estimates against ground truth: ATE, RPE, segments, coverage."""
    from vobench.cli import scoring
    from vobench.pipeline.pair import Source

    forms = [form for form, asked in (("json", json), ("csv", csv), ("md", md)) if asked]
    if len(forms) > 1:
        raise typer.BadParameter(f"choose one of --{' and --'.join(forms)}")
    paths = [*(files or ()), *(scoring.read_list(listed) if listed else ())]
    if not paths or len(paths) % 2:
        raise typer.BadParameter(
            f"files come in pairs, GT EST, but there {'is' if len(paths) == 1 else 'are'} {len(paths)}"
        )
    pairs = [
        (Source(gt, gt_topic, tuple(gt_as or ())), Source(est, est_topic, tuple(est_as or ())))
        for gt, est in zip(paths[::2], paths[1::2], strict=True)
    ]
    scoring.show(
        pairs,
        scoring.Asked(
            like, align, align_n, assoc, t_max_diff, t_offset, delta, delta_unit, all_pairs, pairs_from, full, project
        ),
        times=times or (),
        form=forms[0] if forms else "table",
        per_length=per_length,
    )


def diagnose(
    gt: Gt,
    est: Est,
    *,
    gt_topic: Topic = None,
    est_topic: Topic = None,
    gt_as: As = None,
    est_as: As = None,
    times: Times = None,
    json: Json = False,
) -> None:
    """Say what is wrong between two trajectories (frames, axes, scale, clocks, quaternions), and what mends it."""
    from vobench.cli import diagnosing
    from vobench.pipeline.pair import Source

    diagnosing.show(
        Source(gt, gt_topic, tuple(gt_as or ())),
        Source(est, est_topic, tuple(est_as or ())),
        times=times or (),
        as_json=json,
    )


def metrics(
    metric: Annotated[str | None, typer.Argument(metavar="[ID]", help="All where left out.")] = None,
    *,
    json: Json = False,
) -> None:
    """Define a metric: formula, source, settings, and what it cannot see."""
    from vobench.cli import defining

    defining.show(metric, as_json=json)
