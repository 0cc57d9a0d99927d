"""What a suite's YAML may say of a trajectory: `kind` says which keys there are; without it, waypoints."""

from typing import Annotated, Any, get_args

from pydantic import BeforeValidator, Field

from vobench.catalog.catalog import unknown
from vobench.geometry.rig import WheelGeometry
from vobench.suite.ground_spec import GroundSpec
from vobench.suite.planar_spec import CurveSpec, WaypointsSpec
from vobench.suite.replay_spec import ReplaySpec
from vobench.suite.spatial_spec import HandheldSpec, PoseSplineSpec, QuadrotorSpec, RailSpec
from vobench.suite.strict import tupled, wrong_key

DEFAULT_KIND = "waypoints"


def _of_a_kind(value: Any) -> Any:
    """Keys with their kind. Raises ValidationError where there is none such, or a key is of other kinds."""
    if not isinstance(value, dict):
        return value
    kind = value.get("kind", DEFAULT_KIND)
    if not isinstance(kind, str) or kind not in KINDS:
        raise wrong_key("kind", unknown("kind of trajectory", str(kind), list(KINDS)))
    for key in sorted(set(value) - set(KINDS[kind].model_fields)):
        _refuse_of_others(key, kind, is_said="kind" in value)
    return {**tupled(value), "kind": kind}


def _refuse_of_others(key: str, kind: str, *, is_said: bool) -> None:
    """Raise ValidationError for a key that other kinds have, if it is not one of this kind's without its unit."""
    owners = [name for name, spec in KINDS.items() if key in spec.model_fields]
    if owners and not any(own.startswith(f"{key}_") for own in KINDS[kind].model_fields):
        this = f"this is {kind}" if is_said else f"without a kind this is {kind}"
        raise wrong_key(key, f"belongs to {', '.join(owners)}; {this}")


SpatialSpec = PoseSplineSpec | HandheldSpec | RailSpec | QuadrotorSpec
AnySpec = WaypointsSpec | CurveSpec | SpatialSpec | ReplaySpec
KINDS = {spec.model_fields["kind"].default: spec for spec in get_args(AnySpec)}
TrajectorySpec = Annotated[AnySpec, Field(discriminator="kind"), BeforeValidator(_of_a_kind)]


def wheels_of(spec: AnySpec) -> WheelGeometry | None:
    """The wheels of the body that goes there, None for one that leaves the floor."""
    return spec.wheels if isinstance(spec, GroundSpec) else None
