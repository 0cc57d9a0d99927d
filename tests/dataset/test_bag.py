"""Bags of every make: the eyes are found, the calibration understood, and what is missing is said."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from tests.dataset.conftest import with_everything_of
from vobench.dataset.layout import read, sniff
from vobench.dataset.recording import ReadOptions, Topics
from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, KannalaBrandt, Pinhole
from vobench.sequence import Sequence

IMAGE, COMPRESSED, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
ODOMETRY, POSE, IMU, TF = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "sensor_msgs/msg/Imu",
    "tf2_msgs/msg/TFMessage",
)
D = [-0.28, 0.07, 2e-4, 1.5e-5, 0.0]
K = [40.5, 0, 23.5, 0, 41.25, 15.25, 0, 0, 1.0]
T_BASE_LEFT = se3.transform(Rotation.from_rotvec([0.3, -1.0, 0.9]).as_matrix(), [0.2, 0.06, 0.4])
T_LEFT_RIGHT = se3.transform(Rotation.from_rotvec([0.003, -0.004, 0.002]).as_matrix(), [0.11, 0.001, -0.0005])
T_BASE_IMU = se3.transform(np.eye(3), [0.01, 0.02, 0.03])

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))


@dataclass
class Bag:
    """Messages to be written, as (topic, type, stamp in ns, message), in order of time."""

    ros1: bool = False
    messages: list[tuple[str, str, int, Any]] = field(default_factory=list)

    @property
    def types(self) -> Any:
        return ROS1 if self.ros1 else ROS2

    def make(self, name: str, *values: Any) -> Any:
        return self.types.types[name](*values)

    def header(self, t_ns: int, frame: str) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", *divmod(int(t_ns), 10**9))
        return self.make("std_msgs/msg/Header", *([0] if self.ros1 else []), stamp, frame)

    def image(self, topic: str, t_ns: int, frame: str, pixels: Any, encoding: str, *, pad: int = 0) -> None:
        rows = pixels.reshape(len(pixels), -1).view(np.uint8)
        rows = np.pad(rows, ((0, 0), (0, pad)))
        size = pixels.shape[0], pixels.shape[1]
        data = rows.ravel()
        self.add(topic, IMAGE, t_ns, self.header(t_ns, frame), *size, encoding, 0, rows.shape[1], data)

    def compressed(self, topic: str, t_ns: int, frame: str, encoded: bytes, form: str) -> None:
        self.add(topic, COMPRESSED, t_ns, self.header(t_ns, frame), form, np.frombuffer(encoded, np.uint8))

    def info(self, topic: str, t_ns: int, frame: str, *, P: Any = None, R: Any = None, **lens: Any) -> None:
        region = self.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        P = np.array([40, 0, 23, 0, 0, 40, 15, 0, 0, 0, 1, 0.0] if P is None else P, float)
        R = np.eye(3) if R is None else R
        values = np.array(lens.get("d", D), float), np.array(K, float), np.asarray(R, float).ravel(), P
        model = lens.get("model", "plumb_bob")
        self.add(topic, INFO, t_ns, self.header(t_ns, frame), 32, 48, model, *values, 0, 0, region)

    def fields(self, T: Any, *, pose: bool) -> Any:
        t = self.make(f"geometry_msgs/msg/{'Point' if pose else 'Vector3'}", *T[:3, 3].tolist())
        q = self.make("geometry_msgs/msg/Quaternion", *se3.to_quaternion(T[:3, :3]).tolist())
        return self.make(f"geometry_msgs/msg/{'Pose' if pose else 'Transform'}", t, q)

    def static(self, t_ns: int, links: dict[tuple[str, str], Any]) -> None:
        stamped = [
            self.make("geometry_msgs/msg/TransformStamped", self.header(t_ns, a), b, self.fields(T, pose=False))
            for (a, b), T in links.items()
        ]
        self.add("/tf_static", TF, t_ns, stamped)

    def odometry(self, topic: str, t_ns: int, child: str, T: Any) -> None:
        pose = self.make("geometry_msgs/msg/PoseWithCovariance", self.fields(T, pose=True), np.zeros(36))
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.make("geometry_msgs/msg/Twist", zero, zero)
        twist = self.make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36))
        self.add(topic, ODOMETRY, t_ns, self.header(t_ns, "map"), child, pose, twist)

    def imu(self, topic: str, t_ns: int, frame: str, row: Any) -> None:
        turn, push = (self.make("geometry_msgs/msg/Vector3", *map(float, part)) for part in (row[:3], row[3:]))
        still = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        nothing = np.zeros(9)
        self.add(topic, IMU, t_ns, self.header(t_ns, frame), still, nothing, turn, nothing, push, nothing)

    def add(self, topic: str, kind: str, t_ns: int, *values: Any) -> None:
        self.messages.append((topic, kind, int(t_ns), self.make(kind, *values)))

    def write(self, path: Path, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
        bag: Any = Writer1(path) if self.ros1 else Writer2(path, version=9, storage_plugin=storage)
        serialise = self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr
        with bag:
            connections = {
                topic: bag.add_connection(topic, kind, typestore=self.types)
                for topic, kind in {topic: kind for topic, kind, *_ in self.messages}.items()
            }
            for topic, kind, t_ns, message in sorted(self.messages, key=lambda message: message[2]):
                bag.write(connections[topic], t_ns, serialise(message, kind))
        return path


def whole(scene, *, ros1=False, left="/cam0/image_raw", right="/cam1/image_raw", imu=True) -> Bag:
    """A bag with everything that a bag may have; the right pictures were received late."""
    bag = Bag(ros1)
    links = {("base_link", "left"): T_BASE_LEFT, ("left", "right"): T_LEFT_RIGHT, ("base_link", "imu"): T_BASE_IMU}
    bag.static(scene.t_ns[0], links)
    for index, t in enumerate(scene.t_ns):
        for topic, frame, pixels in ((left, "left", scene.left[index]), (right, "right", scene.right[index])):
            bag.info(topic.rpartition("/")[0] + "/camera_info", t, frame)
            bag.image(topic, t, frame, pixels, "mono8")
        bag.odometry("/ground_truth/odometry", t, "base_link", scene.T_world_body[index])
    for t, row in zip(scene.imu_ns, scene.imu, strict=True) if imu else ():
        bag.imu("/imu", t, "imu", row)
    return bag


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "folder", "mcap"])
def test_everything_of_a_bag_arrives(scene, tmp_path, imported, kind):
    if kind == "ros1":
        path, form = whole(scene, ros1=True).write(tmp_path / "in.bag"), "ros1"
    else:
        storage = StoragePlugin.SQLITE3 if kind == "sqlite" else StoragePlugin.MCAP
        path, form = whole(scene).write(tmp_path / "in", storage), "ros2"
    if kind == "mcap":
        path, form = next(path.glob("*.mcap")), "mcap"
    assert sniff(path) == form
    noise = tmp_path / "imu.yaml"
    noise.write_text(
        "update_rate: 200\ngyroscope_noise_density: 1.0e-4\ngyroscope_random_walk: 2.0e-5\n"
        "accelerometer_noise_density: 2.0e-3\naccelerometer_random_walk: 3.0e-3\n"
    )
    folder = imported(path, imu=noise)
    sequence = with_everything_of(scene, folder)
    assert np.abs(sequence.rig.T_body_left - T_BASE_LEFT).max() < 1e-9
    assert np.abs(sequence.rig.T_left_right - T_LEFT_RIGHT).max() < 1e-9
    assert np.abs(sequence.rig.imu.T_body_imu - T_BASE_IMU).max() < 1e-9
    assert sequence.rig.left == BrownConrady(48, 32, 40.5, 41.25, 23.5, 15.25, *D)
    assert np.array_equal(sequence.imu().gyro_radps, scene.imu[:, :3])


def test_without_transforms_the_projection_says_where_the_right_camera_is(scene, tmp_path):
    bag = Bag()
    for t, left, right in zip(scene.t_ns, scene.left, scene.right, strict=True):
        bag.info("/stereo/left/camera_info", t, "optical")
        bag.info("/stereo/right/camera_info", t, "optical", P=[40, 0, 23, -4.8, 0, 40, 15, 0, 0, 0, 1, 0])
        bag.image("/stereo/left/image_rect", t, "optical", left, "mono8")
        bag.image("/stereo/right/image_rect", t, "optical", right, "mono8")
    recording = read(bag.write(tmp_path / "bag"))
    assert recording.rig.left == Pinhole(48, 32, 40.0, 40.0, 23.0, 15.0)
    assert np.allclose(recording.rig.T_left_right, se3.transform(np.eye(3), [0.12, 0, 0]), rtol=0, atol=1e-15)
    assert recording.truth is None
    assert any("rectified" in note for note in recording.notes)
    assert any("was derived from R and P" in note for note in recording.notes)


def turned(angle_rad: float) -> Any:
    return Rotation.from_rotvec([0, angle_rad, 0]).as_matrix()


@pytest.mark.parametrize("rectified", [True, False])
def test_r_turns_a_camera_s_axes_into_the_rectified_ones(scene, tmp_path, rectified):
    """Whether pictures are rectified or not, the rectified axes of both eyes are one, a baseline apart."""
    bag, name = Bag(), "image_rect" if rectified else "image_raw"
    bag.static(scene.t_ns[0], {("base_link", "optical"): T_BASE_LEFT})
    R_left, R_right = turned(0.02), turned(-0.03)
    P = [40, 0, 23, -4.8, 0, 40, 15, 0, 0, 0, 1, 0]
    for t, left, right in zip(scene.t_ns, scene.left, scene.right, strict=True):
        bag.info("/left/camera_info", t, "optical", R=R_left)
        bag.info("/right/camera_info", t, "optical", R=R_right, P=P)
        bag.image(f"/left/{name}", t, "optical", left, "mono8")
        bag.image(f"/right/{name}", t, "optical", right, "mono8")
    rig = read(bag.write(tmp_path / "bag")).rig
    T_left_rect, T_right_rect = (se3.transform(np.eye(3) if rectified else R.T, np.zeros(3)) for R in (R_left, R_right))
    between = se3.inverse(T_left_rect) @ rig.T_left_right @ T_right_rect
    assert np.allclose(between, se3.transform(np.eye(3), [0.12, 0, 0]), rtol=0, atol=1e-12)
    expected = T_BASE_LEFT @ se3.transform(R_left.T, np.zeros(3))
    assert np.allclose(rig.T_body_left @ T_left_rect, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("encoding", "spread", "said"),
    [
        ("mono8", lambda p: p, ""),
        ("8UC1", lambda p: p, ""),
        ("mono16", lambda p: p.astype(np.uint16) * 257, "upper 8 bits"),
        ("bgr8", lambda p: np.dstack([p] * 3), "converted to grey"),
        ("rgba8", lambda p: np.dstack([p] * 4), "converted to grey"),
    ],
)
def test_raw_pictures_of_every_encoding(scene, tmp_path, encoding, spread, said):
    bag = Bag()
    for t, pixels in zip(scene.t_ns, scene.left, strict=True):
        bag.info("/camera_info", t, "optical")
        bag.image("/image_raw", t, "optical", np.ascontiguousarray(spread(pixels)), encoding, pad=6)
    recording = read(bag.write(tmp_path / "bag"))
    for frame, pixels in zip(recording.frames(), scene.left, strict=True):
        assert np.array_equal(frame.left, pixels)
        assert frame.right is None
    assert any(said in note for note in recording.notes)


def test_red_and_blue_are_not_mistaken_for_each_other(scene, tmp_path):
    for name, channel in (("rgb8", 0), ("bgr8", 2)):
        bag, red = Bag(), np.zeros((32, 48, 3), np.uint8)
        red[..., channel] = 255
        bag.info("/camera_info", scene.t_ns[0], "optical")
        bag.image("/image_raw", scene.t_ns[0], "optical", red, name)
        assert next(read(bag.write(tmp_path / name)).frames()).left[0, 0] == 76  # 0.299 of 255


def test_a_mosaic_of_one_grey_comes_to_that_grey(scene, tmp_path):
    bag = Bag()
    bag.info("/camera_info", scene.t_ns[0], "optical")
    bag.image("/image_raw", scene.t_ns[0], "optical", np.full((32, 48), 90, np.uint8), "bayer_rggb8")
    recording = read(bag.write(tmp_path / "bag"))
    assert (next(recording.frames()).left == 90).all()
    assert any("mosaic (bayer_rggb8)" in note for note in recording.notes)


@pytest.mark.parametrize("form", ["jpeg", "png"])
def test_compressed_pictures_are_handed_on_as_they_are(scene, tmp_path, imported, form):
    bag, files = Bag(), [cv2.imencode(f".{form}", pixels)[1].tobytes() for pixels in scene.left]
    for t, data in zip(scene.t_ns, files, strict=True):
        bag.info("/cam/camera_info", t, "optical")
        bag.compressed("/cam/image_raw/compressed", t, "optical", data, f"mono8; {form} compressed ")
    sequence = Sequence.open(imported(bag.write(tmp_path / "bag")))
    assert [frame.left for frame in sequence.encoded_frames()] == files


def test_a_fisheye_keeps_its_name_for_equidistant(scene, tmp_path):
    bag = Bag()
    for t, pixels in zip(scene.t_ns, scene.left, strict=True):
        bag.info("/camera_info", t, "optical", model="equidistant", d=[0.003, 0.0007, -0.002, 0.0002])
        bag.image("/image_raw", t, "optical", pixels, "mono8")
    assert isinstance(read(bag.write(tmp_path / "bag")).rig.left, KannalaBrandt)


def test_pictures_without_a_partner_are_dropped_and_said(scene, tmp_path):
    bag = whole(scene)
    bag.messages.remove(next(m for m in bag.messages if m[0] == "/cam1/image_raw" and m[2] == scene.t_ns[3]))
    recording = read(bag.write(tmp_path / "bag"))
    assert [frame.t_ns for frame in recording.frames()] == np.delete(scene.t_ns, 3).tolist()
    assert any("1 left and 0 right images without a partner" in note for note in recording.notes)


def test_a_pose_of_no_named_frame_is_taken_for_the_body_s(scene, tmp_path):
    bag = whole(scene)
    bag.messages = [message for message in bag.messages if message[1] != ODOMETRY]
    for t, T in zip(scene.t_ns, scene.T_world_body, strict=True):
        bag.add("/vicon/pose", POSE, t, bag.header(t, "map"), bag.fields(T, pose=True))
    recording = read(bag.write(tmp_path / "bag"))
    assert np.abs(recording.rig.T_body_left - T_BASE_LEFT).max() < 1e-9
    assert any("and the frame of /vicon/pose was assumed to be the body" in note for note in recording.notes)


def test_what_was_not_read_is_named(scene, tmp_path):
    bag = whole(scene)
    bag.imu("/other/imu", scene.t_ns[0], "imu", np.zeros(6))
    notes = read(bag.write(tmp_path / "bag")).notes
    assert "No IMU was read: name one of /imu, /other/imu." in notes
    assert any(note.startswith("Topics that were not read: /imu, /other/imu") for note in notes)


def test_an_imu_without_its_noise_is_dropped_and_said(scene, tmp_path):
    recording = read(whole(scene).write(tmp_path / "bag"))
    assert recording.imu is None
    assert any("a bag has no noise densities of an IMU" in note for note in recording.notes)


def test_a_given_chain_takes_the_place_of_the_bag_s_calibration(scene, tmp_path, camchain, placed):
    chain = tmp_path / "chain.yaml"
    chain.write_text(camchain())
    rig = read(whole(scene).write(tmp_path / "bag"), options=ReadOptions(calibration=chain)).rig
    assert np.abs(rig.T_body_left - placed[0]).max() < 1e-12


def with_chain(scene, tmp_path, camchain, bag: Bag):
    chain = tmp_path / "chain.yaml"
    chain.write_text(camchain())
    return read(bag.write(tmp_path / "bag"), options=ReadOptions(calibration=chain))


def test_the_truth_is_converted_to_the_body_of_a_given_chain(scene, tmp_path, camchain):
    recording = with_chain(scene, tmp_path, camchain, whole(scene))
    T_world_left = scene.T_world_body @ T_BASE_LEFT
    assert np.abs(recording.truth.T_world_frame @ recording.rig.T_body_left - T_world_left).max() < 1e-12
    assert "The truth of base_link was converted to the body by /tf_static." in recording.notes


def test_a_truth_of_an_unknown_frame_is_said_beside_a_given_chain(scene, tmp_path, camchain):
    bag = whole(scene)
    bag.messages = [message for message in bag.messages if message[1] not in (TF, ODOMETRY)]
    for t, T in zip(scene.t_ns, scene.T_world_body, strict=True):
        bag.odometry("/odom", t, "camera_pose_frame", T)
    recording = with_chain(scene, tmp_path, camchain, bag)
    assert np.abs(recording.truth.T_world_frame - scene.T_world_body).max() < 1e-12
    expected = "The truth is of camera_pose_frame, whose position is not known, and was assumed to be of the body."
    assert expected in recording.notes


def test_topics_of_any_name_may_be_named(scene, tmp_path):
    path = whole(scene, left="/port/image", right="/starboard/image").write(tmp_path / "bag")
    with pytest.raises(VobenchError, match=r"name the left and the right topic .* /port/image, /starboard/image"):
        read(path)
    recording = read(path, options=ReadOptions(topics=Topics(left="/port/image", right="/starboard/image")))
    assert recording.rig.right is not None
    with pytest.raises(VobenchError, match="no topic '/port/pictures' in"):
        read(path, options=ReadOptions(topics=Topics(left="/port/pictures", right="/starboard/image")))
    with pytest.raises(VobenchError, match=r"/imu should be .*Image, but is sensor_msgs/msg/Imu"):
        read(path, options=ReadOptions(topics=Topics(left="/imu", right="/starboard/image")))


@pytest.mark.parametrize("ros1", [True, False])
def test_a_bag_without_pictures_says_what_it_has(scene, tmp_path, ros1):
    bag = Bag(ros1)
    bag.imu("/imu", scene.t_ns[0], "imu", np.zeros(6))
    path = bag.write(tmp_path / ("in.bag" if ros1 else "in"))
    with pytest.raises(VobenchError, match=r"no images .* its topics: /imu \(sensor_msgs/msg/Imu\)"):
        read(path)


def test_a_bag_without_calibration(scene, tmp_path):
    bag = Bag()
    bag.image("/image_raw", scene.t_ns[0], "optical", scene.left[0], "mono8")
    with pytest.raises(VobenchError, match="no camera_info for /image_raw: name its topic or a camchain"):
        read(bag.write(tmp_path / "bag"))


def test_a_pair_of_which_nothing_says_how_it_stands(scene, tmp_path):
    bag = whole(scene)
    bag.messages = [message for message in bag.messages if message[1] != TF]
    with pytest.raises(VobenchError, match="neither /tf_static nor P of /cam1/camera_info says where"):
        read(bag.write(tmp_path / "bag"))


@pytest.mark.parametrize("ros1", [True, False])
def test_of_true_poses_with_one_stamp_the_first_is_kept_and_it_is_said(scene, tmp_path, ros1):
    bag = whole(scene, ros1=ros1)
    bag.odometry("/ground_truth/odometry", scene.t_ns[-1], "base_link", np.eye(4))
    recording = read(bag.write(tmp_path / "bag"))
    assert np.abs(recording.truth.T_world_frame - scene.T_world_body).max() < 1e-12
    said = "1 poses of /ground_truth/odometry repeat a stamp; the first pose of each stamp was kept."
    assert said in recording.notes


def test_stamps_that_repeat(scene, tmp_path):
    bag = Bag()
    for late, pixels in zip((0, 0, 5), scene.left, strict=False):
        bag.info("/camera_info", scene.t_ns[0] + late, "optical")
        bag.image("/image_raw", scene.t_ns[0] + late, "optical", pixels, "mono8")
    with pytest.raises(VobenchError, match="/image_raw: stamps must increase, but message 1 has"):
        read(bag.write(tmp_path / "bag"))


def test_an_encoding_that_is_not_read(scene, tmp_path):
    bag = Bag()
    bag.info("/camera_info", scene.t_ns[0], "optical")
    bag.image("/image_raw", scene.t_ns[0], "optical", np.zeros((32, 48, 2), np.uint8), "yuv422")
    with pytest.raises(VobenchError, match=r"the encoding 'yuv422' is not supported\. Known: mono8"):
        read(bag.write(tmp_path / "bag"))


def test_rows_shorter_than_their_pixels(scene, tmp_path):
    bag = Bag()
    bag.info("/camera_info", scene.t_ns[0], "optical")
    bag.image("/image_raw", scene.t_ns[0], "optical", scene.left[0], "bgr8")
    with pytest.raises(VobenchError, match="1536 bytes are not a 48 x 32 image in bgr8"):
        read(bag.write(tmp_path / "bag"))


def test_a_bag_that_is_cut_off(scene, tmp_path):
    path = whole(scene, ros1=True).write(tmp_path / "in.bag")
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(VobenchError, match=r"not a whole recording .*in\.bag"):
        read(path)


@pytest.mark.parametrize("name", ["metadata.yaml", "in.mcap"])
def test_a_pointer_within_a_bag_s_folder_is_named(scene, tmp_path, name):
    folder = whole(scene).write(tmp_path / "in")
    (folder / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(VobenchError, match=f"a Git-LFS pointer.*{name}$"):
        read(folder)


@pytest.fixture(scope="module")
def three_bags(scene, tmp_path_factory) -> dict[str, bytes]:
    """The bytes of one recording in each of the three files that bags are."""
    folder = tmp_path_factory.mktemp("bags")
    paths = [
        whole(scene, ros1=True, imu=False).write(folder / "a.bag"),
        *whole(scene, imu=False).write(folder / "m").glob("*.mcap"),
        *whole(scene, imu=False).write(folder / "s", StoragePlugin.SQLITE3).glob("*.db3"),
    ]
    return {path.suffix: path.read_bytes() for path in paths}


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from([".bag", ".mcap", ".db3"]), st.data())
def test_spoilt_bags_are_read_or_refused_in_a_sentence(three_bags, tmp_path, suffix, data):
    spoilt = bytearray(three_bags[suffix])
    for _ in range(data.draw(st.integers(1, 5))):
        place = data.draw(st.one_of(st.integers(0, len(spoilt) - 1), st.integers(0, 300), st.integers(-500, -1)))
        spoilt[place] = data.draw(st.sampled_from([0, 1, 0x7F, 0x80, 0xFF]))
    path, said = tmp_path / f"spoilt{suffix}", "read"
    path.write_bytes(spoilt[: data.draw(st.sampled_from([None, None, len(spoilt) // 2, -1]))])
    try:
        frames = list(read(path).frames())
    except VobenchError as error:
        said = str(error)
    else:
        assert all(frame.left.shape == (32, 48) for frame in frames)
    assert said.strip()
    assert "\n" not in said
