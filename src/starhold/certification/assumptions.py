"""States assumptions of claims, by the kernel's identifiers, in words, tests them on flights, and finds the numbers of its
loop on which a claim depends."""

import math
from collections.abc import Callable, Iterable, Set
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from starhold.algebra.quaternion import conjugate, multiply, to_reference
from starhold.algebra.vector import ZERO
from starhold.certification.certificate import EVEN, FRESH, LATE, ORBIT, STEADY, UNTIL, WITHOUT, Claim
from starhold.certification.directions import AGE
from starhold.certification.mean_rates import misled
from starhold.certification.orbit_band import strays
from starhold.certification.target_motion import motion_of
from starhold.kernel.sentences import ASSUMPTIONS as SENTENCES
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.contract import AT_REST, IS_VALID
from starhold.parts.effectors.wheel_motion import has_friction
from starhold.parts.effectors.wheels import BAND

Unmet: TypeAlias = list[tuple[Any, str]]
"""At which samples of a flight (n,), or whether at all, an assumption is violated, each with a sentence without its full
stop."""


class Assumption(NamedTuple):
    """The text of an assumption, and where a flight (a `Span` of analysis) violates it; None for what every simulation
    meets, for a claim's set, and for claims that are not about motions."""

    text: str
    unmet: Callable[[Any], Unmet] | None = None


def assumption(identifier: str) -> Assumption:
    """Return the assumption of an identifier."""
    if identifier.startswith(WITHOUT):
        part = identifier.removeprefix(WITHOUT)

        def there(span: Any) -> Unmet:
            return [(True, f"{HAS}{part}")]

        return Assumption(f"without the {part}", there)
    if identifier.startswith(ORBIT):
        share = 100.0 * float(identifier.removeprefix(ORBIT))
        return Assumption(f"distance, speed and momentum of the orbit within {share:.3g} % of two-body motion", _strayed)
    if identifier.startswith(LATE):
        most = float(identifier.removeprefix(LATE))

        def late(span: Any) -> Unmet:
            off = np.linalg.norm(span["torque"] - span["command"], axis=1)
            # Tested only as the flight begins; later errors follow.
            return [(off[:1] > most * MORE, "the torque that acts is further from the command")]

        return Assumption(f"a torque that acts within {most:.4g} N m of the command at the start", late)
    if identifier.startswith(FRESH):
        age = float(identifier.removeprefix(FRESH))

        def aged(span: Any) -> Unmet:
            names = (f"{fitted.prefix}{AGE}" for fitted in span.loop.used("estimator"))
            # Ages are sums of control periods.
            return [(span[name] > age * MORE + NEAR, "directions give no attitude") for name in names]

        most = f"at every control instant, or one no older than {age:.6g} s" if age else "at every control instant"
        return Assumption(f"directions that give an attitude {most}, as far apart as the estimator asks for", aged)
    if identifier.startswith(EVEN):
        most = float(identifier.removeprefix(EVEN))

        def turned(span: Any) -> Unmet:
            return [(misled(span) > most, "the body turns otherwise than at the mean of two readings of its gyro")]

        text = f"a body that turns between two readings of its gyro as at their mean, but for {math.degrees(most):.3g}° told"
        return Assumption(text, turned)
    if identifier.startswith(UNTIL):
        until = float(identifier.removeprefix(UNTIL))

        def late(span: Any) -> Unmet:
            return [(span["time"] * span.unit > until, "its target's motion has no bounds any more")]

        return Assumption(f"the flight's first {until:.6g} s", late)
    return ASSUMPTIONS[identifier]


def texts(identifiers: Iterable[str]) -> tuple[str, ...]:
    """Return the texts of assumptions, each once."""
    return tuple(dict.fromkeys(assumption(name).text for name in identifiers))


def as_it_starts(loop: ClosedLoop) -> Any:
    """Return what the law measures as a loop starts, without errors."""
    loop = loop.without("sensor", "estimator")
    return make_step(loop.composition()).measure(loop.carry(), 0, 0, loop.craft, loop.setup())


