"""The claim that every motion from {V <= start} comes to rest on target, and which part the quaternion sign plays in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from starhold.algebra.polynomial import Polynomial, exact, pieces
from starhold.certification.assumptions import UNLIMITED, WHEELS
from starhold.certification.certificate import EXACT, EXACT_SIGN, LASALLE, Claim, Obligation
from starhold.certification.frame import (
    Cross,
    Frame,
    contents,
    decrease,
    felt_share,
    margin,
    take_apart,
    take_cross,
)
from starhold.certification.matrices import (
    Rows,
    characteristic_roots,
    definite,
    floats,
    identity,
    inverse,
    least,
    matmul,
    number,
    symmetric_part,
    times,
    transpose,
)
from starhold.certification.motion import AXES, RATE, Motion, ShapeError, at_rest, cases
from starhold.certification.refutation import rising_state, unlike_positive
from starhold.certification.subject import Subject, below

ASSUMPTIONS = (
    "rigid-body",
    "inertia-as-given",
    "exact-measurement",
    "ideal-actuators",
    "continuous-torque",
    UNLIMITED,
    "known-outside-torque",
)
ALMOST = fmpq(2**20 - 1, 2**20)
"""How much of a bound that must not be reached is used."""


def assumed(subject: Subject, **instead: tuple[str, ...]) -> tuple[str, ...]:
    """The assumptions of claims of convergence about a subject, with others in place of `limits` and `outside`."""
    limits, outside = ASSUMPTIONS[5:]
    if subject.loop.wheels is not None:
        limits = WHEELS
    return (*ASSUMPTIONS[:5], *instead.get("limits", (limits,)), *instead.get("outside", (outside,)))


@dataclass(frozen=True)
class Basin:
    """{V <= start} stays in {V <= stay} (None: everything), where rates are below `bound`, and converges; what later claims
    build on."""

    motion: Motion
    frame: Frame
    cross: Cross | None
    epsilon: Any
    rho: Any
    bound: Any | None
    stay: Any | None

    @property
    def start(self) -> Any | None:
        """The level from which motions stay below `stay`."""
        return self.start_of(self.stay)

    def start_of(self, stay: Any | None) -> Any | None:
        """The level, exactly a float, from which motions stay below another one."""
        return None if stay is None else exact(below(stay * (1 - self.rho) / (1 + self.rho)))


def converge(subject: Subject, rate: Any = "best") -> tuple[Claim, Basin | None, Basin | None]:
    """The strongest claim and its basin, by the law's own V or by the kinetic energy in its place, see `convergence`; and
    the basin that the law's own V has for whatever rates it can."""
    motion = Motion(subject)
    own, basin = convergence(motion, rate)
    best = basin if basin is not None or rate == "best" else convergence(motion)[1]
    if own.outcome == "proved" and own.numbers["everything"]:
        return own, basin, best
    for stiffness in stiffnesses(motion):
        other, found = convergence(Motion(subject, stiffness), rate)
        if other.outcome == "proved" and (own.outcome != "proved" or other.numbers["everything"]):
            return other, found, best
    return own, basin, best


def stiffnesses(motion: Motion) -> list[Any]:
    """Stiffnesses for which the attitude's part of V' nearly cancels: between the law's smallest and its largest."""
    try:
        K = symmetric_part(motion.linear()[1])
    except ShapeError:
        return []
    values = np.linalg.eigvalsh(floats(K))
    if values[0] <= 0.0:
        return []
    if values[-1] <= values[0] * (1.0 + 1e-9):
        return [exact(number(K[0][0]))]
    ratio = float(values[-1] / values[0])
    between = [float(values[0]) * ratio ** (step / 6.0) for step in (3, 4, 2, 5, 1, 6, 0)]
    return [exact(float(f"{k:.4g}")) for k in between]


