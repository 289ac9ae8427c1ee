"""Searches for the lowest gains with which a slew settles in time, by simulating slews to a target at rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np

from starhold.algebra.quaternion import Quaternion, renormalise, vector_part
from starhold.algebra.scalar import Scalar, either, less, maximum, where
from starhold.algebra.structure import floats, runge_kutta
from starhold.algebra.structured import repeat
from starhold.algebra.vector import ZERO, Vector, cross, dot, scale, subtract
from starhold.algebra.words import number_of
from starhold.parts.bodies.rigid_body import State, observe, rates
from starhold.parts.contract import NoMemory
from starhold.parts.craft import Craft
from starhold.parts.roles import Goal, Loads, Scene
from starhold.synthesis.start import Start
from starhold.trace.calling import Compiled

STEPS = 4000
"""Integration steps of a trial slew, and their largest multiple."""
MOST = 64
RESOLVED = 0.4
"""The largest step as a share of the fastest time constant."""
ON_TARGET = Goal((1.0, 0.0, 0.0, 0.0), ZERO, ZERO)
IN_HAND = 0.99
"""Share of the required settling time used by designs: with a held torque the loop settles slightly later."""


class Turn(NamedTuple):
    """A trial slew: the settling time (s; infinite if it did not settle), and the largest norms of the torque (N m) and of
    the wheel momentum (N m s; 0 without wheels)."""

    time: float
    torque: float
    momentum: float


@dataclass(frozen=True)
class Search:
    """A search for the least scale x (1/s) whose gains settle in time. gains_of(x) returns the gains, rate_of(gains) the
    fastest rate (1/s) of the loop, which the integration must resolve."""

    gains_of: Callable[[float], Any]
    rate_of: Callable[[Any], float]
    craft: Craft
    spec: Any

    @cached_property
    def form(self) -> Any:
        """The key, besides the gains, on which the kernels of its slews depend."""
        return self.spec.wheel_momentum is not None, _form(self.craft)

    @cached_property
    def begun(self) -> tuple[Quaternion, Vector, Vector]:
        """Initial attitude, rate (rad/s) and wheel momentum (N m s)."""
        size = math.hypot(*self.spec.attitude)
        q, w, h = (
            tuple(map(float, part or ZERO)) for part in (self.spec.attitude, self.spec.rate, self.spec.wheel_momentum)
        )
        return cast(Any, (tuple(part / size for part in q), w, h))

    @cached_property
    def ends(self) -> tuple[float, float]:
        """The squares of the quaternion's vector part and of the rate (rad/s) that count as on target."""
        half = math.sin(0.5 * min(self.spec.attitude_tolerance, math.pi))
        return half * half, float(self.spec.rate_tolerance) ** 2

    @cached_property
    def numbers(self) -> tuple[list[float], list[float]]:
        """The numbers of a slew between the gains and the step, and after that."""
        return floats((self.craft, self.begun)), [*self.ends]


Found = TypeVar("Found")
Trials: TypeAlias = Generator[tuple[float, float], Turn, Found]
"""A generator that requests slews, each of a scale x (1/s) over a horizon (s), and returns the result of its search."""


def settle(torque: Callable[..., Any], searches: Sequence[Search]) -> list[tuple[Any, Turn]]:
    """Return for each search the gains of the least scale, and their slew. The searches run side by side, so that the next
    slews of all fly together; the results are those of separate searches.

    Raise ValueError, with the shortest possible time, if the torque or the momentum does not allow the required one."""
    trials = [_least(search.spec) for search in searches]
    wanted = {place: next(trial) for place, trial in enumerate(trials)}
    settled = dict[int, tuple[Any, Turn]]()
    while wanted:
        answers = fly(torque, [(searches[place], *trial) for place, trial in wanted.items()])
        for place, answer in zip([*wanted], answers, strict=True):
            trial = trials[place]
            try:
                wanted[place] = trial.throw(answer) if isinstance(answer, ValueError) else trial.send(answer)
            except StopIteration as end:
                del wanted[place]
                x, slew = end.value
                settled[place] = searches[place].gains_of(x), slew
    return [settled[place] for place in range(len(searches))]


