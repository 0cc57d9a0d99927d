"""Recordings with known damage: whether `vobench explain RECORDING` names it, and whether the twin fails alike.

    python benchmarks/damaged_recordings.py [--only NAME ...] [--world 0|1|2] [--out FOLDER]

Recordings of a small hall are simulated and exported in the form of EuRoC. Then three seconds of their pictures are
damaged by formulas that are not those of `explain`. The twin is simulated in another hall. Prints for each recording
which damage was named, the overlap of errors in time, and the errors on both sides; and in the last line how many were
right. `nothing` is the recording without damage, of which nothing should be named.
"""

import argparse
import csv
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.analysis.explain_recording import explain_recording
from vobench.analysis.picture_change import BLUR, DIRT, DROPPED, EXPOSURE, NOISE, TURNED
from vobench.analysis.recording_explanation import RecordingExplanation
from vobench.dataset.export import export
from vobench.errors import InputError
from vobench.rendering import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.runner.executor import Serial
from vobench.runner.folder import SEQUENCE, RunFolder
from vobench.runner.import_recording import read_all
from vobench.runner.key import cache_folder
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.run import run_suite
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan

Picture = NDArray[np.uint8]

RATE_HZ = 10
DAMAGED_S = (7.0, 10.0)
NEEDED_OVERLAP = 0.6
FOCAL_PX = 500.0
SIZE_PX = (400, 240)

# --- The recordings ---

TWIN_PLACE = "studio"
PLACES: dict[str, dict[str, Any]] = {
    "hall": {
        "room": {"size_m": [8, 7, 3.0], "floor": "floor", "wall": "wall", "ceiling": "wall"},
        "boxes": [
            {"center_m": [3.2, 1.0, 0.6], "size_m": [0.6, 0.6, 1.2], "material": "box"},
            {"center_m": [-3.0, -1.6, 0.7], "size_m": [0.5, 0.7, 1.4], "material": "box", "yaw_deg": 30},
            {"center_m": [0.2, 0.1, 0.5], "size_m": [0.8, 0.5, 1.0], "material": "box", "yaw_deg": 15},
            {"center_m": [0.5, -3.0, 0.8], "size_m": [0.9, 0.5, 1.6], "material": "box", "yaw_deg": 60},
        ],
        "contrast": 0.5,
        "power_lm": 4000,
    },
    "gallery": {
        "room": {"size_m": [9, 6.6, 2.8], "floor": "floor", "wall": "wall", "ceiling": "wall"},
        "boxes": [
            {"center_m": [3.6, -0.8, 0.5], "size_m": [0.7, 0.7, 1.0], "material": "box", "yaw_deg": 20},
            {"center_m": [-3.4, 0.9, 0.9], "size_m": [0.6, 0.4, 1.8], "material": "box"},
            {"center_m": [0.0, 2.8, 0.4], "size_m": [1.2, 0.5, 0.8], "material": "box", "yaw_deg": -20},
        ],
        "contrast": 0.6,
        "power_lm": 3500,
    },
    TWIN_PLACE: {
        "room": {"size_m": [10, 9, 3.2], "floor": "floor", "wall": "wall", "ceiling": "wall"},
        "boxes": [
            {"center_m": [2.0, 3.4, 0.6], "size_m": [0.8, 0.6, 1.2], "material": "box", "yaw_deg": 40},
            {"center_m": [-4.0, 2.6, 0.8], "size_m": [0.6, 0.9, 1.6], "material": "box"},
            {"center_m": [3.9, -2.2, 0.7], "size_m": [0.5, 0.5, 1.4], "material": "box", "yaw_deg": 10},
        ],
        "contrast": 0.55,
        "power_lm": 6000,
    },
    "depot": {
        "room": {"size_m": [7.4, 8.2, 3.1], "floor": "floor", "wall": "wall", "ceiling": "wall"},
        "boxes": [
            {"center_m": [0.2, -0.3, 0.5], "size_m": [0.8, 0.6, 1.0], "material": "box", "yaw_deg": 35},
            {"center_m": [-3.1, -2.6, 0.8], "size_m": [0.6, 0.8, 1.6], "material": "box", "yaw_deg": 10},
            {"center_m": [3.2, 2.2, 0.6], "size_m": [0.5, 0.9, 1.2], "material": "box", "yaw_deg": -15},
            {"center_m": [-1.6, 3.4, 0.7], "size_m": [1.0, 0.6, 1.4], "material": "box", "yaw_deg": 50},
        ],
        "contrast": 0.5,
        "power_lm": 4500,
    },
}
WORLDS = ("hall", "gallery", "depot")
PATHS = {
    "hall": [[2.2, 0, 1.2], [1.5, 1.6, 1.3], [0, 2.1, 1.2], [-1.6, 1.5, 1.1], [-2.2, 0, 1.2], [-1.5, -1.6, 1.3]],
    "gallery": [
        [-2.4, -1.2, 1.3],
        [-1.0, -1.7, 1.2],
        [0.8, -1.3, 1.1],
        [2.2, -0.3, 1.2],
        [2.0, 1.2, 1.3],
        [0.6, 1.6, 1.2],
    ],
    "depot": [
        [-2.6, 0.4, 1.2],
        [-1.4, -1.8, 1.1],
        [0.6, -2.4, 1.2],
        [2.4, -1.4, 1.3],
        [1.8, 0.6, 1.2],
        [0.2, 1.8, 1.1],
    ],
}


