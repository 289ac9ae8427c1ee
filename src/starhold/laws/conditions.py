"""The tests in conditions of modes: the quantity that each tests, its level, and whether it holds.

Some tests need only the law's measurement. Others need what flight software keeps (its clock, the Sun's direction and the
Earth's rotation angle at the start) and what it sees: the estimated state, the readings, and the estimate."""

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
"""Control instants since an event that has not happened yet."""
LATITUDE = Gain("rad", at_least=-0.5 * math.pi, at_most=0.5 * math.pi, text="geodetic, of the station")
LONGITUDE = Gain("rad", at_least=-math.pi, at_most=math.tau, text="of the station, to the east")
HEIGHT = Gain("m", at_least=-500.0, at_most=9000.0, text="of the station above the ellipsoid")
AXIS = Gain("1", shape=(3,), spread=False, text="body axis from which the angle to the Sun is taken")
SETTINGS: Mapping[str, Field] = {
    "latitude": Field("latitude", LATITUDE, True),
    "longitude": Field("longitude", LONGITUDE, True),
    "height": Field("height", HEIGHT, False, 0.0),
    "axis": Field("axis", AXIS, True),
}
"""Further numbers of tests."""


class Sight(NamedTuple):
    """The inputs of flight software besides the law's measurement: the body's state from sensors and estimator, the
    readings of all sensors, and the estimate."""

    state: Any
    readings: tuple[Any, ...]
    estimate: Any


class Sky(NamedTuple):
    """The Sun, and the Earth's rotation in turns, at the start of a flight."""

    sun: sun.Numbers
    turn: Scalar


class Station(NamedTuple):
    """A station's position (m) and vertical in Earth-fixed axes."""

    place: Vector
    up: Vector


class Watch(NamedTuple):
    """The memory of flight software: the control instants since the start, the sky at the start (none if no test needs it),
    the stations of the tests in their order, and the control instants since the last new attitude of a star tracker."""

    clock: Scalar
    sky: Sky | tuple[()]
    stations: tuple[Station, ...]
    fix: Scalar


class Tested(NamedTuple):
    """A quantity that conditions test: its unit and description; its value, or an increasing function of it that is
    cheaper, with the same function of a level. settings: further numbers of the test; reads, estimates: the reading or
    estimate that it needs; sky: whether it needs the epoch and an orbit about the Earth."""

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
    """All that tests use at the start of a control step. Quantities are computed once, when first needed."""

    def __init__(self, measurement: Measurement, watch: Any = (), sight: Sight | None = None) -> None:
        self.measurement, self.watch, self._sight = measurement, watch, sight
        self._known: dict[Any, Any] = {}

    @property
    def sight(self) -> Sight:
        """The view of flight software; available only in the control step of a loop."""
        assert self._sight is not None
        return self._sight

    def once(self, name: Any, compute: Callable[[], Any]) -> Any:
        """Return a value, computed at the first call for `name`."""
        if name not in self._known:
            self._known[name] = compute()
        return self._known[name]

    @property
    def time(self) -> Scalar:
        """The time (s) since the start."""
        return self.once("time", lambda: self.watch.clock * self.measurement.period)

    @property
    def sun(self) -> sun.Sun:
        """The Sun at this time."""
        return self.once("sun", lambda: sun.sun(self.time, self.watch.sky.sun))

    def later(self, periods: Scalar, time: Scalar) -> Truth:
        """Return whether this many control periods reach a time (s), to the nearest control instant."""
        period = self.measurement.period
        return less_equal(time - 0.5 * period, periods * period)

    def holds(self, test: str, level: Scalar, settings: Mapping[str, Any]) -> Truth:
        """Return whether a test holds."""
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
    """Return the sine of half an angle (rad) of up to pi, by its series, with an error of at most 1e-16."""
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
    """Return the sine of the elevation at which a station sees the craft."""
    cosine, sine = now.once("turn", lambda: cosine_sine(turned(now.watch.sky.turn, now.time)))
    station: Station = settings["station"]
    ahead = subtract(now.sight.state.position, spun(station.place, cosine, sine))
    return dot(spun(station.up, cosine, sine), ahead) / norm(ahead)


def _away_from_sun(now: Facts, settings: Mapping[str, Any]) -> Scalar:
    """Return the cosine of the angle between a body axis and the direction away from the Sun."""
    axis = settings["axis"]
    return -dot(axis, to_body(now.sight.state.attitude, now.sun.direction)) / norm(axis)


TESTED: Mapping[str, Tested] = {
    "rate": Tested("rad/s", "the rate relative to the target", _rate, watched=False),
    "body_rate": Tested("rad/s", "the absolute rate", _body_rate, watched=False),
    "angle": Tested("rad", "the angle to the target", _angle, sine_of_half, most=3.141592653589793, watched=False),
    "wheel_momentum": Tested("N m s", "the norm of the wheels' momentum", _wheel_momentum, watched=False),
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
        "1", "the share of the Sun's disc that the Earth leaves in view", _sunlight, least=0.01, most=0.99, sky=True
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
        "s", "the time since the last new attitude of a star tracker", _tracker_age, reads="attitude_is_new"
    ),
    "attitude_deviation": Tested(
        "rad",
        "the norm of the standard deviations of the estimator's attitude",
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
"""Names of all tests: each measured quantity below or above a level, and the time."""
ENDS = ("rate_below", "body_rate_below", "angle_below")
"""The tests that bound the state in which a mode ends."""


def quantity_of(test: str) -> Tested | None:
    """Return the quantity of a test; None for the time."""
    return None if test in TIMES else TESTED[test.rpartition("_")[0]]


def level_of(test: str) -> Gain:
    """Return the declaration of a test's level."""
    tested = quantity_of(test)
    if tested is None:
        return TIMES[test]
    above, text = 0.0 if tested.least is None else None, f"where {tested.text} is {test.rpartition('_')[2]} this"
    return Gain(tested.unit, above=above, at_least=tested.least, at_most=tested.most, text=text)


def settings_of(tests: Iterable[str]) -> tuple[str, ...]:
    """Return the declarations of the further numbers of these tests."""
    needed = {key for test in tests if (tested := quantity_of(test)) for key in tested.settings}
    return tuple(key for key in SETTINGS if key in needed)


def watches(tests: Iterable[str]) -> bool:
    """Return whether one of these tests needs more than the law's measurement."""
    return any((tested := quantity_of(test)) is None or tested.watched for test in tests)


def needs_sky(tests: Iterable[str]) -> bool:
    """Return whether one of these tests needs the Sun or the Earth's rotation."""
    return any((tested := quantity_of(test)) is not None and tested.sky for test in tests)


def sky_at(epoch: Date, ephemeris: int = 0) -> Sky:
    """Return the sky at the start; ephemeris: the model of the Sun, as for parts. Raise ValueError for an epoch that is no
    date or lies outside 1950 to 2050."""
    return Sky(sun.prepared(epoch, ephemeris), sidereal(days_of(epoch)))


def station_at(settings: Mapping[str, Any]) -> Station:
    """Return the station in the settings of a test."""
    return Station(*geodetic(settings["latitude"], settings["longitude"], settings["height"]))


def advanced(watch: Watch, sight: Sight) -> Watch:
    """Return the watch at the start of the next control step."""
    fix = watch.fix + 1.0
    new = [less(0.5, reading.attitude_is_new) for reading in sight.readings if hasattr(reading, "attitude_is_new")]
    for one in new:
        fix = where(one, 0.0, fix)
    return watch._replace(clock=watch.clock + 1.0, fix=fix)