def _least(spec: Any) -> Trials[tuple[float, Turn]]:
    """Search for the least scale that settles in time; return it with its slew."""
    if any(getattr(spec, name, 0) is None for name in Start.__dataclass_fields__ if name != "wheel_momentum"):
        raise ValueError("a design that settles in time needs the start, the tolerances and the torque")
    if not any(spec.attitude):
        raise ValueError("attitude must be a quaternion that is not zero")
    required, horizon = IN_HAND * spec.time, 1.5 * spec.time

    def allowed(slew: Turn) -> bool:
        return slew.torque <= spec.torque and slew.momentum <= spec.momentum

    low, high = 0.0, 0.1 / spec.time
    slew = yield high, horizon
    while slew.time > required and allowed(slew) and high < 1e4 / spec.time:
        low, high = high, 1.2 * high
        slew = yield high, horizon
    if not allowed(slew):
        refused, high = slew, (yield from _border(allowed, low, high, horizon))
        slew = refused if high == 0.0 else (yield high, horizon)
        if high == 0.0 or slew.time > required:
            raise ValueError(_refusal(spec, (yield from _soonest(allowed, high)), refused))
    elif slew.time > required:
        raise ValueError(_refusal(spec, (yield from _soonest(allowed, high)), slew))
    # If the first trial settles in time, its gains are kept.
    while low > 0.0 and high - low > 1e-4 * high:
        middle = 0.5 * (low + high)
        tried = yield middle, horizon
        if tried.time <= required:
            high, slew = middle, tried
        else:
            low = middle
    return high, slew


def _border(allowed: Callable[[Turn], bool], low: float, high: float, horizon: float) -> Trials[float]:
    """Return the largest allowed scale, between an allowed one (or zero) and one that is not."""
    while low == 0.0 and high > 0.0 and not allowed((yield 0.5 * high, horizon)):
        high *= 0.5
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if allowed((yield middle, horizon)) else (low, middle)
    return low


def _soonest(allowed: Callable[[Turn], bool], most: float) -> Trials[float]:
    """Return approximately the shortest time in which a scale up to `most` settles."""
    best = math.inf
    for x in (most / 1.1**k for k in range(80) if most > 0.0):
        # Until it settles, or the horizon needs too many steps.
        with suppress(ValueError):
            for k in range(1, 6):
                slew = yield x, 4.0**k / x
                if slew.time < math.inf:
                    best = min(best, slew.time) if allowed(slew) else best
                    break
    return best


def _refusal(spec: Any, best: float, slew: Turn) -> str:
    what = f"{spec.torque:.4g} N m of torque"
    if slew.torque <= spec.torque and slew.momentum > spec.momentum:
        what = f"{spec.momentum:.4g} N m s that the wheels can store"
    if math.isinf(best):
        return f"it does not settle within {what} and these tolerances, whatever the time"
    return f"{spec.time:.4g} s to settle is too short: {what} allow about {best / IN_HAND:.3g} s"


def fly(torque: Callable[..., Any], trials: Sequence[tuple[Search, float, float]]) -> list[Turn | ValueError]:
    """Simulate slews, each of a search, at a scale (1/s), over a horizon (s), under continuous control; those of the same
    form together. Return each slew, or a ValueError with the reason if there is none, such as a loop that is too fast for
    the integration."""
    answers: list[Turn | ValueError] = [ValueError()] * len(trials)
    alike = dict[Any, list[tuple[int, Search, Any, float]]]()
    for place, (search, x, horizon) in enumerate(trials):
        try:
            gains = search.gains_of(x)
            count = _steps(search.rate_of(gains), search.spec, horizon)
        except ValueError as error:
            answers[place] = error
        else:
            alike.setdefault((count, _form(gains), search.form), []).append((place, search, gains, horizon / count))
    for (count, _, (wheels, _)), slews in alike.items():
        _, search, gains, step = slews[0]
        flight = _flight(torque, count, wheels, _Like((gains, search.craft)))
        if len(slews) == 1:
            flown = [flight(gains, search.craft, search.begun, step, search.ends)]
        else:
            rows = [[*floats(k), *one.numbers[0], step, *one.numbers[1]] for _, one, k, step in slews]
            flown = flight.over(np.array(rows).T).T.tolist()
        for (place, _, _, step), (last, most, momentum) in zip(slews, flown, strict=True):
            time = math.inf if not last < count else (last + 1.0) * step
            answers[place] = Turn(time, math.sqrt(most), math.sqrt(momentum))
    return answers


