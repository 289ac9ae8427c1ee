"""What each kind of claim obliges to, and how its checker verifies that. Nothing here is shared with the certifier."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flint import arb, fmpq, fmpq_mat

from starhold.certification.checker.exact import (
    ZERO,
    Obligation,
    definite,
    demand,
    down,
    greatest,
    has_root_near,
    inverted,
    plus,
    rational,
    root_up,
    times,
    turned,
    unit,
    within_circle,
)
from starhold.certification.checker.loop import Loop
from starhold.certification.checker.region import BALLS, EXACT, LASALLE, ROOTS, SIGN, Numbers, Region, optional
from starhold.certification.checker.subject import Subject
from starhold.certification.checker.surface import Sliding
from starhold.certification.checker.torque import keeps_within


@dataclass(frozen=True)
class Kind:
    """A kind of claim: its assumptions, and from subject, numbers and witness what has to be shown. `untold`: what a claim
    without a tolerance does not assume."""

    assumed: tuple[str, ...]
    proofs: Callable[[Subject, Numbers, Numbers], list[Obligation]]
    untold: str = ""

    def assumptions(self, numbers: Numbers) -> list[str]:
        """What a claim with these numbers assumes."""
        unlimited = numbers.get("tolerance", 0) is None
        return [told for told in self.assumed if not (unlimited and told == self.untold)]


def _region(subject: Subject, numbers: Numbers, witness: Numbers) -> Region:
    return Region(Loop(subject, optional(witness.get("stiffness"))), numbers["level"], numbers["start"], witness)


def _told(region: Region, numbers: Numbers, rate: str = "rate", any_inertia: bool = False) -> Obligation:
    everything = numbers.get("everything", False)

    def contents() -> str:
        return region.contents(numbers["turn"], numbers[rate], numbers["rate_everywhere"], everything, any_inertia)

    return "numbers", "", contents


def _converges(region: Region) -> list[Obligation]:
    return [
        ("form", EXACT, region.form),
        ("positive", SIGN, region.positive),
        ("descent", SIGN, region.descent),
        ("target", EXACT, region.target),
        ("only rest", LASALLE, region.only_rest) if region.epsilon == 0 else ("strict", SIGN, region.strict),
        region.cover(),
    ]


def convergence(subject: Subject, numbers: Numbers, witness: Numbers) -> list[Obligation]:
    """Every motion from {V <= start} comes to rest on target."""
    region = _region(subject, numbers, witness)
    return [*_converges(region), _told(region, numbers)]


def torque_limit(subject: Subject, numbers: Numbers, witness: Numbers) -> list[Obligation]:
    """Motions from {V <= start} keep the torque within the limit, and so come to rest on target as told."""
    region = _region(subject, numbers, witness)

    def torque() -> str:
        demand(numbers["kind"] == subject.limit, "the limit is of another kind than the loop's")
        limit = rational(numbers["limit"])
        demand(subject.torque_limit is not None and limit <= subject.torque_limit, "the loop's limit is lower")
        demand(keeps_within(region.loop, region.level, limit, numbers["kind"] == "axis"), "the torque may exceed the limit")
        return "bounded by tangents of a concave function, or on each piece of the law"

    return [*_converges(region), ("torque", BALLS, torque), _told(region, numbers)]


def inertia(subject: Subject, numbers: Numbers, witness: Numbers) -> list[Obligation]:
    """Convergence for every inertia of a box, or for every inertia."""
    tolerance = optional(numbers["tolerance"])
    demand(tolerance is None or 0 < tolerance <= 1, "the tolerance is not between 0 and 1")
    loop = Loop(subject, optional(witness["stiffness"]), shifted=True, tolerance=tolerance)
    region = Region(loop, witness["level"], numbers["start"], witness)
    demand((tolerance is None) == (region.epsilon == 0), "a cross term is for a tolerance, and only for one")
    return [
        ("form", EXACT, region.form),
        ("positive", SIGN, region.positive),
        ("descent", SIGN, region.descent),
        ("only rest", LASALLE, region.only_rest) if region.epsilon == 0 else ("strict", SIGN, region.strict),
        region.cover(SIGN),
        _told(region, numbers, any_inertia=tolerance is None),
    ]


def disturbance(subject: Subject, numbers: Numbers, witness: Numbers) -> list[Obligation]:
    """With any torque from outside up to a bound, motions from {V <= start} end near the target."""
    region = _region(subject, numbers, witness)
    q_rate, q_attitude = rational(witness["q_rate"]), rational(witness["q_attitude"])
    torque, epsilon, rho = rational(numbers["torque"]), region.epsilon, region.rho

    def descent() -> str:
        demand(q_rate > 0 and q_attitude > 0 and epsilon > 0, "a share of the fall is not positive")
        region.target()
        return region.descent(q_rate, q_attitude)

    def ball() -> tuple[Any, Any]:
        """The largest |w| and |q| where V + epsilon C may rise: within an ellipse."""
        push = root_up(greatest((fmpq_mat(turned(region.loop.frame.W)) * fmpq_mat(region.loop.frame.W)).tolist()))
        square = torque**2 * (push**2 / (4 * q_rate) + epsilon**2 / (4 * q_attitude))
        x = torque * push / (2 * q_rate) + root_up(square / q_rate)
        return x, torque * epsilon / (2 * q_attitude) + root_up(square / q_attitude)

    def end() -> str:
        frame = region.loop.frame
        felt = subject.disturbance + (subject.modelled_norm if frame.felt else ZERO)
        demand(torque >= felt, "the torque from outside may be larger")
        x, y = ball()
        demand(y < 1, "the ball reaches every attitude")
        level = (1 + rho) / (1 - rho) * (greatest(frame.P) * x**2 / 2 + frame.s * y**2)
        demand(region.start is not None and level < region.start, "the end is no lower than the start")
        angle, rate = rational(numbers["angle"]), rational(numbers["rate"])
        demand(0 <= angle <= down(arb.pi()), "the angle is not between 0 and a half turn")
        demand(down(arb(frame.s) * (1 - (arb(angle) / 2).cos())) >= level, "the angle may end larger")
        demand(rate >= 0, "the rate is negative")
        held = plus(times(rate**2, frame.P), unit(3, 2 * level), -1)
        demand(definite(held, strictly=False), "the rate may end larger")
        return "V + epsilon C falls outside an ellipse that is within the end"

    def start() -> str:
        region.strict()
        s, cover, y = region.loop.frame.s, subject.cover, ball()[1]
        if cover == "shortest":
            region.single()
        elif cover == "hysteresis":
            region.jumps()
            demand(y**2 < 1 - subject.width**2, "the ball around the other rest may be reached")
        else:
            # Near the other rest, |q| <= y and q0 < 0, V is at least s (1 + sqrt(1 - y2)).
            demand(region.level is not None and region.level < s * (2 - y**2), "the ball around the other rest may be met")
        return "the level set holds one ball only"

    return [
        ("descent", SIGN, descent),
        ("strict", SIGN, region.strict),
        ("end", SIGN, end),
        ("start", SIGN, start),
        _told(region, numbers, "rate_start"),
    ]


def sampling(subject: Subject, numbers: Numbers, witness: Numbers) -> list[Obligation]:
    """The linear loop with the torque held for a period is stable."""
    loop = Loop(subject)
    radius, longest = rational(numbers["radius"]), rational(numbers["longest"])

    def at_period() -> str:
        demand(rational(numbers["period"]) == subject.period, "the period is not that of the loop")
        demand(0 < radius < 1, "the radius is not below 1")
        roots = stepped(loop, subject.period)
        demand(within_circle(roots, radius), "an eigenvalue may be larger than the radius")
        for real, imaginary in numbers["eigenvalues"]:
            near = has_root_near(roots, rational(real), rational(imaginary), fmpq(1, 10**6))
            demand(near, f"no eigenvalue is near {real:g} {imaginary:+g}i")
        return "by Routh's array, the circle taken to the half plane"

    def at_longest() -> str:
        demand(
            longest > 0 and within_circle(stepped(loop, longest), fmpq(1)), "the loop may be unstable at the longest period"
        )
        return "by Routh's array, the circle taken to the half plane"

    def between() -> str:
        # With x = 2 (z - 1)/(h (z + 1)): (J - h/2 K_rate) x2 + (K_rate - h/4 K_attitude) x + K_attitude/2.
        rate, attitude = loop.linear()
        demand(rate == turned(rate) and attitude == turned(attitude), "the gains are not symmetric")
        kept = (
            attitude,
            plus(subject.inertia, rate, -longest / 2),
            plus(rate, attitude, -longest / 4),
        )
        demand(longest > 0 and all(definite(form) for form in kept), "a form is not definite")
        return "its three forms are definite at the longest, and so at every shorter one"

    proofs: list[Obligation] = [("stable at the period", ROOTS, at_period), ("stable at the longest", ROOTS, at_longest)]
    return [*proofs, ("stable in between", SIGN, between)] if numbers["every_shorter"] else proofs


def stepped(loop: Loop, period: Any) -> list[Any]:
    """The characteristic polynomial of the step over a period, lowest coefficient first: near rest J w' = u is constant and
    q' = w/2, so that q gains period w/2 + period2 J^-1 u/4."""
    pulls = [(fmpq_mat(inverted(loop.subject.inertia)) * fmpq_mat(gain) * -period).tolist() for gain in loop.linear()]
    upper = [[*a, *b] for a, b in zip(plus(unit(3), pulls[0]), pulls[1], strict=True)]
    left = plus(unit(3, period / 2), pulls[0], period / 4)
    lower = [[*a, *b] for a, b in zip(left, plus(unit(3), pulls[1], period / 4), strict=True)]
    return fmpq_mat(upper + lower).charpoly().coeffs()


