"""Shows that what is said to refute a claim does.

A refutation names the obligation that is false and has all that shows it, nothing else: a state of the set that is claimed,
of the law's own V, at the loop's own limit. What is told of it beside must be what is found there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flint import arb, fmpq

from starhold.algebra.polynomial import Polynomial
from starhold.checker.claims import claimed, eigenvalues_of, stepped, torque_limit
from starhold.checker.even_region import EvenRegion
from starhold.checker.exact import (
    ONE,
    ZERO,
    CheckError,
    Rows,
    definite,
    demand,
    identity,
    matmul,
    rational,
    symmetric_part,
    transpose,
    up,
    within_circle,
)
from starhold.checker.frame import EvenFrame, OddFrame, even_frame, is_even, odd_frame
from starhold.checker.loop import ATTITUDE, RATE, TURN, ExactLoop, W
from starhold.checker.odd_region import OddRegion
from starhold.checker.region import Numbers, optional
from starhold.checker.shapes import NUMBERS, WITNESS, shaped
from starhold.checker.subject import LoopSubject, gradient, named
from starhold.checker.surface import Sliding

CLOSE = fmpq(1, 10**9)
"""How far a number that is told may be from what is found, as a share of the sizes that it is made of."""


def refutation(subject: LoopSubject, claim: Mapping[str, Any], obligation: Mapping[str, Any]) -> str:
    """Check the evidence against an obligation and say what it shows; a CheckError where it does not refute."""
    name, evidence = obligation["name"], obligation["evidence"]
    match claim["kind"], name:
        case "convergence", "positive":
            return _not_positive(subject, claim, evidence)
        case "convergence", "descent":
            return _rises(subject, claim, evidence)
        case "torque-limit", "torque":
            return _exceeds(subject, claim, evidence)
        case "sampling", "stable at the period":
            return _unstable(subject, claim["numbers"], evidence)
        case "sliding", "reach exceeds torque":
            return _overpowered(subject, claim["numbers"], evidence)
        case "sliding", "surface holds the target":
            return _leads_away(subject, claim["numbers"], evidence)
        case _:
            raise CheckError(f"nothing refutes {name}")


def _has(given: Any, *keys: str) -> None:
    demand(set(given) == set(keys), f"the evidence is not {', '.join(keys)}")


def _told(told: Any, found: Any, size: Any) -> None:
    """That a number is told as it is found, up to what rounding of the state changes it by."""
    demand(abs(rational(told) - found) <= CLOSE * size, "the evidence tells another number than there is at the state")


def _size(polynomial: Polynomial, values: Mapping[str, Any]) -> Any:
    """The sum of the sizes of a polynomial's terms."""
    total = ZERO
    for monomial, c in polynomial.terms.items():
        for name in monomial:
            c = c * values[name]
        total += abs(c)
    return total


def _state(given: Any) -> dict[str, Any]:
    """The state, its quaternion brought to exactly unit length; everything from outside and all momentum are zero."""
    _has(given, "attitude", "rate")
    q, w = ([rational(x) for x in given[key]] for key in ("attitude", "rate"))
    demand(len(q) == 4 and len(w) == 3, "the state is no state")
    demand(abs(sum((x * x for x in q), ZERO) - 1) < fmpq(1, 10**9), "the attitude is not of unit length")
    side = 1 if q[0] >= 0 else -1
    ratio = [side * x / (1 + side * q[0]) for x in q[1:]]
    square = sum((x * x for x in ratio), ZERO)
    exact = [side * (1 - square) / (1 + square), *(2 * side * x / (1 + square) for x in ratio)]
    outside = {f"{letter}{k}": ZERO for letter in "reamh" for k in (1, 2, 3)}
    return outside | dict(zip((*ATTITUDE, *RATE), (*exact, *w), strict=True))


def _torque(loop: ExactLoop, values: Mapping[str, Any]) -> Any:
    for truths, torque in loop.pieces:
        if all((condition.positive.at(values) > 0) == truth for condition, truth in truths):
            return torque
    raise CheckError("no piece of the law holds at the state")


# --- V ----------------------------------------------------------------------------------------------------------------


def _asked(claim: Mapping[str, Any]) -> Any | None:
    """The rate up to which convergence from every attitude is claimed, None for any; no V but the law's own."""
    numbers = claim["numbers"]
    demand(not claim["witness"], "a refuted V is the law's own")
    demand(set(numbers) in (set(), {"rate_everywhere", "everything"}), "the set is not one that was asked for")
    bound = optional(numbers.get("rate_everywhere"))
    demand(numbers.get("everything", True) == (bound is None), "everything has no largest rate")
    return bound