def write_place(folder: Path, name: str) -> Path:
    """The scene of a place."""
    place = PLACES[name]
    seed = list(PLACES).index(name)
    scene = {
        "name": name,
        "white_cd_m2": 80,
        "materials": {
            "floor": {"pattern": "terrazzo", "albedo": 0.45, "contrast": place["contrast"], "seed": seed + 10},
            "wall": {"pattern": "poster", "albedo": 0.5, "contrast": place["contrast"], "tile_m": 2, "seed": seed + 20},
            "box": {"pattern": "poster", "albedo": 0.4, "contrast": 0.6, "seed": seed + 30},
        },
        "room": place["room"],
        "boxes": place["boxes"],
        "lamps": [
            {"name": "lamp", "center_m": [1.5, 0.5, 2.7], "size_m": [1.0, 0.6], "power_lm": place["power_lm"]},
            {"name": "far", "center_m": [-2.0, -0.8, 2.7], "size_m": [0.8, 0.6], "power_lm": place["power_lm"] / 2},
        ],
    }
    file = folder / f"{name}.yaml"
    file.write_text(json.dumps(scene, indent=1))
    return file


def simulate(folder: Path, world: str, run_plan: PlanRunner) -> Path:
    """Simulate a recording of a world, and export it in the form of EuRoC."""
    scene = write_place(folder, world)
    suite = {
        "name": f"base_{world}",
        "seed": 3,
        "scenes": [str(scene)],
        "rigs": {
            "pair": {
                "own": {
                    "left": {
                        "size_px": SIZE_PX,
                        "focal_px": [FOCAL_PX, FOCAL_PX],
                        "center_px": [SIZE_PX[0] / 2 - 0.5, SIZE_PX[1] / 2 - 0.5],
                    },
                    "right_at_m": [0.15, 0, 0],
                },
                "pitch_deg": 0,
                "forward_m": 0,
                "height_m": 0,
            }
        },
        "trajectories": {
            "way": {"kind": "rail", "points_m": PATHS[world], "speed_mps": 0.5, "accel_mps2": 1.0, "rate_hz": RATE_HZ}
        },
        "cameras": {"usual": {"sensor": "mt9v034", "exposure_ms": 5, "blur_sigma_px": 0.4, "vignetting": 0.2}},
        "estimators": ["stand_still"],
    }
    file = folder / f"base_{world}.yaml"
    file.write_text(json.dumps(suite, indent=1))
    run = run_plan(read_plan(str(file)))
    out = folder / world
    shutil.rmtree(out, ignore_errors=True)
    export((run.case("way") / SEQUENCE).resolve(), out, "euroc")
    return out


# --- Damage ---


@dataclass(frozen=True, slots=True)
class Stretch:
    """The damaged pictures of one camera, one after the other, and random numbers."""

    pictures: list[Picture]
    is_right: bool
    rng: np.random.Generator


def defocused(stretch: Stretch) -> list[Picture]:
    """Pictures behind a lens that is out of focus: a disc of 13 px."""
    rows, columns = np.mgrid[-6:7, -6:7]
    disc = (rows**2 + columns**2 <= 6.5**2).astype(np.float32)
    return [cv2.filter2D(picture, -1, disc / disc.sum(), borderType=cv2.BORDER_REFLECT) for picture in stretch.pictures]


