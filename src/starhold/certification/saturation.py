"""The claim that no reaction wheel needs more torque than its motor gives, nor stores more momentum than it can."""

from __future__ import annotations

from typing import Any

import numpy as np
from flint import fmpq

from starhold.algebra.polynomial import Polynomial, exact, jointly
from starhold.certification.assumptions import FRICTIONLESS
from starhold.certification.certificate import BALLS, EXACT_SIGN, Claim, Obligation
from starhold.certification.convergence import Basin, assumed, reached
from starhold.certification.limits import (
    UNEQUAL,
    Bound,
    LimitedLoad,
    guesser,
    largest_level,
    level_of_turn,
    load_of,
    told_set,
    within,
)
from starhold.certification.matrices import greatest, inverse, least, matmul, number, root_above
from starhold.certification.subject import above, below
from starhold.parts.effectors.wheels import BAND, Wheels

TRIES = (1e-4, 1e-3)
"""Each wheel is bounded twice, so that more digits would take seconds."""
FREE = (FRICTIONLESS, "bounded-momentum")


def saturation(basin: Basin, turn: float | None = None) -> Claim | None:
    """The claim for the largest level, or for every turn from rest up to `turn` (rad); None without wheels or limits, and
    where the torque is limited before it is shared out."""
    loop = basin.motion.subject.loop
    wheels = loop.wheels
    if wheels is None or not np.isfinite((*wheels.torque_limit, *wheels.momentum_limit)).any():
        return None
    if loop.limit != "none" and np.isfinite(loop.craft.torque_limit):
        return None
    numbers: dict[str, Any] = {"momentum": number(basin.motion.subject.total_momentum)}

    def refused(reason: str) -> Claim:
        asked = {} if turn is None else {"slew_angle": turn}
        found = Obligation("torque", BALLS, "undecided", {"reason": reason})
        return Claim("wheels", numbers | asked, {}, assumed(basin.motion.subject, limits=FREE), (found,))

    J = basin.motion.subject.inertia
    stored = np.array(loop.rotors) @ np.array(wheels.axes)
    if numbers["momentum"] + float(np.linalg.norm(stored)) < number(least(J) * basin.motion.subject.target_rate):
        return refused("nothing at rest on target has so little momentum")
    if wheels.allocation:
        return refused("only for torque shared out by least squares")
    if basin.frame.s is None:
        return refused(UNEQUAL)
    pieces = jointly(basin.motion.torque)
    if len(pieces) > 1:
        return refused("the law clips its torque")
    carried = [_load(basin, pieces[0][1], wheels, i) for i in range(len(wheels.axes))]
    known = [load for load in carried if load is not None]
    cap = _cap(basin, wheels)
    if turn is None:
        level = largest_level(basin, known, cap, TRIES)
        if level is None:
            return refused("no level is small enough")
    else:
        level = level_of_turn(basin, turn)[1]
        beyond = [
            name for name, bound in (("convergence", basin.stay), ("momentum", cap)) if bound is not None and level > bound
        ]
        if beyond:
            return refused(f"the bound of {beyond[0]} does not reach that far")
        if not within(basin, known, level):
            return refused("the bound of a motor's torque exceeds its limit")
    numbers |= told_set(basin, level, turn)
    numbers |= {"motors": _needs(basin, carried, level), "wheel_momentum": _stored(basin, wheels, level)}
    before, witness = reached(basin, level, bounded=True)
    shown = (Obligation("torque", BALLS, "proved"), Obligation("momentum", EXACT_SIGN, "proved"))
    return Claim("wheels", numbers, witness, assumed(basin.motion.subject, limits=FREE), (*before, *shown))


def _load(basin: Basin, torque: list[Polynomial], wheels: Wheels, i: int) -> LimitedLoad | None:
    """The bound of a motor's torque; None for a lost wheel."""
    limit = wheels.torque_limit[i]
    if limit == 0.0:
        return None
    total: Any = Polynomial.constant(0)
    for c, component in zip(wheels.least[i], torque, strict=True):
        total = total + exact(c) * component
    return load_of(basin, [total], exact(min(limit, 1e300)))


def _needs(basin: Basin, carried: list[LimitedLoad | None], level: Any) -> list[float]:
    """The torque of each motor that is shown to be enough, near the least."""
    known = [load for load in carried if load is not None]
    guessed = iter(guesser(basin, known)(number(level)))
    last = min(level, basin.frame.potential.top)
    found: list[float] = []
    for load in carried:
        most = 0.0
        if load is not None:
            guess, bound = next(guessed), Bound(load, basin, level)
            tries = [min(exact(float(guess * (1.0 + more))), load.limit) for more in TRIES]
            most = number(next((limit for limit in tries if bound.below(limit, fmpq(0), last)), load.limit))
        found.append(most)
    return found


def _stored(basin: Basin, wheels: Wheels, level: Any) -> list[float]:
    """Bounds of each wheel's momentum on {V <= level}: the wheels share out momentum as they do torque."""
    return [above(offset + gain * _momentum(basin, level)) for offset, gain in _shares(basin, wheels)]


def _momentum(basin: Basin, level: Any) -> Any:
    """A bound of the momentum that the wheels store together."""
    energy, moment = _inertia(basin)
    subject = basin.motion.subject
    return subject.total_momentum + root_above(2 * level * energy) + moment * subject.target_rate


def _inertia(basin: Basin) -> tuple[Any, Any]:
    """The greatest |Jw|2 for w.Pw = 1, and the greatest moment."""
    J = basin.motion.subject.inertia
    return greatest(matmul(matmul(J, inverse(basin.frame.P)), J)), greatest(J)


def _shares(basin: Basin, wheels: Wheels) -> list[tuple[Any, Any]]:
    """For each wheel what it keeps of its momentum at the start whatever the motors do, and its part in a momentum of any
    direction."""
    begun = [exact(h) for h in basin.motion.subject.loop.rotors]
    axes = [[exact(x) for x in axis] for axis in wheels.axes]
    n = [sum((h * axis[k] for h, axis in zip(begun, axes, strict=True)), fmpq(0)) for k in range(3)]
    found: list[tuple[Any, Any]] = []
    for h, row in zip(begun, wheels.least, strict=True):
        gains = [exact(-x) for x in row]
        kept = h - sum((g * x for g, x in zip(gains, n, strict=True)), fmpq(0))
        found.append((abs(kept), root_above(sum((g * g for g in gains), fmpq(0)))))
    return found


def _cap(basin: Basin, wheels: Wheels) -> Any | None:
    """The level up to which no wheel is full; None where nothing fills them, zero where they may be full at once."""
    room: Any | None = None
    for (offset, gain), limit in zip(_shares(basin, wheels), wheels.momentum_limit, strict=True):
        if np.isfinite(limit) and gain != 0:
            own = (exact(limit) * (1 - exact(BAND)) - offset) / gain
            room = own if room is None else min(room, own)
    if room is None:
        return None
    energy, moment = _inertia(basin)
    subject = basin.motion.subject
    left = room - subject.total_momentum - moment * subject.target_rate
    # A little less, for the roots are rounded up.
    return exact(below(left * left / (2 * energy) * (1 - fmpq(1, 10**12)))) if left > 0 else fmpq(0)
