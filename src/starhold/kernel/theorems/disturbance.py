"""The theorem that a bounded torque from outside leaves the motion near the target. Proof: docs/kernel.md, section 7."""

from __future__ import annotations

from collections.abc import Generator

from ..loops import AttitudeLoop
from ..numbers import cosine_below
from ..polynomials import apply, dot, poly, variables
from ..reading import Claim
from ..rules import Exceeds, Obligation, Squares
from ..sentences import Statement, above, below
from .attitude import contents, least_on_target


def ends_near(claim: Claim) -> Generator[tuple[str, Obligation], None, Statement]:
    """With a torque d from outside, |d| <= torque, that nobody is told, motions from {V <= level} stay there, and come in a
    finite time to {V <= end}, where they stay: V' <= -c between the two. There the turn is at most `angle`, the rate
    `end.rate`; as the first is less than a half turn, the quaternion's sign is one all along."""
    loop = AttitudeLoop(claim)
    numbers, V = claim.numbers, loop.lyapunov
    yield from least_on_target(loop)
    torque, level, end = numbers["torque"], numbers["level"], numbers["end"]
    angle, rate = numbers["end.angle"], numbers["end.rate"]
    yield "end", Exceeds(end)
    yield "level", Exceeds(level, end)
    motion = loop.balance(loop.u)
    loop.autonomous(motion)
    d, w, own = variables("d"), loop.w, loop.q[1:]
    slope = loop.slopes_along(V, apply(loop.J_inverse, [p + x for p, x in zip(motion, d, strict=True)]))
    z = [
        poly(1),
        loop.q[0],
        *w,
        *own,
        *d,
        *(q * x for q in loop.q for x in w),
        *(w[i] * w[k] for i in range(3) for k in range(i, 3)),
    ]
    known = [level - V, V - end, torque * torque - dot(d, d)]
    yield "V falls", Squares(-slope, z, 1, known, [loop.sphere])
    near = [poly(1), *loop.q, *w]
    turned = loop.q[0] - cosine_below(angle / 2)
    yield "angle", Squares(turned, near, 0, [end - V], [loop.sphere])
    yield "rate", Squares(rate * rate - dot(w, w), near, 0, [end - V], [loop.sphere])
    held = yield from contents(loop)
    text = f"against a torque of up to {below(torque)} N m every motion from {{V <= {below(level)}}} ends turned by no "
    text += f"more than {above(angle)} rad at no more than {above(rate)} rad/s{''.join(f'; {part}' for part in held)}"
    assumptions = ("rigid-body", "inertia-as-given", "exact-measurement", "ideal-actuators", "continuous-torque")
    told = (
        "known-outside-torque" if loop.outside else "bounded-outside-torque",
        "known-target" if loop.moving else "target-at-rest",
    )
    wheels = ("frictionless-wheels", "unlimited-wheels") if loop.wheels else ("no-wheels",)
    return Statement(text, (*assumptions, "unlimited-torque", *told, *wheels, "quaternion-as-fed"))
