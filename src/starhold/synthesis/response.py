"""Gains of feedback on rate and quaternion from requirements: bandwidth and damping, or a settling time.

The linear loop J a'' + k_rate a' + k_attitude a/2 = 0 (a an angle, q = a/2) has about a principal axis of moment J_i the
natural frequency sqrt(k_attitude/(2 J_i)) and the damping ratio k_rate/sqrt(2 J_i k_attitude): with one number for all axes
both are least about the axis of the largest moment.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import cache, lru_cache, partial
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np

from starhold.algebra.quaternion import Quaternion, renormalise, vector_part
from starhold.algebra.scalar import Scalar, either, less, maximum, where
from starhold.algebra.structure import runge_kutta
from starhold.algebra.structured import repeat
from starhold.algebra.vector import ZERO, Vector, cross, dot, scale, subtract
from starhold.algebra.words import number_of
from starhold.parts.bodies.rigid_body import State, observe, rates
from starhold.parts.contract import NoMemory
from starhold.parts.contract import Parameter as Gain
from starhold.parts.craft import Craft, tensor
from starhold.parts.roles import Goal, Loads, Scene
from starhold.synthesis.start import Start
from starhold.trace.calling import Compiled

STEPS = 4000
"""The integration steps of a trial slew, and the largest multiple of them."""
MOST = 64
RESOLVED = 0.4
"""The largest step as a share of the fastest time constant."""
ON_TARGET = Goal((1.0, 0.0, 0.0, 0.0), ZERO, ZERO)
IN_HAND = 0.99
"""Share of the required settling time that designs use: with a held torque the loop settles a little later."""

TORQUE = Gain("N m", above=0.0, text="largest norm; all that is available if absent")
MOMENTUM = Gain("N m s", above=0.0, text="of the wheels; all available if absent")
TURN = Gain(
    "1", shape=(4,), spread=False, text="rotation from the target to the body at the start; the scenario's if absent"
)
RATE = Gain("rad/s", shape=(3,), spread=False, text="relative rate then; the scenario's if absent")
STORED = Gain("N m s", shape=(3,), spread=False, text="in wheels then, body axes; the scenario's if absent")
ANGLE_LEFT, RATE_LEFT = (Gain(unit, above=0.0, text="that of [settling] if absent") for unit in ("rad", "rad/s"))
"""The inputs common to all forms with a settling time."""


class Bandwidth(NamedTuple):
    """The form takes the natural frequency and damping of the linear loop: exact about the axis of the largest moment of
    inertia, more about the others."""

    bandwidth: Annotated[
        float, Gain("rad/s", above=0.0, plain=(1e3, "deg/s"), text="natural frequency, the least of all axes")
    ]
    damping: Annotated[float, Gain("1", above=0.0, text="damping ratio, the least of all axes")] = 0.7


class Settling(NamedTuple):
    """The form takes the lowest gains that settle in time within the available torque, by integrating the slew to a
    target at rest without external torque."""

    time: Annotated[float, Gain("s", above=0.0, text="after which angle and rate stay within their tolerances")]
    damping: Annotated[float, Gain("1", above=0.0, text="damping ratio, the least of all axes")] = 0.7
    torque: Annotated[float | None, TORQUE] = None
    momentum: Annotated[float | None, MOMENTUM] = None
    attitude: Annotated[Quaternion | None, TURN] = None
    rate: Annotated[Vector | None, RATE] = None
    wheel_momentum: Annotated[Any, STORED] = None
    attitude_tolerance: Annotated[float | None, ANGLE_LEFT] = None
    rate_tolerance: Annotated[float | None, RATE_LEFT] = None


FORMS: dict[str, Any] = {"bandwidth": Bandwidth, "settling": Settling}
Spec = TypeVar("Spec", bound=NamedTuple)


def complete(spec: Spec, start: Callable[[], Start]) -> Spec:
    """Return the inputs of a form; one for a settling time is completed from the scenario's start."""
    left = [name for name in Start.__dataclass_fields__ if getattr(spec, name, 0) is None]
    return spec._replace(**{name: getattr(start(), name) for name in left}) if left else spec


class Turn(NamedTuple):
    """A trial slew has the time at which it settled (s; infinite where it did not), and the largest norms of the torque
    (N m) and of the wheel momentum (N m s; 0 without wheels)."""

    time: float
    torque: float
    momentum: float


