"""What YAML may say of a light's brightness: over time, and as a lighting changes it."""

from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from vobench.scene.light import Dimmer, Flicker, Level, Steady, Switched
from vobench.suite.strict import NonNegative, Positive, Share, Strict


class FlickerSpec(Strict):
    """A lamp on alternating current: 1 + depth cos(2π 2 mains_hz t + phase)."""

    mains_hz: Positive = 50.0
    depth: Share
    phase_deg: float = 0.0


class SwitchedSpec(Strict):
    """On or off at first, and the other way round at each time."""

    times_s: Annotated[tuple[float, ...], Field(min_length=1)]
    on_first: bool = True


class LevelSpec(Strict):
    """A light's brightness over time, relative to its nominal one: exactly one of these."""

    steady: NonNegative | None = None
    flicker: FlickerSpec | None = None
    dimmer: Annotated[tuple[tuple[float, NonNegative], ...], Field(min_length=2)] | None = None
    switched: SwitchedSpec | None = None

    @model_validator(mode="after")
    def _exactly_one(self) -> "LevelSpec":
        if len(self.model_dump(exclude_none=True)) != 1:
            raise ValueError("should have exactly one of steady, flicker, dimmer, switched")
        require_increasing([t for t, _ in self.dimmer or ()])
        require_increasing(list(self.switched.times_s) if self.switched else [])
        return self

    def build(self) -> Level:
        """The function of time."""
        if self.flicker:
            return Flicker(self.flicker.mains_hz, self.flicker.depth, float(np.deg2rad(self.flicker.phase_deg)))
        if self.dimmer:
            return Dimmer(tuple(t for t, _ in self.dimmer), tuple(level for _, level in self.dimmer))
        if self.switched:
            return Switched(self.switched.times_s, self.switched.on_first)
        assert self.steady is not None  # one of them is there
        return Steady(self.steady)


class LightOverride(Strict):
    """A light as a lighting sets it: another power (lamps) or illuminance (sun and sky), or a level over time."""

    power_lm: NonNegative | None = None
    illuminance_lx: NonNegative | None = None
    level: LevelSpec | None = None


def require_increasing(times_s: list[float]) -> None:
    """Raise ValueError where a time is not later than the one before it."""
    for earlier, later in pairwise(times_s):
        if later <= earlier:
            raise ValueError(f"times should increase, but {later:g} follows {earlier:g}")
