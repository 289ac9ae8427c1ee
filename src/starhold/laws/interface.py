"""What a law sees, and what a law file declares.

A law file holds `CARD`, `class Gains(NamedTuple)`, the equation
`torque(measurement, gains, craft, memory) -> (torque, memory)` and `examples()`. It may add
`lyapunov(measurement, gains, craft)`, design forms (`FORMS` with `design(craft, spec)`, and `complete(spec, start)` for
inputs that the scenario gives), `check(gains)` that refuses what cannot be stable, and `remember(gains, craft, period)` for
a memory that is not empty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, get_args, get_origin, get_type_hints

import numpy as np

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import Quaternion
from starhold.algebra.vector import ZERO, Vector, add, apply, gyroscopic_torque, subtract
from starhold.parts.craft import Craft, compact


class Measurement(NamedTuple):
    """What a law is told at a control instant; vectors are in body axes."""

    attitude: Annotated[Quaternion, Quantity("1", "turn from the target axes to the body axes, scalar first")]
    rate: Annotated[Vector, Quantity("rad/s", "angular velocity relative to the target")]
    body_rate: Annotated[Vector, Quantity("rad/s", "absolute angular velocity")]
    target_rate: Annotated[Vector, Quantity("rad/s", "the target's angular velocity")]
    target_acceleration: Annotated[Vector, Quantity("rad/s^2", "derivative of target_rate as the turning body sees it")]
    external_torque: Annotated[Vector, Quantity("N m", "modelled torque from outside at this attitude")]
    position: Annotated[Vector, Quantity("m", "from the centre of attraction")]
    period: Annotated[float, Quantity("s", "for which the torque will be held")]
    wheel_momentum: Annotated[Vector, Quantity("N m s", "angular momentum of the body's wheels")] = ZERO


class NoMemory(NamedTuple):
    """The memory of a law that keeps nothing."""


@dataclass(frozen=True)
class Start:
    """What a scenario tells a design: turn from the target axes to the body axes, rate relative to the target (rad/s) and
    what wheels store (N m s, body axes; None for a craft without) at the start; the torque (N m) and, of wheels, the angular
    momentum (N m s) that there is about every axis, infinite for no limit; and the angle (rad) and rate (rad/s) at which the
    target counts as reached."""

    attitude: Quaternion
    rate: Vector
    wheel_momentum: Vector | None
    torque: float
    momentum: float
    attitude_tolerance: float
    rate_tolerance: float

    @property
    def angle(self) -> float:
        """The error angle (rad, 0..pi)."""
        return 2.0 * float(np.arctan2(np.linalg.norm(self.attitude[1:]), abs(self.attitude[0])))


Claim: TypeAlias = Literal["global", "almost-global", "local", "none"]


@dataclass(frozen=True)
class Card:
    """What a law is: title, sources, assumptions, the stability it claims, and what its readers must know."""

    title: str
    """A few words."""
    summary: str
    """One line: the control as a formula."""
    sources: tuple[str, ...]
    """Where it comes from."""
    assumptions: tuple[str, ...]
    """What its claim takes for granted; not empty where it claims something."""
    claims: Claim
    """The stability that is claimed: global, almost-global, local or none."""
    quaternion_sign: Literal["odd", "even"] = "odd"
    """odd: feeding back -q in place of q changes the torque; even: it does not."""
    rest_tolerance: float = 0.0
    """Largest torque (N m) at rest on target; zero but for laws that solve a problem to a tolerance."""


@dataclass(frozen=True)
class Gain:
    """Unit, bounds and shape of one gain, as an annotation."""

    unit: str = "1"
    """In which plain numbers count: "N m s", "1/s^2"; "1" for none."""
    above: float | None = None
    """Every number is greater."""
    at_least: float | None = None
    """No number is less."""
    at_most: float | None = None
    """No number is greater."""
    shape: tuple[int, ...] = ()
    """() a number, (3,) a vector, (3, 3) a matrix, for which a number stands for that multiple of the identity and a vector
    for a diagonal. A law gets a diagonal matrix as the vector of its diagonal; `apply` and `solve` take both forms."""
    whole: bool = False
    """A whole number, which is a constant of the law while it is recorded: Python's `if` and `range` may use it."""
    choices: tuple[str, ...] = ()
    """Words, of which the law gets the place of the one that is chosen: 0, 1, ...; a constant as well."""
    text: str = ""
    """What it means, for listings and pages."""
    spread: bool = True
    """Whether a number stands for a vector of equal numbers."""
    dimension: Literal["", "length", "velocity", "acceleration", "time", "rate"] = ""
    """What a scaled number is one of: a file may then give a string with a unit of it too."""

    def check(self, value: Any) -> Any:
        """The value as the law wants it; ValueError says what is allowed."""
        if self.choices:
            if value not in self.choices:
                raise ValueError(f"must be one of {', '.join(self.choices)}")
            return self.choices.index(value)
        array = np.asarray(value, dtype=float)
        if not np.isfinite(array).all():
            raise ValueError("must be finite")
        if len(self.shape) == 2 and array.ndim < 2:
            array = array * np.eye(self.shape[0]) if array.ndim == 0 else np.diag(array)
        elif array.ndim == 0 and self.shape and self.spread:
            array = np.full(self.shape, float(array))
        if array.shape != self.shape:
            raise ValueError(f"must be {self.describe()}")
        # Bounds of a matrix speak of its eigenvalues' sign only where the law says so; entries are free.
        if self.shape != (3, 3):
            self._check_bounds(array)
        if self.whole:
            return int(array)
        if not self.shape:
            return float(array)
        return compact(array) if self.shape == (3, 3) else tuple(array.tolist())

    def _check_bounds(self, array: Any) -> None:
        if self.above is not None and not (array > self.above).all():
            raise ValueError(f"must be above {self.above:g}")
        if self.at_least is not None and not (array >= self.at_least).all():
            raise ValueError(f"must be at least {self.at_least:g}")
        if self.at_most is not None and not (array <= self.at_most).all():
            raise ValueError(f"must be at most {self.at_most:g}")
        if self.whole and float(array) != math.floor(float(array)):
            raise ValueError("must be a whole number")

    def describe(self) -> str:
        """What may be written for this gain."""
        if not self.shape:
            return "a whole number" if self.whole else "a number"
        size = self.shape[0]
        if len(self.shape) == 2:
            return f"a number, {size} numbers or a {size}x{size} matrix"
        return f"{'a number or ' if self.spread else ''}{size} numbers"


