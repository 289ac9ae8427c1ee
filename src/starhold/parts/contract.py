"""The contract that every part of a closed loop keeps, whatever its role.

A part is one file: `CARD` describes it, `ROLE` names its role in a loop, `class Params(NamedTuple)` declares its
numbers with units and bounds, and `examples()` gives some of them. The equations of each role, and further
declarations, stand in `roles`. All of them are pure functions of tuples of numbers.
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
"""Whether an estimate can be relied on, which all estimators tell; a law that declares it as a reading gets that of its
estimate, and 1 where there is no estimator."""

GIVEN = (CLOCK, IS_VALID)
"""Readings that no sensor has to give."""


FIX = "fix"
"""The reading that an estimator gets which another one starts: the other's estimate, to be used once it is valid."""


class NoMemory(NamedTuple):
    """The memory of a part that keeps nothing."""


class NoParams(NamedTuple):
    """The parameters of a part that takes none."""


class Errors(NamedTuple):
    """The largest errors that a sensor makes besides its noise: of the attitude (rad), of the rate (rad/s) and of the
    magnetic field (T) that it gives, in norm; `inf` for one without a bound. `bias`: the part of that of the rate that stays
    as it is in body axes (rad/s), which a filter takes out; it takes out no other error."""

    attitude: float = 0.0
    rate: float = 0.0
    field: float = 0.0
    bias: float = 0.0


NO_ERRORS, UNBOUNDED = Errors(), Errors(math.inf, math.inf, math.inf)


DEVIATIONS = 8.0
"""How many deviations a Gaussian vector is taken to be long at most where a part bounds by it what it does."""


class Noise(NamedTuple):
    """The Gaussian errors of sensors, as multiples of independent standard normal vectors: of an attitude (3, 3; rad), which
    is new after each `every` control periods, and at each control step of the rate (rad/s) and of the change of a gyro's
    bias until the next (rad/s); the deviation about each axis of that of the magnetic field (T); of the attitudes of further
    sensors (3, 3; rad), new at the same steps. Of an environment the deviation about each axis of a torque (N m) that is new
    at each control step and held until the next."""

    attitude: Matrix = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    every: int = 1
    rate: float = 0.0
    walk: float = 0.0
    field: float = 0.0
    more: tuple[Matrix, ...] = ()
    torque: float = 0.0


class Recursion(NamedTuple):
    """How noise drives small errors of what a law is told, linearly. At a control step an equation takes `errors` and the
    standard normal `noise` of rate, bias and each attitude, tuples of vectors, to the errors that are kept for the next step
    and to those of attitude (rad) and rate (rad/s) that the law is told: `corrected` at every `every`-th step, at which
    attitudes are new, and `carried` at the others."""

    corrected: Callable[..., tuple[tuple[Vector, ...], Vector, Vector]]
    carried: Callable[..., tuple[tuple[Vector, ...], Vector, Vector]]
    every: int
    size: int
    """How many vectors of errors are kept."""
    noises: int = 3
    """How many vectors of noise there are."""


class Envelope(NamedTuple):
    """Bounds the motions of a loop, for parts that bound what they do: the least distance from the centre of
    attraction (m) and the largest speed (m/s) of the orbit, the angular momentum of body and wheels together (N m s), the
    body's largest moment of inertia (kg m2), and the error of the magnetic field that is measured (T)."""

    distance: float
    speed: float
    momentum: float
    moment: float
    field_error: float = 0.0


class Orbit(NamedTuple):
    """Bounds of an orbit, for targets that bound by it how they move: the least distance from the centre of attraction (m),
    the largest speed (m/s), the rate (rad/s) and the acceleration (rad/s2) of the orbital frame, the gravitational parameter
    (m3/s2), and the direction of the angular momentum at the start. Forces beside that of a point mass move the craft by no
    more than `force` (m/s2), and the frame otherwise than in two-body motion by no more than `off_rate` (rad/s) and
    `off_acceleration` (rad/s2)."""

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
    """Bounds of how a target moves: its rate (rad/s) and acceleration (rad/s2), `inf` for one without; how far those that it
    gives may be off (rad/s, rad/s2); until when, since the start of the flight, all this holds (s); and whether its attitude
    or its rate jumps at some instants, between which it holds."""

    rate: float
    acceleration: float
    off_rate: float = 0.0
    off_acceleration: float = 0.0
    until: float = math.inf
    jumps: bool = False


