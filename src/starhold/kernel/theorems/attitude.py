"""Theorems that a law turns a rigid body to its target. Proofs: docs/kernel.md, section 3.

All of them are about the loop of `loops`, which must depend on nothing but the state (q, w) (`autonomous`). Optional numbers
of a claim: `level`, of V, at which motions start; `fastest`, a rate that they do not exceed from there; the contents of the
set {V <= level} (`contents`); and limits (`limits`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from ..loops import HANDED, HYSTERESIS, NONE, SHORTEST, AttitudeLoop
from ..numbers import cosine_below, demand
from ..polynomials import Poly, apply, cross, dot, horner, minus, poly, total, var
from ..reading import Claim
from ..rules import Exceeds, Part, Proof, Shown, Squares, Sum, vanish
from ..sentences import Statement, above, below, enumerated
from .limits import within_limits


def converges(claim: Claim, strictly: bool = False, any_inertia: bool = False, near: bool = False) -> Proof:
    """Every motion converges to rest on target or, for a set of starts of measure zero, to the other quaternion of the same
    attitude. V' <= -c |w|^2, `strictly` -c (|w|^2 + |q|^2). `any_inertia`: so does every body under the unchanged law;
    `near`: so does every body with an inertia near the given one."""
    loop = AttitudeLoop(claim, any_inertia, near)
    w = loop.w
    yield from least_on_target(loop)
    z = [*w, *loop.q[1:] * strictly, *(q * x for q in loop.q for x in w)]
    z += [w[i] * w[k] for i in range(3) for k in range(i, 3)] * (strictly or "fastest" in claim.numbers)
    said = yield from is_non_increasing(loop, z, 6 if strictly else 3)
    if not strictly:
        # At rest the law's torque is zero only where q is.
        resting = [p.at(loop.still) for p in loop.balance(loop.quiet.value)]
        yield from vanish("only equilibrium", loop.q[1:], [*resting, loop.sphere], first=1)
    return (yield from concluded(loop, said))


def converges_evenly(claim: Claim, any_inertia: bool = False) -> Proof:
    """Every motion converges to rest on target, on either quaternion, or to a half turn, each of which is unstable."""
    loop = AttitudeLoop(claim, any_inertia)
    vector, resting, level = loop.q[1:], loop.lyapunov.at(loop.still), claim.numbers.get("level")
    yield from least_on_target(loop, vector)
    said = yield from is_non_increasing(loop, [*loop.w, *(q * x for q in loop.q for x in loop.w)], 3)
    demand(all(len(m) == 2 and "q0" not in m for m in resting.terms), "V at rest is no form of q1, q2, q3")
    at_axes = [resting.terms.get((name, name), 0) for name in ("q1", "q2", "q3")]
    if level is None or level >= min(at_axes):
        said.append("comes to rest on target or at a half turn, each of which is unstable")
    else:
        yield "half turns are outside", Squares(resting - level, [poly(1), *vector], 1, modulo=[dot(vector, vector) - 1])
        said.append("comes to rest on target")
    return (yield from finished(loop, said))


def least_on_target(loop: AttitudeLoop, turned: Sequence[Poly] = ()) -> Shown:
    """V >= c (|turned|^2 + |w|^2), with turned = (1 - q0, q) unless given. For an unknown inertia V contains the kinetic
    energy, with v = w + lean q for w, of which only v.Jv > 0 is used."""
    yield from loop.sound()
    z, momentum, energy = [*(turned or [1 - loop.q[0], *loop.q[1:]])], apply(loop.J, loop.leaning), kinetic(loop)
    if loop.any_inertia:
        yield from vanish("kinetic energy", minus([loop.lyapunov.slope(name) for name in loop.driven], momentum))
    else:
        z += loop.w
    known = loop.heaviest(loop.q[1:])
    yield "V is least on target", Squares(loop.lyapunov, z, len(z), known, [loop.sphere], energy)


def kinetic(loop: AttitudeLoop, more: Fraction | int = 0) -> list[Poly]:
    """Return v.Jv for an unknown inertia, with this much more lean in v."""
    v = [x + more * q for x, q in zip(loop.leaning, loop.q[1:], strict=True)]
    return [dot(v, apply(loop.J, v))] if loop.any_inertia else []


def is_non_increasing(loop: AttitudeLoop, z: Sequence[Poly], least: int) -> Part[list[str]]:
    """V' <= -c times the squares of the first entries of z, everywhere or, with a level, on {V <= level}, which is then
    invariant; with `fastest`, the rate there is at most that. If the law has cases, V' <= -c in all cases that do not hold
    around a rest."""
    numbers, V, w = loop.claim.numbers, loop.lyapunov, loop.w
    level, fastest = numbers.get("level"), numbers.get("fastest")
    known = loop.shifted()
    said = ["from every attitude and rate the body"]
    if level is not None:
        said = [f"every motion from {{V <= {below(level)}}} stays there and"]
    if fastest is not None:
        slow = fastest * fastest - dot(w, w)
        yield "rates", Squares(slow, [poly(1), *loop.q, *w], 0, [numbers["level"] - V], [loop.sphere])
        known += [slow * x * x for x in w]
        said.append(f"turns no faster than {above(fastest)} rad/s and")
    for case, side in enumerate(loop.sides):
        motion = loop.balance(side.value)
        # With nothing from outside H is constant in the axes of a target at rest: a function of the attitude.
        loop.autonomous([*motion, *side.known], kept="" if loop.outside or loop.moving else "h")
        # Of any inertia dV/dw = Jv, so that V' is v.Jw' and what the attitude does.
        slope = loop.slopes_along(V, NONE if loop.any_inertia else apply(loop.J_inverse, motion))
        slope = slope + dot(loop.leaning, motion) * loop.any_inertia
        loop.autonomous([slope])
        name, conditions = (
            f"V is non-increasing {case}" if len(loop.sides) > 1 else "V is non-increasing",
            [*known, *side.known],
        )
        if side is loop.quiet:
            yield name, Squares(-slope, z, least, conditions, [loop.sphere])
        else:
            yield name, Squares(-slope, [poly(1), *z], 0, conditions, [loop.sphere], [poly(1)])
    return said


def concluded(loop: AttitudeLoop, said: list[str]) -> Proof:
    """Decide the role of the rest at q0 = -1 and of the quaternion's sign."""
    numbers, V, q, w = loop.claim.numbers, loop.lyapunov, loop.q, loop.w
    level = numbers.get("level")
    away = V.at(loop.opposite | loop.still)
    if HYSTERESIS in loop.signs:
        width = numbers["hysteresis"]
        yield "width", Exceeds(min(width, 1 - width))
        jump, inside = V - V.at({f"q{k}": -x for k, x in enumerate(q)}), [] if level is None else [level - V]
        if loop.near:
            # So much of the level leaves nothing of J but a form that is positive, and q.Jq.
            more = numbers["jump.lean"]
            demand(level is not None and more > 0, "a jump needs a level and a positive lean")
            jump = jump - 2 * loop.lean / more * inside[0]
            inside = [*kinetic(loop, more), *loop.heaviest(q[1:])]
        yield "a jump lowers V", Squares(jump, [poly(1), *q, *w], 1, [-width - q[0], *inside], [loop.sphere])
        said.append(f"comes to rest on target, with the quaternion's sign chosen anew at q0 < -{above(width)}")
    elif SHORTEST in loop.signs:
        known = loop.heaviest(q[1:])
        higher, z = V.at({"q0": 0}) - numbers["level"], [poly(1), *q[1:], *w]
        yield "the sign never changes", Squares(higher, z, 1, known, [loop.sphere.at({"q0": 0})], kinetic(loop))
        said.append("comes to rest on target by the shorter turn")
    elif level is not None and not loop.any_inertia and away.number > level:
        yield "the other equilibrium is outside", Exceeds(away.number, level)
        said.append("comes to rest on target")
    else:
        demand(level is None or not loop.any_inertia, "a level for every inertia needs a sign of the quaternion")
        if level is not None:
            repels = Squares(away - V.at(loop.still), [1 + q[0], *q[1:]], 4, modulo=[loop.sphere])
            yield "the other equilibrium repels", repels
        said.append("comes to rest on target, but for a set of measure zero, which ends on the other quaternion")
    return (yield from finished(loop, said, loop.sign_assumed))


