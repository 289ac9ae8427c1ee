"""Checks that random errors are as parts say: no larger, and new at each reading; and places no further off than is said."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from math import isfinite
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import multiply, normalise
from starhold.algebra.vector import ZERO, Vector, add, norm, scale, subtract, unit
from starhold.certification.measured import bounded
from starhold.conformance.bench import anywhere, loop_with
from starhold.conformance.directions import field_at, scattered, sky_at, turn_between
from starhold.conformance.verdicts import NotApplicableError, require
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import DEVIATIONS, Direction, Noise, Place
from starhold.parts.part import Fitted, Part
from starhold.parts.random import Dice, Silent
from starhold.parts.vectors import KINDS

Array = NDArray[np.float64]
FLIGHTS, BEFORE, READINGS, MORE = 40, 32, 8, 1.5
"""In so many flights, after so many readings, the errors of some more are summed: sums of what is new each time are rarely
more than this multiple of their deviation in the mean, while errors that stay add up to nearly three times that."""
PLACES, MOST, SLOW = 20, 3, 0.3
"""The number of states in which errors are compared, of those in which they are looked at more closely, and the share of
the usual rates (1 rad/s) at which bodies turn there."""


class Scatter(NamedTuple):
    """A reading's name, what its errors are sums of, (flights, 3), their covariance as it is said (3, 3), and what else
    they may contain."""

    name: str
    sums: Array
    said: Array
    besides: float = 0.0


def draws_as_it_says(part: Part) -> None:
    """Random errors are no larger than its `noise`, `direction` or `combined` says, and new each time; a place is within its
    `place`."""
    if not any(map(part.hook, ("noise", "direction", "place", "combined"))):
        raise NotApplicableError("it says nothing of random errors")
    for params in part.examples():
        loop = loop_with(part, params)
        fitted = next(f for f in loop.parts if f.part == part)
        for name, sums, said, besides in _scatters(fitted, loop):
            square = sums.T @ sums / len(sums)
            for way in np.linalg.eigh(square - MORE**2 * said)[1].T:
                size, most = (float(np.sqrt(way @ x @ way / READINGS)) for x in (square, said))
                require(
                    size <= MORE * most + besides + 1e-12,
                    f"random part of the {name} is {size:g} in the mean of {READINGS} readings, that said {most:g}",
                )
        if part.hook("place"):
            _places(fitted, loop)
        for size, most in scattered(fitted, loop) if part.hook("combined") else ():
            require(size <= MORE * most, f"random part of the attitude has a deviation of {size:g}, that said {most:g}")


def _scatters(fitted: Fitted, loop: ClosedLoop) -> Iterator[Scatter]:
    """Yield the random errors of a part with bounds: of a torque, of an attitude, a rate or a field, of a direction."""
    part, module, each = fitted.part, fitted.part.module, READINGS * np.eye(3)
    tell: Any = part.hook("noise")
    noise: Noise = Noise() if tell is None else tell(fitted.params, loop.period)
    if part.role == "environment":
        yield Scatter("torque", _torques(fitted, loop), noise.torque**2 * each)
        return
    errors = bounded(fitted, loop.period) if part.hook("error") else None
    if tell is not None and errors is not None:
        # A step of a walk is in all later readings.
        walk = (sum(k * k for k in range(READINGS)) / READINGS + BEFORE * READINGS) * noise.walk**2
        turns = np.array(noise.attitude)
        said = {"rate": (noise.rate**2 + walk) * each, "attitude": turns @ turns.T * READINGS}
        said["magnetic_field"] = noise.field**2 * each
        sizes = {"rate": (errors.rate - errors.bias, noise.rate), "attitude": (errors.attitude, turns.max())}
        sizes["magnetic_field"] = errors.field, noise.field
        for name in said.keys() & {*module.Reading._fields}:
            sums = _sums(fitted, loop, name, noise.every)
            steps = _steps(fitted, loop, name, *sizes[name])
            yield Scatter(f"error of the {name}", sums, said[name], steps)
            alike = said[name] - (walk * each if name == "rate" else 0.0)
            yield from (Scatter(f"error of the {name}", x, alike, steps) for x in _largest(fitted, loop, name))
    if part.hook("direction"):
        seen: Direction = module.direction(fitted.params, loop.period, sky_at(fitted.params, loop))
        if isfinite(seen.error):
            sums = _sums(fitted, loop, KINDS[seen.of][0], seen.every, as_direction=True)
            steps = _steps(fitted, loop, KINDS[seen.of][0], seen.error, seen.deviation, as_direction=True)
            for some in (sums, *_largest(fitted, loop, KINDS[seen.of][0], as_direction=True)):
                yield Scatter(f"error of the {seen.of}", some, seen.deviation**2 * each, steps)


def _steps(fitted: Fitted, loop: ClosedLoop, name: str, error: float, deviation: float, as_direction: bool = False) -> float:
    """Return what noise may add by the steps of a reading to the sum of its errors over the root of their number: where
    errors are not small, twice as much at each reading as it differs from one that follows the motion evenly over about the
    deviation of its noise."""
    if not 2.0 * deviation < error:
        return 0.0
    module, numbers, random = fitted.part.module, fitted.prepared(loop.period), np.random.default_rng(4)
    # A field turns with the body.
    size = norm(field_at(fitted.params, loop.start.position, 0.0)) if name == "magnetic_field" and not as_direction else 1.0
    most = 0.0

    def reading(state: Any, moved: Any) -> Any:
        moved = cast(Vector, tuple((3.0 / size * deviation * moved).tolist()))
        if name == "rate":
            state = state._replace(rate=add(state.rate, moved))
        else:
            state = state._replace(attitude=normalise(multiply(state.attitude, (1.0, *scale(0.5, moved)))))
        return module.measure(state, fitted.remembered(numbers, state), numbers, Silent(), 0)[0]

    for state, *_ in islice(anywhere(loop, random), READINGS):
        moves = random.normal(size=(4 * MOST, 3))
        first, *seen = (reading(state, moved) for moved in (np.zeros(3), *moves))
        if all(getattr(one, flag, 1.0) > 0.5 for one in (first, *seen) for flag in flags_of(name)):
            apart = np.array([_apart(name, getattr(first, name), getattr(one, name), as_direction) for one in seen])
            given = np.column_stack([moves, np.ones(len(moves))])
            off = apart - given @ np.linalg.lstsq(given, apart, rcond=None)[0]
            most = max(most, float(np.linalg.norm(off, axis=1).max()))
    return 2.0 * most * float(np.sqrt(READINGS))


def _sums(fitted: Fitted, loop: ClosedLoop, name: str, every: int, as_direction: bool = False) -> Array:
    """Return sums of the differences of readings with and without random numbers, of those that are new."""
    module, numbers, summed = fitted.part.module, fitted.prepared(loop.period), np.zeros((FLIGHTS, 3))

    def readings(drawn: Any) -> list[Any]:
        memory, seen = fitted.remembered(numbers, loop.start), list[Any]()
        for step in range((BEFORE + READINGS) * every):
            reading, memory = module.measure(loop.start, memory, numbers, drawn(step), step)
            seen.append(reading)
        return seen[BEFORE * every :: every]

    still, flags = readings(Silent), flags_of(name)
    for flight in range(FLIGHTS):
        for quiet, seen in zip(still, readings(lambda step, flight=flight: Dice((1, flight), step, 0)), strict=True):
            if all(getattr(one, flag, 1.0) > 0.5 for one in (seen, quiet) for flag in flags):
                summed[flight] += _apart(name, getattr(quiet, name), getattr(seen, name), as_direction)
    return summed


def _largest(fitted: Fitted, loop: ClosedLoop, name: str, as_direction: bool = False) -> Iterator[Array]:
    """Yield random errors of a first reading in the states, of some, in which they seem to be largest, as if summed."""
    module, numbers, random = fitted.part.module, fitted.prepared(loop.period), np.random.default_rng(8)
    states = [state._replace(rate=scale(SLOW, state.rate)) for state, *_ in islice(anywhere(loop, random), PLACES)]

    def drawn(place: int, first: int, count: int) -> Array:
        begun = fitted.remembered(numbers, states[place])
        quiet, *seen = (
            module.measure(states[place], begun, numbers, dice, 0)[0]
            for dice in (Silent(), *(Dice((1, first + k), 0, 0) for k in range(count)))
        )
        there = [one for one in seen if all(getattr(x, flag, 1.0) > 0.5 for x in (quiet, one) for flag in flags_of(name))]
        apart = [_apart(name, getattr(quiet, name), getattr(one, name), as_direction) for one in there]
        return np.reshape(np.array(apart), (-1, 3))

    sizes = [float(np.sum(drawn(place, 0, 2) ** 2)) for place in range(PLACES)]
    for place in sorted(range(PLACES), key=lambda place: -sizes[place])[:MOST]:
        if sizes[place]:
            yield float(np.sqrt(READINGS)) * drawn(place, 2, FLIGHTS)


def flags_of(name: str) -> tuple[str, ...]:
    """Return the names of readings that tell whether one of this name is there."""
    return f"{name}_is_new", f"{name}_is_seen"


def _apart(name: str, quiet: Any, seen: Any, as_direction: bool) -> Vector:
    """Return by how much a reading differs from another one, as a rotation (rad) if it is an attitude."""
    if name == "attitude":
        return turn_between(quiet, seen)
    return subtract(unit(seen), unit(quiet)) if as_direction else subtract(seen, quiet)


def _torques(fitted: Fitted, loop: ClosedLoop) -> Array:
    """Return sums of the random torques of an environment."""
    module, numbers, summed = fitted.part.module, fitted.prepared(loop.period), np.zeros((FLIGHTS, 3))
    for flight in range(FLIGHTS):
        memory = still = fitted.remembered(numbers)
        for step in range(BEFORE + READINGS):
            memory = module.update(memory, loop.start, numbers, Dice((1, flight), step, 0), step)
            still = module.update(still, loop.start, numbers, Silent(), step)
            given = (module.torque(loop.start, numbers, loop.craft, one) for one in (memory, still))
            summed[flight] += subtract(*given) if step >= BEFORE else ZERO
    return summed


def _places(fitted: Fitted, loop: ClosedLoop) -> None:
    """Check how far places are off as a craft moves on, with noise as large as it is assumed to be."""
    module, numbers, start = fitted.part.module, fitted.prepared(loop.period), loop.start
    said: Place = module.place(fitted.params, sky_at(fitted.params, loop))
    memory = still = fitted.remembered(numbers, start)
    squares, late = list[float](), 0.0
    for step in range(FLIGHTS * READINGS):
        state = start._replace(position=add(start.position, scale(step * loop.period, start.velocity)))
        reading, memory = module.measure(state, memory, numbers, Dice((1, 0), step, 0), step)
        quiet, still = module.measure(state, still, numbers, Silent(), step)
        late = max(late, norm(subtract(quiet.position, state.position)))
        squares.append(norm(subtract(reading.position, quiet.position)) ** 2 / 3.0)
    off = late + DEVIATIONS / MORE * float(np.sqrt(np.mean(squares)))
    require(off <= said.error * (1.0 + 1e-9) + 1e-6, f"the place is off by {off:g} m, and not {said.error:g} m")
