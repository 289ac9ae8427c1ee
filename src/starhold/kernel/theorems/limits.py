"""Limits that hold on {V <= level}: of the torque, of the wheels' motors and of their momentum. Proof: docs/kernel.md, 4."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from ..loops import AXES, MOMENTA, NONE, AttitudeLoop
from ..numbers import Rows, definite, demand, inverse, norm, reach, times, transpose
from ..polynomials import Poly, apply, dot, poly, var, variables
from ..programs import joined
from ..rules import Exceeds, Proof, Squares
from ..sentences import Statement, above, below, enumerated

Row: TypeAlias = Sequence[Poly | Fraction | int]
Most: TypeAlias = list[Fraction | None]
TORQUE, UNIT = "torque-limit", variables("d")


class Asking(NamedTuple):
    """A law asks for `command` because of state and momentum alone, which stays within a share of each limit about an axis
    or of a motor. pace: how fast it may approach that (1/s), for each unit that is left. rates: polynomials of the mean
    rates of change of `command` from one sample to the next; rest: bounds of what these are besides, about each axis;
    pushed: of another part, as a vector. begun, still: what is nonnegative, and what is zero, in states at first."""

    share: Fraction
    pace: Fraction
    command: list[Poly]
    rates: list[Poly]
    rest: list[Fraction]
    pushed: Fraction
    begun: list[Poly]
    still: Mapping[str, int]


def within_limits(
    loop: AttitudeLoop,
    less: Fraction = Fraction(0),
    largest: Sequence[Fraction] | None = None,
    between: Fraction = Fraction(0),
    slow: Sequence[Poly] = (),
    asking: Asking | None = None,
) -> Proof:
    """On {V <= level}, or everywhere, with external inputs within their bounds: each component of the torque is at most
    `limit` in size (`limit.norm`: their norm); each listed motor gives at most motors.k, each listed wheel stores at most
    stored.k. less: a bound of the torque error due to wrong inputs of the law. largest: a bound of the torque about each
    axis, errors included, if known. between: a bound of the momentum that wheels store between samples beyond what they
    store at both. slow: what is nonnegative besides, as motions stay slow. asking: what keeps the law within
    limits that it would exceed elsewhere on {V <= level}."""
    numbers, q, w = loop.claim.numbers, loop.q, loop.w
    limit, longest = numbers.get("limit"), numbers.get("limit.norm")
    count = rotors(loop)
    motors, stored = ([numbers.get(f"{name}.{k}") for k in range(count)] for name in ("motors", "stored"))
    limits = [x for x in (*motors, *stored) if x is not None]
    unlimited = ["unlimited-wheels"] * (loop.wheels and (not limits or len(limits) < 2 * count))
    if limit is None and longest is None and not limits:
        return Statement("", ("unlimited-torque", *unlimited))
    known, squared, bounded = list[Poly](), list[Poly](), list[list[Poly]]()
    bounds, assumed = list[str](), list[str]()
    if loop.outside:
        outside = [numbers[f"outside.{k}"] for k in range(3)]
        known += [most - sign * e for most, e in zip(outside, loop.e, strict=True) for sign in (1, -1)]
        # A norm multiplies them by the unit vector, which needs their squares.
        squared = [most * most - e * e for most, e in zip(outside, loop.e, strict=True)]
        bounds.append(f"a torque from outside of up to {', '.join(map(below, outside))} N m about the axes")
        assumed.append("bounded-outside-torque")
    vectors = [("target.rate", loop.r, "a target that turns at up to {} rad/s")] * loop.moving
    vectors += [("target.acceleration", loop.a, "a target that speeds up by up to {} rad/s^2")] * loop.moving
    vectors += [("momentum", loop.H, "a momentum of up to {} N m s")] * loop.wheels
    balls = [numbers[name] * numbers[name] - dot(vector, vector) for name, vector, _ in vectors]
    known += balls
    for name, vector, text in vectors:
        bounded.append(vector)
        bounds.append(text.format(below(numbers[name])))
    assumed += ["bounded-target"] * loop.moving + ["bounded-momentum"] * loop.wheels + unlimited
    if count > len(AXES) and any(x is not None for x in stored):
        # Friction, an error of the command, moves momentum between more than three rotors.
        assumed += ["spare-momentum"] * any(numbers.get(name) for name in ("error", "error.per.rate"))
    known += [*(level - loop.lyapunov for level in (numbers.get("level"),) if level is not None), *slow]
    said, none = list[str](), poly(0)
    reduced = [None if x is None else x - less for x in (limit, longest)]
    limited = [(*load, none) for load in loads("torque", *reduced)] if largest is None else []
    for name, bound in (("torque", limit), ("norm of the torque", longest)):
        if bound is not None and largest is not None:
            yield name, Exceeds(bound, max(largest) if bound is limit else norm(largest))
    if limit is not None:
        said.append(f"the law asks for no more than {above(limit)} N m about any axis")
    if longest is not None:
        said.append(f"the law asks for a torque of no more than {above(longest)} N m")
    if limits:
        shares, kept = allocated(loop, motors)
        # The rotors' momenta change by share.(torque), the wheels' together by its negative.
        stores = [keeps - p for keeps, p in zip(kept, apply(shares, loop.stored), strict=True)]
        for k, row in enumerate(shares):
            given = motors[k]
            driven, kept_at = (None if x is None else x - norm(row) * y for x, y in ((given, less), (stored[k], between)))
            for name, most, load, rest in (("motor", driven, row, none), ("wheel", kept_at, NONE, stores[k])):
                if most is None:
                    continue
                for sign in (1, -1):
                    limited.append((f"{name} {sign * (k + 1):+d}", most, [sign * x for x in load], sign * rest))
        for text, unit, bound_of in (("motors give", "N m", motors), ("wheels store", "N m s", stored)):
            if any(x is not None for x in bound_of):
                said.append(f"{text} no more than {', '.join('inf' if x is None else above(x) for x in bound_of)} {unit}")
    approached = [] if asking is None else list(approaches(asking, limited, less))
    known += [room for *_, room, _ in approached]
    for name, bound, row, rest in limited:
        used = [k for k in AXES if poly(row[k]).terms]
        cases = joined(loop.law[k] for k in used)
        for n, case in enumerate(cases):
            load = rest + dot([row[k] for k in used], case.value)
            # Of what is bounded from outside only what the load depends on.
            felt = [vector for vector in bounded if any(x.names <= load.names for x in vector)]
            turned = bool(squared) and row is UNIT
            felt += [loop.e] * turned
            z = [poly(1), *q, *w, *(x for vector in felt for x in vector)]
            if load.terms:
                full = name if len(cases) == 1 else f"{name} {n}"
                yield full, within(bound, load, z, w, [*case.known, *squared * turned, *known], [loop.sphere])
    if asking is not None:
        for what, place, room, left in approached:
            # That of momentum is the last.
            momentum, ball = (loop.H, balls[-1:]) if heeds_momentum([room]) else ([], [])
            z = [poly(1), *q, *w, *momentum]
            first = Squares(room.at(asking.still), z, 0, [*asking.begun, *ball], [loop.sphere])
            yield f"{what} at first {place}", first
            turned = [x * x * p for x in w for p in ball]
            yield f"{what} falls {place}", Squares(left, basis(loop, left), 0, [*known, *turned], [loop.sphere])
    with_ = f"with {enumerated(bounds)} " if bounds else ""
    return Statement(with_ + enumerated(said), tuple(assumed), "wheels" if limits else TORQUE)


def approaches(
    asking: Asking, limited: Sequence[tuple[str, Fraction, Row, Poly]], less: Fraction
) -> Iterator[tuple[str, str, Poly, Poly]]:
    """Yield for limits of the torque about an axis and of motors, reduced by `less` for each unit of the torque, their names
    and places, what is left of the law's share of them, and of its pace less the rate at which it approaches that."""
    for name, bound, row, rest in limited:
        exact = [Fraction(x) for x in row if not isinstance(x, Poly)]
        if len(exact) == len(AXES) and any(exact) and not rest.terms:
            what, place = name.split()
            room = asking.share * (bound + norm(exact) * less) - dot(exact, asking.command)
            more = reach([exact], asking.rest)[0] + norm(exact) * asking.pushed
            yield what, place, room, asking.pace * room - dot(exact, asking.rates) - more