def finished(loop: AttitudeLoop, said: list[str], *assumed: str) -> Proof:
    """Add the contents of the set and the limits, and state the result."""
    contained = yield from contents(loop, loop.lyapunov)
    limited = yield from within_limits(loop)
    if loop.near:
        said = [f"with every J_ik off by up to {below(loop.claim.numbers['tolerance'])} sqrt(J_ii J_kk),", *said]
    handed = loop.claim.taken.get(HANDED)
    bounded = "level" not in loop.claim.numbers or "start.rate" in loop.claim.numbers
    demand(not handed or bounded, "what is handed over is not bounded")
    text = "; ".join(part for part in (" ".join(said), enumerated(contained), limited.text) if part)
    label = limited.label or ("inertia" if loop.any_inertia else "hand-over" if handed else "convergence")
    return Statement(text, (*loop.assumed, "continuous-torque", *limited.assumptions, *assumed), label)


def contents(loop: AttitudeLoop, V: Poly) -> Part[list[str]]:
    """{V <= level} contains every attitude at rest turned by up to `angle`; on target every rate up to `rate`; and every
    state turned by up to `start.angle` at up to `start.rate`."""
    numbers, q, w, one = loop.claim.numbers, loop.q, loop.w, poly(1)
    level, said = numbers.get("level"), list[str]()
    if level is None:
        return said
    inside, angle, rate = level - V, numbers.get("angle"), numbers.get("rate")
    if angle is not None:
        yield "turns from rest", Squares(inside.at(loop.still), [one, *q], 0, within_turn(loop, angle), [loop.sphere])
        said.append(f"the set holds every rest turned by up to {below(angle)} rad")
    if rate is not None:
        known = [rate * rate - dot(w, w), *loop.heaviest(w)]
        yield "rates on target", Squares(inside.at(loop.on_target), [one, *w], 0, known)
        said.append(f"on target every rate up to {below(rate)} rad/s")
    if "start.rate" in numbers:
        angle, rate = numbers["start.angle"], numbers["start.rate"]
        starts = [*within_turn(loop, angle), rate * rate - dot(w, w), *loop.heaviest(loop.leaning)]
        starts += [dot(q[1:], apply(loop.J, q[1:]))] * loop.near
        yield "states", Squares(inside, [one, *q, *w], 0, starts, [loop.sphere])
        said.append(f"every state turned by up to {below(angle)} rad at up to {below(rate)} rad/s")
    return said


