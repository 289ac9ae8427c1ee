"""Limits that hold on {V <= level}: of the torque, of the wheels' motors and of their momentum. Docs/kernel.md, 4."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from fractions import Fraction

from ..loops import AttitudeLoop
from ..numbers import definite, demand, inverse, times, transpose
from ..polynomials import Poly, dot, poly, variables
from ..rules import Exceeds, Obligation, Squares
from ..sentences import Statement, above, below, enumerated

TORQUE = "torque-limit"


def within_limits(loop: AttitudeLoop) -> Generator[tuple[str, Obligation], None, Statement]:
    """On {V <= level}, with everything from outside at most as told: each component of the torque is at most `limit` in size
    (`limit.norm`: their norm); each motor gives at most motors.k, each wheel stores at most stored.k.

    As no motion leaves the set (theorems of `attitude`), nothing is ever limited, and the loop is the one that was taken."""
    numbers, said, bounds = loop.claim.numbers, list[str](), list[str]()
    limit, norm = numbers.get("limit"), numbers.get("limit.norm")
    motors = "motors.0" in numbers or "stored.0" in numbers
    if limit is None and norm is None and not motors:
        return Statement("", ("unlimited-torque", *(["unlimited-wheels"] if loop.wheels else [])))
    known, z, bounded = list[Poly](), [poly(1), *loop.q, *loop.w], list[Poly]()
    if loop.outside:
        outside = [numbers[f"outside.{k}"] for k in range(3)]
        known += [most - sign * e for most, e in zip(outside, loop.e, strict=True) for sign in (1, -1)]
        bounds.append(f"a torque from outside of up to {', '.join(map(below, outside))} N m about the axes")
    for name, taken, vector, text in (
        ("target.rate", loop.moving, loop.r, "a target that turns at up to {} rad/s"),
        ("target.acceleration", loop.moving, loop.a, "a target that speeds up by up to {} rad/s^2"),
        ("momentum", loop.wheels, loop.H, "a momentum of up to {} N m s"),
    ):
        if taken:
            most = numbers[name]
            known, bounded = [*known, most * most - dot(vector, vector)], [*bounded, *vector]
            bounds.append(text.format(below(most)))
    known.append(numbers["level"] - loop.lyapunov)

    def within(limit: Fraction, load: Poly, more: Sequence[Poly] = (), units: Sequence[Poly] = ()) -> Squares:
        # Of what is bounded from outside only what the load depends on.
        own = [x for x in bounded if x.names <= load.names]
        return Squares(limit - load, [*z, *own, *more], 0, known, [loop.sphere, *units])

    if limit is not None:
        for axis, u in enumerate(loop.u):
            for sign in (1, -1):
                yield f"torque {sign * (axis + 1):+d}", within(limit, sign * u)
        said.append(f"the law asks for no more than {above(limit)} N m about any axis")
    if norm is not None:
        # |u| <= limit where d.u <= limit for every unit vector d.
        d = variables("d")
        more = [*d, *(x * w for x in d for w in loop.w)]
        yield "norm of the torque", within(norm, dot(d, loop.u), more, [dot(d, d) - 1])
        said.append(f"the law asks for a torque of no more than {above(norm)} N m")
    told = f"with {enumerated(bounds)} " if bounds else ""
    assumptions = ("bounded-momentum",) if loop.wheels else ()
    if not motors:
        return Statement(told + enumerated(said), (*assumptions, *(["unlimited-wheels"] if loop.wheels else [])), TORQUE)
    shares, held = allocated(loop)
    for k, (share, own) in enumerate(zip(shares, held, strict=True)):
        for name, load, most in (
            ("motor", dot(share, loop.u), numbers[f"motors.{k}"]),
            # The rotor's momentum changes by share.(torque), the wheels' together by its negative.
            ("wheel", own - dot(share, loop.stored), numbers[f"stored.{k}"]),
        ):
            if name == "motor" and not any(share):
                continue
            yield f"limit of {name} {k}", Exceeds(most)
            for sign in (1, -1):
                yield f"{name} {sign * (k + 1):+d}", within(most, sign * load)
    torques, momenta = (", ".join(above(numbers[f"{n}.{k}"]) for k in range(len(shares))) for n in ("motors", "stored"))
    said.append(f"motors give no more than {torques} N m and wheels store no more than {momenta} N m s")
    return Statement(told + enumerated(said), assumptions, "wheels")


def allocated(loop: AttitudeLoop) -> tuple[list[list[Fraction]], list[Fraction]]:
    """Return for each wheel its share of the body's torque, and the momentum that it keeps whatever the body does.

    With the axes as columns of A the shares are the rows of L = -A'(AA')^-1, which give the torque, -ALu = u, with the
    least sum of squares. As the rotors' momenta have p' = Lu and together h = Ap, p + Lh does not change. A motor that is
    told to give nothing has no share, and its wheel keeps what it stores."""
    subject, numbers = loop.claim.subject, loop.claim.numbers
    demand(loop.wheels, "the loop is taken without wheels")
    count = next(k for k in range(1000) if f"wheel.{k}.axis.0" not in subject)
    axes = [[subject[f"wheel.{k}.axis.{i}"] for i in range(3)] for k in range(count)]
    driven = [axis if numbers[f"motors.{k}"] != 0 else [Fraction(0)] * 3 for k, axis in enumerate(axes)]
    square = times(transpose(driven), driven) if axes else [[Fraction(0)] * 3] * 3
    demand(definite(square), "the wheels do not act about three axes")
    shares = [[-x for x in row] for row in times(driven, inverse(square))]
    begun = [subject[f"wheel.{k}.momentum"] for k in range(count)]
    stored = [sum((a[i] * p for a, p in zip(axes, begun, strict=True)), Fraction(0)) for i in range(3)]
    return shares, [
        p + sum((x * h for x, h in zip(row, stored, strict=True)), Fraction(0)) for p, row in zip(begun, shares, strict=True)
    ]
