"""Names from earlier releases that have moved or were removed, each supported for one more release.

A name that has only moved still works, with a DeprecationWarning that names the new module. For a name that was removed
or changed, the import raises an ImportError with a sentence that names the replacement. `vobench/__init__.py` uses this
module only when an import from vobench is about to fail.
"""

import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

ADVICE = "import from vobench.plugin what plugins may use (docs/estimators.md)"

# Old module: name: the name that replaces it, in the same form. Cache keys read this table without importing it
# (`runner/key.py`), so it must stay a literal.
MOVED = {
    "vobench.asset.picture": {
        "Unpainted": "vobench.asset.picture.LazyTexture",
        "some": "vobench.asset.picture.one_of",
    },
    "vobench.plugin": {"Followed": "vobench.plugin.StereoTracks"},
    "vobench.geometry.rectify": {
        "Rectification": "vobench.plugin.Rectification",
        "rectification": "vobench.plugin.rectification",
        "projection": "vobench.geometry.rig.projection",
    },
    "vobench.geometry.lens": {
        "BrownConrady": "vobench.plugin.BrownConrady",
        "KannalaBrandt": "vobench.plugin.KannalaBrandt",
    },
    "vobench.geometry.sphere": {
        "DoubleSphere": "vobench.plugin.DoubleSphere",
        "Equirectangular": "vobench.plugin.Equirectangular",
    },
    "vobench.estimator.tools": {
        "Eye": "vobench.plugin.Eye",
        "Mask": "vobench.plugin.Mask",
        "Points": "vobench.plugin.Points",
        "StereoPair": "vobench.plugin.StereoPair",
        "coarse_disparity": "vobench.plugin.coarse_disparity",
        "comparable": "vobench.plugin.comparable",
        "corners_per_cell": "vobench.plugin.corners_per_cell",
        "follow": "vobench.plugin.follow",
        "follow_predicted": "vobench.plugin.follow_predicted",
        "inside": "vobench.plugin.inside",
        "local_contrast": "vobench.plugin.local_contrast",
        "lucas_kanade": "vobench.plugin.lucas_kanade",
        "parameters": "vobench.plugin.parameters",
        "predicted": "vobench.plugin.predicted",
        "stereo_pair": "vobench.plugin.stereo_pair",
        "DisparityOffset": "vobench.plugin.DisparityOffset",
        "PoseFit": "vobench.plugin.PoseFit",
        "adjoint": "vobench.plugin.adjoint",
        "carried_on": "vobench.plugin.carried_on",
        "cross_matrix": "vobench.plugin.cross_matrix",
        "pose_from_points": "vobench.plugin.pose_from_points",
        "twist": "vobench.plugin.twist",
    },
    "vobench.sensor.encoder": {
        "ENCODERS": "vobench.motion.encoder.ENCODERS",
        "EncoderErrors": "vobench.motion.encoder.EncoderErrors",
        "ticks": "vobench.motion.encoder.ticks",
    },
    "vobench.dataset.convert": {"convert": "vobench.dataset.sequence.convert"},
    "vobench.dataset.read": {
        "read": "vobench.dataset.layout.read",
        "sniff": "vobench.dataset.layout.sniff",
    },
    "vobench.dataset.sniff": {"sniff": "vobench.dataset.layout.sniff"},
    "vobench.dataset.options": {
        "Options": "vobench.plugin.ReadOptions",
        "Topics": "vobench.plugin.Topics",
    },
    "vobench.dataset.views": {
        "Views": "vobench.plugin.Views",
        "rectified": "vobench.plugin.rectified",
    },
    "vobench.dataset.files": {
        "read_bytes": "vobench.dataset.picture.read_bytes",
        "read_text": "vobench.dataset.picture.read_text",
        "unread": "vobench.plugin.unread",
    },
    "vobench.dataset.reproject": {"check_path": "vobench.dataset.read_back.check_path"},
    "vobench.dataset.stream": {
        "PictureStream": "vobench.plugin.PictureStream",
        "Shot": "vobench.plugin.RecordedFrame",
    },
    "vobench.dataset.export_trajectory": {"export_trajectory": "vobench.dataset.export.export_trajectory"},
    "vobench.metric.scale": {
        "ate_scale": "vobench.metric.comparison.ate_scale",
        "motion_scale": "vobench.metric.comparison.motion_scale",
        "scale_errors": "vobench.metric.segment.scale_errors",
    },
    "vobench.metric.pose_error": {
        "angle_rad": "vobench.metric.motion_error.angle_rad",
        "in_plane": "vobench.metric.comparison.in_plane",
        "motion_errors": "vobench.metric.motion_error.motion_errors",
        "motions": "vobench.metric.motion_error.motions",
        "roll_pitch_yaw_rad": "vobench.geometry.se3.roll_pitch_yaw_rad",
    },
    "vobench.metric.pairs": {"select_pairs": "vobench.metric.pose_pairs.select_pairs"},
    "vobench.metric.statistic": {"statistics": "vobench.metric.score.statistics"},
    "vobench.trajectory.text": {"format_tum": "vobench.trajectory.tum.format_tum"},
}

