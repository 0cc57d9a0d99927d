import pytest

from vobench.dataset.bag_topics import COMPRESSED, IMU, INFO, RAW, SelectedTopics, choose
from vobench.dataset.recording import Topics
from vobench.errors import InputError

ODOMETRY = "nav_msgs/msg/Odometry"
PAIR = {"/cam0/image_raw": RAW, "/cam1/image_raw": RAW}


def chosen(types: dict[str, str], **topics: str) -> SelectedTopics:
    return choose(types, Topics(**topics), "a.bag")


@pytest.mark.parametrize(
    ("left", "right"),
    [("/left/image", "/right/image"), ("/cam0/x", "/cam1/x"), ("/infra1/x", "/infra2/x"), ("/image_0", "/image_1")],
)
def test_a_pair_is_told_by_its_names(left: str, right: str) -> None:
    found = chosen({right: RAW, left: COMPRESSED, "/depth_left": RAW, "/depth_right": RAW})
    assert (found.left, found.right) == (left, right)
    assert found.notes == (f"The images are those of {left} and {right}.",)


def test_a_single_topic_of_pictures_is_one_camera() -> None:
    found = chosen({"/front": RAW, "/front/depth": RAW})
    assert (found.left, found.right) == ("/front", None)
    assert found.notes == ("The images are those of /front, one camera.",)
    assert (found.right_info, found.imu, found.truth) == (None, None, None)


def test_a_named_topic_is_taken_with_its_only_partner() -> None:
    types = {**PAIR, "/cam2/image_raw": RAW}
    assert chosen(types, left="/cam0/image_raw").right == "/cam1/image_raw"
    assert chosen(types, left="/cam1/image_raw").right == "/cam2/image_raw"
    assert chosen(types, left="/cam2/image_raw").right is None
    assert chosen(types, right="/cam2/image_raw").left == "/cam1/image_raw"
    assert chosen(types, left="/cam2/image_raw", right="/cam0/image_raw").right == "/cam0/image_raw"
    with pytest.raises(InputError, match=r"^name the left and the right topic of a\.bag; with images: /cam0"):
        chosen(types)


def test_a_right_topic_alone_is_no_single_camera() -> None:
    with pytest.raises(InputError, match="name the left and the right topic"):
        chosen({"/front": RAW}, right="/front")
    with pytest.raises(InputError, match=r"no images \(Image or CompressedImage\) in a\.bag; its topics: none$"):
        chosen({})


def test_a_topic_that_is_missing_or_of_another_type_is_refused() -> None:
    for name in ("left", "right", "left_info", "right_info", "imu"):
        with pytest.raises(InputError, match=r"^no topic '/x' in a\.bag; its topics: /cam0/image_raw \(sensor_msgs"):
            chosen(PAIR, **{name: "/x"})
        with pytest.raises(InputError, match=r"^/x should be sensor_msgs/.*, but is std_msgs/msg/String in a\.bag"):
            chosen({**PAIR, "/x": "std_msgs/msg/String"}, **{name: "/x"})


def test_the_camera_info_is_the_nearest_one_going_up() -> None:
    types = {**PAIR, "/cam0/camera_info": INFO, "/camera_info": INFO, "/cam1/image_raw/camera_info": INFO}
    found = chosen(types)
    assert (found.left_info, found.right_info) == ("/cam0/camera_info", "/cam1/image_raw/camera_info")
    named = chosen(types, left_info="/camera_info", right_info="/cam0/camera_info")
    assert (named.left_info, named.right_info) == ("/camera_info", "/cam0/camera_info")
    assert chosen({**PAIR, "/cam0/camera_info": RAW}).left_info is None


def test_of_several_imus_none_is_read_until_one_is_named() -> None:
    assert chosen({**PAIR, "/imu": IMU}).imu == "/imu"
    both = {**PAIR, "/a": IMU, "/b": IMU}
    assert chosen(both).imu is None
    assert chosen(both).notes[-1] == "No IMU was read: name one of /a, /b."
    assert chosen(both, imu="/b").imu == "/b"
    assert len(chosen(both, imu="/b").notes) == 1


def test_the_truth_is_named_or_calls_itself_so_or_is_the_only_one() -> None:
    types = {**PAIR, "/odom": ODOMETRY, "/gt/pose": ODOMETRY}
    assert chosen(types).notes[-1] == "The truth is /gt/pose, chosen by its name."
    assert chosen(types, truth="/odom").notes[-1] == "The truth is /odom."
    only = chosen({**PAIR, "/odom": ODOMETRY})
    assert only.notes[-1] == "The truth was assumed to be /odom, the only topic with poses."
    several = chosen({**PAIR, "/a": ODOMETRY, "/b": ODOMETRY})
    assert several.truth is None
    assert several.notes[-1] == "No truth was read: name one of /a, /b."


def test_the_frames_of_a_truth_stand_behind_its_topic() -> None:
    found = chosen(PAIR, truth="/tf:map.body")
    assert (found.truth_topic, found.truth_frames) == ("/tf", "map.body")
    assert (chosen(PAIR).truth_topic, chosen(PAIR).truth_frames) == ("", "")
    assert found.sensors == ["/cam0/image_raw", "/cam1/image_raw"]
