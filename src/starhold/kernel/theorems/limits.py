"""Limits that hold on {V <= level}: of the torque, of the wheels' motors and of their momentum. Proof: docs/kernel.md, 4."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from fractions import Fraction
from typing import TypeAlias

from ..loops import AttitudeLoop
from ..numbers import definite, demand, inverse, times, transpose
from ..polynomials import Poly, apply, dot, poly, variables
from ..rules import Obligation, Squares
from ..sentences import Statement, above, below, enumerated

Load: TypeAlias = tuple[str, Fraction, Poly]
TORQUE, UNIT = "torque-limit", variables("d")


def within_limits(loop: AttitudeLoop, less: Fraction = Fraction(0)) -> Generator[tuple[str, Obligation], None, Statement]:
    """On {V <= level}, with everything from outside at most as told: each component of the torque is at most `limit` in size
    (`limit.norm`: their norm); each motor gives at most motors.k, each wheel stores at most stored.k. less: what the torque
    is below its limit, for what it is not told exactly."""
    numbers, q, w = loop.claim.numbers, loop.q, loop.w
    limit, norm = numbers.get("limit"), numbers.get("limit.norm")
    motors = "motors.0" in numbers or "stored.0" in numbers
    unlimited = [] if motors or not loop.wheels else ["unlimited-wheels"]
    if limit is None and norm is None and not motors:
        return Statement("", ("unlimited-torque", *unlimited))
    known, bounded, bounds, assumed = list[Poly](), list[Poly](), list[str](), list[str]()
    if loop.outside:
        outside = [numbers[f"outside.{k}"] for k in range(3)]
        known += [most - sign * e for most, e in zip(outside, loop.e, strict=True) for sign in (1, -1)]
        bounds.append(f"a torque from outside of up to {', '.join(map(below, outside))} N m about the axes")
        assumed.append("bounded-outside-torque")
    vectors = [("target.rate", loop.r, "a target that turns at up to {} rad/s")] * loop.moving
    vectors += [("target.acceleration", loop.a, "a target that speeds up by up to {} rad/s^2")] * loop.moving
    vectors += [("momentum", loop.H, "a momentum of up to {} N m s")] * loop.wheels
    for name, vector, text in vectors:
        known.append(numbers[name] * numbers[name] - dot(vector, vector))
        bounded += vector
        bounds.append(text.format(below(numbers[name])))
    assumed += ["bounded-target"] * loop.moving + ["bounded-momentum"] * loop.wheels + unlimited
    known.append(numbers["level"] - loop.lyapunov)
    said, asked = list[str](), [None if x is None else x - less for x in (limit, norm)]
    limited = list(loads("torque", loop.u, *asked))
    if limit is not None:
        said.append(f"the law asks for no more than {above(limit)} N m about any axis")
    if norm is not None:
        said.append(f"the law asks for a torque of no more than {above(norm)} N m")
    if motors:
        shares, held = allocated(loop)
        most = {name: [numbers[f"{name}.{k}"] for k in range(len(shares))] for name in ("motors", "stored")}
        # The rotors' momenta change by share.(torque), the wheels' together by its negative.
        gives = apply(shares, loop.u)
        stores = [own - p for own, p in zip(held, apply(shares, loop.stored), strict=True)]
        for k in range(len(shares)):
            for name, bound, load in (("motor", most["motors"][k], gives[k]), ("wheel", most["stored"][k], stores[k])):
                both = [(f"{name} {sign * (k + 1):+d}", bound, sign * load) for sign in (1, -1)]
                limited += both if load.terms else []
        torques, momenta = (", ".join(map(above, own)) for own in most.values())
        said.append(f"motors give no more than {torques} N m and wheels store no more than {momenta} N m s")
    for name, bound, load in limited:
        # Of what is bounded from outside only what the load depends on.
        z = [poly(1), *q, *w, *(x for x in bounded if x.names <= load.names)]
        yield name, within(bound, load, z, w, known, [loop.sphere])
    told = f"with {enumerated(bounds)} " if bounds else ""
    return Statement(told + enumerated(said), tuple(assumed), "wheels" if motors else TORQUE)


def loads(name: str, u: Sequence[Poly], axis: Fraction | None, norm: Fraction | None) -> Iterator[Load]:
    """Yield what is at most `axis` where each component of u is, and `norm` where |u| is: d.u with every unit vector d."""
    if axis is not None:
        yield from ((f"{name} {sign * k:+d}", axis, sign * p) for k, p in enumerate(u, 1) for sign in (1, -1))
    if norm is not None:
        yield f"norm of the {name}", norm, dot(UNIT, u)


def within(
    bound: Fraction, load: Poly, z: list[Poly], paired: Sequence[Poly], known: Sequence[Poly], modulo: list[Poly]
) -> Squares:
    """Return that a load is at most its bound; terms that the unit vector of a norm is paired with are told."""
    if not UNIT[0].names <= load.names:
        return Squares(bound - load, z, 0, known, modulo)
    more = [*UNIT, *(d * x for d in UNIT for x in paired)]
    return Squares(bound - load, [*z, *more], 0, known, [*modulo, dot(UNIT, UNIT) - 1])


def allocated(loop: AttitudeLoop) -> tuple[list[list[Fraction]], list[Fraction]]:
    """Return for each wheel its share of the body's torque, and the momentum that it keeps whatever the body does: the rows
    of L = -A'(AA')^-1 and p + Lh. A motor that is told to give nothing has no share."""
    subject, numbers = loop.claim.subject, loop.claim.numbers
    demand(loop.wheels, "the loop is taken without wheels")
    count = next(k for k in range(1000) if f"wheel.{k}.axis.0" not in subject)
    demand(count > 0, "there are no wheels")
    axes = [[subject[f"wheel.{k}.axis.{i}"] for i in range(3)] for k in range(count)]
    driven = [axis if numbers[f"motors.{k}"] != 0 else [Fraction(0)] * 3 for k, axis in enumerate(axes)]
    square = times(transpose(driven), driven)
    demand(definite(square), "the wheels do not act about three axes")
    shares = [[-x for x in row] for row in times(driven, inverse(square))]
    begun = [[subject[f"wheel.{k}.momentum"]] for k in range(count)]
    kept = times(shares, times(transpose(axes), begun))
    return shares, [p + more for (p,), (more,) in zip(begun, kept, strict=True)]
