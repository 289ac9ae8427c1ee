"""The tests of which conditions of modes are made: the quantity that each looks at, its level, and whether it holds.

A test of what is measured takes the law's measurement alone. Others take what flight software keeps (its clock, the Sun's
place and the turn of the Earth at the start) and what it sees: the state as sensors and estimator give it, readings, and the
estimate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from starhold.algebra.circular import cosine_sine
from starhold.algebra.quaternion import half_angle_sine, to_body
from starhold.algebra.scalar import Scalar, Truth, less, less_equal, where
from starhold.algebra.vector import Vector, dot, norm, subtract
from starhold.laws.interface import Field, Gain, Measurement
from starhold.parts import sun
from starhold.parts.epoch import Date, days_of, sidereal, spun, turned
from starhold.parts.targets.alignment import geodetic

NEVER = 1e12
"""Control instants since what has not come yet."""
LATITUDE = Gain("rad", at_least=-0.5 * math.pi, at_most=0.5 * math.pi, text="geodetic, of the station")
LONGITUDE = Gain("rad", at_least=-math.pi, at_most=math.tau, text="of the station, to the east")
HEIGHT = Gain("m", at_least=-500.0, at_most=9000.0, text="of the station above the ellipsoid")
AXIS = Gain("1", shape=(3,), spread=False, text="body axis that the angle to the Sun is of")
SETTINGS: Mapping[str, Field] = {
    "latitude": Field("latitude", LATITUDE, True),
    "longitude": Field("longitude", LONGITUDE, True),
    "height": Field("height", HEIGHT, False, 0.0),
    "axis": Field("axis", AXIS, True),
}
"""Further numbers of tests."""


class Sight(NamedTuple):
    """Flight software sees this in addition to the law's measurement: the body's state as sensors and estimator give it, the
    readings of all sensors, and the estimate."""

    state: Any
    readings: tuple[Any, ...]
    estimate: Any


class Sky(NamedTuple):
    """The Sun and the turns of the Earth at the start of a flight."""

    sun: sun.Numbers
    turn: Scalar


class Station(NamedTuple):
    """A station's place (m) and vertical in axes of the Earth."""

    place: Vector
    up: Vector


class Watch(NamedTuple):
    """Flight software keeps the control instants since the start, the sky at the start (none where nothing asks for it), the
    stations that tests are about, in their order, and the control instants since the last new attitude of a star
    tracker."""

    clock: Scalar
    sky: Sky | tuple[()]
    stations: tuple[Station, ...]
    fix: Scalar


class Tested(NamedTuple):
    """A quantity that conditions test: its unit and words for it; its value, which may be a rising function of it that costs
    less, with the same function of a level. settings: further numbers of such a test; reads, estimates: the reading, or the
    estimate, that it needs; sky: whether it needs the epoch and an orbit about the Earth."""

    unit: str
    text: str
    value: Callable[[Facts, Mapping[str, Any]], Scalar]
    level: Callable[[Scalar], Scalar] | None = None
    least: float | None = None
    most: float | None = None
    settings: tuple[str, ...] = ()
    reads: str = ""
    estimates: str = ""
    sky: bool = False
    watched: bool = True


class Facts:
    """All that tests look at as a control step begins. Quantities are computed once, when first needed."""

    def __init__(self, measurement: Measurement, watch: Any = (), sight: Sight | None = None) -> None:
        self.measurement, self.watch, self._sight = measurement, watch, sight
        self._known: dict[Any, Any] = {}

    @property
    def sight(self) -> Sight:
        """The sight of flight software; only the control step of a loop gives it."""
        assert self._sight is not None
        return self._sight

    def once(self, name: Any, compute: Callable[[], Any]) -> Any:
        """A value, computed when it is first asked for."""
        if name not in self._known:
            self._known[name] = compute()
        return self._known[name]

    @property
    def time(self) -> Scalar:
        """The time (s) since the start."""
        return self.once("time", lambda: self.watch.clock * self.measurement.period)

    @property
    def sun(self) -> sun.Sun:
        """The Sun now."""
        return self.once("sun", lambda: sun.sun(self.time, self.watch.sky.sun))

    def later(self, periods: Scalar, time: Scalar) -> Truth:
        """Whether this many control periods reach a time (s), to the nearest control instant."""
        period = self.measurement.period
        return less_equal(time - 0.5 * period, periods * period)

    def holds(self, test: str, level: Scalar, settings: Mapping[str, Any]) -> Truth:
        """Whether a test holds."""
        if test == "not_before":
            return self.later(self.watch.clock, level)
        if test == "not_after":
            return less(self.time - 0.5 * self.measurement.period, level)
        name, _, side = test.rpartition("_")
        tested = TESTED[name]
        given = {key: settings[key] for key in ("station", *tested.settings) if key in settings}
        level = level if tested.level is None else tested.level(level)
        value = tested.value(self, given) if tested.settings else self.once(name, lambda: tested.value(self, given))
        return less(value, level) if side == "below" else less(level, value)


def sine_of_half(angle: Scalar) -> Scalar:
    """The sine of half an angle of up to pi, by its series; 1e-16 off at most."""
    x = 0.25 * angle * angle
    total = 1.0
    for n in range(20, 0, -2):
        total = 1.0 - total * x / float(n * (n + 1))
    return 0.5 * angle * total


def _sine(angle: Scalar) -> Scalar:
    return cosine_sine(angle / math.tau)[1]


def _minus_cosine(angle: Scalar) -> Scalar:
    return -cosine_sine(angle / math.tau)[0]


def _rate(now: Facts, _: Mapping[str, Any]) -> Scalar:
    return norm(now.measurement.rate)


def _body_rate(now: Facts, _: Mapping[str, Any]) -> Scalar:
    return norm(now.measurement.body_rate)


