"""Draw the paper's figures 10 and 11 anew, with what they do not tell: python examples/paper_figures.py FOLDER."""

import argparse
from collections.abc import Callable
from dataclasses import astuple
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vobench.motion.controller import CONTROLLERS, ControllerSettings
from vobench.motion.drive import Drive, drive
from vobench.motion.pioneer import THETAS, Theta

START, *TARGETS = (0, 0), (1, 1), (0, 1), (1, 0), (2, 2)
AS_PRINTED = THETAS["pioneer_3dx_paper"]
by_tolerance = partial(drive, TARGETS)
by_the_clock = partial(drive, TARGETS, leg_s=3.0, settle_s=3.0)
# Every way to drive figure 10: the paper compares the first with the last.
WAYS: dict[str, Callable[..., Drive]] = {
    "30 Hz, by tolerance": partial(by_tolerance, rate_hz=30.0),
    "30 Hz, by the clock": partial(by_the_clock, rate_hz=30.0),
    "10 Hz, by tolerance": partial(by_tolerance, rate_hz=10.0),
    "10 Hz, by the clock": partial(by_the_clock, rate_hz=10.0),
}
FINE = "30 Hz, by tolerance"
COARSE = "10 Hz, by the clock"
PRINTED = {FINE: (7e-4, 1.3e-3), COARSE: (4.52e-2, 3.3e-3)}  # the paper's digits, x and y in m
LABELS = ((8, -16), (8, -16), (-4, 9), (-16, -14), (8, -16))  # where the targets' numbers cover no path
COLOURS = {FINE: "#1f6fb4", COARSE: "#d1602d", "paper": "#1f6fb4", "smooth": "#2a8c57", "easy": "#8a5aa8"}


def errors(run: Drive) -> np.ndarray:
    """Distance of h from the second target, (0, 1), on each axis at each frame, (N, 2) in m."""
    return np.abs(run.state[:, :2] - TARGETS[1])


def second_leg(run: Drive) -> slice:
    """Frames on the way to (0, 1), with the one that ends it."""
    return slice(run.reached[0], run.reached[1] + 1)


def minima(run: Drive) -> np.ndarray:
    """The smallest distances (2,) in m on that leg: what figure 11 gives as digits."""
    return errors(run)[second_leg(run)].min(0)


def nearly(rng: np.random.Generator) -> tuple[Theta, ControllerSettings]:
    """The printed theta and the paper's controller with every number up to one per cent off."""
    theta, controller = (np.array(astuple(it)) for it in (AS_PRINTED, CONTROLLERS["paper"]))
    off = 1 + rng.uniform(-0.01, 0.01, 11)
    return Theta(*(theta * off[:6]).tolist()), ControllerSettings(*(controller * off[6:]).tolist())


