"""A generated place is what a generator returns, and cannot be changed."""

from dataclasses import FrozenInstanceError

import pytest

from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.material import Material


def test_a_place_without_lights_has_none_of_another_place() -> None:
    first = GeneratedPlace((), {"grey": Material()})
    assert tuple(first.lights) == ()
    assert first == GeneratedPlace((), {"grey": Material()}, ())


def test_a_place_cannot_be_changed() -> None:
    place = GeneratedPlace((), {})
    with pytest.raises(FrozenInstanceError):
        place.things = ()  # type: ignore[misc]
