"""Moves: said in a word, read back from it, and rigid."""

import itertools

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.trajectory.correction import Move, parse_move

AXES = [
    ",".join(sign + axis for sign, axis in zip(signs, order, strict=True))
    for order in itertools.permutations("xyz")
    for signs in itertools.product(("", "-"), repeat=3)
]


def poses(n=20):
    rng = np.random.default_rng(4)
    q = rng.normal(size=(n, 4))
    return se3.transform(se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)), rng.normal(size=(n, 3)))


@pytest.mark.parametrize("axes", AXES)
def test_all_48_axes_read_back_and_keep_poses_rigid(axes):
    T = poses()
    for kind in ("axes", "positions"):
        move = parse_move(f"{kind}:{axes}")
        assert str(move) == f"{kind}:{axes}"
        moved = move.apply(T)
        assert se3.is_rotation(moved[:, :3, :3])
        np.testing.assert_array_equal(Move(move.kind, move.matrix.T).apply(moved), T)


def test_axes_say_where_the_new_ones_are_found_in_the_file():
    T = se3.transform(np.eye(3), [1.0, 2.0, 3.0])
    assert parse_move("positions:z,-x,-y").apply(T)[:3, 3].tolist() == [3, -1, -2]


def test_turned_axes_turn_motions_with_them():
    T, move = poses(), parse_move("axes:z,-x,-y")
    motion = se3.inverse(T[:-1]) @ T[1:]
    moved = move.apply(T)
    np.testing.assert_allclose(se3.inverse(moved[:-1]) @ moved[1:], move.apply(motion), atol=1e-14)


def test_a_mount_is_a_constant_motion_in_the_bodys_own_frame():
    T, move = poses(), parse_move("mount:0.1,0.2,0.3,0,0,0.6,0.8")
    np.testing.assert_allclose(se3.inverse(T) @ move.apply(T), np.broadcast_to(move.matrix, T.shape), atol=1e-14)
    assert str(move) == "mount:0.1,0.2,0.3,0,0,0.6,0.8"


@pytest.mark.parametrize("word", ["inverse", "rotations:inverse"])
def test_an_inverse_reads_back_and_undoes_itself(word):
    T, move = poses(), parse_move(word)
    assert str(move) == word
    np.testing.assert_allclose(move.apply(move.apply(T)), T, atol=1e-14)
    undone = T @ move.apply(T) if word == "inverse" else T[:, :3, :3] @ move.apply(T)[:, :3, :3]
    np.testing.assert_allclose(undone, np.broadcast_to(np.eye(undone.shape[-1]), undone.shape), atol=1e-14)
    if word == "rotations:inverse":
        np.testing.assert_array_equal(move.apply(T)[:, :3, 3], T[:, :3, 3])


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("axes:x,y", "axes are x, y and z, each once"),
        ("axes:x,x,z", "axes are x, y and z, each once"),
        ("positions:x,y,w", "axes are x, y and z, each once"),
        ("mount:1,2,3", "a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1"),
        ("mount:1,2,3,0,0,0,2", "a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1"),
        ("mount:a,2,3,0,0,0,1", "a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1"),
        (
            "sideways",
            "a file may be read as axes:…, positions:…, mount:…, inverse or rotations:inverse, but not as 'sideways'",
        ),
    ],
)
def test_a_word_that_means_nothing_is_named(word, sentence):
    with pytest.raises(InputError, match=sentence):
        parse_move(word)
