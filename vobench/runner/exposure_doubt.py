"""Doubts about exposures: cases and scenes whose pictures are largely saturated or black, and what to change."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vobench.errors import VobenchError
from vobench.runner.folder import SEQUENCE, RunFolder, UnavailableCases
from vobench.runner.key import cache_folder
from vobench.runner.task import bake_task, is_done
from vobench.scene.light import Light
from vobench.suite.case import Case
from vobench.suite.plan import Plan
from vobench.suite.scene_build import listed_lights
from vobench.suite.scene_lighting import with_lighting
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite_case import scene_lights

if TYPE_CHECKING:
    from vobench.suite.white import ExposedShares, Remedy

# What reads the light is imported where it is used: a check of a suite whose light is not computed needs none of it.

FIRST_PICTURES = 3  # of a case, that a run looks at


def exposure_doubts(spec: SceneFile, light: Path) -> list[str]:
    """A sentence if the scene's white makes pictures from its free path largely saturated or black, else none.

    `light` is the folder with the scene's light.
    """
    from vobench.rendering.seen_light import read_seen_light
    from vobench.suite.white import Remedy, doubt_sentence, exposed_shares, white_of

    seen = read_seen_light(light)
    luminance_cd_m2 = seen.luminance(listed_lights(spec))
    remedy = Remedy(white_cd_m2=white_of(spec, light))
    shares = exposed_shares(luminance_cd_m2, remedy.effective_white_cd_m2)
    if not shares.is_doubtful:
        return []
    sentence = doubt_sentence(shares, luminance_cd_m2, seen.is_source, remedy)
    return [f"{sentence} (along the free path)"]


def doubts_of_plan(plan: Plan) -> list[str]:
    """A sentence for each group of simulated cases that would be largely saturated or black along the free path.

    Only cases whose light is in the cache are known. Scenarios, which are dark or bright on purpose, are left out, and
    cameras with auto-exposure.
    """
    sentences = dict[str, str]()
    for case in _doubtable(plan.simulated):
        light = _light(case)
        sentence = _doubt_of(case, light) if light else None
        if sentence:
            sentences[case.name] = sentence
    return [f"{names}: {sentence} (along the free path)" for sentence, names in _grouped(sentences).items()]


def doubts_of_run(plan: Plan, folder: RunFolder) -> list[str]:
    """A sentence for each group of simulated cases whose first pictures are largely saturated or black."""
    sentences = dict[str, str]()
    for case in _doubtable(plan.simulated):
        shares = _shares_of_first_pictures(folder.case(case.name) / SEQUENCE)
        if shares is None or not shares.is_doubtful:
            continue
        light = _light(case)
        sentence = _doubt_of(case, light, shares) if light else None
        sentences[case.name] = sentence or f"{shares}; change the camera's exposure_gain, or use auto_exposure"
    return [f"{names}: {sentence} (in its first images)" for sentence, names in _grouped(sentences).items()]


def _doubt_of(case: Case, light: Path, shares: "ExposedShares | None" = None) -> str | None:
    """What to change in a case with such shares of pixels, by default those along the free path; None if they are good.

    `light` is the folder with the light of its scene.
    """
    from vobench.rendering.seen_light import read_seen_light
    from vobench.suite.white import doubt_sentence, exposed_shares

    seen = read_seen_light(light)
    luminance_cd_m2 = seen.luminance(_lights(case))
    remedy = _remedy(case, light)
    shown = shares or exposed_shares(luminance_cd_m2, remedy.effective_white_cd_m2)
    if not shown.is_doubtful:
        return None
    return doubt_sentence(shown, luminance_cd_m2, seen.is_source, remedy)


def _doubtable(cases: Iterable[Case]) -> list[Case]:
    return [case for case in cases if case.scenario is None and case.camera.auto_exposure is None]


def _light(case: Case) -> Path | None:
    """The folder with the light of a case's scene, if it is in the cache."""
    task = bake_task(case.scene)
    root = cache_folder()
    return root / task.key if is_done(task, root) else None


def _lights(case: Case) -> tuple[Light, ...]:
    """The lights of a case whose levels may differ from those that its scene's light is stored with."""
    return with_lighting(scene_lights(case.scene, case.lighting.keys()), case.lighting)


def _remedy(case: Case, light: Path) -> "Remedy":
    """How a case is exposed, and which key changes that.

    White belongs to the scene's own lighting. Under another lighting, or if white is not stated, the camera's
    exposure_gain is to be changed.
    """
    from vobench.suite.white import Remedy, white_of

    camera = case.camera
    amplification = camera.compensation * 10 ** (camera.gain_db / 20)
    is_white_at_fault = case.scene.white_cd_m2 is not None and not case.lighting
    return Remedy(
        white_cd_m2=white_of(case.scene, light),
        exposure_gain=camera.exposure_gain,
        amplification=amplification,
        changes_white=is_white_at_fault,
    )


def _shares_of_first_pictures(sequence: Path) -> "ExposedShares | None":
    """The shares of saturated and black pixels in the first left pictures of a sequence; None if there is none."""
    from vobench.sequence import Sequence as Recorded
    from vobench.suite.white import BLACK_DN, SATURATED_DN, ExposedShares

    pictures = []
    try:
        for frame in Recorded.open(sequence).frames(right=False):
            pictures.append(frame.left)
            if len(pictures) == FIRST_PICTURES:
                break
    except VobenchError:
        return None  # the run says elsewhere which sequences could not be made
    if not pictures:
        return None
    values = np.stack(pictures)
    return ExposedShares(float((values >= SATURATED_DN).mean()), float((values <= BLACK_DN).mean()))


def _grouped(sentences: Mapping[str, str]) -> dict[str, str]:
    """The names of the cases of each sentence."""
    cases = dict[str, list[str]]()
    for case, sentence in sentences.items():
        cases.setdefault(sentence, []).append(case)
    return {sentence: _names(names) for sentence, names in cases.items()}


def _names(cases: Sequence[str]) -> str:
    return UnavailableCases("", tuple(cases)).names
