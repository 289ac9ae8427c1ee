"""The contract of every part of a closed loop, in any role.

A part is one file: `CARD` describes it, `ROLE` names its role in a loop, `class Params(NamedTuple)` declares its numbers
with units and bounds, and `examples()` returns some instances. `roles` lists the equations of each role, and further
declarations. All equations are pure functions of tuples of numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from starhold.algebra.vector import Matrix, Vector
from starhold.parts.craft import compact

CLOCK = "time"
"""The reading that every loop gives to a law that declares it: seconds since the start. No sensor is needed for it."""

IS_VALID = "is_valid"
"""Whether an estimate can be relied on, which all estimators state; a law that declares it as a reading gets that of its
estimate, and 1 without an estimator."""

GIVEN = (CLOCK, IS_VALID)
"""Readings that no sensor has to give."""


FIX = "fix"
"""The reading of an estimator that another one starts: the other's estimate, to be used once it is valid."""


class NoMemory(NamedTuple):
    """The memory of a part without one."""


class NoParams(NamedTuple):
    """The parameters of a part that takes none."""


class Errors(NamedTuple):
    """Bounds on the norms of a sensor's errors besides noise: of the attitude (rad), the rate (rad/s) and the magnetic
    field (T); `inf` for no bound. `bias`: the part of the rate's error that is constant in body axes (rad/s), the only
    error that a filter removes. Beside them errors may grow with the motion: `turning`, of the attitude with the body's
    rate (s); `turned`, of the rate with that (1); and `late`, of the rate with the body's acceleration (s). They are those
    of the last `ago` seconds, in the state of which before the start nothing changed, on a body that turns by no more
    than 2 rad in a control period. gaussian: how many Gaussian vectors they depend on at each reading, which are no longer
    than they are assumed to be."""

    attitude: float = 0.0
    rate: float = 0.0
    field: float = 0.0
    bias: float = 0.0
    turning: float = 0.0
    turned: float = 0.0
    late: float = 0.0
    ago: float = 0.0
    gaussian: int = 0

    @property
    def grow(self) -> bool:
        """Whether they grow with the motion."""
        return max(self.turning, self.turned, self.late) > 0.0


NO_ERRORS, UNBOUNDED = Errors(), Errors(math.inf, math.inf, math.inf)


DEVIATIONS = 8.0
"""The length, in standard deviations, that a Gaussian vector is assumed not to exceed where a part uses it in a bound."""


class Noise(NamedTuple):
    """The Gaussian errors of sensors, as multiples of independent standard normal vectors: of an attitude (3, 3; rad), new
    every `every` control periods; at each control step, of the rate (rad/s) and of the change of a gyro's bias until the
    next (rad/s); the standard deviation per axis of the magnetic field's error (T); and of the attitudes of further sensors
    (3, 3; rad), new at the same steps. For an environment, the standard deviation per axis of a torque (N m) that is new at
    each control step and held until the next."""

    attitude: Matrix = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    every: int = 1
    rate: float = 0.0
    walk: float = 0.0
    field: float = 0.0
    more: tuple[Matrix, ...] = ()
    torque: float = 0.0


class Sky(NamedTuple):
    """Bounds on an orbit's surroundings, from which sensors bound their errors of directions: the least strength of the
    magnetic field (T), how much the field's direction changes with the place (rad/m), the least distance from the Earth's
    centre (m), and the largest speed (m/s)."""

    weakest: float
    turning: float
    distance: float
    speed: float


class Direction(NamedTuple):
    """How far off a measured direction is. It is that of a + d + n: a the true one of unit length as the body had it `late`
    seconds ago, |d| at most `error`, `inf` for no bound, and n Gaussian, of the standard deviation `deviation` on each axis,
    independent at each reading, new every `every` control periods. of: "sun", "field" or "nadir"."""

    of: str
    error: float
    deviation: float = 0.0
    late: float = 0.0
    every: int = 1

    @property
    def most(self) -> float:
        """The largest |d + n|, where n is no longer than Gaussian vectors are assumed to be."""
        return self.error + DEVIATIONS * self.deviation

    def beside(self, sine: float) -> Direction:
        """Return how far it is from another direction a', at an angle from a of at most this sine, to which a/cos is a' and
        a vector across it of the length tan."""
        if not sine < 1.0:
            return self._replace(error=math.inf)
        cosine = math.sqrt(1.0 - sine * sine)
        return self._replace(error=(self.error + sine) / cosine, deviation=self.deviation / cosine)


class Place(NamedTuple):
    """How far off a measured position is at most (m), where the Gaussian vectors on which it depends, so many at a reading,
    are no longer than they are assumed to be."""

    error: float
    gaussian: int = 0