def _frame(loop: ExactLoop) -> EvenFrame | OddFrame:
    return even_frame(loop) if is_even(loop) else odd_frame(loop)


def _not_positive(subject: LoopSubject, claim: Mapping[str, Any], evidence: Numbers) -> str:
    """A form that is not positive somewhere is so however near the target: no set is left."""
    _has(evidence, "state", "V")
    _asked(claim)
    loop, values = ExactLoop(subject), _state(evidence["state"])
    V = loop.lyapunov.value
    _frame(loop)
    on_target = not any(values[name] for name in (*TURN, *RATE)) and (values[ATTITUDE[0]] > 0 or is_even(loop))
    demand(not on_target, "V has to be zero on target at rest")
    demand(V.at(values) <= 0, "V is positive there")
    _told(evidence["V"], V.at(values), _size(V, values))
    return "V is not positive at the state"


def _rises(subject: LoopSubject, claim: Mapping[str, Any], evidence: Numbers) -> str:
    """V rises at a state of the set; where none is told, at states as near the target as one likes."""
    _has(evidence, "state", "V'")
    bound, loop, values = _asked(claim), ExactLoop(subject), _state(evidence["state"])
    slope = loop.slope(_torque(loop, values))
    demand(slope.at(values) > 0, "V falls there")
    _told(evidence["V'"], slope.at(values), _size(slope, values))
    square = sum((values[name] ** 2 for name in RATE), ZERO)
    demand(bound is None or square <= bound**2, "the rate is larger than claimed")
    if not claim["numbers"]:
        frame = _frame(loop)
        mixes = getattr(frame, "E", identity(3, ZERO)) != identity(3, ZERO)
        demand(mixes or not definite(symmetric_part(frame.D)), "V falls near the target")
    return "V rises at the state"


def _exceeds(subject: LoopSubject, claim: Mapping[str, Any], evidence: Numbers) -> str:
    """The torque exceeds the loop's own limit at a state of the set that holds the turn that was asked for, and no more;
    what else is told of that set holds."""
    _has(evidence, "state", "torque")
    numbers = claim["numbers"]
    shaped(numbers, NUMBERS["torque-limit"], "the numbers")
    shaped(claim["witness"], WITNESS["torque-limit"], "the witness")
    demand(numbers["kind"] == subject.limit, "the limit is of another kind than the loop's")
    limit = rational(numbers["limit"])
    demand(limit == subject.torque_limit, "a limit is refuted that is not the loop's")
    region, proofs = claimed(subject, claim), torque_limit(subject, claim)
    outcomes = {told["name"]: told["outcome"] for told in claim["obligations"]}
    listed = [(told["name"], told["how"]) for told in claim["obligations"]]
    demand(listed == [(name, how) for name, how, _ in proofs if how], "the obligations are not those of such a claim")
    for name, _, verify in proofs:
        if outcomes.get(name, "proved") == "proved":
            verify()
    demand(
        region.start is not None and region.start <= _height(region, numbers["slew_angle"]),
        "the set holds more than the turn",
    )
    values = _state(evidence["state"])
    parts = list(_torque(region.loop, values).values())
    found = [part.at(values) for part in parts]
    squares = [x * x for x in found]
    demand(region.loop.lyapunov.value.at(values) <= region.start, "the state is outside the set")
    over = [x for x in (squares if numbers["kind"] == "axis" else [sum(squares, ZERO)]) if x > limit**2]
    demand(bool(over), "the torque is within its limit")
    told, size = rational(evidence["torque"]), sum((_size(part, values) for part in parts), ZERO)
    near = told > 0 and any(abs(told**2 - x) <= CLOSE * size**2 for x in over)
    demand(near, "the evidence tells another torque than there is")
    return "the torque exceeds its limit at the state"


def _height(region: OddRegion | EvenRegion, turn: float) -> Any:
    """V at rest after a turn, a little more for rounding."""
    s = region.well()[0]
    half = arb(rational(turn)) / 2
    V = arb(s) * (half.sin() ** 2 if isinstance(region, EvenRegion) else 1 - half.cos())
    return up(V * (1 + arb(CLOSE)))


# --- a held torque ----------------------------------------------------------------------------------------------------