AT_REST, UNLIMITED = Motion(0.0, 0.0), Motion(math.inf, math.inf)
"""The motion of a target that rests, and of one without bounds."""


class Push(NamedTuple):
    """A bound of the norm of a torque or of an error of the command, which may grow with the body's rate: `torque` (N m),
    and `per_rate` (N m s) times the norm of the rate (rad/s); `inf` for one without a bound. Of how fast a torque changes
    both are so much per second."""

    torque: float
    per_rate: float = 0.0


class Late(NamedTuple):
    """How what a part gives is late, in a loop of one control period. Let e be the command less what acts. In a period |e|
    does not grow, is no more than `mean` times its first value in the mean, and `kept` times that in the end; then it
    changes by as much as the command. All this while no component of e exceeds `most`. alike: e keeps its direction, and
    falls exactly so."""

    kept: float
    mean: float
    most: float = math.inf
    alike: bool = False


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
    """Unit, bounds and shape of one parameter, or of a law's gain, declared as an annotation."""

    unit: str = "1"
    """The unit of plain numbers: "N m s", "1/s^2"; "1" for none."""
    also: str = ""
    """A further unit that strings may have, as data sheets give it, in which the quantity is the same number: a deviation
    over a second in "rad/s" is that of white noise in "rad/sqrt(s)"."""
    above: float | None = None
    """Every number is greater."""
    at_least: float | None = None
    """No number is less."""
    at_most: float | None = None
    """No number is greater."""
    shape: tuple[int, ...] = ()
    """() a number, (3,) a vector, (3, 3) a matrix, for which a number stands for that multiple of the identity and a vector
    for a diagonal. A part gets a diagonal matrix as the vector of its diagonal; `apply` and `solve` take both forms."""
    whole: bool = False
    """A whole number, which is a constant of the part while it is recorded: Python's `if` and `range` may use it."""
    choices: tuple[str, ...] = ()
    """Words to choose from; the part gets the place of the chosen one: 0, 1, ...; a constant as well."""
    text: str = ""
    """The meaning, for listings and pages."""
    spread: bool = True
    """Whether a number stands for a vector of equal numbers."""
    plain: tuple[float, str] | None = None
    """The largest number that a file may hold without its unit, well above any of its kind, and the unit that a larger one
    may be meant in."""
    columns: tuple[str, ...] = ()
    """The names of a table's columns. The table is given as rows, or as the name of a CSV file of them."""
    dimension: Literal["", "length", "velocity", "acceleration", "time", "rate"] = ""
    """The physical dimension of a scaled number, which a file may also give as a string with a unit."""
    shared: str = ""
    """The key of a scenario, "orbit.epoch", that gives the number to all parts that declare it, in place of keys of
    their own tables, which scenarios without such a key use."""

    @property
    def units(self) -> str:
        """The units in words."""
        return f"{self.unit} or {self.also}" if self.also else self.unit

    def check(self, value: Any) -> Any:
        """Validate a value and convert it to the form that equations take; the ValueError says what is allowed."""
        if self.choices:
            if value not in self.choices:
                raise ValueError(f"must be one of {', '.join(self.choices)}")
            return self.choices.index(value)
        try:
            array = np.asarray(value, dtype=float)
        except (ValueError, TypeError):
            # Rows of different lengths, or entries that are no numbers.
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
                # No longer one, whose square would fill the memory.
                array = np.diag(array)
        elif array.ndim == 0 and self.shape and self.spread:
            array = np.full(self.shape, float(array))
        if array.shape != self.shape:
            raise ValueError(f"must be {self.describe()}")
        # Bounds of a matrix speak of its eigenvalues' sign only where the part says so; entries are free.
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
        """Describe the values that may be written for this parameter."""
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
        """Return a value as a file has it: a choice by its word."""
        return self.gain.choices[int(value)] if self.gain.choices else value


@cache
def fields(cls: Any, but: str = "") -> list[Field]:
    """Read the declared parameters of a NamedTuple class (`Params`, `Gains`, a design form), in order; `but`: the name of a
    field that is left out."""
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