def basis(loop: AttitudeLoop, p: Poly) -> list[Poly]:
    """Return the terms whose squares and products a polynomial in attitude, rate and momentum may be a sum of."""
    z, stored = [poly(1), *loop.q, *loop.w], heeds_momentum([p])
    if stored:
        z += [*loop.H, *(a * b for a in loop.w for b in loop.H)]
    if p.degree > 3 or stored:
        z += [a * b for k, a in enumerate(loop.q) for b in loop.q[max(k, not stored) :]]
    elif p.degree > 2:
        z += [a * b for a in loop.q for b in loop.w]
    return z


def heeds_momentum(parts: Sequence[Poly]) -> bool:
    """Return whether some of these depend on the wheels' momentum."""
    return any(not p.names.isdisjoint(MOMENTA) for p in parts)


def loads(name: str, axis: Fraction | None, norm: Fraction | None) -> Iterator[tuple[str, Fraction, Row]]:
    """Yield rows whose product with u is at most `axis` for components of u within it, and at most `norm` for |u| within it:
    all unit vectors d."""
    if axis is not None:
        yield from ((f"{name} {sign * (k + 1):+d}", axis, [sign * (i == k) for i in AXES]) for k in AXES for sign in (1, -1))
    if norm is not None:
        yield f"norm of the {name}", norm, UNIT


