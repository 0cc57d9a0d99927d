"""The sun for Mitsuba, which has none with a disc of its own: parallel light from all of its half degree."""

from functools import cache
from typing import Any

import numpy as np

from vobench.scene.light import SUN_RADIUS_RAD

PLUGIN = "vobench_sun"
FAR_M = 1e4  # beyond every scene; shadow rays end here


@cache
def register() -> None:
    """Make the plugin known to Mitsuba, whose variant must be set."""
    import drjit as dr
    import mitsuba as mi

    class SunDisc(mi.Emitter):  # type: ignore[misc]
        """`irradiance` on a surface that faces `direction`, the unit vector towards the sun; itself unseen.

        Delta light to the integrator, as only emitter sampling finds it; its direction is drawn from the disc.
        """

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.irradiance = mi.Float(properties["irradiance"])
            self.direction = mi.Vector3f(properties["direction"])
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.DeltaDirection
            dr.make_opaque(self.irradiance, self.direction)

        def traverse(self, callback: Any) -> None:
            callback.put("irradiance", self.irradiance, mi.ParamFlags.NonDifferentiable)
            callback.put("direction", self.direction, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, _keys: Any) -> None:
            # Constants would be compiled into the kernel, one kernel for each value.
            dr.make_opaque(self.irradiance, self.direction)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            disc = mi.warp.square_to_uniform_cone(sample, float(np.cos(SUN_RADIUS_RAD)))
            ds = dr.zeros(mi.DirectionSample3f)
            ds.d = mi.Frame3f(self.direction).to_world(disc)
            ds.dist, ds.p, ds.n = FAR_M, it.p + FAR_M * ds.d, -ds.d
            ds.uv, ds.time, ds.pdf, ds.delta = sample, it.time, 1.0, True
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

    mi.register_emitter(PLUGIN, SunDisc)
