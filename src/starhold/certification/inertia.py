"""The claim that convergence holds for every inertia near the one the law was designed for, or for every inertia.

V is the true kinetic energy and 2 stiffness (1 - q0): its derivative does not depend on the inertia, and the cross term's
does so linearly, so that a box of inertias is decided by its size alone. A law whose own V is even in q keeps its potential.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from flint import fmpq

from starhold.algebra.polynomial import Polynomial, exact
from starhold.certification.certificate import EXACT, EXACT_SIGN, LASALLE, Claim, Obligation
from starhold.certification.convergence import ALMOST, Basin, assumed, stiffnesses
from starhold.certification.frame import Cross, contents, cross_parts, decrease, quadratic_sizes, take_apart
from starhold.certification.matrices import definite, floats, greatest, identity, number, root_above, symmetric_part
from starhold.certification.motion import ATTITUDE, RATE, Motion, ShapeError, at_rest, cases
from starhold.certification.refutation import rational_turn, state_evidence
from starhold.certification.subject import Subject, below
from starhold.parts.bodies.rigid_body import kinetic_energy
from starhold.parts.craft import check_inertia

NAMES = ("j11", "j22", "j33", "j12", "j13", "j23")


def inertia_box(basin: Basin, tolerance: float | None = None) -> Claim:
    """The claim for the largest box |J*_ij - J_ij| <= tolerance sqrt(J_ii J_jj), at most 1, or for the one given, of a law
    that converges for the inertia it knows."""
    subject = basin.motion.subject
    families: list[Family] = []
    for stiffness in (None,) if basin.frame.potential.even else stiffnesses(Motion(subject)):
        try:
            family = Family(subject, stiffness)
        except ShapeError:
            continue
        if family.any_inertia():
            return family.claim_for_any()
        families.append(family)
    if tolerance is not None:
        found = next((claim for family in families if (claim := family.claim(tolerance)) is not None), None)
        return found or _refused(subject, families, tolerance)
    best = max(((family.largest, place) for place, family in enumerate(families)), default=(0.0, 0))
    claim = families[best[1]].claim(best[0]) if best[0] > 0.0 else None
    return claim or _refused(subject, families, 1e-6)


class Family:
    """The loop with the inertia it was designed for and with any other, and V = kinetic energy + 2 stiffness (1 - q0) or,
    for None, the law's own.

    Raises ShapeError where V' depends on the inertia, or the cross term's derivative does other than linearly.
    """

    def __init__(self, subject: Subject, stiffness: Any) -> None:
        self.nominal = Motion(subject, stiffness)
        self.other = Motion(subject, stiffness, unknown_inertia=True)
        self.frame = take_apart(self.nominal)
        if self.frame.K.terms or not (self._same_potential() and self._same_slope()):
            raise ShapeError("V' depends on the inertia")
        self.crosses: list[Cross] = []
        """The cross term's parts at the nominal inertia, then what each entry of `NAMES` adds to them."""
        if not self.any_inertia():
            if not self.frame.whole:
                raise ShapeError("a clipped torque")
            self.crosses = self._crosses()

    def any_inertia(self) -> bool:
        """Whether V' has only damping, in which no inertia occurs."""
        return self.frame.exact and (self.frame.potential.even or definite(symmetric_part(self.nominal.linear()[1])))

    def _same_potential(self) -> bool:
        """Whether V is the kinetic energy of whatever inertia and a function of the attitude."""
        parts: list[Any] = [_function(m) - kinetic_energy(m.measurement.rate, m.plant) for m in (self.nominal, self.other)]
        return not (parts[0] - parts[1]).terms

    def _same_slope(self) -> bool:
        known = {_key(t): v for t, v in cases(self.nominal.along(_function(self.nominal)))}
        found = {_key(t): v for t, v in cases(self.other.along(_function(self.other)))}
        return known.keys() == found.keys() and all(
            not _own(value - self.other.factor * known[truths]).terms for truths, value in found.items()
        )

    def _crosses(self) -> list[Cross]:
        slope = _own(at_rest(self.other.along(self.other.cross_term))[1])
        J = self.nominal.subject.inertia
        centre = {name: J[int(name[1]) - 1][int(name[2]) - 1] for name in NAMES}
        length = max(J[i][i] for i in range(3))
        points = [centre, *({**centre, name: centre[name] + length} for name in NAMES)]
        values = [slope.given(point) / self.other.factor.at(point) for point in points]
        steps = [
            (value - values[0]) / (point[name] - centre[name])
            for name, value, point in zip(NAMES, values[1:], points[1:], strict=True)
        ]
        linear: Any = values[0]
        for name, step in zip(NAMES, steps, strict=True):
            linear = linear + (Polynomial.variable(name) - centre[name]) * step
        if (slope - self.other.factor * linear).terms:
            raise ShapeError("the derivative of q.Jw is not linear in the inertia")
        return [cross_parts(self.nominal.cross_term, value) for value in (values[0], *steps)]

    def claim_for_any(self) -> Claim:
        """The claim for every inertia; V is then strictly what the law's own V is, up to a factor."""
        cover = self.nominal.subject.loop.sign_policy
        even, stiffness = self.frame.potential.even, self.nominal.stiffness
        start = self.frame.s * ALMOST if cover == "shortest" and not even else None
        obligations = [
            ("form", EXACT),
            ("positive", EXACT_SIGN),
            ("descent", EXACT_SIGN),
            ("only equilibrium", LASALLE),
            ("half turns repel", EXACT_SIGN) if even else _cover(cover),
        ]
        held = contents(start, self.frame.P, self.frame.potential)
        if start is not None:
            # How fast a body on target may turn depends on its inertia.
            held |= {"rate": 0.0, "rate_everywhere": None}
        numbers = {"tolerance": None, "start": None if start is None else number(start), **held}
        witness = {"stiffness": None if stiffness is None else number(stiffness), "epsilon": 0.0, "rho": 0.0}
        return self._proved(numbers, witness | {"level": numbers["start"]}, obligations)

    def _proved(self, numbers: dict[str, Any], witness: dict[str, Any], obligations: list[tuple[str, str]]) -> Claim:
        proved = tuple(Obligation(name, how, "proved") for name, how in obligations)
        return Claim("inertia", numbers, witness, told(self.nominal.subject, numbers["tolerance"]), proved)

    def sizes(self, tolerance: Any) -> tuple[Any, Any]:
        """Bounds over the box: of sigma, and of the largest moment."""
        J = self.nominal.subject.inertia
        reach = {n: tolerance * root_above(J[int(n[1]) - 1][int(n[1]) - 1] * J[int(n[2]) - 1][int(n[2]) - 1]) for n in NAMES}
        total: Any = fmpq(0)
        for k in range(4):
            size = self._form_sizes[0][k]
            for name, own in zip(NAMES, self._form_sizes[1:], strict=True):
                size += reach[name] * own[k]
            total += size * size
        # The deviations are at most tolerance times the rank-one matrix of sqrt(J_ii J_jj), whose norm is the trace.
        return root_above(total), greatest(J) + tolerance * (J[0][0] + J[1][1] + J[2][2])

    def claim(self, tolerance: float) -> Claim | None:
        """The claim for a box, if it can be shown."""
        found = self.weights(tolerance)
        if found is None:
            return None
        epsilon, rho = found
        loop = self.nominal.subject.loop
        level, start = self._levels(rho)
        most = self.sizes(exact(tolerance))[1]
        held = contents(start, identity(3, most), self.frame.potential)
        obligations = [
            ("form", EXACT),
            *((n, EXACT_SIGN) for n in ("positive", "descent", "strict")),
            _cover(loop.sign_policy),
        ]
        numbers = {"tolerance": tolerance, "start": None if start is None else number(start), **held}
        witness = {"stiffness": number(self.nominal.stiffness), "epsilon": number(epsilon), "rho": number(rho)}
        return self._proved(numbers, witness | {"level": None if level is None else number(level)}, obligations)

    def _levels(self, rho: Any) -> tuple[Any | None, Any | None]:
        """The level that the quaternion sign allows, and that from which motions stay below it."""
        loop, s = self.nominal.subject.loop, self.frame.s
        if loop.sign_policy == "as_published":
            return None, None
        cap = s if loop.sign_policy == "shortest" else (1 + rho) * s * exact(loop.hysteresis_width) / rho
        level = exact(below(cap * ALMOST))
        return level, exact(below(level * (1 - rho) / (1 + rho)))

    def _holds_every_attitude(self, rho: Any, most: Any) -> bool:
        """Whether the set holds every attitude at the rate of the loop's start, and at a degree a second at least."""
        rate = exact(max(float(np.linalg.norm(self.nominal.subject.loop.start.rate)), np.radians(1.0)))
        start = self._levels(rho)[1]
        return start is None or start >= 2 * self.frame.s + most * rate * rate / 2

    def weights(self, tolerance: float) -> tuple[Any, Any] | None:
        """Weight of the cross term and its cost, with which V falls for every inertia of the box."""
        if not self.crosses:
            return None
        sigma, most = self.sizes(exact(tolerance))
        s = self.frame.s
        cross = Cross(self.crosses[0].J, self.crosses[0].A, self.crosses[0].B, sigma, self.crosses[0].forms)
        if any(x != 0 for other in self.crosses[1:] for matrix in (other.A, other.B) for row in matrix for x in row):
            return None
        for share in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
            rho = exact(share)
            epsilon = exact(float(f"{0.9999 * share * number(s / most) ** 0.5:.6g}"))
            if self.nominal.subject.loop.sign_policy == "hysteresis" and not self._holds_every_attitude(rho, most):
                continue
            if epsilon * epsilon * most < rho * rho * s and definite(decrease(self.frame, cross, epsilon, None)):
                return epsilon, rho
        return None

    @cached_property
    def _form_sizes(self) -> list[list[Any]]:
        return [quadratic_sizes(cross) for cross in self.crosses]

    @cached_property
    def largest(self) -> float:
        """The largest tolerance, to three digits, for which there are weights; 0 for none."""
        if self.weights(1.0) is not None:
            return 1.0
        low, high = 0.0, 1.0
        for _ in range(12):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.weights(middle) is not None else (low, middle)
        return float(f"{low * 0.9995:.3g}")

    def rising(self, tolerance: float) -> dict[str, Any] | None:
        """An inertia of the box, which a body can have, and a state at which V plus the cross term rises, for the weight
        that serves the largest box; None where none is found."""
        known = self.weights(self.largest)
        if known is None:
            return None
        epsilon = known[0]
        slope = _own(at_rest(self.other.along(_function(self.other)))[1])
        slope = slope + epsilon * _own(at_rest(self.other.along(self.other.cross_term))[1])
        random = np.random.default_rng(0)
        J = floats(self.nominal.subject.inertia)
        reach = 0.999999 * tolerance * np.sqrt(np.outer(np.diagonal(J), np.diagonal(J)))
        for _ in range(300):
            share = np.triu(np.clip(random.normal(size=(3, 3)) * 2.0, -1.0, 1.0))
            try:
                shifted = check_inertia(J + reach * (share + np.triu(share, 1).T))
            except ValueError:
                continue
            values = {name: exact(float(shifted[int(name[1]) - 1, int(name[2]) - 1])) for name in NAMES}
            there, factor = slope.given(values), self.other.factor.at(values)
            for _ in range(20):
                axis, w = random.normal(size=(2, 3))
                angle = random.uniform(0.0, np.pi)
                turn = rational_turn([np.cos(angle), *(np.sin(angle) * axis / np.linalg.norm(axis))])
                rate = [exact(float(f"{x:.4g}")) for x in w / np.linalg.norm(w) * 10.0 ** random.uniform(-3.0, 1.0)]
                found = there.at(dict(zip((*ATTITUDE, *RATE), (*turn, *rate), strict=True)))
                if found > 0:
                    return {"inertia": shifted.tolist(), **state_evidence(turn, rate, "V'", found / factor)}
        return None