def within(
    bound: Fraction, load: Poly, z: list[Poly], paired: Sequence[Poly], known: Sequence[Poly], modulo: list[Poly]
) -> Squares:
    """Return the obligation that a load is at most its bound; `paired` are the terms for the unit vector of a norm."""
    if not UNIT[0].names <= load.names:
        return Squares(bound - load, z, 0, known, modulo)
    more = [*UNIT, *(d * x for d in UNIT for x in paired)]
    # A torque with products of attitudes in it needs their squares.
    attitude = [x for x in z if x.names & {"q1", "q2", "q3"}]
    if any(sum(name[0] == "q" for name in m) == 2 for m in load.terms):
        more += [a * b for k, a in enumerate(attitude) for b in [var("q0"), *attitude[k:]]]
    return Squares(bound - load, [*z, *more], 0, known, [*modulo, dot(UNIT, UNIT) - 1])


def rotors(loop: AttitudeLoop) -> int:
    """Return how many wheels a claim lists."""
    return next(k for k in range(1000) if not loop.wheels or f"wheel.{k}.axis.0" not in loop.claim.subject)


def axes_of(loop: AttitudeLoop) -> Rows:
    """Return the axes of these wheels."""
    return [[loop.claim.subject[f"wheel.{k}.axis.{i}"] for i in AXES] for k in range(rotors(loop))]


def allocated(loop: AttitudeLoop, motors: Most) -> tuple[Rows, list[Fraction]]:
    """Return for each wheel its share of the body's torque, and the momentum that it keeps whatever the body does: the rows
    of L = -A'(AA')^-1 and p + Lh. A motor declared to give nothing has no share."""
    subject = loop.claim.subject
    axes = axes_of(loop)
    driven = [axis if most != 0 else [Fraction(0)] * 3 for axis, most in zip(axes, motors, strict=True)]
    square = times(transpose(driven), driven)
    demand(definite(square), "the wheels do not act about three axes")
    shares = [[-x for x in row] for row in times(driven, inverse(square))]
    begun = [[subject[f"wheel.{k}.momentum"]] for k in range(len(axes))]
    kept = times(shares, times(transpose(axes), begun))
    return shares, [p + more for (p,), (more,) in zip(begun, kept, strict=True)]