def dirty(stretch: Stretch) -> list[Picture]:
    """Pictures behind a lens with opaque specks and translucent smears, other ones for each eye."""
    height, width = stretch.pictures[0].shape
    loss = np.zeros((height, width))
    rows, columns = np.mgrid[:height, :width]
    for _ in range(70):
        row = stretch.rng.uniform(0, height)
        column = stretch.rng.uniform(0, width)
        radius = stretch.rng.uniform(5, 16)
        stretching = stretch.rng.uniform(0.6, 1.6)
        distance = np.hypot((rows - row) * stretching, (columns - column) / stretching) / radius
        loss = np.maximum(loss, stretch.rng.uniform(0.7, 0.97) * np.clip(3 - 2.2 * distance, 0, 1))
    return [
        np.rint(picture * (1 - loss) + 0.15 * loss * picture.mean()).astype(np.uint8) for picture in stretch.pictures
    ]


def noisy(stretch: Stretch) -> list[Picture]:
    """Pictures of a chip that counts few electrons, with a bright and a dark offset of its rows."""
    noisy_pictures = []
    for picture in stretch.pictures:
        electrons = stretch.rng.poisson(picture * 0.12).astype(float)
        rows = stretch.rng.normal(0, 3, (len(picture), 1))
        values = electrons / 0.12 + rows + stretch.rng.normal(0, 8, picture.shape)
        noisy_pictures.append(np.clip(np.rint(values), 0, 255).astype(np.uint8))
    return noisy_pictures