class Recursion(NamedTuple):
    """The linear recursion by which noise drives small errors of the estimate. At a control step an equation maps `errors`
    and the standard normal `noise` of rate, bias and each attitude, tuples of vectors, to the errors at the next step and
    the errors of attitude (rad) and rate (rad/s) that the law gets: `corrected` at every `every`-th step, at which
    attitudes are new, and `carried` at the others."""

    corrected: Callable[..., tuple[tuple[Vector, ...], Vector, Vector]]
    carried: Callable[..., tuple[tuple[Vector, ...], Vector, Vector]]
    every: int
    size: int
    """Number of vectors of errors."""
    noises: int = 3
    """Number of vectors of noise."""
    lag: float = 0.0
    """How much of the body's acceleration (s) is at most an error of the rate that counts until the next step."""
    strays: bool = False
    """Whether the first error, of the attitude, is propagated from step to step at the mean of the rates there."""
    biased: bool = False
    """Whether a constant bias of the gyro stays in the rate."""


class Envelope(NamedTuple):
    """Bounds on the motions of a loop, from which parts bound their effect: the least distance from the centre of
    attraction (m) and the largest speed (m/s) of the orbit, the angular momentum of body and wheels together (N m s), the
    body's largest moment of inertia (kg m2), and the error of the measured magnetic field (T)."""

    distance: float
    speed: float
    momentum: float
    moment: float
    field_error: float = 0.0


class Orbit(NamedTuple):
    """Bounds on an orbit, from which targets bound their motion: the least distance from the centre of attraction (m), the
    largest speed (m/s), the rate (rad/s) and the acceleration (rad/s2) of the orbital frame, the gravitational parameter
    (m3/s2), and the direction of the angular momentum at the start. Accelerations besides that of a point mass are at most
    `force` (m/s2), and they change the frame's rate and acceleration from those of two-body motion by at most `off_rate`
    (rad/s) and `off_acceleration` (rad/s2)."""

    nearest: float
    speed: float
    rate: float
    acceleration: float
    gravity: float
    normal: Vector
    force: float = 0.0
    off_rate: float = 0.0
    off_acceleration: float = 0.0


class Motion(NamedTuple):
    """Bounds on the motion of a target: its rate (rad/s) and acceleration (rad/s2), `inf` for no bound; the errors of those
    that it states (rad/s, rad/s2); the time since the start of the flight until which the bounds hold (s); and whether its
    attitude or rate jumps at some instants, between which they hold."""

    rate: float
    acceleration: float
    off_rate: float = 0.0
    off_acceleration: float = 0.0
    until: float = math.inf
    jumps: bool = False


AT_REST, UNLIMITED = Motion(0.0, 0.0), Motion(math.inf, math.inf)
"""The motion of a target at rest, and of one without bounds."""


class Push(NamedTuple):
    """A bound on the norm of a torque or of an error of the command, which may grow with the body's rate: `torque` (N m)
    plus `per_rate` (N m s) times the norm of the rate (rad/s); `inf` for no bound. As a bound on the rate of change of a
    torque, both are per second."""

    torque: float
    per_rate: float = 0.0


class Late(NamedTuple):
    """How what a part gives is late, in a loop of one control period. Let e be the command less what acts. In a period |e|
    does not grow, is no more than `mean` times its first value in the mean, and `kept` times that in the end; then it
    changes by as much as the command. All this while no component of e exceeds `most`. moment: of what is linear, so that e
    keeps its direction and these shares are exact, the mean in which it counts by the share of the period that is left.
    least: these three at least, which flights do not follow exactly."""

    kept: float
    mean: float
    most: float = math.inf
    moment: float | None = None
    least: tuple[float, ...] = ()


@dataclass(frozen=True)
class Card:
    """Title, sources and assumptions of a part."""

    title: str
    """A few words."""
    summary: str
    """One line: the part as a formula."""
    sources: tuple[str, ...]
    """The publications that describe it."""
    assumptions: tuple[str, ...]
    """The conditions under which it is valid, for readers and for claims that rely on it."""


