"""The self-test passes where pictures are right, and fails where they are not."""

import json

import numpy as np
import pytest
from OpenGL import GL

from vobench.errors import MissingDependencyError
from vobench.rendering import self_test
from vobench.rendering.draw_call import DrawCalls
from vobench.rendering.gl_state import disabled


def test_a_machine_that_draws_rightly_passes() -> None:
    found = self_test.check_drawing()
    assert found.well
    assert found.largest_error < self_test.TOLERANCE / 5
    assert found.driver.device in found.devices


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda picture: picture * 1.01, "largest_error"),
        (lambda picture: np.roll(picture, 2, 1), "largest_error"),
        (lambda picture: picture[::-1], "largest_error"),
        (lambda picture: picture[..., ::-1], "largest_error"),
        (lambda picture: np.maximum(picture, np.float32(0.01)), "stray_cd_m2"),
    ],
    ids=["brighter", "shifted", "upside down", "blue for red", "stray light"],
)
def test_a_picture_that_is_wrong_fails(monkeypatch: pytest.MonkeyPatch, wrong, named: str) -> None:
    right = self_test._drawn()
    monkeypatch.setattr(self_test, "_drawn", lambda: wrong(right))
    found = self_test.check_drawing()
    assert not found.well
    assert getattr(found, named) > (self_test.TOLERANCE if named == "largest_error" else 0)


def test_a_picture_of_no_numbers_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(self_test, "_drawn", lambda: np.full((64, 96, 3), np.nan, np.float32))
    assert not self_test.check_drawing().well


def test_what_is_missing_is_printed_as_an_error(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def refuse() -> None:
        raise MissingDependencyError("cannot draw; run: something")

    monkeypatch.setattr(self_test, "check_drawing", refuse)
    self_test.main()
    assert json.loads(capsys.readouterr().out) == {"error": "cannot draw; run: something"}


def test_a_driver_that_draws_panes_over_what_hides_them_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    draw_pane = DrawCalls._draw_pane

    def without_depth_test(self: DrawCalls, *arguments: object, **options: object) -> None:
        with disabled(GL.GL_DEPTH_TEST):
            draw_pane(self, *arguments, **options)

    monkeypatch.setattr(DrawCalls, "_draw_pane", without_depth_test)
    assert not self_test.check_drawing().well