@dataclass(frozen=True)
class Field:
    """One gain of a law or one input of a design form: its name, declaration and default."""

    name: str
    gain: Gain
    required: bool
    default: Any = field(default=None)


@cache
def fields(cls: Any) -> list[Field]:
    """The declared gains of a `Gains` class (or of a design form), in order."""
    found: list[Field] = []
    hints = get_type_hints(cls, include_extras=True)
    for name in cls._fields:
        hint = hints[name]
        gain = next((a for a in get_args(hint)[1:] if isinstance(a, Gain)), None)
        if get_origin(hint) is not Annotated or gain is None:
            raise TypeError(f"{cls.__module__}.{cls.__name__}.{name} declares no unit: annotate it with Gain")
        defaults: dict[str, Any] = cls._field_defaults
        found.append(Field(name, gain, name not in defaults, defaults.get(name)))
    return found


def tracking_torque(measurement: Measurement, craft: Craft) -> Vector:
    """The torque (N m) that makes the motion relative to a moving target obey the equations of a target at rest,
    J w_e' + w_e x J w_e = rest of the torque; zero for a target at rest."""
    gyroscopic = subtract(
        gyroscopic_torque(craft.inertia, measurement.body_rate), gyroscopic_torque(craft.inertia, measurement.rate)
    )
    return add(gyroscopic, apply(craft.inertia, measurement.target_acceleration))