def within_turn(loop: AttitudeLoop, angle: Fraction) -> list[Poly]:
    """Return what is nonnegative for rotations of up to an angle: |q0| and q0 are at least the cosine; for less than a half
    turn so is q0^2 at least its square."""
    cosine = cosine_below(angle / 2) if angle <= 6 else Fraction(-1)
    return [loop.q[0] - cosine, *([loop.q[0] * loop.q[0] - cosine * cosine] if cosine >= 0 else [])]


# --- without a preferred axis: V and V' depend on 1 - q0, |w| and the part of q along w alone ---------------------------


def converges_without_axes(claim: Claim) -> Proof:
    """Every motion from {V <= level} stays there and converges to rest on target: V has its minimum on target, and on the
    set V' <= -c (|w|^2 + |q|^2). Both are shown for w = (v, 0, 0) and q = (t, n, 0)."""
    loop = AttitudeLoop(claim, quotients=True)
    yield from loop.sound()
    V, level = loop.lyapunov, claim.numbers["level"]
    slope = without_quotients(loop, loop.slopes_along(V, loop.acceleration))
    loop.autonomous([slope, *loop.divisors.values()])
    for name, divisor in loop.divisors.items():
        yield f"divisor {name}", Squares(divisor, [poly(1), *loop.q, *loop.w], 1, modulo=[loop.sphere])
    for name, p in (("V", V), ("V'", slope)):
        yield from vanish(f"{name} turned about axis", [turned(loop, p, axis) for axis in range(3)])
    u, v, t = map(var, "uvt")
    height, fall, q2 = reduced(V), -reduced(slope), u * (2 - u)
    yield "V is least on target", Sum(height, [q2 - t * t], (), [v * v, u * u, q2])
    yield "V decreases", Sum(fall, [level - height, q2 - t * t], (), [v * v, q2])
    statement = yield from concluded(loop, [f"every motion from {{V <= {below(level)}}} stays there and"])
    return replace(statement, label="region")


def without_quotients(loop: AttitudeLoop, p: Poly) -> Poly:
    """Return p times its divisors, each as often as its inverse occurs in p: a product with the sign of p."""
    for name, divisor in loop.divisors.items():
        p = horner(p.powers(name)[::-1], divisor)
    return p


def turned(loop: AttitudeLoop, p: Poly, axis: int) -> Poly:
    """Return the derivative of p as q and w are rotated together about an axis."""
    along = [poly(i == axis) for i in range(3)]
    vectors = [("q", loop.q[1:]), ("w", loop.w)]
    return total(p.slope(f"{x}{i}") * rate for x, vector in vectors for i, rate in enumerate(cross(along, vector), 1))


def reduced(p: Poly) -> Poly:
    """Return p at w = (v, 0, 0), q = (t, n, 0) and q0 = 1 - u, even in n, whose square is u (2 - u) - t^2."""
    u, v, t = map(var, "uvt")
    parts = p.at({"q0": 1 - u, "q1": t, "q3": 0, "w1": v, "w2": 0, "w3": 0}).powers("q2")
    demand(not any(part.terms for part in parts[1::2]), "a function of a direction has one side")
    return horner(parts[::2], u * (2 - u) - t * t)
