"""Make what ORB-SLAM3 needs to stand on a board: an environment of its own and a vocabulary.

    .venv/bin/python examples/orbslam3/setup.py
    VOBENCH_SANDBOX_READ=examples/orbslam3 .venv/bin/vobench run examples/orbslam3/suite.yaml

pyorbslam3 is ORB-SLAM3 (Campos et al., TRO 2021) as a wheel, under GPL-3: it lives in `.venv` beside this file, runs in
processes of its own, and nothing of vobench imports it. The variable lets its estimators read this folder. Its own
vocabulary is not in the wheel; the one made here is of ORB features in vobench's textures. It needs the system
libraries libgl1 libegl1 libopengl0 libsm6 libice6 libx11-6 libxext6.
"""

import subprocess
import sys
import venv
from pathlib import Path

import numpy as np

from vobench.plugin import picture

FOLDER = Path(__file__).resolve().parent
PICTURES = 24


def textures() -> list[np.ndarray]:
    """Pages, posters, spines, screens, brick and wood (H, W, 3) uint8: what a wall or a shelf shows."""
    made = []
    for seed in range(PICTURES // 6):
        made += [picture.pages(seed), picture.screen(seed), picture.whiteboard(seed), picture.carton(seed)]
        made += [picture.poster("talk", seed), picture.terrazzo(seed)]
    return [one.pixels()[..., :3] for one in made]


def main() -> None:
    """The environment, then the vocabulary by a script that runs in it."""
    environment = FOLDER / ".venv"
    venv.create(environment, with_pip=True)
    python = environment / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", "pyorbslam3", "opencv-python-headless"], check=True)
    with (FOLDER / ".venv" / "textures.npz").open("wb") as file:
        np.savez(file, *textures())
    subprocess.run([python, FOLDER / "vocabulary.py", file.name, environment / "vocabulary.txt"], check=True)
    print(f"ready: {environment}")


if __name__ == "__main__":
    sys.exit(main())