def cancels(loop: ClosedLoop) -> bool:
    """Return whether the law subtracts the modelled torque from its command, as tested at an arbitrary start."""
    measurement = as_it_starts(loop)
    memory = loop.law.remember(loop.gains, loop.craft, loop.period)
    more = 0.01 * loop.craft.torque_limit if math.isfinite(loop.craft.torque_limit) else 1.0
    # From rest on target, where clipped and switching laws are farthest from saturation.
    measurement = measurement._replace(attitude=(1.0, 0.0, 0.0, 0.0), rate=ZERO)
    torques = [
        np.array(loop.law.command(measurement._replace(external_torque=(x, x, x)), loop.gains, loop.craft, memory)[0])
        for x in (0.0, more)
    ]
    return bool(np.allclose(torques[0] - torques[1], more, rtol=1e-6))


def _limited(span: Any) -> Unmet:
    return [(span.on_limit(span["command"]), "the torque reaches its limit")]


def _controlled(span: Any) -> Unmet:
    return [(span.on_limit(span["command"]), "the control reaches its limit")]


def _held_aside(span: Any) -> Unmet:
    return [(span.on_limit(span["command"][:, 1:]), "the control along Y or Z reaches its limit")]


def _wheels_limited(span: Any) -> Unmet:
    wheels = span.loop.wheels
    strong = span.reaches(np.abs(span["wheel_torque"]), np.array(wheels.torque_limit))[:, _working(wheels)].any(axis=1)
    power = [(bool(wheels.power_limit), "the motors have a power limit")]
    return [*_friction(span), *_limited(span), (strong, "a motor reaches its limit"), *_filled(span), *power]


def _working(wheels: Any) -> Any:
    return np.array(wheels.torque_limit) > 0.0


def _filled(span: Any) -> Unmet:
    wheels = span.loop.wheels
    full = np.abs(span["wheel_momentum"]) > np.array(wheels.momentum_limit) * (1.0 - BAND)
    return [(full[:, _working(wheels)].any(axis=1), "a wheel is full")]


def _friction(span: Any) -> Unmet:
    wheels = span.loop.wheels
    return [(has_friction(wheels), "the wheels have friction"), (bool(wheels.unbalanced), "the rotors are out of balance")]


def _strayed(span: Any) -> Unmet:
    return [(strays(span.loop, span["position"], span["velocity"]), "forces move the orbit further than is assumed")]


def _uncancelled(span: Any) -> Unmet:
    gravity = span.loop.has("gravity-gradient") and not cancels(span.loop)
    return [(gravity, "the law does not cancel the gravity gradient")]


def _pulled(span: Any) -> Unmet:
    return [(span.loop.has("gravity-gradient"), "the gravity gradient acts")]


def _told(span: Any) -> Unmet:
    modelled = any(fitted.part.flag("MODELLED") for fitted in span.loop.used("environment"))
    return [(modelled, "the law is given a torque from outside")]


def _unsure(span: Any) -> Unmet:
    names = (f"{fitted.prefix}{IS_VALID}" for fitted in span.loop.used("estimator"))
    return [(span[name] < 0.5, "the estimate is not valid") for name in names]


def _jumped(span: Any) -> Unmet:
    motion, time = motion_of(span.loop) or AT_REST, span["time"] * span.unit
    body, error = span["attitude"].T, span["attitude_error"].T
    target: Any = multiply(body, conjugate(error))
    steps = np.abs(np.einsum("ik,ik->k", np.array(target)[:, 1:], np.array(target)[:, :-1]))
    rates = np.array(to_reference(body, (span["rate"] - span["rate_error"]).T))
    most = np.diff(time) * MORE
    jumps = 2.0 * np.arccos(np.minimum(steps, 1.0)) > motion.rate * most + NEAR
    jumps |= np.linalg.norm(np.diff(rates), axis=0) > motion.acceleration * most + NEAR * motion.rate
    return [(np.append(False, jumps), "the target jumps")]


def _turning(span: Any) -> Unmet:
    return [(span.loop.target.part.name != "inertial", "the target turns")]


