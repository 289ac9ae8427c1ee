"""The [orbit] table, with position and velocity or elements, and the checks of the orbit."""

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Self, cast

from pydantic import BeforeValidator, WithJsonSchema, model_validator

from starhold.algebra.vector import Vector, cross, norm
from starhold.laws.interface import Gain
from starhold.parts.craft import EARTH
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, date_of
from starhold.parts.orbit import BODIES, NEWTON, Elements, body_of, from_elements, lowest, meets_at
from starhold.scenario.element_sets import ElementSet, Ephemeris
from starhold.scenario.quantity import ask_for_unit, quantity, reader
from starhold.scenario.tables import Table, at_key, refuse

DENSEST = 1e6
"""Mean density (kg/m3) above which a start lies inside the central body; planets have less than 6000."""
LOWEST = 1.0 / 64.0
"""Plain altitudes below this share of the body's radius need a unit: for the Earth, below 100 km."""
AIR = 5e4
"""Altitude (m) below which nothing orbits the Earth. Altitudes up to geostationary that were given in km are below it."""
FARTHEST = 4e8
"""Plain altitude (m) above the Earth beyond which the unit is assumed to be wrong."""
FASTEST = 10.0
"""The ratio of speed to the escape speed of the Sun, a planet or the Moon above which the unit is assumed to be wrong."""
STRAIGHT = 1e-9
"""The sine of the angle between position and velocity below which an orbit counts as passing through the centre."""
ANGLE_UP = Gain("rad", at_least=0.0, at_most=math.pi, text="angle between the orbit's plane and the first two axes")
ANGLES = ("inclination", "raan", "argument_of_perigee", "true_anomaly")


def too_dense(gravity: float, distance: float) -> bool:
    """Return whether a body with this gravitational parameter (m3/s2) inside this distance (m) would be too dense."""
    return gravity > DENSEST * NEWTON * 4.0 / 3.0 * math.pi * distance**3


def check_gravity(key: str, gravity: float) -> None:
    """Raise an error where a gravitational parameter equals that of a known body in km^3/s^2."""
    meant = body_of(1e9 * gravity)
    if meant is not None:
        raise at_key(key, f'm^3/s^2; that of the {meant} is "{gravity:.10g} km^3/s^2"', gravity)


def _read_epoch(given: Any) -> Any:
    try:
        return date_of(given if isinstance(given, str) else reader(EPOCH)(given))
    except ValueError as error:
        raise refuse(str(error)) from None


EPOCH_KEY = (
    BeforeValidator(_read_epoch),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string", "description": "date and time in ISO 8601"},
                {
                    "type": "array",
                    "items": {"type": "number"},
                    "minItems": 6,
                    "maxItems": 6,
                    "description": "year, month, day, hour, minute, second",
                },
            ],
            "description": "when the flight begins, for all parts that use the Sun or the Earth's rotation; "
            f"{START[0]:.0f} January 1 if absent (UTC)",
        }
    ),
    EPOCH,
)


def _file(what: str, gives: str = "SGP4 gives the state at the epoch, by default that of the elements") -> tuple[Any, ...]:
    text = f"a file of {what}: {gives}"
    return BeforeValidator(_read_elements), WithJsonSchema({"type": "string", "description": text})


def _read_elements(given: Any) -> Any:
    """Return the elements that `with_orbit` has read. A file name that is left is refused: its table has no folder."""
    if given is not None and not isinstance(given, ElementSet | Ephemeris):
        raise refuse("a key of [orbit] of a scenario, which has a folder")
    return given