def _unstable(subject: LoopSubject, numbers: Numbers, evidence: Numbers) -> str:
    _has(evidence, "eigenvalue")
    demand(set(numbers) == set(NUMBERS["sampling"]), "the numbers are not those of such a claim")
    demand(rational(numbers["period"]) == subject.period, "the period is not that of the loop")
    demand(numbers["longest"] is None and not numbers["every_shorter"], "an unstable loop has no longest period")
    roots = stepped(ExactLoop(subject, quotient=True), subject.period)
    demand(not within_circle(roots, ONE), "all eigenvalues are within the circle")
    eigenvalues_of(roots, numbers["eigenvalues"])
    demand(within_circle(roots, rational(numbers["radius"]) * (1 + CLOSE)), "an eigenvalue may be larger than the radius")
    demand(evidence["eigenvalue"] in numbers["eigenvalues"], "the eigenvalue is none of those told")
    real, imaginary = map(rational, evidence["eigenvalue"])
    demand(real**2 + imaginary**2 >= 1 - CLOSE, "the eigenvalue is within the circle")
    return "an eigenvalue is not within the circle"


# --- a surface --------------------------------------------------------------------------------------------------------


def _surface(subject: LoopSubject, numbers: Numbers) -> Sliding:
    """The surface, against what the loop has to stand and no more."""
    demand(set(numbers) == {"torque", "margin"}, "the numbers are not those of such a claim")
    proof = Sliding(subject, {"surface": 0, "angle": 0, "rate": 0, **numbers})
    felt = [modelled + subject.disturbance for modelled in subject.modelled]
    demand(
        all(m <= torque <= m * (1 + CLOSE) for m, torque in zip(felt, proof.torque, strict=True)),
        "the torque from outside is another",
    )
    margin = min(g - m for g, m in zip(proof.reach, proof.torque, strict=True))
    demand(rational(numbers["margin"]) <= margin, "the margin is another")
    return proof


def _overpowered(subject: LoopSubject, numbers: Numbers, evidence: Numbers) -> str:
    """The disturbance, with the gravity gradient at a place on the orbit, pushes s_i away from zero where it switches."""
    _has(evidence, "axis", "reach", "torque", "state", *(["position"] if "position" in evidence else []))
    proof, place = _surface(subject, numbers), evidence["axis"]
    demand(type(place) is int and place in (1, 2, 3), "there is no such axis")
    push: Any = arb(subject.disturbance)
    if "position" in evidence:
        push += _gravity(subject, evidence["position"], place)
    reach = proof.reach[place - 1]
    demand(bool(push > reach), "the switching torque is larger, or only its bound is not")
    demand(bool(abs(push - rational(evidence["torque"])) <= push * arb(CLOSE)), "the evidence tells another torque")
    _told(evidence["reach"], reach, reach)
    values = _state(evidence["state"])
    s = W[place - 1].at(values) + sum((c * values[name] for c, name in zip(proof.K[place - 1], TURN, strict=True)), ZERO)
    demand(s > proof.width[place - 1], "the state is within the layer, or on the other side")
    return "the torque from outside exceeds the switching torque"


def _gravity(subject: LoopSubject, position: Sequence[float], place: int) -> Any:
    """The gravity gradient about an axis for a direction in the body, no nearer than the orbit's perigee."""
    p, perigee = [rational(x) for x in position], subject.perigee
    square: Any = sum((x * x for x in p), ZERO)
    if perigee is None or len(p) != 3:
        raise CheckError("there is no such place on the orbit")
    demand(bool(square * (1 + CLOSE) > perigee**2), "the place is nearer than the orbit")
    distance = arb(square).sqrt().max(arb(perigee))
    form = gradient(subject.whole)[place - 1].at(dict(zip(named("p"), p, strict=True)))
    return 3 * arb(subject.gravity) * arb(form) / arb(square) / distance**3


def _leads_away(subject: LoopSubject, numbers: Numbers, evidence: Numbers) -> str:
    _has(evidence, "axis", "q.Kq")
    proof, axis = _surface(subject, numbers), [rational(x) for x in evidence["axis"]]
    demand(len(axis) == 3, "there is no such axis")
    form = matmul(matmul([axis], symmetric_part(proof.K)), transpose([axis]))[0][0]
    demand(form < 0, "the surface leads to the target along this axis")
    sizes: Rows = [[abs(x) for x in row] for row in symmetric_part(proof.K)]
    _told(evidence["q.Kq"], form, matmul(matmul([[abs(x) for x in axis]], sizes), transpose([[abs(x) for x in axis]]))[0][0])
    return "the surface does not lead to the target"