def _cover(cover: str) -> tuple[str, str]:
    """Near q0 = -1 the function falls as it does near the target but is no minimum there, hence by the inertia theorem
    for Lyapunov's equation that rest has unstable directions and none that is neutral."""
    names = {
        "hysteresis": "jumps lower V",
        "shortest": "single equilibrium in the set",
        "as_published": "other equilibrium repels",
    }
    return names[cover], EXACT_SIGN


def _refused(subject: Subject, families: list[Family], tolerance: float) -> Claim:
    """The claim that could not be shown: up to where it could, and where the function of that proof rises."""
    largest = max((family.largest for family in families), default=0.0)
    evidence: dict[str, Any] = {"reason": f"shown up to {100.0 * largest:.3g} %" if largest else "not shown for any box"}
    for family in families:
        found = family.rising(tolerance) if family.largest == largest else None
        if found is not None:
            evidence |= found
            break
    refused = (Obligation("descent", EXACT_SIGN, "undecided", evidence),)
    return Claim("inertia", {"tolerance": tolerance}, {}, told(subject, tolerance), refused)


def told(subject: Subject, tolerance: float | None) -> tuple[str, ...]:
    """The assumptions of the claim; for a tolerance of None any inertia."""
    body, _, *others = assumed(subject, outside=("no-outside-torque", "target-at-rest"))
    return (body, *(() if tolerance is None else ("inertia-within-tolerance",)), *others)


def _function(motion: Motion) -> Polynomial:
    function = motion.lyapunov
    if function is None:
        raise ShapeError("no V")
    return function


def _key(truths: Any) -> tuple[Any, ...]:
    return tuple(sorted((condition.key, truth) for condition, truth in truths))


def _own(slope: Polynomial) -> Polynomial:
    """Without the torques from outside."""
    return slope.only(lambda m: not any(name[0] in "em" for name in m))