def _steps(rate: float, spec: Any, horizon: float) -> int:
    """Return the steps of a slew whose loop has this fastest rate (1/s). Raise ValueError if it is too fast."""
    least = max(rate, math.hypot(*spec.rate)) * horizon / (STEPS * RESOLVED)
    many = next((m for m in (1, 4, 16, MOST) if m >= least), None)
    if many is None:
        raise ValueError("the loop is too fast beside the time it is to settle in")
    return STEPS * many


class _Like:
    """Arguments of a kernel, equal to others of the same form."""

    def __init__(self, values: Any) -> None:
        self.values, self.form = values, _form(values)

    def __hash__(self) -> int:
        return hash(self.form)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Like) and self.form == other.form


def _form(value: Any) -> Any:
    if isinstance(value, tuple):
        return (type(value), *(_form(part) for part in value))  # pyright: ignore
    return "number" if isinstance(value, float) else value


@cache
def _flight(torque: Callable[..., Any], count: int, wheels: bool, like: _Like) -> Compiled:
    """Return the compiled slew, a function of gains, craft, start, step and squared tolerances. It returns the last step at
    which angle or rate was outside (-1: none), and the largest squares of torque and of wheel momentum."""

    def command(moving: Any, gains: Any, craft: Craft, step: Scalar) -> Vector:
        attitude, rate, stored = moving
        scene = Scene(ON_TARGET, True, ZERO, stored, step, math.inf, ())
        return torque(observe(State(attitude, rate, ZERO, ZERO, ZERO), scene), gains, craft, NoMemory())[0]

    def motion(moving: Any, gains: Any, craft: Craft, step: Scalar) -> Any:
        given, (attitude, rate, stored) = command(moving, gains, craft, step), moving
        reaction = subtract(given, cross(rate, stored)) if wheels else None
        loads = Loads(None, None, reaction, None, not wheels)
        turning, spin, *_ = rates(State(attitude, rate, ZERO, ZERO, given), loads, None, craft)
        return turning, spin, scale(-1.0, given) if wheels else ZERO

    advance = runge_kutta(motion)

    def whole(gains: Any, craft: Craft, begun: Any, step: Scalar, ends: Any) -> Any:
        def turn(k: Any, state: Any, last: Scalar, most: Scalar, momentum: Scalar) -> Any:
            given, (q, w, stored) = command(state, gains, craft, step), state
            # Written so that a NaN does not count as within.
            inside = either(less(ends[0], dot(vector_part(q), vector_part(q))), less(ends[1], dot(w, w)))
            after = advance(state, step, gains, craft, step)
            notes = (
                where(inside, number_of(k), last),
                maximum(most, dot(given, given)),
                maximum(momentum, dot(stored, stored)),
            )
            return (renormalise(after[0]), *after[1:]), *notes

        state, last, most, momentum = repeat(count, turn, begun, -1.0, 0.0, 0.0)
        # Diverged, or still outside at the end.
        q, w, _ = state
        there = less(dot(vector_part(q), vector_part(q)), ends[0])
        there = where(there, where(less(dot(w, w), ends[1]), last, float(count)), float(count))
        return there, most, momentum

    return Compiled(whole, *like.values, ((1.0, 0.0, 0.0, 0.0), ZERO, ZERO), 1.0, (1.0, 1.0))