def largest_moment(craft: Craft) -> float:
    """Return the largest principal moment of inertia (kg m2)."""
    return float(np.linalg.eigvalsh(tensor(craft.inertia))[-1])


def feedback(craft: Craft, bandwidth: float, damping: float) -> tuple[float, float]:
    """Return k_rate (N m s) and k_attitude (N m); ValueError where they are not finite and positive."""
    moment = largest_moment(craft)
    gains = 2.0 * damping * bandwidth * moment, 2.0 * bandwidth * bandwidth * moment
    if not all(math.isfinite(gain) and gain > 0.0 for gain in gains):
        raise ValueError("the gains leave the range of numbers")
    return gains


def fastest(craft: Craft, share: float, gains: Any) -> float:
    """Return a bound on the fastest rate (1/s) of the linear loop with k_rate and this share of k_attitude against q."""
    least = float(np.linalg.eigvalsh(tensor(craft.inertia))[0])
    return max(gains.k_rate / least, math.sqrt(0.5 * share * gains.k_attitude / least))


def settle(
    torque: Callable[..., Any], gains_of: Callable[[float], Any], rate_of: Callable[[Any], float], craft: Craft, spec: Any
) -> tuple[Any, Turn]:
    """Return the gains of the least scale x (1/s) that settle in time, and their slew.

    gains_of(x): the gains; rate_of(gains): the fastest rate (1/s) of the loop, which the integration must resolve.
    ValueError states the shortest time where the torque or the momentum does not allow the required one."""
    if any(getattr(spec, name, 0) is None for name in Start.__dataclass_fields__ if name != "wheel_momentum"):
        raise ValueError("a design that settles in time needs the start, the tolerances and the torque")
    if not any(spec.attitude):
        raise ValueError("attitude must be a quaternion that is not zero")
    required = IN_HAND * spec.time

    def turn(x: float, horizon: float = 1.5 * spec.time) -> Turn:
        return fly(torque, gains_of(x), craft, spec, horizon, rate_of(gains_of(x)))

    def allowed(slew: Turn) -> bool:
        return slew.torque <= spec.torque and slew.momentum <= spec.momentum

    low, high = 0.0, 0.1 / spec.time
    slew = turn(high)
    while slew.time > required and allowed(slew) and high < 1e4 / spec.time:
        low, high = high, 1.2 * high
        slew = turn(high)
    if not allowed(slew):
        high = _border(turn, allowed, low, high)
        if high == 0.0 or turn(high).time > required:
            raise ValueError(_refusal(spec, _soonest(turn, allowed, high), slew))
    elif slew.time > required:
        raise ValueError(_refusal(spec, _soonest(turn, allowed, high), slew))
    # A turn that is over before it begins leaves the gains as they were tried.
    while low > 0.0 and high - low > 1e-4 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if turn(middle).time <= required else (middle, high)
    return gains_of(high), turn(high)


def _border(turn: Callable[..., Turn], allowed: Callable[[Turn], bool], low: float, high: float) -> float:
    """Return the largest scale that is allowed, between one that is (or zero) and one that is not."""
    while low == 0.0 and high > 0.0 and not allowed(turn(0.5 * high)):
        high *= 0.5
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if allowed(turn(middle)) else (low, middle)
    return low


def _soonest(turn: Callable[..., Turn], allowed: Callable[[Turn], bool], most: float) -> float:
    """Return about the shortest time in which any scale up to `most` settles."""
    best = math.inf
    for x in (most / 1.1**k for k in range(80) if most > 0.0):
        settled = None
        # Until it settles, or the horizon is too long for the steps that the loop needs.
        with suppress(ValueError):
            turns = (turn(x, 4.0**k / x) for k in range(1, 6))
            settled = next((slew for slew in turns if slew.time < math.inf), None)
        if settled is not None and allowed(settled):
            best = min(best, settled.time)
    return best


def _refusal(spec: Any, best: float, slew: Turn) -> str:
    what = f"{spec.torque:.4g} N m of torque"
    if slew.torque <= spec.torque and slew.momentum > spec.momentum:
        what = f"{spec.momentum:.4g} N m s that the wheels can store"
    if math.isinf(best):
        return f"it does not settle within {what} and these tolerances, whatever the time"
    return f"{spec.time:.4g} s to settle is too short: {what} allow about {best / IN_HAND:.3g} s"