# Old module: name: the replacement, as the end of a sentence.
GONE = {
    "vobench.geometry.rectify": {
        "rectify": "vobench.plugin.rectification gives the rectified views of a rig, vobench.plugin.stereo_pair a pair "
        "that matches images as they are",
    },
    "vobench.plugin": {
        "Mesh": "a mesh is a trimesh.Trimesh; vobench.plugin.make_mesh makes one of vertices, faces, texture "
        "coordinates and normals"
    },
    "vobench.scene.surface": {
        "LAP_M": "faces that touch need no lap",
        "Surface": "a surface is a vobench.plugin.Thing, a trimesh.Trimesh with a material's name",
        "Window": "vobench.plugin.Opening says where a wall is open",
        "box": "vobench.plugin.block makes a box",
        "rectangle": "vobench.plugin.quad makes a rectangle",
        "room": "vobench.plugin.shell makes a room's floor, walls and ceiling",
        "with_windows": "vobench.plugin.shell cuts openings into its walls",
    },
    "vobench.metric.measure": {
        "Comparison": "vobench.plugin.Comparison is what a metric measures",
        "LengthMetric": "the `measure` of a vobench.plugin.MetricDefinition returns vobench.plugin.OverLengths",
        "Metric": "vobench.plugin.MetricDefinition is a metric",
        "Samples": "the `measure` of a vobench.plugin.MetricDefinition returns an array",
    },
    "vobench.metric.scale": {"METRICS": "vobench.metric.segment.METRICS has the errors of scale"},
    "vobench.metric.identity": {
        "identity": "vobench.metric.definitions.identity takes a vobench.plugin.MetricDefinition"
    },
    "vobench.dataset.reproject": {"check_rig": "every export is read back and compared, so a layout need not do it"},
    "vobench.dataset.yaml_values": {"read_yaml": "vobench.plugin.chain_rig reads Kalibr's files"},
    "vobench.trajectory.text": {"parse_tum": "vobench.read_trajectory reads a trajectory in any format"},
}

# Packages that were renamed as a whole.
ROOMS = {
    "vobench.catalog": "vobench.suite",
    "vobench.pipeline": "vobench.runner",
    "vobench.render": "vobench.rendering",
    "vobench.results": "vobench.runner",
    "vobench.robot": "vobench.motion",
    "vobench.run": "vobench.runner",
    "vobench.viewer": "vobench.report",
}


def lookup(module: str, name: str) -> object:
    """The value that `from module import name` gave in an earlier release, with a DeprecationWarning.

    Raises ImportError with one sentence if the name was removed, AttributeError if the module never had it.
    """
    moved = MOVED.get(module, {}).get(name)
    if moved is not None:
        message = f"{module}.{name} is now {moved}; the old name will be removed in the next release"
        warnings.warn(message, DeprecationWarning, stacklevel=3)
        home, _, new_name = moved.rpartition(".")
        return getattr(import_module(home), new_name)
    gone = GONE.get(module, {}).get(name)
    if gone is not None:
        raise ImportError(f"{module}.{name} was removed: {gone}", name=module)
    raise AttributeError(f"module {module!r} has no attribute {name!r}")


class RetiredModule(ModuleType):
    """A module that was removed; its names are looked up in the tables above."""

    def __getattr__(self, name: str) -> object:
        """The retired name. Raises ImportError if there is no such name."""
        if name.startswith("__"):  # asked for by the import system
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        try:
            return lookup(self.__name__, name)
        except AttributeError:
            raise ImportError(f"{self.__name__} was removed, with {name}; {ADVICE}", name=self.__name__) from None


class _Loader:
    """Creates a RetiredModule."""

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return RetiredModule(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Nothing: there is no code."""


def find_spec(module: str) -> ModuleSpec | None:
    """The retired module with that name; None if there never was one. Raises ImportError for a renamed package."""
    if module in MOVED or module in GONE:
        return ModuleSpec(module, _Loader())  # type: ignore[arg-type]
    for package, new_package in ROOMS.items():
        if module == package or module.startswith(f"{package}."):
            raise ModuleNotFoundError(f"{package} is now {new_package}; {ADVICE}", name=module)
    return None
