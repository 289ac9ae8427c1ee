"""The obligations of each kind of claim, and how the checker verifies them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from flint import acb, acb_poly, arb, fmpq, fmpq_mat, fmpq_poly

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
    times,
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


def _told(region: Region[Any], numbers: Numbers, rate: str = "rate", any_inertia: bool = False) -> Obligation:
    everything = numbers.get("everything", False)

    def contents() -> str:
        return region.contents(numbers["slew_angle"], numbers[rate], numbers["rate_everywhere"], everything, any_inertia)

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


def hand_over(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """Motions from {V <= start} come to rest on target, and the set holds all states with which the mode before may end."""
    region, numbers = claimed(subject, claim), claim["numbers"]
    rate, angle, part = (optional(x) for x in (numbers["rate"], numbers["angle"], claim["witness"]["attitude_level"]))

    def inside() -> str:
        everything, switch = numbers["everything"], subject.switch
        if switch is None:
            raise CheckError("there is no switch")
        for name, most, level in zip(("rate", "angle"), (rate, angle), switch, strict=True):
            demand(most is None or (level is not None and most >= level), f"the switch lets the {name} be larger")
        demand(everything == (region.level is None) == (region.start is None), "only without a level it is everything")
        if everything:
            return "every state is in it"
        start, even = region.start, is_even(region.loop)
        if rate is None or part is None or start is None:
            raise CheckError("the rate is not bounded")
        demand(rate >= 0 and 0 < part <= start, "the rate is negative, or there is no room for the attitude")
        for P in region.frame.tops:
            left = plus(identity(3, 2 * (start - part)), times(rate**2, P), -1)
            demand(definite(left, strictly=False), "with such a rate V may be larger")
        shorter = subject.sign_policy == "shortest" and not even
        if angle is None:
            demand((2 if shorter else 1) * part >= region.highest, "at some attitude V may be larger")
        else:
            # Which of its quaternions tells an attitude matters but for these.
            demand(even or shorter, "an attitude may be told by the longer of its quaternions")
            below = _region(region.loop, numbers["level"], claim["witness"]["attitude_level"], claim["witness"])
            demand(angle >= 0 and below.holds_turn(angle), "at such an angle V may be larger")
        return "its largest V is at most that of the set"

    return [*_converges(region, claim), ("holds what is handed over", BALLS, inside)]


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


def inertia(subject: LoopSubject, claim: Numbers) -> list[Obligation]:
    """Convergence for every inertia of a box, or for every inertia."""
    numbers, witness = claim["numbers"], claim["witness"]
    tolerance, stiffness = optional(numbers["tolerance"]), optional(witness["stiffness"])
    demand(tolerance is None or 0 < tolerance <= 1, "the tolerance is not between 0 and 1")
    loop = ExactLoop(subject, stiffness, shifted=True, tolerance=tolerance)
    region = _region(loop, witness["level"], numbers["start"], witness)
    demand(stiffness is not None or isinstance(region, EvenRegion), "there is no stiffness")
    demand((tolerance is None) == (region.epsilon == 0), "a cross term is for a tolerance, and only for one")
    return [
        ("form", EXACT, region.form),
        ("positive", SIGN, region.positive),
        ("descent", SIGN, region.descent),
        region.settles(),
        region.cover(_names(claim), SIGN),
        _told(region, numbers, any_inertia=tolerance is None),
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


UNLIMITED, _FREE = "torque not limited", "neither torque nor wheels limited, wheels without friction"
_BASE = (
    "rigid body",
    "inertia exactly as given",
    "exact measurement and ideal actuators",
    "torque applied continuously",
    UNLIMITED,
    "no torque from outside but what the law cancels",
)
_BOX = "inertia within the tolerance"


def _instead(old: str, *new: str) -> tuple[str, ...]:
    return tuple(found for told in _BASE for found in (new if told == old else (told,)))


CLAIMS: dict[str, Kind] = {
    "convergence": Kind(_BASE, convergence),
    "hand-over": Kind(_BASE, hand_over),
    "torque-limit": Kind(_instead(UNLIMITED), torque_limit, wheels=False),
    "wheels": Kind(
        _instead(UNLIMITED, "wheels without friction", "total momentum at most as told"), wheels_limits, wheels=True
    ),
    # What a law cancels of a torque that depends on the inertia is not what another inertia feels.
    "inertia": Kind((_BASE[0], _BOX, *_BASE[2:5], "no torque from outside", "target at rest"), inertia, _BOX),
    "pointing": Kind(
        (*_BASE[:2], "torques from outside and errors of the command no larger than told", "torque held between samples"),
        by_the_kernel,
    ),
    "sampling": Kind(
        (*_BASE[:3], "linear motion near rest on a target at rest", _BASE[4], "no torque from outside"),
        sampling,
        beside=("no stored momentum",),
    ),
    "sliding": Kind(_instead(_BASE[5], "torque from outside bounded on each axis"), by_the_kernel),
    "region": Kind(_BASE, by_the_kernel),
}