@dataclass(frozen=True)
class Parameter:
    """Unit, bounds and shape of a parameter or of a law's gain, declared as an annotation."""

    unit: str = "1"
    """The unit of plain numbers: "N m s", "1/s^2"; "1" for none."""
    also: str = ""
    """A further unit allowed in strings, used by data sheets, in which the quantity has the same value: a standard
    deviation over one second in "rad/s" is that of white noise in "rad/sqrt(s)"."""
    above: float | None = None
    """Every number is greater."""
    at_least: float | None = None
    """No number is less."""
    at_most: float | None = None
    """No number is greater."""
    shape: tuple[int, ...] = ()
    """() a number, (3,) a vector, (3, 3) a matrix, for which a number means that multiple of the identity and a vector a
    diagonal. A part gets a diagonal matrix as the vector of its diagonal; `apply` and `solve` accept both forms."""
    whole: bool = False
    """An integer, which is a constant of the part while it is recorded: Python's `if` and `range` may use it."""
    choices: tuple[str, ...] = ()
    """The allowed words; the part gets the index of the chosen one, 0, 1, ..., also a constant."""
    text: str = ""
    """The meaning, for listings and pages."""
    spread: bool = True
    """Whether a single number means a vector of equal numbers."""
    plain: tuple[float, str] | None = None
    """The largest number that a file may give without a unit, well above any real value, and the unit in which a larger one
    was probably meant."""
    columns: tuple[str, ...] = ()
    """The names of a table's columns. The table is given as rows, or as the name of a CSV file."""
    dimension: Literal["", "length", "velocity", "acceleration", "time", "rate"] = ""
    """The physical dimension of a scaled number, which a file may also give as a string with a unit."""
    shared: str = ""
    """The key of a scenario, such as "orbit.epoch", that gives the number to all parts that declare it; scenarios without
    this key use keys of the parts' own tables."""

    @property
    def units(self) -> str:
        """The units in words."""
        return f"{self.unit} or {self.also}" if self.also else self.unit

    def check(self, value: Any) -> Any:
        """Return a value, validated and in the form that equations take. The ValueError says what is allowed."""
        if self.choices:
            if value not in self.choices:
                raise ValueError(f"must be one of {', '.join(self.choices)}")
            return self.choices.index(value)
        try:
            array = np.asarray(value, dtype=float)
        except (ValueError, TypeError):
            # Rows of different lengths, or entries that are not numbers.
            raise ValueError(f"must be {self.describe()}") from None
        if self.columns and (array.ndim != 2 or array.shape[1] != len(self.columns)):
            raise ValueError(f"must be {self.describe()}")
        if not np.isfinite(array).all():
            raise ValueError("must be finite")
        if self.columns:
            return tuple(tuple(row) for row in array.tolist())
        if len(self.shape) == 2 and array.ndim < 2:
            if array.ndim == 0:
                array = array * np.eye(self.shape[0])
            elif array.shape == self.shape[:1]:
                # No longer vector, whose square matrix would fill the memory.
                array = np.diag(array)
        elif array.ndim == 0 and self.shape and self.spread:
            array = np.full(self.shape, float(array))
        if array.shape != self.shape:
            raise ValueError(f"must be {self.describe()}")
        # The entries of a matrix are free: a part that needs bounds checks its eigenvalues.
        if self.shape != (3, 3):
            self._check_bounds(array)
        if self.whole:
            return int(array)
        if not self.shape:
            return float(array)
        return compact(array) if self.shape == (3, 3) else tuple(array.tolist())

    def _check_bounds(self, array: Any) -> None:
        if self.above is not None and not (array > self.above).all():
            raise ValueError(f"must be above {self._bound(self.above)}")
        if self.at_least is not None and not (array >= self.at_least).all():
            raise ValueError(f"must be at least {self._bound(self.at_least)}")
        if self.at_most is not None and not (array <= self.at_most).all():
            raise ValueError(f"must be at most {self._bound(self.at_most)}")
        if self.whole and float(array) != math.floor(float(array)):
            raise ValueError("must be a whole number")

    def _bound(self, bound: float) -> str:
        return f"{math.degrees(bound):.6g} deg" if bound and self.unit == "rad" else f"{bound:g}"

    def describe(self) -> str:
        """Return a description of the values allowed for this parameter."""
        if self.columns:
            return f"rows of {', '.join(self.columns)}, or the name of a CSV file of such columns"
        if not self.shape:
            return "a whole number" if self.whole else "a number"
        size = self.shape[0]
        if len(self.shape) == 2:
            return f"a number, {size} numbers or a {size}x{size} matrix"
        return f"{'a number or ' if self.spread else ''}{size} numbers"


@dataclass(frozen=True)
class Field:
    """A parameter of a part, a gain of a law or an input of a design form: its name, declaration and default."""

    name: str
    gain: Parameter
    required: bool
    default: Any = field(default=None)

    def written(self, value: Any) -> Any:
        """Return a value as written in a file: a choice by its word."""
        return self.gain.choices[int(value)] if self.gain.choices else value


@cache
def fields(cls: Any, but: str = "") -> list[Field]:
    """Return the declared parameters of a NamedTuple class (`Params`, `Gains`, a design form), in order; `but`: the name of
    a field to omit."""
    declared: list[Field] = []
    hints = get_type_hints(cls, include_extras=True)
    for name in cls._fields:
        if name == but:
            continue
        hint = hints[name]
        gain = next((a for a in get_args(hint)[1:] if isinstance(a, Parameter)), None)
        if get_origin(hint) is not Annotated or gain is None:
            raise TypeError(f"{cls.__module__}.{cls.__name__}.{name} declares no unit: annotate it with Parameter")
        defaults: dict[str, Any] = cls._field_defaults
        declared.append(Field(name, gain, name not in defaults, defaults.get(name)))
    return declared
