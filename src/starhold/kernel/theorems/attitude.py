"""Theorems that a law turns a rigid body to its target. Proofs: docs/kernel.md, section 3.

All of them are about the loop of `loops`, in which nothing but the state (q, w) may be left (`autonomous`). Numbers that a
claim may have: `level`, of V, at which motions start; `fastest`, a rate that they do not exceed from there; what the set
{V <= level} holds (`contents`); and limits (`limits`).
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from fractions import Fraction
from typing import TypeAlias

from ..loops import HYSTERESIS, MOVING, OUTSIDE, SHORTEST, WHEELS, AttitudeLoop
from ..numbers import cosine_below, demand
from ..polynomials import Poly, apply, dot, poly
from ..reading import Claim
from ..rules import Exceeds, Obligation, Shown, Solves, Squares, Vanishes
from ..sentences import Statement, above, below, enumerated
from .limits import within_limits

Proof: TypeAlias = Generator[tuple[str, Obligation], None, Statement]
Part: TypeAlias = Generator[tuple[str, Obligation], None, list[str]]


def converges(claim: Claim) -> Proof:
    """Every motion comes to rest on target, or, almost never, on the other quaternion of the same attitude.

    V' <= -c |w|^2 (LaSalle 1960); the other rest is unstable, for V at rest is highest there (Chen and Wimmer 1973)."""
    loop = AttitudeLoop(claim)
    yield from least_on_target(loop)
    said = yield from is_non_increasing(loop, _damped(loop), 3)
    yield from only_equilibrium(loop)
    return (yield from concluded(loop, said))


def converges_strictly(claim: Claim) -> Proof:
    """Motions end as in `converges` by a V, of whatever origin, with V' <= -c (|w|^2 + |q|^2): it decreases but at rest
    at q = 0 (Lyapunov)."""
    loop = AttitudeLoop(claim)
    yield from least_on_target(loop)
    w = loop.w
    more = [*(q * x for q in loop.q for x in w), *(w[i] * w[k] for i in range(3) for k in range(i, 3))]
    said = yield from is_non_increasing(loop, [*w, *loop.q[1:], *more], 6)
    return (yield from concluded(loop, said, strictly=True))


def converges_whatever_the_inertia(claim: Claim) -> Proof:
    """Motions end as in `converges` for every inertia of the body, while the law's own numbers stay: V is the kinetic energy
    of that inertia and a function of the attitude."""
    loop = AttitudeLoop(claim, any_inertia=True)
    yield from least_on_target(loop)
    said = yield from is_non_increasing(loop, _damped(loop), 3)
    yield from only_equilibrium(loop)
    return (yield from concluded(loop, said))


def converges_evenly(claim: Claim) -> Proof:
    """Every motion comes to rest on target, on either quaternion, or at a half turn, each of which is unstable."""
    return (yield from _evenly(AttitudeLoop(claim)))


def converges_evenly_whatever_the_inertia(claim: Claim) -> Proof:
    """Motions end as in `converges_evenly` for every inertia of the body, while the law's own numbers stay."""
    return (yield from _evenly(AttitudeLoop(claim, any_inertia=True)))


def _evenly(loop: AttitudeLoop) -> Proof:
    own, resting, level = loop.q[1:], loop.lyapunov.at(loop.still), loop.claim.numbers.get("level")
    yield from least_on_target(loop, own)
    said = yield from is_non_increasing(loop, _damped(loop), 3)
    pull = -dot(own, loop.balance(loop.u)).at(loop.still)
    yield "rests at half turns only", Squares(pull.over("q0"), own, 3, modulo=[loop.sphere])
    demand(all(len(m) == 2 and "q0" not in m for m in resting.terms), "V at rest is no form of q1, q2, q3")
    if level is None:
        said.append("comes to rest on target or at a half turn, each of which is unstable")
    else:
        yield "half turns are outside", Squares(resting - level, [poly(1), *own], 1, modulo=[dot(own, own) - 1])
        said.append("comes to rest on target")
    return (yield from finished(loop, said, even=True))


def _damped(loop: AttitudeLoop) -> list[Poly]:
    return [*loop.w, *(q * w for q in loop.q for w in loop.w)]