def sliding(subject: Subject, numbers: Numbers, witness: Numbers) -> list[Obligation]:
    """A law with a surface reaches it against torque from outside, and ends on target or near it."""
    proof = Sliding(subject, numbers)
    found: list[Obligation] = [
        ("form", EXACT, proof.form),
        ("reach exceeds torque", SIGN, proof.reaches),
        ("surface holds the target", SIGN, proof.holds),
    ]
    if proof.layered():
        found.append(("layer", SIGN, proof.layer))
    last = "other rest repels" if subject.cover == "as_published" else "no switch of the double cover"
    return [*found, (last, SIGN, proof.cover), ("numbers", "", proof.ends)]


_BASE = (
    "rigid body",
    "inertia exactly as given",
    "exact measurement and ideal actuators",
    "torque applied continuously",
    "torque not limited",
    "no torque from outside but what the law cancels",
)
_BOX = "inertia within the tolerance"


def _instead(old: str, *new: str) -> tuple[str, ...]:
    return tuple(found for told in _BASE for found in (new if told == old else (told,)))


CLAIMS: dict[str, Kind] = {
    "convergence": Kind(_BASE, convergence),
    "torque-limit": Kind(_instead("torque not limited"), torque_limit),
    # What a law cancels of a torque that depends on the inertia is not what another inertia feels.
    "inertia": Kind((_BASE[0], _BOX, *_BASE[2:5], "no torque from outside", "target at rest"), inertia, _BOX),
    "disturbance": Kind(_instead(_BASE[5], "torque from outside bounded in norm"), disturbance),
    "sampling": Kind(
        (*_BASE[:3], "linear motion near rest on a target at rest", _BASE[4], "no torque from outside"), sampling
    ),
    "sliding": Kind(_instead(_BASE[5], "torque from outside bounded on each axis"), sliding),
}
