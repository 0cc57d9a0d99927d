"""The last renderer is used again for the same key, and closed for another one, after an exception, or at once."""

import pytest

from vobench.runner.last_renderer import LastRenderer


class Renderer:
    """A renderer that counts how often it is closed."""

    def __init__(self) -> None:
        self.closed = 0

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def kept() -> LastRenderer:
    last = LastRenderer()
    last.is_kept = True
    return last


def used(last: LastRenderer, key: str) -> Renderer:
    with last.using(key, Renderer) as renderer:
        assert renderer.closed == 0
        return renderer


def test_without_keeping_each_use_opens_a_renderer_and_closes_it() -> None:
    last = LastRenderer()
    first = used(last, "room")
    assert first.closed == 1
    assert used(last, "room") is not first


def test_a_kept_renderer_serves_its_key_until_another_one_is_needed(kept: LastRenderer) -> None:
    first = used(kept, "room")
    assert used(kept, "room") is first
    assert first.closed == 0

    second = used(kept, "park")
    assert second is not first
    assert (first.closed, second.closed) == (1, 0)
    assert used(kept, "room") is not first


def test_a_renderer_is_not_used_again_after_an_exception(kept: LastRenderer) -> None:
    with pytest.raises(ValueError, match="lost"), kept.using("room", Renderer) as broken:
        raise ValueError("lost")
    assert broken.closed == 1
    assert used(kept, "room") is not broken


def test_a_kept_renderer_can_be_closed_once(kept: LastRenderer) -> None:
    first = used(kept, "room")
    kept.close()
    kept.close()
    assert first.closed == 1