def least_on_target(loop: AttitudeLoop, turned: Sequence[Poly] = ()) -> Shown:
    """V >= c (|turned|^2 + |w|^2), turned being (1 - q0, q) unless told: V is zero only on target at rest, and {V <= level}
    is compact. Of an inertia that is not known V has the kinetic energy, of which only w.Jw > 0 is used."""
    yield from loop.sound()
    turned, momentum = turned or [1 - loop.q[0], *loop.q[1:]], apply(loop.J, loop.w)
    if loop.any_inertia:
        for k, p in enumerate(momentum):
            yield f"kinetic energy {k}", Vanishes(loop.lyapunov.slope(f"w{k + 1}") - p)
        energy = [dot(loop.w, momentum)]
        yield "V is least on target", Squares(loop.lyapunov, turned, len(turned), modulo=[loop.sphere], strict=energy)
    else:
        z = [*turned, *loop.w]
        yield "V is least on target", Squares(loop.lyapunov, z, len(z), modulo=[loop.sphere])


def is_non_increasing(loop: AttitudeLoop, z: Sequence[Poly], least: int) -> Part:
    """V' <= -c times the squares of the first of z, everywhere or, with a level, on {V <= level}, which is then not left; if
    `fastest` is told, there the rate is at most that."""
    numbers, V = loop.claim.numbers, loop.lyapunov
    level, fastest = numbers.get("level"), numbers.get("fastest")
    motion, known = loop.balance(loop.u), list[Poly]()
    # With nothing from outside H is constant in the axes of a target at rest: a function of the attitude.
    loop.autonomous(motion, kept="" if loop.outside or loop.moving else "h")
    said = ["from every attitude and rate the body"]
    if level is not None:
        said = [f"every motion from {{V <= {below(level)}}} stays there and"]
    if fastest is not None:
        slow = fastest * fastest - dot(loop.w, loop.w)
        yield "rates", Squares(slow, [poly(1), *loop.q, *loop.w], 0, [numbers["level"] - V], [loop.sphere])
        known = [slow * w * w for w in loop.w]
        said.append(f"turns no faster than {above(fastest)} rad/s and")
    if loop.any_inertia:
        # V = w.Jw/2 + U(q), so that V' = w.Jw' + U'.
        slope = loop.slopes_along(V, NOTHING) + dot(loop.w, motion)
    else:
        slope = loop.slopes_along(V, loop.acceleration)
    loop.autonomous([slope])
    yield "V is non-increasing", Squares(-slope, z, least, known, [loop.sphere])
    return said


NOTHING = [Poly({})] * 3


def only_equilibrium(loop: AttitudeLoop) -> Shown:
    """At rest the law's torque is zero only where q is."""
    yield "only equilibrium", Solves([p.at(loop.still) for p in loop.balance(loop.u)], loop.q[1:], [loop.sphere])


def concluded(loop: AttitudeLoop, said: list[str], strictly: bool = False) -> Proof:
    """Settle the part that the rest at q0 = -1 and the quaternion's sign play."""
    claim, V = loop.claim, loop.lyapunov
    level = claim.numbers.get("level")
    z = [poly(1), *loop.q, *loop.w]
    inside = [] if level is None else [level - V]
    if claim.taken.get(HYSTERESIS):
        width = claim.numbers["hysteresis"]
        yield "width", Exceeds(min(width, 1 - width))
        jump = V - V.at({f"q{k}": -q for k, q in enumerate(loop.q)})
        yield "a jump lowers V", Squares(jump, z, 1, [-width - loop.q[0], *inside], [loop.sphere])
        said.append(f"comes to rest on target, with the quaternion's sign chosen anew at q0 < -{above(width)}")
    elif claim.taken.get(SHORTEST):
        border, energy = [loop.sphere.at({"q0": 0})], [dot(loop.w, apply(loop.J, loop.w))] * loop.any_inertia
        higher = V.at({"q0": 0}) - claim.numbers["level"]
        yield "the sign never changes", Squares(higher, [poly(1), *loop.q[1:], *loop.w], 1, (), border, energy)
        said.append("comes to rest on target by the shorter turn")
    elif level is not None and not loop.any_inertia and V.at(loop.opposite | loop.still).number > level:
        yield "the other equilibrium is outside", Exceeds(V.at(loop.opposite | loop.still).number, level)
        said.append("comes to rest on target")
    else:
        demand(level is None or not loop.any_inertia, "a level for every inertia needs a sign of the quaternion")
        if level is not None:
            yield "the other equilibrium is inside", Exceeds(level, V.at(loop.opposite | loop.still).number)
        for k, name in enumerate(loop.still if strictly else ()):
            yield f"V is level at the other equilibrium {k}", Vanishes(V.slope(name).at(loop.opposite | loop.still))
        lower = V.at(loop.opposite | loop.still) - V.at(loop.still)
        yield "the other equilibrium repels", Squares(lower, [1 + loop.q[0], *loop.q[1:]], 4, modulo=[loop.sphere])
        said.append("comes to rest on target, but for a set of measure zero, which ends on the other quaternion")
    return (yield from finished(loop, said))


