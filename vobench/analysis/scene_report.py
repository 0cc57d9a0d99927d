"""Reports the contents of a scene or model as lines of text, as a table, and as a picture with a plan and views."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vobench.analysis.scene_sheet import sheet
from vobench.analysis.scene_survey import SceneSurvey, scene_survey
from vobench.asset import MODEL_SUFFIXES
from vobench.runner.exposure_doubt import exposure_doubts
from vobench.runner.key import cache_folder
from vobench.runner.simulate import open_renderer
from vobench.runner.store import SILENT, Progress
from vobench.runner.task import bake_task, is_done, perform
from vobench.scene.light import Light, Sky, Sun
from vobench.scene.scene import Scene
from vobench.sequence.picture import write_png
from vobench.suite.scene_build import build
from vobench.suite.scene_entry import DRAWN
from vobench.suite.scene_file import read_place
from vobench.suite.scene_spec import ModelSpec, SceneFile
from vobench.suite.suite_spec import Rendering
from vobench.suite.white import white_of


@dataclass(frozen=True, slots=True)
class SceneReport:
    """The survey of a scene.

    `spec` is the scene's file.
    `scene` is the scene that was built from it.
    `survey` has the contents of the scene and the defects of its meshes.
    `notes` are notes for the user on what was changed or doubtful when the models were read.
    """

    spec: SceneFile
    scene: Scene
    survey: SceneSurvey
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """The contents of the scene, one line each, without the notes."""
        survey = self.survey
        corners_m = zip(survey.low_m, survey.high_m, strict=True)
        size = " x ".join(f"{high_m - low_m:.2f}" for low_m, high_m in corners_m)
        defects = f"open edges: {survey.open_edge_count:,}; faces on a face: {survey.duplicate_face_count:,}"
        contents = f"{survey.thing_count} things, {survey.face_count:,} faces, {survey.material_count} materials"
        lines = [
            f"{self.spec.place_name}: {contents}",
            f"size: {size} m",
            f"textures: {survey.textures_mb:.0f} MB",
            defects,
            f"backs seen: {survey.back_facing_share:.1%}",
            f"free circle: {self._free_circle()}",
        ]
        if not survey.is_place:
            lines.append("an object rather than a place to drive in: put it into a scene's YAML as one of its meshes")
        lines += [f"light: {light.name}, {strength(light)}" for light in self.scene.lights]
        return lines

    def _free_circle(self) -> str:
        circle = self.survey.free_circle
        if circle is None:
            return "none"
        return f"{circle.radius_m:.1f} m around ({circle.x_m:.1f}, {circle.y_m:.1f}), floor at {circle.floor_m:.2f} m"

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench scene --json` prints them."""
        survey = self.survey
        return {
            "things": survey.thing_count,
            "faces": survey.face_count,
            "materials": survey.material_count,
            "textures_mb": survey.textures_mb,
            "low_m": survey.low_m,
            "high_m": survey.high_m,
            "lights": survey.light_names,
            "open_edges": survey.open_edge_count,
            "twins": survey.duplicate_face_count,
            "backs": survey.back_facing_share,
            "free": asdict(survey.free_circle) if survey.free_circle else None,
            "is_place": survey.is_place,
            "notes": list(self.notes),
            "white_cd_m2": self.white_cd_m2(),
        }

    def white_cd_m2(self) -> float | None:
        """The luminance of the white that cameras are exposed for, in cd/m².

        It is None if the scene does not specify it and its light has not been computed.
        """
        if self.spec.white_cd_m2 is None and self._light() is None:
            return None
        return white_of(self.spec, self._light())

    def doubts(self) -> list[str]:
        """Warnings about the exposure of cameras on the free path; empty if the light is not in the cache."""
        light = self._light()
        return exposure_doubts(self.spec, light) if light else []

    def _light(self) -> Path | None:
        """The folder of the scene's light, if it is in the cache."""
        task = bake_task(self.spec)
        root = cache_folder()
        return root / task.key if is_done(task, root) else None

    def save_picture(self, path: Path, *, progress: Progress = SILENT) -> None:
        """Draw a plan, the lines of text and four views to a PNG. The light is computed unless it is cached."""
        light = perform(bake_task(self.spec), cache_folder(), progress=progress)
        with closing(open_renderer(self.scene, Rendering(), light)) as renderer:
            picture = sheet(self.scene, self.survey, renderer, white_of(self.spec, light), self.lines())
        write_png(path, picture)


def strength(light: Light) -> str:
    """The illuminance or power of a light, as text with its unit."""
    if isinstance(light, Sky | Sun):
        return f"{light.illuminance_lx:.0f} lx"
    return f"{light.power_lm:.0f} lm"


def survey_scene(scene: str, *, seed: int | None = None, lighting: str = DRAWN) -> SceneReport:
    """Survey a scene, given its name or the path of its file or model. Its light is not computed.

    `seed` is the seed of the place that the scene's generator creates; None for a scene that is not generated.
    `lighting` is the lighting of a generated place.
    Raises UnknownNameError if there is no such scene, and SuiteError or ModelError if its files are invalid.
    """
    spec = read_place(scene, seed=seed, lighting=lighting)
    built = build(spec, {})
    return SceneReport(spec, built, scene_survey(built), tuple(_notes(spec.meshes)))


def _notes(models: Sequence[ModelSpec]) -> list[str]:
    """Notes on what was changed or doubtful when the models were read."""
    from vobench.asset.model import read_model

    notes = []
    for spec in models:
        path = Path(spec.file)
        if path.suffix.lower() not in MODEL_SUFFIXES:
            continue
        model = read_model(path, scale=spec.scale, roles=spec.roles, up=spec.up)
        notes += [f"{path.name}: {note}" for note in model.notes]
        if model.dropped_faces:
            notes.append(f"{path.name}: {model.dropped_faces} faces without area were dropped")
    return notes
