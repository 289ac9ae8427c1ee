"""The theorem about a law that opposes the change of the magnetic field: in which control periods the kinetic energy
decreases, by how much it increases at most in the others, and how often those occur. Proof: docs/kernel.md, section 11."""

from __future__ import annotations

from fractions import Fraction
from itertools import count
from typing import NamedTuple

from ..loops import AttitudeLoop, wired
from ..numbers import demand, plus, scalar, up
from ..polynomials import Poly, apply, cross, dot, minus, poly, var, variables
from ..programs import condition
from ..reading import Claim
from ..rules import Definite, Exceeds, Proof, Shown, Squares, vanish
from ..sentences import Statement, above, below


class Power(NamedTuple):
    """Polynomials in m bound the power of a control period in which the field turns in the body at the mean rate m, over it
    and the period before. `free`: with rods within their limit, with a negative coefficient of m^2. With rods at the limit
    the power is at most `others`, and where `free` is negative it is at most -c if `limited` is at least c `seen`."""

    free: Poly
    others: Poly
    limited: Poly
    seen: Poly


def detumbles(claim: Claim) -> Proof:
    """In each control period from the second measurement on in which, as in the two before, the body turns no faster than
    rate.k, its kinetic energy decreases if the held field turns in it by more than above.k on average, from the sample
    before to the one after; by fall.k times the period if by more than often.k; otherwise it increases by at most rise.k
    times the period; for each k that is stated. So the field turns faster than often.k for only a part of any time. Rods
    give dipoles of up to dipole.limit each; the field is at least field.least, and changes from sample to sample by at most
    field.change times itself and the period; external torques are at most `outside`, and others, at right angles to the
    field, at most outside.across. Wheels, if there are any, keep a momentum of up to `stored`. Commanded torques are given
    in full up to `limit`, or all of them without a limit."""
    loop, numbers = AttitudeLoop(claim, quotients=True), claim.numbers
    low, high = numbers["inertia.low"], numbers["inertia.high"]
    yield from loop.sound()
    yield from opposes_change(loop)
    yield "least moment", Definite(plus(loop.given, scalar(low), -1))
    yield "largest moment", Definite(plus(scalar(high), loop.given, -1))
    # |J^-1 (w x Jw)| <= gyroscopic |w|^2.
    w, turning = loop.w, apply(loop.J_inverse, cross(loop.w, apply(loop.J, loop.w)))
    squares = [a * b for k, a in enumerate(w) for b in w[k:]]
    size = numbers["gyroscopic"] * dot(w, w)
    yield "gyroscopic", Squares(size * size - dot(turning, turning), squares, 0)
    texts = list[str]()
    for k in count():
        if f"rate.{k}" not in numbers:
            break
        rate, least, often, fall, rise = (numbers[f"{name}.{k}"] for name in ("rate", "above", "often", "fall", "rise"))
        power = power_at(loop, rate)
        if "limit" in numbers:
            yield f"limit {k}", Exceeds(numbers["limit"], loop.claim.subject["gains.k"] * (rate + numbers["field.change"]))
        # These signs last beyond m: but for m^2 no coefficient of `free` is negative, and none of `limited` positive.
        for name, m, c in (("falls", least, Fraction(0)), ("falls by a part", often, fall)):
            yield f"energy {name} {k}", Exceeds(-value(power.free, m), c)
            yield f"energy {name} at the limit {k}", Exceeds(value(power.limited, m), c * value(power.seen, m))
        yield f"energy rises {k}", Exceeds(rise, max(highest(power.free), value(power.others, least)))
        more = fall + rise
        demand(more > 0, "the energy does not fall")
        spell, share = high * rate * rate / 2 / more, rise / more
        texts.append(
            f"at up to {below(rate)} rad/s above {above(least)} rad/s, and else rises by {above(rise)} W at most, so that it"
            f" is above {above(often)} rad/s for at most {above(spell)} s and {above(share)} of the time"
        )
    demand(bool(texts), "no rate is stated")
    wheels = f"wheels that keep up to {below(numbers['stored'])} N m s, " if loop.wheels else ""
    text = (
        "in each control period the kinetic energy falls where the field turns in the body, in the mean of it and the one"
        f" before, faster than told: {'; '.join(texts)}; for rates in these two and the one before; with {wheels}rods of"
        f" up to {below(numbers['dipole.limit'])} A m2, a field of at least {above(numbers['field.least'])} T that changes"
        f" by no more than {below(numbers['field.change'])} of itself per second, and torques from outside of up to"
        f" {below(numbers['outside'])} N m and, at right angles to the field, {below(numbers['outside.across'])} N m"
    )
    if "limit" in numbers:
        text += f", and a torque of up to {below(numbers['limit'])} N m given in full to the rods"
    assumed = ["rigid-body", "inertia-as-given", "exact-measurement", "bounded-outside-torque", "held-field", "rods-alike"]
    assumed += [] if "limit" in numbers else ["unlimited-torque"]
    return Statement(text, (*assumed, "idle-wheels" if loop.wheels else "no-wheels"), "detumbling")


