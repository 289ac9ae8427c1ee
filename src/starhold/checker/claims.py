"""The obligations of each kind of claim, and how the checker verifies them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from flint import acb, acb_poly, arb, fmpq, fmpq_mat, fmpq_poly

from starhold.checker.disturbed import Disturbed
from starhold.checker.even_region import EvenRegion
from starhold.checker.exact import (
    ONE,
    CheckError,
    Obligation,
    definite,
    demand,
    has_root_near,
    identity,
    inverse,
    plus,
    rational,
    root_above,
    transpose,
    within_circle,
)
from starhold.checker.frame import is_even
from starhold.checker.loop import ExactLoop
from starhold.checker.odd_region import OddRegion
from starhold.checker.region import BALLS, EXACT, ROOTS, SIGN, Numbers, Region, optional
from starhold.checker.subject import LoopSubject
from starhold.checker.torque import bounded, keeps_within
from starhold.checker.wheels import holds_target, keeps_momenta


@dataclass(frozen=True)
class Kind:
    """A kind of claim: its assumptions, and from subject and claim what has to be shown. `untold`: what a claim without a
    tolerance does not assume; `beside`: what one about a loop with wheels assumes too; `wheels`: whether it is for such
    loops (None: for any)."""

    assumed: tuple[str, ...]
    proofs: Callable[[LoopSubject, Numbers], list[Obligation]]
    untold: str = ""
    beside: tuple[str, ...] = ()
    wheels: bool | None = None

    def assumptions(self, numbers: Numbers, wheels: bool) -> list[str]:
        """The assumptions of a claim with these numbers, about a loop with or without wheels."""
        unlimited = numbers.get("tolerance", 0) is None
        kept = [told for told in self.assumed if not (unlimited and told == self.untold)]
        return [_FREE if told == UNLIMITED else told for told in (*kept, *self.beside)] if wheels else kept


def _region(loop: ExactLoop, level: Any | None, start: Any | None, witness: Numbers) -> OddRegion | EvenRegion:
    return (EvenRegion if is_even(loop) else OddRegion)(loop, level, start, witness)


def claimed(subject: LoopSubject, claim: Numbers) -> OddRegion | EvenRegion:
    """The set that a claim speaks of, with its V."""
    numbers, witness = claim["numbers"], claim["witness"]
    return _region(ExactLoop(subject, optional(witness["stiffness"])), numbers["level"], numbers["start"], witness)


def _names(claim: Numbers) -> list[str]:
    return [obligation["name"] for obligation in claim["obligations"]]


def _told(region: Region[Any], numbers: Numbers, rate: str = "rate") -> Obligation:
    everything = numbers.get("everything", False)

    def contents() -> str:
        return region.contents(numbers["slew_angle"], numbers[rate], numbers["rate_everywhere"], everything)

    return "numbers", "", contents


def _converges(region: Region[Any], claim: Numbers, bounded: bool = False) -> list[Obligation]:
    return [
        ("form", EXACT, region.form),
        ("positive", SIGN, region.positive),
        ("descent", SIGN, region.descent),
        ("target", EXACT, partial(region.target, bounded)),
        region.settles(),
        region.cover(_names(claim)),
    ]


def convergence(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """Every motion from {V <= start} comes to rest on target."""
    region = claimed(subject, claim)
    return [*_converges(region, claim), _told(region, claim["numbers"])]


def torque_limit(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """Motions from {V <= start} keep the torque within the limit, and so come to rest on target as told."""
    region, numbers = claimed(subject, claim), claim["numbers"]

    def torque() -> str:
        demand(numbers["kind"] == subject.limit, "the limit is of another kind than the loop's")
        limit = rational(numbers["limit"])
        demand(subject.torque_limit is not None and limit <= subject.torque_limit, "the loop's limit is lower")
        how = [optional(claim["witness"][name]) for name in ("shift", "weight")]
        demand(keeps_within(region, limit, numbers["kind"] == "axis", *how), "the torque may exceed the limit")
        return "bounded by tangents of a concave function, or on each piece of the law"

    return [*_converges(region, claim), ("torque", BALLS, torque), _told(region, numbers)]


def wheels_limits(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """Motions from {V <= start} keep every motor's torque and every wheel's momentum within its limit, and so come to rest
    on target as told."""
    region, numbers, wheels = claimed(subject, claim), claim["numbers"], subject.wheels
    if wheels is None:
        raise CheckError("there are no wheels")
    told: list[list[Any]] = [[rational(x) for x in numbers[key]] for key in ("motors", "wheel_momentum")]
    demand(all(len(bounds) == len(wheels.axes) for bounds in told), "the bounds are not one for each wheel")
    demand(rational(numbers["momentum"]) == wheels.total, "the total momentum is not that of the loop")
    holds_target(wheels, region.loop.inertia, subject.target_rate)
    demand(wheels.allocation == "least-squares", "the torque is shared out in another way")
    demand(subject.limit == "none" or subject.torque_limit is None, "another limit of the torque may act")
    demand(region.level is not None, "without a level nothing bounds torque and momentum")

    def torque() -> str:
        pieces = region.loop.pieces
        demand(len(pieces) == 1, "the law has several pieces")
        asked = list(pieces[0][1].values())
        for k, (row, most, limit) in enumerate(zip(wheels.least, told[0], wheels.torque_limit, strict=True), 1):
            demand(limit is None or most <= limit, f"the limit of wheel {k} is lower")
            demand(limit != 0 or most == 0, f"wheel {k} gives no torque")
            part: Any = row[0] * asked[0] + row[1] * asked[1] + row[2] * asked[2]
            demand(limit == 0 or bounded(region, [part], most), f"the torque of wheel {k} may be larger")
        return "bounded by tangents of a concave function"

    def momentum() -> str:
        P, J = region.frame.P, region.loop.inertia
        keeps_momenta(wheels, told[1], J, P, region.level, subject.target_rate)
        return "what the wheels exchange among them stays, and V bounds the body's momentum"

    proofs: list[Obligation] = [("torque", BALLS, torque), ("momentum", SIGN, momentum)]
    return [*_converges(region, claim, bounded=True), *proofs, _told(region, numbers)]


def disturbance(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """With any torque from outside up to a bound, motions from {V <= start} end near the target."""
    region, numbers, witness = claimed(subject, claim), claim["numbers"], claim["witness"]
    if isinstance(region, EvenRegion):
        raise CheckError("not for a V even in q")
    proof = Disturbed(subject, region, numbers, witness)
    return [
        ("descent", SIGN, proof.descent),
        ("strict", SIGN, region.strict),
        ("end", SIGN, proof.end),
        ("start", SIGN, proof.start),
        _told(region, numbers, "rate_start"),
    ]


def sampling(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """The linear loop with the torque held for a period is stable."""
    loop, numbers = ExactLoop(subject, quotient=True), claim["numbers"]
    radius, longest = rational(numbers["radius"]), rational(numbers["longest"])

    def at_period() -> str:
        demand(rational(numbers["period"]) == subject.period, "the period is not that of the loop")
        demand(0 < radius < 1, "the radius is not below 1")
        roots = stepped(loop, subject.period)
        demand(within_circle(roots, radius), "an eigenvalue may be larger than the radius")
        eigenvalues_of(roots, numbers["eigenvalues"])
        return "by Routh's array, the circle taken to the half plane"

    def at_longest() -> str:
        demand(
            longest > 0 and within_circle(stepped(loop, longest), fmpq(1)), "the loop may be unstable at the longest period"
        )
        return "by Routh's array, the circle taken to the half plane"

    def between() -> str:
        # With x = 2 (z - 1)/(h (z + 1)): (J - h/2 K_rate) x2 + (K_rate - h/4 K_attitude) x + K_attitude/2.
        rate, attitude = loop.linear()
        demand(rate == transpose(rate) and attitude == transpose(attitude), "the gains are not symmetric")
        kept = (
            attitude,
            plus(subject.inertia, rate, -longest / 2),
            plus(rate, attitude, -longest / 4),
        )
        demand(longest > 0 and all(definite(form) for form in kept), "a form is not definite")
        return "its three forms are definite at the longest, and so at every shorter one"

    proofs: list[Obligation] = [("stable at the period", ROOTS, at_period), ("stable at the longest", ROOTS, at_longest)]
    return [*proofs, ("stable in between", SIGN, between)] if numbers["every_shorter"] else proofs


def eigenvalues_of(coefficients: Sequence[Any], told: Sequence[Sequence[float]]) -> None:
    """A CheckError unless eigenvalues that are told, each as often as it is one, are those of a polynomial: a root is near
    each, and so is the polynomial that they make."""
    product, sizes = acb_poly([1]), fmpq_poly([1])
    for pair in told:
        real, imaginary = map(rational, pair)
        size = root_above(real**2 + imaginary**2)
        near = has_root_near(coefficients, real, imaginary, max(ONE, size) / 10**6)
        demand(near, f"no eigenvalue is near {pair[0]:g} {pair[1]:+g}i")
        product, sizes = product * acb_poly([-acb(arb(real), arb(imaginary)), 1]), sizes * fmpq_poly([size, 1])
    for c, found, size in zip(coefficients, product.coeffs(), sizes.coeffs(), strict=True):
        demand(bool(abs(found - arb(c)) <= arb(size / 10**9)), "an eigenvalue is told too often, or left out")


def stepped(loop: ExactLoop, period: Any) -> list[Any]:
    """The characteristic polynomial of the step over a period, lowest first: near equilibrium J w' = u is constant
    and q' = w/2, so that q gains period w/2 + period2 J^-1 u/4."""
    pulls = [(fmpq_mat(inverse(loop.subject.inertia)) * fmpq_mat(gain) * -period).tolist() for gain in loop.linear()]
    upper = [[*a, *b] for a, b in zip(plus(identity(3), pulls[0]), pulls[1], strict=True)]
    left = plus(identity(3, period / 2), pulls[0], period / 4)
    lower = [[*a, *b] for a, b in zip(left, plus(identity(3), pulls[1], period / 4), strict=True)]
    return fmpq_mat(upper + lower).charpoly().coeffs()


