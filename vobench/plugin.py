"""All names that a plugin may import: `from vobench.plugin import Result, Status, stereo_pair`.

Estimators   Estimator Frame Result Status Tracks Image EncoderReadings ImuReadings: the protocol
             Rig ImuCalibration WheelGeometry Rectification rectification STANDARD_GRAVITY_MPS2: the calibration
             corners_per_cell follow follow_predicted predicted inside comparable local_contrast lucas_kanade
             Points Mask: corners and tracks
             StereoPair Eye stereo_pair coarse_disparity DisparityOffset: a stereo pair of any two lenses
             PoseFit pose_from_points carried_on: motion
             StereoTracker TrackerSettings StereoTracks: a keyframe whose points are tracked in both cameras
             parameters assert_contract: the manifest's parameters, and the contract in a plugin's own test
Makers       Thing make_mesh joined moved copies flipped two_sided textured: meshes, as trimesh.Trimesh
             quad at block card cards cushion extrusion lathe pierced reveal sheet spline tube: shapes
             Material Picture Procedural coated matt wood picture STEEL CHROME WHITE DARK BLACK: materials, textures
             BRICK INK INKS NAVY OCHRE PAPER PLUM SAND TEAL: colours
             Part Piece put stood things mm bars bulb kitchen: furniture
             Opening shell FINISHES OUTWARD: rooms
             AreaLight PointLight SpotLight Sun Sky Steady Flicker Dimmer Switched: lights
             Surroundings GeneratedPlace: the panorama of a sky, what a generator returns
             home workplace street warehouse park paper_room: places by seed, from flats to variants of the paper's room
Layouts      Layout Writing ReadOptions Topics: the definition of a layout, and the options of its reader
             Recording RecordedFrame RecordedPicture PictureStream assemble picture_files numbered truth_file unread
             chain_rig: reading
             ExportSource Views rectified png_frames: writing
Metrics      MetricDefinition Comparison OverLengths POSES ScoreSettings
All          se3 Array adjoint cross_matrix twist unit: rigid motions
             Camera Pinhole BrownConrady KannalaBrandt DoubleSphere Equirectangular looking side_by_side: cameras
             Trajectory Stamps: stamped poses
             VobenchError InputError SequenceError SettingError: errors that are reported in one sentence

`python -m pydoc vobench.plugin.StereoPair` describes one of them.

A name is imported from its module on first use, so an estimator does not load the modules for scenes.
`tests/plugin_surface.txt` freezes names and signatures. A name that is removed works for one more release with a
DeprecationWarning (`vobench/retired.py`). Everything else in vobench may change at any time.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vobench.asset import home, kitchen, paper_room, park, picture, street, warehouse, workplace
    from vobench.asset.fitting import bars
    from vobench.asset.furniture import (
        BLACK,
        CHROME,
        DARK,
        STEEL,
        WHITE,
        Part,
        coated,
        matt,
        mm,
        put,
        stood,
        wood,
    )
    from vobench.asset.household import bulb
    from vobench.asset.panorama import Surroundings
    from vobench.asset.picture import BRICK, INK, INKS, NAVY, OCHRE, PAPER, PLUM, SAND, TEAL
    from vobench.asset.room import FINISHES, OUTWARD, Opening, Piece, shell, things
    from vobench.asset.shape import (
        at,
        block,
        card,
        cards,
        cushion,
        extrusion,
        lathe,
        sheet,
        spline,
        tube,
    )
    from vobench.asset.texture import Procedural
    from vobench.asset.wall import pierced, reveal
    from vobench.dataset.kalibr import chain_rig
    from vobench.dataset.layout import Layout, Writing
    from vobench.dataset.picture import EncodedPicture as RecordedPicture
    from vobench.dataset.picture import unread
    from vobench.dataset.picture_list import numbered, picture_files
    from vobench.dataset.png_frame import png_frames
    from vobench.dataset.recording import PictureStream, ReadOptions, RecordedFrame, Recording, Topics, assemble
    from vobench.dataset.rectified_view import Views, rectified
    from vobench.dataset.source import ExportSource
    from vobench.dataset.truth_file import truth_file
    from vobench.errors import InputError, SequenceError, SettingError, VobenchError
    from vobench.estimator.disparity_offset import DisparityOffset
    from vobench.estimator.parameter import parameters
    from vobench.estimator.pose import (
        PoseFit,
        adjoint,
        carried_on,
        cross_matrix,
        pose_from_points,
        twist,
    )
    from vobench.estimator.protocol import EncoderReadings, Estimator, Frame, Image, Result, Status, Tracks
    from vobench.estimator.stereo import Eye, StereoPair, coarse_disparity, predicted, stereo_pair
    from vobench.estimator.stereo_tracker import StereoTracker, StereoTracks, TrackerSettings
    from vobench.estimator.tracking import (
        Mask,
        Points,
        comparable,
        corners_per_cell,
        follow,
        follow_predicted,
        inside,
        local_contrast,
        lucas_kanade,
    )
    from vobench.geometry import se3
    from vobench.geometry.camera import (
        BrownConrady,
        Camera,
        DoubleSphere,
        Equirectangular,
        KannalaBrandt,
        Pinhole,
    )
    from vobench.geometry.rig import (
        ImuCalibration,
        Rectification,
        Rig,
        WheelGeometry,
        looking,
        rectification,
        side_by_side,
    )
    from vobench.geometry.se3 import Array
    from vobench.geometry.vector import unit
    from vobench.metric.comparison import POSES, Comparison, MetricDefinition, OverLengths
    from vobench.metric.settings import ScoreSettings
    from vobench.report.contract import assert_contract
    from vobench.scene.generated_place import GeneratedPlace
    from vobench.scene.light import (
        AreaLight,
        Dimmer,
        Flicker,
        PointLight,
        Sky,
        SpotLight,
        Steady,
        Sun,
        Switched,
    )
    from vobench.scene.material import Material, Picture
    from vobench.scene.mesh import copies, flipped, joined, make_mesh, moved, quad, textured, two_sided
    from vobench.scene.triangles import Thing
    from vobench.sensor.imu import ImuReadings
    from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2
    from vobench.trajectory.trajectory import Stamps, Trajectory

# The module of each name: `module:name` where it has another name there; `se3` and `picture` are modules themselves.
# `runner/key.py` reads this table without importing it, so it must stay a literal.
HOMES = {
    "bars": "vobench.asset.fitting",
    "BLACK": "vobench.asset.furniture",
    "CHROME": "vobench.asset.furniture",
    "DARK": "vobench.asset.furniture",
    "Part": "vobench.asset.furniture",
    "STEEL": "vobench.asset.furniture",
    "WHITE": "vobench.asset.furniture",
    "coated": "vobench.asset.furniture",
    "matt": "vobench.asset.furniture",
    "mm": "vobench.asset.furniture",
    "put": "vobench.asset.furniture",
    "stood": "vobench.asset.furniture",
    "wood": "vobench.asset.furniture",
    "bulb": "vobench.asset.household",
    "Surroundings": "vobench.asset.panorama",
    "BRICK": "vobench.asset.picture",
    "INK": "vobench.asset.picture",
    "INKS": "vobench.asset.picture",
    "NAVY": "vobench.asset.picture",
    "OCHRE": "vobench.asset.picture",
    "PAPER": "vobench.asset.picture",
    "PLUM": "vobench.asset.picture",
    "SAND": "vobench.asset.picture",
    "TEAL": "vobench.asset.picture",
    "picture": "vobench.asset.picture",
    "home": "vobench.asset.home",
    "kitchen": "vobench.asset.kitchen",
    "paper_room": "vobench.asset.paper_room",
    "park": "vobench.asset.park",
    "street": "vobench.asset.street",
    "warehouse": "vobench.asset.warehouse",
    "workplace": "vobench.asset.workplace",
    "FINISHES": "vobench.asset.room",
    "OUTWARD": "vobench.asset.room",
    "Opening": "vobench.asset.room",
    "Piece": "vobench.asset.room",
    "shell": "vobench.asset.room",
    "things": "vobench.asset.room",
    "at": "vobench.asset.shape",
    "block": "vobench.asset.shape",
    "card": "vobench.asset.shape",
    "cards": "vobench.asset.shape",
    "cushion": "vobench.asset.shape",
    "extrusion": "vobench.asset.shape",
    "lathe": "vobench.asset.shape",
    "pierced": "vobench.asset.wall",
    "reveal": "vobench.asset.wall",
    "sheet": "vobench.asset.shape",
    "spline": "vobench.asset.shape",
    "tube": "vobench.asset.shape",
    "Procedural": "vobench.asset.texture",
    "chain_rig": "vobench.dataset.kalibr",
    "Layout": "vobench.dataset.layout",
    "Writing": "vobench.dataset.layout",
    "unread": "vobench.dataset.picture",
    "RecordedPicture": "vobench.dataset.picture:EncodedPicture",
    "PictureStream": "vobench.dataset.recording",
    "ReadOptions": "vobench.dataset.recording",
    "RecordedFrame": "vobench.dataset.recording",
    "Recording": "vobench.dataset.recording",
    "Topics": "vobench.dataset.recording",
    "assemble": "vobench.dataset.recording",
    "numbered": "vobench.dataset.picture_list",
    "picture_files": "vobench.dataset.picture_list",
    "truth_file": "vobench.dataset.truth_file:truth_file",
    "ExportSource": "vobench.dataset.source",
    "Views": "vobench.dataset.rectified_view",
    "png_frames": "vobench.dataset.png_frame",
    "rectified": "vobench.dataset.rectified_view",
    "InputError": "vobench.errors",
    "SequenceError": "vobench.errors",
    "SettingError": "vobench.errors",
    "VobenchError": "vobench.errors",
    "DisparityOffset": "vobench.estimator.disparity_offset",
    "parameters": "vobench.estimator.parameter",
    "PoseFit": "vobench.estimator.pose",
    "adjoint": "vobench.estimator.pose",
    "carried_on": "vobench.estimator.pose",
    "cross_matrix": "vobench.estimator.pose",
    "pose_from_points": "vobench.estimator.pose",
    "twist": "vobench.estimator.pose",
    "EncoderReadings": "vobench.estimator.protocol",
    "Estimator": "vobench.estimator.protocol",
    "Frame": "vobench.estimator.protocol",
    "Image": "vobench.estimator.protocol",
    "Result": "vobench.estimator.protocol",
    "Status": "vobench.estimator.protocol",
    "Tracks": "vobench.estimator.protocol",
    "Eye": "vobench.estimator.stereo",
    "StereoPair": "vobench.estimator.stereo",
    "coarse_disparity": "vobench.estimator.stereo",
    "predicted": "vobench.estimator.stereo",
    "stereo_pair": "vobench.estimator.stereo",
    "StereoTracker": "vobench.estimator.stereo_tracker",
    "StereoTracks": "vobench.estimator.stereo_tracker",
    "TrackerSettings": "vobench.estimator.stereo_tracker",
    "Mask": "vobench.estimator.tracking",
    "Points": "vobench.estimator.tracking",
    "comparable": "vobench.estimator.tracking",
    "corners_per_cell": "vobench.estimator.tracking",
    "follow": "vobench.estimator.tracking",
    "follow_predicted": "vobench.estimator.tracking",
    "inside": "vobench.estimator.tracking",
    "local_contrast": "vobench.estimator.tracking",
    "lucas_kanade": "vobench.estimator.tracking",
    "BrownConrady": "vobench.geometry.camera",
    "Camera": "vobench.geometry.camera",
    "DoubleSphere": "vobench.geometry.camera",
    "Equirectangular": "vobench.geometry.camera",
    "KannalaBrandt": "vobench.geometry.camera",
    "Pinhole": "vobench.geometry.camera",
    "unit": "vobench.geometry.vector",
    "ImuCalibration": "vobench.geometry.rig",
    "Rectification": "vobench.geometry.rig",
    "Rig": "vobench.geometry.rig",
    "WheelGeometry": "vobench.geometry.rig",
    "looking": "vobench.geometry.rig",
    "rectification": "vobench.geometry.rig",
    "side_by_side": "vobench.geometry.rig",
    "Array": "vobench.geometry.se3",
    "se3": "vobench.geometry.se3",
    "Comparison": "vobench.metric.comparison",
    "MetricDefinition": "vobench.metric.comparison",
    "OverLengths": "vobench.metric.comparison",
    "POSES": "vobench.metric.comparison",
    "ScoreSettings": "vobench.metric.settings",
    "assert_contract": "vobench.report.contract",
    "GeneratedPlace": "vobench.scene.generated_place",
    "AreaLight": "vobench.scene.light",
    "Dimmer": "vobench.scene.light",
    "Flicker": "vobench.scene.light",
    "PointLight": "vobench.scene.light",
    "Sky": "vobench.scene.light",
    "SpotLight": "vobench.scene.light",
    "Steady": "vobench.scene.light",
    "Sun": "vobench.scene.light",
    "Switched": "vobench.scene.light",
    "Material": "vobench.scene.material",
    "Picture": "vobench.scene.material",
    "Thing": "vobench.scene.triangles",
    "copies": "vobench.scene.mesh",
    "flipped": "vobench.scene.mesh",
    "joined": "vobench.scene.mesh",
    "make_mesh": "vobench.scene.mesh",
    "moved": "vobench.scene.mesh",
    "quad": "vobench.scene.mesh",
    "textured": "vobench.scene.mesh",
    "two_sided": "vobench.scene.mesh",
    "ImuReadings": "vobench.sensor.imu",
    "STANDARD_GRAVITY_MPS2": "vobench.trajectory.kinematics",
    "Stamps": "vobench.trajectory.trajectory",
    "Trajectory": "vobench.trajectory.trajectory",
}

__all__ = [
    "BLACK",
    "BRICK",
    "CHROME",
    "DARK",
    "FINISHES",
    "INK",
    "INKS",
    "NAVY",
    "OCHRE",
    "OUTWARD",
    "PAPER",
    "PLUM",
    "POSES",
    "SAND",
    "STANDARD_GRAVITY_MPS2",
    "STEEL",
    "TEAL",
    "WHITE",
    "AreaLight",
    "Array",
    "BrownConrady",
    "Camera",
    "Comparison",
    "Dimmer",
    "DisparityOffset",
    "DoubleSphere",
    "EncoderReadings",
    "Equirectangular",
    "Estimator",
    "ExportSource",
    "Eye",
    "Flicker",
    "Frame",
    "GeneratedPlace",
    "Image",
    "ImuCalibration",
    "ImuReadings",
    "InputError",
    "KannalaBrandt",
    "Layout",
    "Mask",
    "Material",
    "MetricDefinition",
    "Opening",
    "OverLengths",
    "Part",
    "Picture",
    "PictureStream",
    "Piece",
    "Pinhole",
    "PointLight",
    "Points",
    "PoseFit",
    "Procedural",
    "ReadOptions",
    "RecordedFrame",
    "RecordedPicture",
    "Recording",
    "Rectification",
    "Result",
    "Rig",
    "ScoreSettings",
    "SequenceError",
    "SettingError",
    "Sky",
    "SpotLight",
    "Stamps",
    "Status",
    "Steady",
    "StereoPair",
    "StereoTracker",
    "StereoTracks",
    "Sun",
    "Surroundings",
    "Switched",
    "Thing",
    "Topics",
    "TrackerSettings",
    "Tracks",
    "Trajectory",
    "Views",
    "VobenchError",
    "WheelGeometry",
    "Writing",
    "adjoint",
    "assemble",
    "assert_contract",
    "at",
    "bars",
    "block",
    "bulb",
    "card",
    "cards",
    "carried_on",
    "chain_rig",
    "coarse_disparity",
    "coated",
    "comparable",
    "copies",
    "corners_per_cell",
    "cross_matrix",
    "cushion",
    "extrusion",
    "flipped",
    "follow",
    "follow_predicted",
    "home",
    "inside",
    "joined",
    "kitchen",
    "lathe",
    "local_contrast",
    "looking",
    "lucas_kanade",
    "make_mesh",
    "matt",
    "mm",
    "moved",
    "numbered",
    "paper_room",
    "parameters",
    "park",
    "picture",
    "picture_files",
    "pierced",
    "png_frames",
    "pose_from_points",
    "predicted",
    "put",
    "quad",
    "rectification",
    "rectified",
    "reveal",
    "se3",
    "sheet",
    "shell",
    "side_by_side",
    "spline",
    "stereo_pair",
    "stood",
    "street",
    "textured",
    "things",
    "truth_file",
    "tube",
    "twist",
    "two_sided",
    "unit",
    "unread",
    "warehouse",
    "wood",
    "workplace",
]

if not TYPE_CHECKING:  # otherwise a type checker would accept every misspelt name

    def __getattr__(name):
        """Import a name of `__all__`, or a retired name, on first use."""
        if name.startswith("__"):  # asked for by the import system, with every `from vobench.plugin import ...`
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        if name not in HOMES:
            from vobench import retired

            return retired.lookup(__name__, name)
        module, _, attribute = HOMES[name].partition(":")
        is_module = not attribute and module.rpartition(".")[2] == name
        value = import_module(module) if is_module else getattr(import_module(module), attribute or name)
        globals()[name] = value  # found without this function from now on
        return value

    def __dir__():
        """All names, imported or not."""
        return sorted({*globals(), *__all__})