def draw_figure_10(path: Path, runs: dict[str, Drive], presets: dict[str, Drive]) -> None:
    """Paths of h: the paper's comparison, and the three presets."""
    figure = Figure(figsize=(11, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    draw_paths(left, {name: runs[name] for name in (FINE, COARSE)}, "Figure 10: the paper's gains, two ways to stop")
    draw_paths(right, presets, "The three presets at 30 Hz, by tolerance")
    left.set_ylabel("y of h (m)")
    figure.savefig(path, dpi=110)


def draw_paths(axes: Axes, runs: dict[str, Drive], title: str) -> None:
    """Paths with the targets numbered in their order."""
    for name, run in runs.items():
        axes.plot(*run.state[:, :2].T, label=name, color=COLOURS[name], lw=1.6)
    axes.plot(*np.transpose([START, *TARGETS]), "k+", ms=11, zorder=3)
    for number, (place, beside) in enumerate(zip([START, *TARGETS], LABELS, strict=True)):
        axes.annotate(f"{number}", place, xytext=beside, textcoords="offset points")
    axes.set(title=title, xlabel="x of h (m)", aspect="equal", xlim=(-0.3, 2.3), ylim=(-0.3, 2.3))
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")


def draw_figure_11(path: Path, runs: dict[str, Drive], spread: dict[str, np.ndarray]) -> None:
    """Errors from (0, 1) against normalised steps, and where the minima fall when every number is 1 % unsure."""
    figure = Figure(figsize=(11, 7.5), layout="constrained")
    for axis, row in enumerate(figure.subplots(2, 2, width_ratios=(2, 1), sharex="col")):
        for name in (FINE, COARSE):
            draw_error(row[0], runs[name], name, axis)
            draw_spread(row[1], spread[name][:, axis], name, axis)
        row[0].set(ylabel=f"|error in {'xy'[axis]}| from (0, 1) (m)", xlim=(0, 1), yscale="log", ylim=(5e-5, 3))
        row[0].grid(alpha=0.3)
        row[1].grid(alpha=0.3)
        row[1].set(ylabel="share of drives", xscale="log", xlim=(1e-5, 1e-1))
        if axis == 0:
            row[0].set_title("Figure 11: thick on the way to (0, 1), dots at the minima there")
            row[1].set_title("Minima with every number ±1 %")
            row[0].legend(loc="lower right")
        else:
            row[0].set_xlabel("step / number of steps (settling at the last target cut off)")
            row[1].set_xlabel("smallest error (m); dashes: the paper's digits")
    figure.savefig(path, dpi=110)


def draw_error(axes: Axes, run: Drive, name: str, axis: int) -> None:
    """One run's error, the leg to (0, 1) strong, its minimum a dot."""
    error = errors(run)[:, axis]
    leg = second_leg(run)
    share = np.arange(len(error)) / run.reached[3]
    axes.plot(share, error, color=COLOURS[name], lw=0.8, alpha=0.6)
    axes.plot(share[leg], error[leg], color=COLOURS[name], lw=2, label=name)
    nearest = leg.start + int(error[leg].argmin())
    axes.plot(share[nearest], error[nearest], "o", color=COLOURS[name])


def draw_spread(axes: Axes, minima_m: np.ndarray, name: str, axis: int) -> None:
    """Which share of the drives came nearer than that; a dashed line for the paper's one."""
    axes.axvline(PRINTED[name][axis], color=COLOURS[name], ls="--", lw=1.2)
    axes.step(np.sort(minima_m), (np.arange(len(minima_m)) + 1) / len(minima_m), color=COLOURS[name], where="post")


def tell(runs: dict[str, Drive], spread: dict[str, np.ndarray]) -> None:
    """Print the table of docs/paper.md."""
    print("| | x, y (mm) | x, every number ±1 % | y, every number ±1 % | the first is nearer in x, y |")
    print("|---|---|---|---|---|")
    for name, run in runs.items():
        x, y = minima(run) * 1e3
        low, middle, high = np.percentile(spread[name] * 1e3, [2.5, 50, 97.5], axis=0)
        ranges = " | ".join(f"{middle[i]:.2g} ({low[i]:.2g} to {high[i]:.2g})" for i in (0, 1))
        nearer = ", ".join(f"{share:.0%}" for share in (spread[FINE] < spread[name]).mean(0))
        print(f"| {name} | {x:.2g}, {y:.2g} | {ranges} | {nearer if name != FINE else ''} |")


def main() -> None:
    """Drive, draw two pictures, print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--draws", type=int, default=200, help="drives with every number up to 1 % off")
    asked = parser.parse_args()
    paper = CONTROLLERS["paper"]
    runs = {name: way(theta=AS_PRINTED, controller=paper) for name, way in WAYS.items()}
    presets = {name: drive(TARGETS, theta=AS_PRINTED, controller=settings) for name, settings in CONTROLLERS.items()}
    robots = [nearly(rng) for rng in np.random.default_rng(0).spawn(asked.draws)]
    spread = {}
    for name, way in WAYS.items():
        closest = [minima(way(theta=t, controller=c)) for t, c in robots]
        spread[name] = np.array(closest)
    asked.folder.mkdir(parents=True, exist_ok=True)
    draw_figure_10(asked.folder / "paper_figure_10.png", runs, presets)
    draw_figure_11(asked.folder / "paper_figure_11.png", runs, spread)
    tell(runs, spread)


if __name__ == "__main__":
    main()