MORE, NEAR = 1.0 + 1e-6, 1e-6
"""The margins by which a target that jumps is told from one that moves."""
UNLIMITED, WHEELS, FRICTIONLESS = "unlimited-torque", "unlimited-wheels", "frictionless-wheels"
UNLIMITED_CONTROL, IN_THE_PLANE, LINEAR = "unlimited-control", "in-the-plane", "linear-motion"
VALID_ESTIMATE = "valid-estimate"
HAS = "the loop has the "
"""The beginning of the text about a part that a claim leaves out, role and name."""
# Imperfect measurement and actuators are parts, which are left out by name.
_IDEAL = Assumption("exact measurement and ideal actuators")
# Every departure checks how long the torque is held, and what changes.
ASSUMPTIONS = {
    "rigid-body": Assumption("rigid body"),
    "inertia-as-given": Assumption("inertia exactly as given"),
    "inertia-near": Assumption("inertia within the tolerance"),
    "exact-measurement": _IDEAL,
    "ideal-actuators": _IDEAL,
    "continuous-torque": Assumption("torque applied continuously"),
    UNLIMITED: Assumption("torque not limited", _limited),
    WHEELS: Assumption("neither torque nor wheels limited, wheels without friction", _wheels_limited),
    FRICTIONLESS: Assumption("wheels without friction", _friction),
    "bounded-momentum": Assumption("total momentum at most as stated"),
    "spare-momentum": Assumption("no wheel filled by momentum that friction moves between wheels", _filled),
    "best-plan": Assumption("torque of a plan as stated, of nearly the least cost", _limited),
    "no-wheels": Assumption("no stored momentum"),
    "no-outside-torque": Assumption("no torque from outside", _pulled),
    "known-outside-torque": Assumption("no torque from outside but what the law cancels", _uncancelled),
    "untold-torque": Assumption("a law that is given no torque from outside", _told),
    "bounded-outside-torque": Assumption("torque from outside bounded on each axis"),
    "changing-outside-torque": Assumption("external torque known as at the measured attitude, its rate bounded"),
    "unknown-outside-torque": Assumption("torque from outside bounded in norm"),
    "bounded-target": Assumption("target's motion at most as stated"),
    VALID_ESTIMATE: Assumption("estimate valid throughout", _unsure),
    STEADY: Assumption("target between its jumps", _jumped),
    "target-at-rest": Assumption("target at rest", _turning),
    LINEAR: Assumption("linear motion near rest on a target at rest"),
    "equations-as-given": Assumption("the equations exactly as given"),
    "filippov": Assumption(
        "where the right-hand side jumps, motions in the sense of Filippov: x' is any mean of what it is on the sides and "
        "on the surface"
    ),
    UNLIMITED_CONTROL: Assumption(SENTENCES[UNLIMITED_CONTROL], _controlled),
    "held-aside": Assumption(SENTENCES["held-aside"], _held_aside),
} | {
    name: Assumption(SENTENCES[name])
    for name in (
        "appendages-as-given",
        "bounded-push",
        "held-torque",
        "late-torque",
        "late-alike",
        "late-told",
        # The distribution of noise cannot be told from one flight.
        "gaussian-noise",
        "linear-estimate",
        "settled-estimate",
        "held-field",
        "rods-alike",
        "idle-wheels",
        "linear-field",
        "whole-field",
        "circling-bodies",
        "exact-place",
        "continuous-control",
        IN_THE_PLANE,
        "off-the-bodies",
    )
}
"""The assumptions of claims, except for parts left out by name."""


@dataclass(frozen=True)
class Standing:
    """A claim stands with the gains it was made for, and with other numbers as stated here. known: whether with any inertia
    of the law's nominal model; true: "given" with the true one it was made for, "any", or "box" with those whose entries
    differ by at most `tolerance` sqrt(J_ii J_jj); limit: "given", "any" or "above", which is that limit or a larger one;
    momentum: whether with any angular momentum at the start; start: the level of V below which the start must be, None for
    any start."""

    known: bool
    true: str
    tolerance: float | None
    limit: str
    momentum: bool
    start: float | None


def standing(claim: Claim, reads: Set[str]) -> Standing:
    """Return the numbers with which a claim stands, for a law that reads these of its nominal model: "inertia",
    "torque_limit"."""
    free = not {UNLIMITED, WHEELS, LINEAR}.isdisjoint(claim.assumptions)
    limit = "given"
    if "torque_limit" not in reads:
        # A set on which the torque is within its limit also serves every larger limit.
        limit = "any" if free else "above" if "limit" in claim.numbers else "given"
    tolerance: float | None = claim.numbers.get("tolerance")
    # V of the loop as it flies is that of the inertia as given.
    given = "tolerance" not in claim.numbers or claim.kind == "pointing"
    true = "given" if given else "any" if tolerance is None else "box"
    return Standing(
        "inertia" not in reads and true != "given",
        true,
        tolerance,
        limit,
        "momentum" not in claim.numbers,
        claim.numbers.get("start"),
    )