def _angle(now: Facts, _: Mapping[str, Any]) -> Scalar:
    return half_angle_sine(now.measurement.attitude)


def _wheel_momentum(now: Facts, _: Mapping[str, Any]) -> Scalar:
    return norm(now.measurement.wheel_momentum)


def _sunlight(now: Facts, _: Mapping[str, Any]) -> Scalar:
    return sun.in_view(now.sight.state.position, now.sun)


def _tracker_age(now: Facts, _: Mapping[str, Any]) -> Scalar:
    return now.watch.fix * now.measurement.period


def _attitude_deviation(now: Facts, _: Mapping[str, Any]) -> Scalar:
    return norm(now.sight.estimate.attitude_deviation)


def _elevation(now: Facts, settings: Mapping[str, Any]) -> Scalar:
    """The sine of the elevation at which a station sees the craft."""
    cosine, sine = now.once("turn", lambda: cosine_sine(turned(now.watch.sky.turn, now.time)))
    station: Station = settings["station"]
    ahead = subtract(now.sight.state.position, spun(station.place, cosine, sine))
    return dot(spun(station.up, cosine, sine), ahead) / norm(ahead)


def _away_from_sun(now: Facts, settings: Mapping[str, Any]) -> Scalar:
    """The cosine of the angle between a body axis and the direction away from the Sun."""
    axis = settings["axis"]
    return -dot(axis, to_body(now.sight.state.attitude, now.sun.direction)) / norm(axis)


TESTED: Mapping[str, Tested] = {
    "rate": Tested("rad/s", "the rate relative to the target", _rate, watched=False),
    "body_rate": Tested("rad/s", "the absolute rate", _body_rate, watched=False),
    "angle": Tested(
        "rad",
        "the angle to the target",
        _angle,
        sine_of_half,
        most=3.141592653589793,
        watched=False,
    ),
    "wheel_momentum": Tested(
        "N m s",
        "the norm of the wheels' momentum",
        _wheel_momentum,
        watched=False,
    ),
    "elevation": Tested(
        "rad",
        "the elevation at which the station at this latitude and longitude sees the craft",
        _elevation,
        _sine,
        -0.5 * math.pi,
        0.5 * math.pi,
        ("latitude", "longitude", "height"),
        sky=True,
    ),
    "sunlight": Tested(
        "1",
        "the share of the Sun's disc that the Earth leaves in view",
        _sunlight,
        least=0.01,
        most=0.99,
        sky=True,
    ),
    "sun_angle": Tested(
        "rad",
        "the angle between the body axis and the Sun",
        _away_from_sun,
        _minus_cosine,
        None,
        math.pi,
        ("axis",),
        sky=True,
    ),
    "tracker_age": Tested(
        "s",
        "the time since the last new attitude of a star tracker",
        _tracker_age,
        reads="attitude_is_new",
    ),
    "attitude_deviation": Tested(
        "rad",
        "the norm of the deviations that the estimator states for its attitude",
        _attitude_deviation,
        estimates="attitude_deviation",
    ),
}
"""Quantities that a condition may test, besides time."""
MEASURED = tuple(f"{name}_{side}" for name in TESTED for side in ("below", "above"))
TIMES: Mapping[str, Gain] = {
    "not_before": Gain("s", at_least=0.0, text="since the start, or a date: it holds from then on"),
    "not_after": Gain("s", above=0.0, text="since the start, or a date: it holds until then"),
}
TESTS = (*MEASURED, *TIMES)
"""Each measured quantity below or above a level, and the time."""
ENDS = ("rate_below", "body_rate_below", "angle_below")
"""The tests that bound where a mode ends."""


def quantity_of(test: str) -> Tested | None:
    """The quantity that a test looks at; None for the time."""
    return None if test in TIMES else TESTED[test.rpartition("_")[0]]


def level_of(test: str) -> Gain:
    """The declaration of a test's level."""
    tested = quantity_of(test)
    if tested is None:
        return TIMES[test]
    above, text = 0.0 if tested.least is None else None, f"where {tested.text} is {test.rpartition('_')[2]} this"
    return Gain(tested.unit, above=above, at_least=tested.least, at_most=tested.most, text=text)


def settings_of(tests: Iterable[str]) -> tuple[str, ...]:
    """The further numbers of these tests."""
    needed = {key for test in tests if (tested := quantity_of(test)) for key in tested.settings}
    return tuple(key for key in SETTINGS if key in needed)


def watches(tests: Iterable[str]) -> bool:
    """Whether one of these tests looks beyond the law's measurement."""
    return any((tested := quantity_of(test)) is None or tested.watched for test in tests)


def needs_sky(tests: Iterable[str]) -> bool:
    """Whether one of these tests needs the Sun or the turn of the Earth."""
    return any((tested := quantity_of(test)) is not None and tested.sky for test in tests)


def sky_at(epoch: Date, ephemeris: int = 0) -> Sky:
    """The sky at the start; ephemeris: how the Sun moves, as parts are given it. ValueError for an epoch that is no date, or
    not from 1950 to 2050."""
    return Sky(sun.prepared(epoch, ephemeris), sidereal(days_of(epoch)))


def station_at(settings: Mapping[str, Any]) -> Station:
    """The station of a test's settings."""
    return Station(*geodetic(settings["latitude"], settings["longitude"], settings["height"]))


def advanced(watch: Watch, sight: Sight) -> Watch:
    """The watch as the next control step begins."""
    fix = watch.fix + 1.0
    new = [less(0.5, reading.attitude_is_new) for reading in sight.readings if hasattr(reading, "attitude_is_new")]
    for one in new:
        fix = where(one, 0.0, fix)
    return watch._replace(clock=watch.clock + 1.0, fix=fix)