def convergence(motion: Motion, rate: Any = "best") -> tuple[Claim, Basin | None]:
    """The claim by one V, with the largest level or, with `rate`, for every attitude and rates up to it (None: any)."""
    found = Obligations()
    numbers: dict[str, Any] = {} if rate == "best" else {"rate_everywhere": rate, "everything": rate is None}
    witness: dict[str, Any] = {}

    def finish(basin: Basin | None = None) -> tuple[Claim, Basin | None]:
        return Claim("convergence", numbers, witness, assumed(motion.subject), tuple(found)), basin

    try:
        frame = take_apart(motion)
    except ShapeError as reason:
        found.add("form", EXACT, None, {"reason": str(reason)})
        return finish()
    found.add("form", EXACT, True)
    positive = definite(frame.P) and frame.potential.positive
    if not positive:
        against = unlike_positive(frame)
        found.add("positive", EXACT_SIGN, False if "state" in against else None, against)
        return finish()
    found.add("positive", EXACT_SIGN, True)
    slopes = cases(motion.along(motion.lyapunov or Polynomial.constant(0)))

    def rising(reason: str) -> None:
        # Where no set is asked for, only a V that rises however near the target is refuted; of a claim up to a rate, a state
        # that turns faster is no refutation.
        near = not (frame.exact and definite(symmetric_part(frame.D)))
        most, tries = None if rate in ("best", None) else exact(rate), max(200 // len(slopes), 10)
        states = (rising_state(*piece, most, tries) for piece in slopes if rate != "best" or near)
        evidence = next((state for state in states if state is not None), None)
        found.add("descent", EXACT_SIGN, False if evidence else None, evidence or {"reason": reason})

    if not (definite(symmetric_part(frame.D)) if frame.whole else all(_falls(*piece) for piece in slopes)):
        rising("V' may be positive")
        return finish()
    cross, epsilon, rho, bound = None, fmpq(0), fmpq(0), None
    if frame.exact:
        if frame.K.terms:
            bound = exact(below(least(symmetric_part(frame.D)) * ALMOST / frame.cubic))
            if bound <= 0:
                rising("the damping around the equilibrium is not definite, or too weak for what is cubic in the rate")
                return finish()
    else:
        strict = _strict(motion, frame)
        if strict is None:
            rising("no weight of the cross term was found for which V falls")
            return finish()
        cross, epsilon, rho, bound = strict
    level = _capped(None if bound is None else least(frame.P) * bound * bound / 2, motion, frame, rho)
    level = None if level is None else exact(below(level))
    basin = Basin(motion, frame, cross, epsilon, rho, bound, level)
    start = basin.start
    reached_set = {"level": None if level is None else number(level), "start": None if start is None else number(start)}
    reached_set |= contents(start, frame.P, frame.potential)
    if rate != "best" and not _covers(reached_set, rate):
        rising("not shown up to this rate")
        return finish()
    numbers |= reached_set
    obligations, proof = reached(basin, level)
    found.extend(obligations[2:])
    witness |= proof
    return finish(basin if found.proved else None)


def reached(basin: Basin, level: Any | None, bounded: bool = False) -> tuple[list[Obligation], dict[str, Any]]:
    """The obligations of convergence from a level that the basin holds, and their witness. `bounded`: the momentum that
    wheels store is assumed to be."""
    motion, found = basin.motion, Obligations()
    for name, how in (("form", EXACT), ("positive", EXACT_SIGN), ("descent", EXACT_SIGN)):
        found.add(name, how, True)
    reason = _depends_on(motion, bounded)
    found.add("target", EXACT, None if reason else True, {"reason": reason} if reason else {})
    if basin.cross is None:
        # Without terms of V' that are linear in the rate, the torque at rest is the slope of the potential.
        found.add("only equilibrium", LASALLE, *((True, None) if basin.frame.potential.even else _only_equilibrium(motion)))
    else:
        found.add("strict", EXACT_SIGN, True)
    found.add(*_quaternion_sign(motion, basin.frame, level))
    witness = {
        "stiffness": None if motion.stiffness is None else number(motion.stiffness),
        "epsilon": number(basin.epsilon),
        "rho": number(basin.rho),
        "rate_bound": None if basin.bound is None else number(basin.bound),
    }
    return found, witness


class Obligations(list[Obligation]):
    """Obligations as they are met: True is proved, False refuted, None undecided."""

    def add(self, name: str, how: str, holds: bool | None, evidence: dict[str, Any] | None = None) -> None:
        outcome = "proved" if holds else "undecided" if holds is None else "refuted"
        self.append(Obligation(name, how, outcome, evidence or {}))

    @property
    def proved(self) -> bool:
        """Whether all are."""
        return all(obligation.outcome == "proved" for obligation in self)


def _falls(truths: Any, slope: Polynomial) -> bool:
    """Whether a piece of V' that is a sum of polynomials of single rates is negative wherever its conditions hold and
    the rate is not zero. Torques from outside are left aside."""
    own = slope.only(lambda m: set(m) <= set(RATE))
    if any(len(set(m)) != 1 or len(m) > 2 for m in own.terms) or any(
        not (len(m) == 2 and m[0][0] in "em" and m[1] in RATE) for m in slope.terms if m not in own.terms
    ):
        return False
    for name in RATE:
        linear, quadratic = (own.terms.get((name,) * power, fmpq(0)) for power in (1, 2))
        if quadratic > 0 or (quadratic == 0 and linear == 0):
            return False
        if linear != 0 and not _one_sided(truths, name, linear < 0):
            return False
    return True


def _one_sided(truths: Any, name: str, positive: bool) -> bool:
    """Whether the conditions keep a rate on one side of zero."""
    for condition, truth in truths:
        terms = condition.positive.terms
        slope, offset = terms.get((name,), fmpq(0)), terms.get((), fmpq(0))
        if truth and set(terms) <= {(), (name,)} and offset <= 0 and slope != 0 and (slope > 0) == positive:
            return True
    return False


def _strict(motion: Motion, frame: Frame) -> tuple[Cross, Any, Any, Any | None] | None:
    """Cross term, epsilon, rho and rate bound that make V + epsilon C fall strictly."""
    try:
        cross = take_cross(motion)
    except ShapeError:
        return None
    most = np.linalg.norm(np.linalg.solve(np.linalg.cholesky(floats(frame.P)), floats(cross.J)), 2)
    bound = exact(below(least(symmetric_part(frame.D)) / 2 / frame.cubic)) if frame.K.terms else None
    if bound is not None and bound <= 0:
        return None
    for rho in (*(fmpq(1, 2**power) for power in range(20, 0, -1)), fmpq(3, 4), fmpq(9, 10)):
        for share in (0.5, 0.99):
            epsilon = exact(float(f"{share * number(rho) * number(frame.s) ** 0.5 / most:.6g}"))
            if definite(margin(frame, cross, epsilon, rho)) and definite(decrease(frame, cross, epsilon, bound)):
                return cross, epsilon, rho, bound
    return None


def _capped(stay: Any | None, motion: Motion, frame: Frame, rho: Any) -> Any | None:
    """The level, no higher than the treatment of the quaternion sign allows."""
    loop = motion.subject.loop
    if frame.potential.even:
        return stay
    if loop.sign_policy == "shortest":
        # At q0 = 0, where the feedback switches, V is at least s.
        cap = frame.s * ALMOST
    elif loop.sign_policy == "hysteresis" and rho != 0:
        cap = (1 + rho) * frame.s * exact(loop.hysteresis_width) / rho * ALMOST
    else:
        return stay
    return cap if stay is None else min(stay, cap)


def _covers(numbers: dict[str, Any], rate: Any) -> bool:
    if numbers["everything"]:
        return True
    found = numbers["rate_everywhere"]
    return rate is not None and found is not None and found >= rate


def _quaternion_sign(motion: Motion, frame: Frame, stay: Any | None) -> tuple[str, str, bool | None, dict[str, Any]]:
    loop = motion.subject.loop
    even = frame.potential.even
    if stay is not None and stay < frame.potential.barrier and (even or loop.sign_policy != "hysteresis"):
        return "single equilibrium in the set", EXACT_SIGN, True, {}
    if even:
        # V has no minimum there, and falls wherever the body turns.
        return "half turns repel", EXACT_SIGN, True, {}
    if loop.sign_policy == "hysteresis":
        narrow = 0.0 < loop.hysteresis_width < 1.0
        return "jumps lower V", EXACT_SIGN, narrow or None, {} if narrow else {"reason": "the width is not between 0 and 1"}
    if loop.wheels is not None and frame.exact:
        # Whatever momentum the wheels store, by the same argument as for any inertia.
        stiffness = motion.linear(-1)[1]
        held = stiffness == transpose(stiffness) and definite(stiffness)
        return (
            "other equilibrium repels",
            EXACT_SIGN,
            held or None,
            {} if held else {"reason": "the stiffness is not symmetric"},
        )
    return ("other equilibrium repels", "certified roots", *_repels(motion))


def _repels(motion: Motion) -> tuple[bool | None, dict[str, Any]]:
    """Whether the linear loop around q0 = -1 has roots on the right of the imaginary axis and none on it."""
    rate, attitude = motion.linear(-1)
    turn = inverse(motion.subject.inertia)
    zero, half = times(0, identity(3)), identity(3, fmpq(-1, 2))
    upper = [[*a, *b] for a, b in zip(matmul(turn, rate), matmul(turn, attitude), strict=True)]
    lower = [[*a, *b] for a, b in zip(half, zero, strict=True)]
    roots = characteristic_roots([*times(-1, upper), *lower])
    if any(root.real.contains(0) for root, _ in roots):
        return None, {"reason": "a root on the imaginary axis is not excluded"}
    if any(root.real > 0 for root, _ in roots):
        return True, {}
    return None, {"reason": "no root on the right was found"}


def _determinant(K: Rows) -> Any:
    return fmpq_mat(3, 3, [x for row in K for x in row]).det()


def _depends_on(motion: Motion, bounded: bool) -> str:
    """The reason why the target's motion, or wheel momentum that may grow without end, does not drop out of the error's
    motion, as it would have to: with such momentum the motion may slow down for good before it is on target."""
    letters = {name[0] for c in motion.acceleration for case in pieces(c) for name in case.value.variables()}
    if letters & set("ra"):
        return "how the target moves does not drop out"
    if "h" not in letters or bounded or not any(motion.subject.modelled):
        return ""
    if not felt_share(at_rest(motion.along(motion.lyapunov or Polynomial.constant(0)))[1]):
        return "a torque that the law cancels may fill the wheels without end, and their momentum does not drop out"
    return ""


def _only_equilibrium(motion: Motion) -> tuple[bool | None, dict[str, Any]]:
    """Whether a body without rate stays so only where q = 0: there the acceleration must be -J^-1 K q with a regular K."""
    K = motion.linear()[1]
    for component in motion.acceleration:
        own = at_rest(component)[1].only(lambda m: not any(name[0] in "wem" for name in m))
        if any(len(m) != 1 or m[0] not in AXES for m in own.terms):
            return None, {"reason": f"the acceleration at rest is {own}"}
    return (True, {}) if _determinant(K) != 0 else (None, {"reason": "the stiffness is singular"})