class Orbit(Table):
    """The initial orbit, as position and velocity or as orbital elements; without this table the spacecraft is in free
    space."""

    position: Annotated[Any, *quantity(Gain("m", shape=(3,), spread=False, text="inertial position"))] = None
    velocity: Annotated[Any, *quantity(Gain("m/s", shape=(3,), spread=False, text="inertial velocity"))] = None
    altitude: Annotated[
        float | None, *quantity(Gain("m", above=0.0, text="altitude of a circular orbit above the equatorial radius"))
    ] = None
    semi_major_axis: Annotated[float | None, *quantity(Gain("m", text="semi-major axis, negative for a hyperbola"))] = None
    eccentricity: Annotated[float | None, *quantity(Gain("1", at_least=0.0, text="eccentricity, 0 if absent"))] = None
    inclination: Annotated[float | None, *quantity(ANGLE_UP)] = None
    raan: Annotated[float | None, *quantity(Gain("rad", text="right ascension of the ascending node, 0 if absent"))] = None
    argument_of_perigee: Annotated[
        float | None, *quantity(Gain("rad", text="angle from the ascending node, 0 if absent"))
    ] = None
    true_anomaly: Annotated[
        float | None, *quantity(Gain("rad", text="angle from the perigee, on a circle from the ascending node; 0 if absent"))
    ] = None
    gravitational_parameter: Annotated[float, *quantity(Gain("m^3/s^2", above=0.0, text="GM of the central body"))] = EARTH
    radius: Annotated[
        float | None,
        *quantity(
            Gain("m", above=0.0, text="equatorial radius of the central body; known for the Sun, the planets and the Moon")
        ),
    ] = None

    epoch: Annotated[Any, *EPOCH_KEY] = None
    ephemeris: Annotated[
        int | None,
        *quantity(
            replace(EPHEMERIS, text="model of the motion of Sun and Moon, for all parts that use them; almanac if absent")
        ),
    ] = None
    tle: Annotated[Any, *_file("two lines (TLE)")] = None
    omm: Annotated[Any, *_file("an orbit mean-elements message (OMM)")] = None
    oem: Annotated[
        Any, *_file("an orbit ephemeris message (OEM)", "it gives the state at the epoch, by default its first")
    ] = None

    @property
    def surface(self) -> float | None:
        """The radius (m) of the central body, or None if unknown."""
        known = body_of(self.gravitational_parameter)
        return self.radius if self.radius is not None or known is None else BODIES[known].radius

    @property
    def start(self) -> tuple[Vector, Vector]:
        """The inertial position (m) and velocity (m/s) at the start."""
        if self.position is not None:
            return self.position, self.velocity
        angles = [getattr(self, key) or 0.0 for key in ANGLES]
        size = self.semi_major_axis if self.altitude is None else self.altitude + (self.surface or 0.0)
        return from_elements(Elements(size or 0.0, self.eccentricity or 0.0, *angles), self.gravitational_parameter)

    @model_validator(mode="wrap")
    @classmethod
    def _in_metres(cls, given: Any, read: Callable[[Any], Self]) -> Self:
        orbit, altitude = read(given), cast(Any, given).get("altitude") if isinstance(given, dict) else None
        if isinstance(altitude, int | float) and orbit.surface is not None and altitude < LOWEST * orbit.surface:
            low = f"{LOWEST * orbit.surface:.6g} or more about this body"
            raise at_key("altitude", ask_for_unit(altitude, "m", low, "km"), altitude)
        earth = body_of(orbit.gravitational_parameter) == "Earth"
        if isinstance(altitude, int | float) and altitude > FARTHEST and earth:
            far = f"within {FARTHEST:g}, where the Moon is; is {1e-3 * altitude:g} m meant?"
            raise at_key("altitude", f"a plain number is in m, {far}", altitude)
        if orbit.altitude is not None and orbit.altitude < AIR and earth:
            allowed = f"one above the atmosphere, which {orbit.altitude:.6g} m is inside; is {orbit.altitude:.6g} km meant?"
            raise at_key("altitude", allowed, altitude)
        return orbit

    @model_validator(mode="after")
    def _told_once(self) -> Self:
        sizes = [key for key in ("altitude", "semi_major_axis") if getattr(self, key) is not None]
        elements = [key for key in ("eccentricity", *ANGLES) if getattr(self, key) is not None]
        if self.position is not None or self.velocity is not None:
            missing = "velocity" if self.velocity is None else "position"
            if sizes or elements:
                key = (sizes + elements)[0]
                raise at_key(key, "either position and velocity, or the elements of an orbit", getattr(self, key))
            if getattr(self, missing) is None:
                raise at_key(missing, "position and velocity together", None)
        elif len(sizes) != 1:
            allowed = "position and velocity, or either altitude or semi_major_axis, with inclination"
            raise at_key(sizes[-1] if sizes else "position", allowed, getattr(self, sizes[-1]) if sizes else None)
        elif self.inclination is None:
            raise at_key("inclination", "an angle, together with altitude or semi_major_axis", None)
        elif self.altitude is not None and self.eccentricity:
            raise at_key(
                "eccentricity", "0 with an altitude, which means a circle; else a semi_major_axis", self.eccentricity
            )
        elif self.altitude is not None and self.surface is None:
            raise at_key("radius", "the radius of the body above which the altitude is measured", None)
        return self

    @model_validator(mode="after")
    def _possible(self) -> Self:
        check_gravity("gravitational_parameter", self.gravitational_parameter)
        try:
            start = self.start
        except ValueError as error:
            key = "true_anomaly" if "anomaly" in str(error) else "semi_major_axis"
            raise at_key(key, str(error), getattr(self, key)) from None
        self.check_start(*start)
        return self

    def check_start(self, position: Vector, velocity: Vector) -> None:
        """Raise an error where the orbit starts inside the central body or passes through its centre."""
        gravity = self.gravitational_parameter
        key, value = ("semi_major_axis", self.semi_major_axis) if self.position is None else ("position", list(position))
        distance, fast = norm(position), norm(velocity)
        if not distance:
            raise at_key(key, "a point away from the centre of attraction", value)
        if self.surface is not None and distance < self.surface:
            name = body_of(gravity) or "body"
            allowed = f"a start above the {name}'s radius of {1e-3 * self.surface:g} km; a plain number is in m"
            raise at_key(key, allowed, value)
        if too_dense(gravity, distance):
            allowed = "a start outside the central body; plain numbers are in m, GM in m^3/s^2"
            raise at_key(key, allowed, value)
        if norm(cross(position, velocity)) <= STRAIGHT * distance * fast:
            raise at_key("velocity", "an orbit that does not pass through the centre of attraction", list(velocity))

    def check_flight(self, duration: float, start: tuple[Vector, Vector] | None = None) -> None:
        """Raise an error where the orbit meets the body's surface during a run of this duration (s); warn where it would
        later. start: position and velocity, if already computed."""
        position, velocity = self.start if start is None else start
        gravity, surface = self.gravitational_parameter, self.surface
        escape = math.sqrt(2.0 * gravity / norm(position))
        if body_of(gravity) is not None and norm(velocity) > FASTEST * escape:
            said = f"{norm(velocity) / escape:.3g} times the speed of escape; plain numbers are in m/s"
            warnings.warn(f"orbit.velocity: {said}", stacklevel=2)
        if surface is None or lowest(position, velocity, gravity) >= surface:
            return
        key, value = ("velocity", list(velocity)) if self.position is not None else ("semi_major_axis", self.semi_major_axis)
        name = body_of(gravity) or "body"
        moment = meets_at(position, velocity, gravity, surface)
        if moment < duration:
            allowed = (
                f"an orbit above the {name}'s surface, which this one meets after {moment:.4g} s; plain numbers are in m/s"
            )
            raise at_key(f"orbit.{key}", allowed, value)
        if moment < math.inf:
            warnings.warn(f"orbit.{key}: the orbit meets the {name}'s surface after {moment:.4g} s", stacklevel=2)