def finished(loop: AttitudeLoop, said: list[str], even: bool = False) -> Proof:
    """Add what the set holds and the limits, and say all that was shown."""
    claim = loop.claim
    held = yield from contents(loop, loop.lyapunov)
    limited = yield from within_limits(loop)
    assumptions = ["rigid-body", "exact-measurement", "ideal-actuators", "continuous-torque"]
    assumptions += [] if loop.any_inertia else ["inertia-as-given"]
    assumptions += limited.assumptions
    bounded = claim.numbers.content.keys()
    words = claim.taken.content
    assumptions.append("known-outside-torque" if OUTSIDE in words else "no-outside-torque")
    assumptions.append("known-target" if MOVING in words else "target-at-rest")
    assumptions += ["bounded-outside-torque"] * ("outside.0" in bounded) + ["bounded-target"] * ("target.rate" in bounded)
    assumptions.append("frictionless-wheels" if WHEELS in words else "no-wheels")
    if not even:
        assumptions.append("sign-at-once" if {SHORTEST, HYSTERESIS} & words.keys() else "quaternion-as-fed")
    text = f"{' '.join(said)}{''.join(f'; {part}' for part in (enumerated(held), limited.text) if part)}"
    return Statement(text, tuple(assumptions), limited.label or ("inertia" if loop.any_inertia else "convergence"))


def contents(loop: AttitudeLoop, V: Poly) -> Part:
    """{V <= level} holds every attitude at rest turned by up to `angle`; on target every rate up to `rate`; and every state
    turned by up to `start.angle` at up to `start.rate`."""
    numbers, said = loop.claim.numbers, list[str]()
    level, z = numbers.get("level"), [poly(1), *loop.q, *loop.w]

    def near(angle: Fraction) -> list[Poly]:
        # |q0| and q0 are at least the cosine; for less than a half turn so is q0^2 at least its square.
        cosine = cosine_below(angle / 2) if angle <= 6 else Fraction(-1)
        return [loop.q[0] - cosine, *([loop.q[0] * loop.q[0] - cosine * cosine] if cosine >= 0 else [])]

    def slow(rate: Fraction) -> list[Poly]:
        return [rate * rate - dot(loop.w, loop.w)]

    if level is None:
        return said
    inside, angle, rate = level - V, numbers.get("angle"), numbers.get("rate")
    if angle is not None:
        yield "turns from rest", Squares(inside.at(loop.still), z[:5], 0, near(angle), [loop.sphere])
        said.append(f"the set holds every rest turned by up to {below(angle)} rad")
    if rate is not None:
        yield "rates on target", Squares(inside.at(loop.on_target), [z[0], *loop.w], 0, slow(rate))
        said.append(f"on target every rate up to {below(rate)} rad/s")
    if "start.rate" in numbers:
        angle, rate = numbers["start.angle"], numbers["start.rate"]
        yield "states", Squares(inside, z, 0, [*near(angle), *slow(rate)], [loop.sphere])
        said.append(f"every state turned by up to {below(angle)} rad at up to {below(rate)} rad/s")
    return said
