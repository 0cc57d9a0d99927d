"""The sun as an emitter plugin of Mitsuba."""

from functools import cache
from typing import Any

import numpy as np

from vobench.scene.light import SUN_RADIUS_RAD

PLUGIN = "vobench_sun"
FAR_M = 1e4  # beyond every scene; shadow rays end here


@cache
def register_sun() -> None:
    """Register the plugin in Mitsuba, whose variant must be set."""
    import drjit as dr
    import mitsuba as mi

    class SunPlugin(mi.Emitter):  # type: ignore[misc]
        """A sun that is not visible itself: `irradiance` on a surface that faces `direction`, a unit vector to the sun.

        For the integrator it is a delta light, which only emitter sampling finds. Directions are sampled on the disc.
        """

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.irradiance = mi.Color3f(properties["irradiance"])
            self.direction = mi.Vector3f(properties["direction"])
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.DeltaDirection
            dr.make_opaque(self.irradiance, self.direction)

        def traverse(self, callback: Any) -> None:
            callback.put("irradiance", self.irradiance, mi.ParamFlags.NonDifferentiable)
            callback.put("direction", self.direction, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, _keys: Any) -> None:
            # Constants would be compiled into the kernel, one kernel for each value.
            dr.make_opaque(self.irradiance, self.direction)

        def sample_direction(
            self,
            it: Any,
            sample: Any,
            active: Any = True,
        ) -> tuple[Any, Any]:
            disc = mi.warp.square_to_uniform_cone(sample, float(np.cos(SUN_RADIUS_RAD)))
            ds = dr.zeros(mi.DirectionSample3f)
            ds.d = mi.Frame3f(self.direction).to_world(disc)
            ds.dist = FAR_M
            ds.p = it.p + FAR_M * ds.d
            ds.n = -ds.d
            ds.uv = sample
            ds.time = it.time
            ds.pdf = 1.0
            ds.delta = True
            ds.emitter = mi.EmitterPtr(self)
            return ds, mi.Spectrum(self.irradiance) & active

        def pdf_direction(self, *_: Any) -> Any:
            return mi.Float(0.0)

        def eval(self, *_: Any) -> Any:
            return mi.Spectrum(0.0)

        def eval_direction(self, *_: Any) -> Any:
            return mi.Spectrum(0.0)

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f()

    mi.register_emitter(PLUGIN, SunPlugin)
