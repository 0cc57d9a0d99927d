"""Pictures of truth tell values apart, and leave black what is not known."""

import numpy as np
import pytest

from vobench.errors import UnknownNameError
from vobench.sensor.pixel_truth import CHANNELS, NEAR_TO_FAR, TruthFrame, check_channels, picture

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("channel", CHANNELS)
def test_every_channel_becomes_a_colour_picture_and_its_values_stay_as_they_are(channel):
    kind = CHANNELS[channel]
    values = RNG.uniform(0.1, 4, kind.shape(6, 5)).astype(kind.dtype)
    before = values.copy()
    seen = picture(channel, values)
    assert seen.shape == (6, 5, 3)
    assert seen.dtype == np.uint8
    np.testing.assert_array_equal(values, before)


@pytest.mark.parametrize("channel", CHANNELS)
def test_what_is_not_known_is_black(channel):
    kind = CHANNELS[channel]
    nothing = np.full(kind.shape(3, 4), np.nan if kind.dtype is np.float32 else 0, kind.dtype)
    assert not picture(channel, nothing).any()


def test_nearer_is_lighter():
    brightness = picture("depth", np.geomspace(0.3, 20, 50, dtype=np.float32)[None]).astype(int).sum(-1)[0]
    assert (np.diff(brightness) <= 0).all()
    assert brightness[0] > 3 * brightness[-1]


def test_opposite_flows_have_opposite_colours_and_none_is_white():
    angles = np.linspace(0, 2 * np.pi, 13)[:-1]
    flow = np.stack([np.cos(angles), np.sin(angles)], -1)[None].astype(np.float32)
    there, back = picture("flow", flow).astype(int), picture("flow", -flow).astype(int)
    np.testing.assert_allclose(there.min(-1), 0, atol=1)
    assert (np.abs(there - back).sum(-1) > 250).all()
    still = np.concatenate([flow, np.zeros_like(flow)])
    assert (picture("flow", still)[1] == 255).all()


def test_ids_keep_their_colour_whatever_else_is_there_and_differ():
    ids = np.arange(1, 30, dtype=np.uint16)[None]
    colors = picture("instance", ids)[0]
    assert len(np.unique(colors, axis=0)) == 29
    np.testing.assert_array_equal(picture("instance", ids[:, 5:6])[0, 0], colors[5])


def test_a_surface_that_faces_the_camera_is_blue_and_one_below_it_green():
    normals = np.array([[[0, 0, -1.0], [0, -1.0, 0]]], np.float32)
    assert picture("normals", normals)[0].argmax(-1).tolist() == [2, 1]


def test_masks_are_white_and_shadows_the_lighter_the_more_lights_are_hidden():
    assert picture("moving", np.array([[True, False]]))[0].tolist() == [[255] * 3, [0] * 3]
    shades = picture("shadow", np.arange(4, dtype=np.uint16)[None])[0, :, 0]
    assert (np.diff(shades.astype(int)) > 0).all()


def test_flows_a_third_of_a_turn_apart_are_red_green_and_blue():
    angles = np.array([0, 2 * np.pi / 3, -2 * np.pi / 3])
    flow = np.stack([np.cos(angles), np.sin(angles)], -1)[None].astype(np.float32)
    np.testing.assert_array_equal(picture("flow", flow)[0], 255 * np.eye(3, dtype=int))


def test_the_speed_of_all_but_the_fastest_hundredth_has_full_strength_and_half_of_it_half():
    flow = np.zeros((1, 200, 2), np.float32)
    flow[0, :, 0] = 4.0
    flow[0, 0, 0] = 1000.0
    flow[0, 1, 0] = 2.0
    seen = picture("flow", flow)[0]
    assert seen[0].tolist() == seen[5].tolist() == [255, 0, 0]
    assert seen[1].tolist() == [255, 128, 128]


def test_the_nearest_distance_has_the_first_colour_and_the_farthest_the_last():
    seen = picture("depth", np.array([[2.0, 8.0, 4.0, np.nan, -1.0]], np.float32))[0]
    assert seen[[0, 1]].tolist() == NEAR_TO_FAR[[0, -1]].astype(int).tolist()
    assert seen[2].tolist() == NEAR_TO_FAR[2].astype(int).tolist(), "half way on a logarithmic scale"
    assert not seen[3].any()


def test_a_frame_names_the_channels_it_has_in_their_own_order():
    frame = TruthFrame(moving=np.zeros((2, 2), bool), depth=np.zeros((2, 2), np.float32))
    assert list(frame.channels()) == ["depth", "moving"]
    assert check_channels(["moving", "depth", "moving"]) == ("depth", "moving")
    assert CHANNELS["normals"].shape(4, 5) == (4, 5, 3)
    assert CHANNELS["flow"].shape(4, 5) == (4, 5, 2)
    assert CHANNELS["depth"].shape(4, 5) == (4, 5)
    with pytest.raises(UnknownNameError, match=r"no truth channel 'flo'\. Known: depth, normals, flow"):
        check_channels(["flo"])
