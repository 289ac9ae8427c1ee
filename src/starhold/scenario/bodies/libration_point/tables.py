"""The tables of a station-keeping scenario. Plain numbers are scaled: by the unit of length, and one revolution takes 2
pi."""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from starhold.laws.interface import Gain
from starhold.parts.bodies.libration_point import EARTH_DIAMETER, PRIMARIES, Libration, Primaries, Units
from starhold.parts.orbit import BODIES, body_of
from starhold.scenario.checking import nearest
from starhold.scenario.orbit import check_gravity, too_dense
from starhold.scenario.quantity import quantity, scaled
from starhold.scenario.schema import LawTable, ScenarioTable, Timing
from starhold.scenario.tables import Table, at_key, refuse


def _known_pair(value: Any) -> Any:
    if not isinstance(value, str) or value not in PRIMARIES:
        raise refuse(nearest(str(value), list(PRIMARIES)))
    return value


class LibrationTable(Table):
    """The libration point, its two bodies, the model of the motion, and the unit of length. Two custom bodies replace
    `primaries`."""

    primaries: Annotated[
        str | None,
        BeforeValidator(_known_pair),
        WithJsonSchema({"enum": list(PRIMARIES), "description": "two bodies by name; sun-earth if none are given"}),
    ] = None
    larger: Annotated[float | None, *quantity(Gain("m^3/s^2", above=0.0, text="GM of the larger body"))] = None
    smaller: Annotated[float | None, *quantity(Gain("m^3/s^2", above=0.0, text="GM of the smaller body"))] = None
    separation: Annotated[float | None, *quantity(Gain("m", above=0.0, text="distance between the two bodies"))] = None
    point: Annotated[Literal["L1", "L2", "L3"], Field(description="collinear libration point")] = "L2"
    model: Annotated[Literal["linear", "nonlinear"], Field(description="motion near the point, or three-body problem")] = (
        "linear"
    )
    length_unit: Annotated[float, *quantity(Gain("m", above=0.0, text="unit of length, an Earth diameter if absent"))] = (
        EARTH_DIAMETER
    )

    @model_validator(mode="after")
    def _bodies(self) -> Self:
        given = {"larger": self.larger, "smaller": self.smaller, "separation": self.separation}
        missing = [key for key, value in given.items() if value is None]
        if self.primaries is not None and len(missing) < len(given):
            raise at_key("primaries", "either primaries or larger, smaller and separation", self.primaries)
        if missing and len(missing) < len(given):
            raise at_key(missing[0], "larger, smaller and separation together", None)
        if not missing:
            self._check_own()
        return self

    def _check_own(self) -> None:
        """Raise an error for an impossible pair of custom bodies."""
        pair = self.pair
        check_gravity("larger", pair.larger)
        check_gravity("smaller", pair.smaller)
        if pair.smaller > pair.larger:
            raise at_key("smaller", f"at most that of the larger body, {pair.larger:g}", self.smaller)
        for gravity in (pair.larger, pair.smaller):
            known = body_of(gravity)
            if too_dense(gravity, pair.separation) or (known is not None and pair.separation < BODIES[known].radius):
                raise at_key(
                    "separation", "more than the size of a body; a plain number is in m, GM in m^3/s^2", pair.separation
                )

    @property
    def pair(self) -> Primaries:
        """The larger and the smaller body."""
        if self.larger is None or self.smaller is None or self.separation is None:
            return PRIMARIES[self.primaries or "sun-earth"]
        return Primaries("two bodies", self.larger, self.smaller, self.separation, 0.0, 0.0)

    @property
    def units(self) -> Units:
        """The physical units of scaled numbers."""
        return self.pair.units(self.length_unit)

    @property
    def plant(self) -> Libration:
        """The equations' numbers for this libration point."""
        return self.pair.point(self.point, self.length_unit)


class Resources(Table):
    """The control limit, as `limit`, `margin` or `deficit`, and the lag of the control."""

    limit: Annotated[float | None, *scaled("acceleration", Gain("m/s^2", above=0.0, text="largest control"))] = None
    margin: Annotated[
        float | None, *quantity(Gain("1", at_least=0.0, text="share by which the limit exceeds the circle's peak demand"))
    ] = None
    deficit: Annotated[
        float | None, *quantity(Gain("1", at_least=0.0, at_most=0.99, text="share by which the limit is below that demand"))
    ] = None
    lag: Annotated[float | None, *scaled("time", Gain("s", at_least=0.0, text="time constant of the control surfaces"))] = (
        None
    )

    @property
    def limits(self) -> dict[str, float]:
        """The keys of the limit that the file gives, with their values."""
        given = {"limit": self.limit, "margin": self.margin, "deficit": self.deficit}
        return {key: value for key, value in given.items() if value is not None}

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        if len(self.limits) > 1:
            raise at_key(list(self.limits)[1], f"one of limit, margin and deficit, not also {next(iter(self.limits))}", None)
        return self


class ControlTable(Resources):
    """The default control limits and lag of all laws."""

    limit_kind: Annotated[
        Literal["norm", "axis", "none"], Field(description="whether the limit holds for the norm, each axis, or not at all")
    ] = "norm"


class PointInitial(Table):
    """The initial state, relative to the libration point, or to the law's circle or equilibrium."""

    relative_to: Annotated[
        Literal["point", "target"],
        Field(description="origin of position and velocity; target: the law's circle at a phase, or its equilibrium"),
    ] = "point"
    phase: Annotated[float, *quantity(Gain("rad", text="phase angle on the circle, from Y towards Z"))] = 0.0
    position: Annotated[Any, *scaled("length", Gain("m", shape=(3,), spread=False, text="position"))] = (0.0, 0.0, 0.0)
    velocity: Annotated[Any, *scaled("velocity", Gain("m/s", shape=(3,), spread=False, text="velocity"))] = (0.0, 0.0, 0.0)


class PointTiming(Timing):
    """The duration of a run, its control period and its integration steps."""

    duration: Annotated[float, *scaled("time", Gain("s", above=0.0, text="length of the run, in whole control periods"))]
    control_period: Annotated[float, *scaled("time", Gain("s", above=0.0, text="time for which a control is held"))] = 0.001
    record_every: Annotated[int, *quantity(Gain("1", at_least=1, whole=True, text="control steps per recorded sample"))] = 10
    lost_beyond: Annotated[
        float | None,
        *scaled("length", Gain("m", above=0.0, text="divergence bound on the distance; 0.4 of the nearer body's if absent")),
    ] = None


class Near(Table):
    """The tolerance within which the circle or the equilibrium counts as reached."""

    tolerance: Annotated[float, *scaled("length", Gain("m", above=0.0, text="distance from circle or equilibrium"))] = 0.05


class PointLawTable(LawTable, Resources):
    """The keys of every law table besides the law's own gains."""


class LibrationPointTable(ScenarioTable):
    """A scenario file without its law tables, which are read one by one."""

    libration: LibrationTable
    control: ControlTable = ControlTable()
    initial: PointInitial = PointInitial()
    simulation: PointTiming
    settling: Near = Near()

    @model_validator(mode="after")
    def _limit_is_of_something(self) -> Self:
        if self.control.limit_kind == "none" and self.control.limits:
            raise at_key("control.limit_kind", "norm or axis where there is a limit", "none")
        return self
