"""That what is said to refute a claim does. Nothing here is shared with the certifier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flint import arb, fmpq

from starhold.certification.checker.claims import stepped
from starhold.certification.checker.exact import (
    ZERO,
    CheckError,
    chained,
    definite,
    demand,
    determinant,
    even,
    rational,
    within_circle,
)
from starhold.certification.checker.loop import ATTITUDE, RATE, Loop
from starhold.certification.checker.modal import ModalRegion
from starhold.certification.checker.region import Numbers, optional
from starhold.certification.checker.subject import Subject, gradient, named
from starhold.certification.checker.surface import Sliding


def refutation(subject: Subject, claim: Mapping[str, Any], evidence: Mapping[str, Any]) -> str:
    """What evidence shows; a CheckError where it does not refute."""
    kind, numbers, witness = (claim[key] for key in ("kind", "numbers", "witness"))
    if "eigenvalue" in evidence:
        roots = stepped(Loop(subject, quotient=True), subject.period)
        demand(not within_circle(roots, fmpq(1)), "all eigenvalues are within the circle")
        return "an eigenvalue is not within the circle"
    if kind == "sliding":
        return _surface(subject, numbers, evidence)
    demand("state" in evidence, "there is no state")
    if kind == "region":
        return ModalRegion(subject, numbers, witness).rises(_state(evidence["state"]))
    other = _inertia(subject, numbers, evidence) if "inertia" in evidence else None
    loop = Loop(subject, optional(witness.get("stiffness")), other)
    values = _state(evidence["state"])
    V, torque = loop.lyapunov.value.at(values), _torque(loop, values)
    if "V'" in evidence:
        demand(loop.slope(torque).at(values) > 0, "V falls there")
        bound = numbers.get("rate_everywhere")
        square = sum((values[name] ** 2 for name in RATE), ZERO)
        demand(bound is None or square <= rational(bound) ** 2, "the rate is larger than claimed")
        return "V rises at the state"
    if "torque at rest" in evidence:
        demand(determinant(loop.linear()[1]) == 0, "no other attitude is at rest")
        return "another attitude is at rest"
    if "torque" in evidence:
        found, level = [part.at(values) for part in torque.values()], numbers.get("level")
        over = _motors_exceed(subject, found) if kind == "wheels" else _exceeds(found, numbers)
        demand(over and (level is None or rational(level) >= V), "the torque is within its limit, or the state outside")
        return "the torque exceeds its limit at the state"
    demand("V" in evidence and V <= 0, "V is positive there")
    return "V is not positive at the state"


def _state(given: Any) -> dict[str, Any]:
    """The state, its quaternion brought to exactly unit length; everything from outside and all momentum are zero."""
    q, w = ([rational(x) for x in given[key]] for key in ("attitude", "rate"))
    demand(len(q) == 4 and len(w) == 3, "the state is no state")
    demand(abs(sum((x * x for x in q), ZERO) - 1) < fmpq(1, 10**9), "the attitude is not of unit length")
    side = 1 if q[0] >= 0 else -1
    ratio = [side * x / (1 + side * q[0]) for x in q[1:]]
    square = sum((x * x for x in ratio), ZERO)
    exact = [side * (1 - square) / (1 + square), *(2 * side * x / (1 + square) for x in ratio)]
    outside = {f"{letter}{k}": ZERO for letter in "reamh" for k in (1, 2, 3)}
    return outside | dict(zip((*ATTITUDE, *RATE), (*exact, *w), strict=True))


def _exceeds(torque: Sequence[Any], numbers: Numbers) -> bool:
    limit = rational(numbers["limit"])
    if numbers["kind"] == "axis":
        return any(abs(x) > limit for x in torque)
    return sum((x * x for x in torque), ZERO) > limit**2


def _motors_exceed(subject: Subject, torque: Sequence[Any]) -> bool:
    wheels: Any = subject.wheels
    limits = zip(wheels.torque_limit, chained(wheels.least, [[x] for x in torque]), strict=True)
    return any(limit is not None and abs(motor) > limit for limit, (motor,) in limits)


def _torque(loop: Loop, values: Mapping[str, Any]) -> Any:
    for truths, torque in loop.pieces:
        if all((condition.positive.at(values) > 0) == truth for condition, truth in truths):
            return torque
    raise CheckError("no piece of the law holds at the state")


def _inertia(subject: Subject, numbers: Numbers, evidence: Mapping[str, Any]) -> list[list[Any]]:
    """The inertia of evidence, if a claim is about it."""
    found, J, tolerance = [[rational(x) for x in row] for row in evidence["inertia"]], subject.inertia, numbers["tolerance"]
    demand(len(found) == 3 and all(len(row) == 3 for row in found) and definite(found), "the inertia is none")
    for i in range(3):
        for j in range(3):
            far = (found[i][j] - J[i][j]) ** 2 - (0 if tolerance is None else rational(tolerance) ** 2 * J[i][i] * J[j][j])
            demand(found[i][j] == found[j][i] and (tolerance is None or far <= 0), "the inertia is not within the tolerance")
    return found


def _surface(subject: Subject, numbers: Numbers, evidence: Mapping[str, Any]) -> str:
    blank = {"surface": 0, "angle": 0, "rate": 0}
    proof = Sliding(subject, {**blank, **numbers})
    if "q.Kq" in evidence:
        demand(not definite(even(proof.K)), "the surface leads to the target")
        return "the surface does not lead to the target"
    place: Any = evidence["axis"]
    demand(place in (1, 2, 3), "there is no such axis")
    push: Any = subject.disturbance
    if "position" in evidence:
        position: Sequence[Any] = [rational(x) for x in evidence["position"]]
        square = sum((x * x for x in position), ZERO)
        strength = 3 * arb(subject.gravity) / arb(square).sqrt() ** 5
        push = strength * gradient(subject.whole)[place - 1].at(dict(zip(named("p"), position, strict=True)))
    demand(bool(abs(push) > proof.reach[place - 1]), "the switching torque is larger, or only its bound is not")
    return "the torque from outside exceeds the switching torque"