def exposed_by_turns(stretch: Stretch) -> list[Picture]:
    """Pictures whose exposure jumps to and fro every two frames, as a loop does that overshoots."""
    gains = (0.05, 4.0, 0.08, 1.0, 5.0)
    exposed = []
    for index, picture in enumerate(stretch.pictures):
        gain = gains[(index // 2) % len(gains)]
        exposed.append(np.clip(np.floor(picture.astype(float) * gain), 0, 255).astype(np.uint8))
    return exposed


def turned(stretch: Stretch) -> list[Picture]:
    """Right pictures of a camera that is turned by .05° to the right about its vertical axis."""
    if not stretch.is_right:
        return stretch.pictures
    angle_rad = np.deg2rad(0.05)
    width, height = SIZE_PX
    K = np.array([[FOCAL_PX, 0, width / 2 - 0.5], [0, FOCAL_PX, height / 2 - 0.5], [0, 0, 1]])
    # The new camera's x axis points away from the scene's: a point moves to the left.
    R_new_old = cv2.Rodrigues(np.array([0, -angle_rad, 0]))[0]
    H = K @ R_new_old @ np.linalg.inv(K)
    return [
        cv2.warpPerspective(picture, H, SIZE_PX, flags=cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT)
        for picture in stretch.pictures
    ]


@dataclass(frozen=True, slots=True)
class Damage:
    """What is done to pictures, the name that `explain` should give, and an estimator that fails."""

    cause: str
    estimator: str
    change: Callable[[Stretch], list[Picture]] | None = None
    kept: int = 1  # one of so many frames is kept


DAMAGES = {
    "defocus": Damage(BLUR, "lk_epipolar", defocused),
    "dirt": Damage(DIRT, "lk_epipolar", dirty),
    "noise": Damage(NOISE, "lk_epipolar", noisy),
    "drops": Damage(DROPPED, "lk_epipolar", kept=15),
    "turned": Damage(TURNED, "feature_vo", turned),
    "jumps": Damage(EXPOSURE, "feature_vo", exposed_by_turns),
    "nothing": Damage("", "lk_epipolar"),
}


def damage(recording: Path, out: Path, what: Damage, *, seed: int = 0) -> Path:
    """A copy of a recording in which three seconds are damaged."""
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(recording, out)
    for camera in ("cam0", "cam1"):
        folder = out / "mav0" / camera
        rows = list(csv.reader((folder / "data.csv").read_text().splitlines()))
        header, *frames = rows
        start_ns = int(frames[0][0])
        since_s = [(int(frame[0]) - start_ns) / 1e9 for frame in frames]
        chosen = [index for index, t_s in enumerate(since_s) if DAMAGED_S[0] <= t_s < DAMAGED_S[1]]
        files = [folder / "data" / frames[index][1].strip() for index in chosen]
        if what.change is not None:
            pictures = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]
            rng = np.random.default_rng([seed, int(camera == "cam1")])
            for file, picture in zip(files, what.change(Stretch(pictures, camera == "cam1", rng)), strict=True):
                cv2.imwrite(str(file), picture)
        if what.kept > 1:
            dropped = {index for number, index in enumerate(chosen) if number % what.kept}
            for index in dropped:
                (folder / "data" / frames[index][1].strip()).unlink()
            kept = [frame for index, frame in enumerate(frames) if index not in dropped]
            (folder / "data.csv").write_text("".join(f"{','.join(row)}\n" for row in [header, *kept]))
    return out


# --- The judgement ---


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether the damage was named, and nothing else; and a line about it."""

    is_right: bool
    is_alike: bool
    line: str


def judge(name: str, base: Path, place: Path, run_plan: PlanRunner) -> Judgement:
    """Damage a recording, and explain it by a twin in a place. The copy and the twin are beside the recording."""
    what = DAMAGES[name]
    recording = damage(base, base.with_name(f"{base.name}_{name}"), what)
    out = base.with_name(f"explained_{base.name}_{name}")
    shutil.rmtree(out, ignore_errors=True)
    began_s = time.process_time()
    try:
        found = explain_recording(
            recording, run_plan=run_plan, estimator=what.estimator, place=str(place), out=out, repeats=3
        )
    except InputError as error:
        return Judgement(not what.cause, not what.cause, f"{base.name} {name}: no answer: {error}")
    cost_s = time.process_time() - began_s
    is_right = set(found.named) == ({what.cause} if what.cause else set())
    is_alike = found.overlap >= NEEDED_OVERLAP
    (out / "answer.txt").write_text("\n".join(found.sentences) + "\n")
    return Judgement(is_right, is_alike, f"{base.name} {name}: {_line(found, is_right=is_right)}; {cost_s:.0f} CPU s")


def _line(found: RecordingExplanation, *, is_right: bool) -> str:
    seen = ", ".join(change.name for change in found.changes) or "nothing"
    named = ", ".join(found.named) or "nothing"
    line = (
        f"{'right' if is_right else 'WRONG'}: named {named}; seen {seen}; {found.frames.is_failing.sum()} frames fail"
    )
    if found.twin is None:
        return line
    failing = found.frames.is_failing
    typical_in_twin = np.median(found.twin.unchanged_loss)
    reductions = ", ".join(f"{'+'.join(c.removed)} {c.reduction:.0%}" for c in found.twin.explanation.singles)
    return (
        f"{line}; overlap {found.overlap:.2f} (by chance {found.twin.coincidence.by_chance:.2f}, "
        f"p {found.twin.coincidence.p:.2f}); error "
        f"{found.frames.loss[failing].mean():.1%} and {found.twin.loss[failing].mean():.1%} (typical "
        f"{found.frames.typical:.1%} and {typical_in_twin:.1%}); without {reductions}; "
        f"scale {found.twin.scale:g}, misfit {found.twin.misfit:.0%}"
    )


def coarse_light() -> None:
    """Light that is computed in half a second: it is the same in all recordings."""
    whole = bake.bake
    bake.bake = lambda scene, _, tell: whole(scene, BakeSettings(0.1, 4, 0.3, 64, 4), tell)


def plan_runner(out: Path) -> PlanRunner:
    """Runs a plan in this process."""

    def run_here(plan: Plan, /) -> RunFolder:
        recordings = read_all(plan)
        return run_suite(plan, recordings, root=out, store=cache_folder(), finish=lambda *_: None, executor=Serial())

    return run_here


def main() -> None:
    """Read what is asked for, and print."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--only", nargs="*", choices=list(DAMAGES), default=list(DAMAGES))
    asked.add_argument("--world", type=int, choices=range(len(WORLDS)), default=0)
    asked.add_argument("--out", type=Path, default=Path("runs/damaged"))
    args = asked.parse_args()
    coarse_light()
    folder = args.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    run_plan = plan_runner(folder / "runs")
    world = WORLDS[args.world]
    base = simulate(folder, world, run_plan)
    place = write_place(folder, TWIN_PLACE)
    judgements = []
    for name in args.only:
        judgement = judge(name, base, place, run_plan)
        print(judgement.line, flush=True)
        judgements.append(judgement)
    right = sum(judgement.is_right for judgement in judgements)
    alike = sum(judgement.is_alike for judgement in judgements)
    print(f"{right} of {len(judgements)} right, {alike} with an overlap of {NEEDED_OVERLAP:g} or more")


if __name__ == "__main__":
    main()