def opposes_change(loop: AttitudeLoop) -> Shown:
    """With a field b the law remembers it, and its torque is m x b with m = -k (b - b before)/(period |b|^2), or none at the
    first measurement, before which no field is known."""
    b, before, subject = variables("b"), variables("m"), loop.claim.subject
    # The measured fields that the kernel knows; a law that flies could read others.
    fields = {name.rpartition(".")[0] for name in loop.claim.programs["law"].inputs if name.startswith("measurement.")}
    demand(fields <= {"measurement", "measurement.magnetic_field"}, "the law is given more than the field")
    square, gain = dot(b, b), -subject["gains.k"] / subject["measurement.period"]
    for name, known in (("first torque", 0), ("torque", 1)):
        outputs = loop.read("law", 7, wired("memory.field", before) | {"memory.known": poly(known)})
        values = [[case.value for case in cases if case.guards <= {(condition(square), True)}] for cases in outputs]
        demand(all(len(one) == 1 for one in values), "the law switches where there is a field")
        torque, after = [one[0] for one in values[:3]], [one[0] for one in values[3:]]
        divisors = loop.divisors
        demand(len(divisors) == 1, "the law does not divide by the field's square alone")
        ((divided, divisor),) = divisors.items()
        yield from vanish("square of the field", [divisor - square], first=known)
        wanted = [known * gain * var(divided) * part for part in cross(minus(b, before), b)]
        yield from vanish(f"{name} of the law", minus(torque, wanted))
        yield from vanish("memory of the law", minus(after, [*b, poly(1)]), first=4 * known)


def power_at(loop: AttitudeLoop, rate: Fraction) -> Power:
    """Return a bound of the power of a period while the body turns no faster than a rate (rad/s)."""
    numbers, subject, m = loop.claim.numbers, loop.claim.subject, var("m")
    k, h, low = subject["gains.k"], subject["measurement.period"], numbers["inertia.low"]
    change, outside, across = (numbers[name] for name in ("field.change", "outside", "outside.across"))
    demand(min(k, h, low, rate) > 0 and h * rate < 1, "the body turns too far in a period")
    # The rate at which the field turns changes by no more than turned m + begun per second.
    torque = k * (rate + change) + outside + across + (rate * numbers["stored"] if loop.wheels else 0)
    turned, begun = rate / (1 - h * rate), up((numbers["gyroscopic"] * rate * rate + torque / low) / (1 - h * rate))
    bent = (turned * m + begun) * (h / 2)
    mean = m + bent
    opposed = m * m - bent * bent - (mean + mean * mean * (h / 2)) * change
    demand(opposed.terms.get(("m", "m"), 0) > 0, "the body turns too far in a period")
    others = (1 + h * turned) * across * m + rate * outside + across * h * begun
    # Rods at their limit give at least this torque, and the law commands k times the rate at which it sees the field turn.
    most, seen = numbers["dipole.limit"] * numbers["field.least"], mean + change
    return Power(others - opposed * k, others, opposed * most - others * seen, seen)


def value(p: Poly, m: Fraction | int) -> Fraction:
    """Return the value at m."""
    return p.at({"m": m}).number


def highest(p: Poly) -> Fraction:
    """Return the largest value of a quadratic polynomial with a negative second derivative."""
    slope = p.slope("m")
    return value(p, -value(slope, 0) / value(slope.slope("m"), 0))