def fly(torque: Callable[..., Any], gains: Any, craft: Craft, spec: Any, horizon: float, rate: float) -> Turn:
    """Fly the slew of a body under a law, which acts on it without pause, from the start of a form over a horizon (s).
    `rate`: the fastest (1/s) of the loop. ValueError where that is too fast to be followed."""
    speed = math.hypot(*spec.rate)
    least = max(rate, speed) * horizon / (STEPS * RESOLVED)
    many = next((m for m in (1, 4, 16, MOST) if m >= least), None)
    if many is None:
        raise ValueError("the loop is too fast beside the time it is to settle in")
    count = STEPS * many
    half = math.sin(0.5 * min(spec.attitude_tolerance, math.pi))
    ends = (half * half, spec.rate_tolerance**2)
    size = math.hypot(*spec.attitude)
    step, begun = horizon / count, (tuple(q / size for q in spec.attitude), tuple(map(float, spec.rate)))
    wheels = spec.wheel_momentum is not None
    stored = tuple(map(float, spec.wheel_momentum)) if wheels else ZERO
    flown = _flight(torque, count, wheels, _Like((gains, craft)))
    last, most, momentum = flown(gains, craft, (*begun, stored), step, ends)
    time = math.inf if not last < count else (last + 1.0) * step
    return Turn(time, math.sqrt(most), math.sqrt(momentum))


class _Like:
    """Arguments of a kernel are equal to others of the same form."""

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
    """Compile the slew: gains, craft, start, step and squared ends give the last step at which angle or rate was outside
    (-1: at none), and the largest squares of torque and of the wheel momentum."""

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


def designs(
    make: Callable[[float, float], Any], torque: Callable[..., Any], share: float = 1.0
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return `design` and `explain` of a law with these two forms. `make` gives its gains of k_rate (N m s) and k_attitude
    (N m), of which the law acts with this share against q near rest."""

    def gains_at(craft: Craft, bandwidth: float, damping: float) -> Any:
        k_rate, stiffness = feedback(craft, bandwidth, damping)
        return make(k_rate, stiffness / share)

    @lru_cache(maxsize=64)
    def settled(craft: Craft, spec: Settling) -> tuple[Any, Turn]:
        def gains_of(x: float) -> Any:
            return gains_at(craft, x, spec.damping)

        return settle(torque, gains_of, partial(fastest, craft, share), craft, spec)

    def design(craft: Craft, spec: Bandwidth | Settling) -> Any:
        if isinstance(spec, Bandwidth):
            return gains_at(craft, spec.bandwidth, spec.damping)
        return settled(craft, spec)[0]

    def explain(craft: Craft, spec: Bandwidth | Settling) -> list[tuple[str, Any]]:
        gains = design(craft, spec)
        turned = slew_figures(settled(craft, spec)[1]) if isinstance(spec, Settling) else []
        return turned + explained(craft, gains.k_rate, share * gains.k_attitude)

    return design, explain


def explained(craft: Craft, k_rate: float, k_attitude: float) -> list[tuple[str, Any]]:
    """Return natural frequency and damping about each principal axis, and the linear loop's eigenvalues."""
    moments = np.linalg.eigvalsh(tensor(craft.inertia))
    roots = np.array([np.roots([moment, k_rate, 0.5 * k_attitude]) for moment in moments]).ravel()
    return [
        ("principal moments (kg m^2)", moments),
        ("natural frequency (rad/s)", np.sqrt(0.5 * k_attitude / moments)),
        ("damping ratio", k_rate / np.sqrt(2.0 * moments * k_attitude)),
        ("eigenvalues of the linear loop (1/s)", roots),
        ("degree of stability (1/s)", float(-roots.real.max())),
    ]


def slew_figures(turn: Turn) -> list[tuple[str, Any]]:
    """Return the figures of merit of a slew designed for a settling time."""
    return [
        ("settles after (s)", turn.time),
        ("largest torque (N m)", turn.torque),
        ("largest momentum of the wheels (N m s)", turn.momentum),
    ]