def by_the_kernel(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """Refuse a claim that only the kernel proves."""
    raise CheckError("such a claim comes with a proof, or is not proved")


UNLIMITED, _FREE = "unlimited-torque", "unlimited-wheels"
_BASE = (
    "rigid-body",
    "inertia-as-given",
    "exact-measurement",
    "ideal-actuators",
    "continuous-torque",
    UNLIMITED,
    "known-outside-torque",
)
_BOX = "inertia-near"


def _instead(old: str, *new: str) -> tuple[str, ...]:
    return tuple(found for told in _BASE for found in (new if told == old else (told,)))


CLAIMS: dict[str, Kind] = {
    "convergence": Kind(_BASE, convergence),
    "hand-over": Kind(_BASE, by_the_kernel),
    "torque-limit": Kind(_instead(UNLIMITED), torque_limit, wheels=False),
    "wheels": Kind(_instead(UNLIMITED, "frictionless-wheels", "bounded-momentum"), wheels_limits, wheels=True),
    # What a law cancels of a torque that depends on the inertia is not what another inertia feels.
    "inertia": Kind((_BASE[0], _BOX, *_BASE[2:6], "no-outside-torque", "target-at-rest"), by_the_kernel, _BOX),
    "disturbance": Kind(_instead(_BASE[6], "unknown-outside-torque"), disturbance),
    "sampling": Kind(
        (*_BASE[:4], "linear-motion", _BASE[5], "no-outside-torque"),
        sampling,
        beside=("no-wheels",),
    ),
    "sliding": Kind(_instead(_BASE[6], "bounded-outside-torque"), by_the_kernel),
    "region": Kind(_BASE, by_the_kernel),
}
