"""The wheels of a subject, and how far their momenta go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flint import fmpq

from starhold.checker.exact import (
    ZERO,
    Rows,
    definite,
    demand,
    greatest,
    identity,
    inverse,
    matmul,
    plus,
    rational,
    root_above,
    times,
    transpose,
)

CLOSE = fmpq(1, 10**9)
"""How far what a file says of the allocation may be from what its axes tell."""
FREE = fmpq(99, 100)
"""Up to this share of its momentum limit a motor has all of its torque."""


@dataclass(frozen=True)
class SubjectWheels:
    """Wheels, their numbers exact: unit axes, limits (None: no limit; a torque limit of 0: a lost wheel), moments of
    the rotors, the rows that share out a torque by least squares, momenta at the start, and what the momentum of the whole
    does not exceed."""

    axes: Rows
    torque_limit: list[Any | None]
    momentum_limit: list[Any | None]
    inertia: list[Any]
    least: Rows
    momentum: list[Any]
    allocation: str
    total: Any

    @property
    def working(self) -> list[int]:
        """The wheels that are not lost."""
        return [k for k, limit in enumerate(self.torque_limit) if limit != 0]

    @property
    def moments(self) -> Rows:
        """The inertia that the moments of the rotors about their axes add."""
        return matmul(
            transpose(self.axes), [[moment * x for x in row] for moment, row in zip(self.inertia, self.axes, strict=True)]
        )


def read_wheels(given: Mapping[str, Any]) -> SubjectWheels:
    """The wheels in a subject whose keys and types are in order; a CheckError where they say what cannot be."""
    columns = ("axes", "torque_limit", "momentum_limit", "inertia", "least", "momentum")
    demand(len(given["axes"]) >= 3, "there are fewer than three wheels")
    demand(len({len(given[name]) for name in columns}) == 1, "the wheels are not equally many everywhere")
    wheels = SubjectWheels(
        axes=[[rational(x) for x in row] for row in given["axes"]],
        torque_limit=[None if x is None else rational(x) for x in given["torque_limit"]],
        momentum_limit=[None if x is None else rational(x) for x in given["momentum_limit"]],
        inertia=[rational(x) for x in given["inertia"]],
        least=[[rational(x) for x in row] for row in given["least"]],
        momentum=[rational(x) for x in given["momentum"]],
        allocation=given["allocation"],
        total=rational(given["total_momentum"]),
    )
    demand(wheels.total >= 0, "the total momentum is negative")
    demand(all(limit is None or limit >= 0 for limit in wheels.torque_limit), "a torque limit is negative")
    demand(all(limit is None or limit > 0 for limit in wheels.momentum_limit), "a momentum limit is not positive")
    demand(all(moment > 0 for moment in wheels.inertia), "a rotor has no inertia")
    for axis in wheels.axes:
        length = sum((x * x for x in axis), ZERO)
        demand((1 - CLOSE / 1000) ** 2 <= length <= (1 + CLOSE / 1000) ** 2, "an axis is not of unit length")
    _check_shares(wheels)
    return wheels


def _check_shares(wheels: SubjectWheels) -> None:
    """That the rows give the torque that is asked for, and with the least sum of squares: -A'(A A')^-1."""
    working = wheels.working
    axes, rows = ([matrix[k] for k in working] for matrix in (wheels.axes, wheels.least))
    lost = [row for row, limit in zip(wheels.least, wheels.torque_limit, strict=True) if limit == 0]
    demand(not any(x for row in lost for x in row), "a lost wheel takes a share")
    demand(len(axes) >= 3, "fewer than three wheels work")
    given = matmul(transpose(axes), times(-1, rows))
    demand(_near(given, identity(3), CLOSE), "the shares do not add up to the torque")
    least = matmul(times(-1, axes), inverse(matmul(transpose(axes), axes)))
    largest = max(abs(x) for row in least for x in row)
    demand(_near(rows, least, CLOSE * largest), "the shares are not those of least squares")


def _near(a: Rows, b: Rows, distance: Any) -> bool:
    return all(abs(x) <= distance for row in plus(a, b, -1) for x in row)


def holds_target(wheels: SubjectWheels, J: Rows, target_rate: Any) -> None:
    """A CheckError where no craft with these wheels that is at rest on target has as little momentum as told: there it is
    J r + n, n that of the wheels at the start."""
    stored = matmul([wheels.momentum], wheels.axes)[0]
    most = root_above(sum((n * n for n in stored), ZERO)) + wheels.total
    demand(
        most >= -greatest(times(-1, J)) * target_rate, "nothing at rest on target has so little momentum: the claim is empty"
    )


def keeps_momenta(wheels: SubjectWheels, told: Sequence[Any], J: Rows, P: Rows, level: Any, target_rate: Any) -> None:
    """A CheckError unless no wheel's momentum exceeds what is told and its limit, while w.Pw <= 2 level and the momentum of
    the whole is at most as told.

    The momenta h are (h - G n) + G n, G = -least, of which the first part stays: h' = -G u, and n = sum a_i h_i has n' = -u.
    And |n| is at most the momentum of the whole and that of the body, |J w_abs| <= |J w| + |J| target_rate.
    """
    stored = matmul([wheels.momentum], wheels.axes)[0]
    fastest = ZERO if target_rate == 0 else greatest(J) * target_rate
    form = matmul(matmul(J, inverse(P)), J)
    working = set(wheels.working)
    for k, (row, momentum, most, limit) in enumerate(
        zip(wheels.least, wheels.momentum, told, wheels.momentum_limit, strict=True)
    ):
        if k not in working:
            demand(abs(momentum) <= most and (limit is None or most <= limit), f"lost wheel {k + 1} holds more")
            continue
        demand(limit is None or most <= FREE * limit, f"wheel {k + 1} may reach its momentum limit")
        kept = abs(momentum + sum((g * n for g, n in zip(row, stored, strict=True)), ZERO))
        share = root_above(sum((g * g for g in row), ZERO))
        # What is left for |Jw|, the square of which is at most 2 level times the greatest eigenvalue of J P^-1 J.
        room = (most - kept) / share - wheels.total - fastest
        held = room >= 0 and definite(plus(identity(3, room**2), form, -2 * level), strictly=False)
        demand(held, f"wheel {k + 1} may store more than told")
