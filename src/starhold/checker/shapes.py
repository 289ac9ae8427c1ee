"""The shape of a certificate file: the keys of each object, and their allowed values. For a craft near a libration point the
proof is compared with the law and with the certificate."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal, TypeAlias

from starhold.kernel.check import Proved
from starhold.kernel.programs import digest
from starhold.kernel.sentences import ASSUMPTIONS
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.point_programs import claim_of, point_programs, point_subject
from starhold.parts.bodies.libration_point import Libration

Test: TypeAlias = Callable[[Any], bool]
Verdict: TypeAlias = Literal["holds", "fails", "not claimed"]


class CheckError(Exception):
    """Something in a certificate does not hold, or cannot be verified."""


def demand(holds: bool, otherwise: str) -> None:
    """Raise a CheckError unless something holds."""
    if not holds:
        raise CheckError(otherwise)


def shaped(given: Any, shape: Mapping[str, Test], where: str) -> None:
    """Check that an object has exactly the keys of a shape, and values that their tests allow."""
    demand(isinstance(given, Mapping), f"{where} is not an object")
    demand(set(given) == set(shape), f"{where} must have the keys {', '.join(shape) or '(none)'}")
    for key, test in shape.items():
        demand(test(given[key]), f"{where} has a value that is not allowed under {key}")


def certificate_shaped(given: Any) -> None:
    """Check that a certificate has its keys, and exactly the claims whose kinds it lists."""
    shaped({key: part for key, part in given.items() if key != "proof"}, CERTIFICATE, "the certificate")
    kinds = [claim.get("kind") for claim in given["claims"]]
    demand(given["kinds"] == kinds, f"the claims are not those listed: {', '.join(given['kinds']) or '(none)'}")


def outcome_of(parts: Sequence[Any]) -> str:
    """Return the outcome of a whole from its parts: refuted if one is, proved if there are some and all are."""
    if "refuted" in parts:
        return "refuted"
    return "proved" if parts and all(outcome == "proved" for outcome in parts) else "undecided"


def _number(x: Any) -> bool:
    if isinstance(x, bool) or not isinstance(x, (int, float)):
        return False
    try:
        return math.isfinite(x) and float(x) == x
    except OverflowError:
        return False


def _text(x: Any) -> bool:
    """Return whether a text is printable: no lone surrogates, no terminal control characters."""
    return isinstance(x, str) and x.isprintable()


def _flag(x: Any) -> bool:
    return isinstance(x, bool)


def _object(x: Any) -> bool:
    return isinstance(x, Mapping)


def _plain(x: Any) -> bool:
    """Return whether a value consists of finite numbers, texts, lists and objects."""
    if isinstance(x, Mapping):
        return all(isinstance(key, str) and _plain(value) for key, value in x.items())  # pyright: ignore
    return all(map(_plain, x)) if isinstance(x, list) else x is None or _flag(x) or _text(x) or _number(x)  # pyright: ignore


def _gain(x: Any) -> bool:
    return _text(x) or _number(x) or (isinstance(x, list) and all(map(_gain, x)))  # pyright: ignore


def _list(test: Test, count: int | None = None) -> Test:
    def holds(x: Any) -> bool:
        return isinstance(x, list) and (count is None or len(x) == count) and all(map(test, x))  # pyright: ignore

    return holds


def _one(*allowed: str) -> Test:
    return lambda x: isinstance(x, str) and x in allowed


def _or_none(test: Test) -> Test:
    return lambda x: x is None or test(x)


def _within(shape: Mapping[str, Test]) -> Test:
    return lambda x: isinstance(x, Mapping) and set(x) == set(shape) and all(shape[key](x[key]) for key in shape)  # pyright: ignore


_OUTCOME = _one("proved", "refuted", "undecided")
_VECTOR, _MAYBE = _list(_number, 3), _or_none(_number)
FILE: dict[str, Test] = {
    **dict.fromkeys(("format", "scenario", "note"), _text),
    "versions": lambda x: _object(x) and all(map(_text, x.values())),
    "programs": _object,
    **dict.fromkeys(("claims", "certificates"), _list(_object)),
}
PROVED: dict[str, Test] = {"kind": _text, "outcome": _one("proved", "refuted"), "proof": lambda x: type(x) is int and x >= 0}
"""A claim that the file has a proof of, by its place."""
CERTIFICATE: dict[str, Test] = {
    "name": lambda x: _text(x) and len(x) <= 1_000,
    "outcome": _OUTCOME,
    "subject": _object,
    "kinds": _list(_text),
    "claims": _list(_object),
}
CLAIM: dict[str, Test] = {
    "kind": _text,
    "outcome": _OUTCOME,
    "numbers": lambda x: _object(x) and _plain(x),
    "witness": lambda x: _object(x) and _plain(x),
    "assumptions": _list(_text),
    "obligations": _list(_object),
}
OBLIGATION: dict[str, Test] = {
    "name": _text,
    "how": _text,
    "outcome": _OUTCOME,
    "evidence": lambda x: _object(x) and _plain(x),
}
_WHEELS: dict[str, Test] = {
    "axes": _list(_VECTOR),
    "torque_limit": _list(_MAYBE),
    "momentum_limit": _list(_MAYBE),
    "inertia": _list(_number),
    "least": _list(_VECTOR),
    "momentum": _list(_number),
    "allocation": _one("least-squares", "least-peak"),
    "total_momentum": _number,
}
_HISTORY: dict[str, Test] = {
    "interpolant": _one("rotation spline"),
    "times": _list(_number),
    "attitudes": _list(_list(_number, 4)),
    "rates": _list(_VECTOR),
}
SUBJECT: dict[str, Test] = {
    "law": _text,
    "gains": lambda x: _object(x) and all(map(_gain, x.values())),
    "quaternion_sign": _one("as_published", "shortest", "hysteresis"),
    "hysteresis_width": _MAYBE,
    "inertia": _list(_VECTOR, 3),
    "limit": _one("axis", "norm", "none"),
    "torque_limit": _MAYBE,
    "orbit": _or_none(_within({"position": _VECTOR, "velocity": _VECTOR, "gravitational_parameter": _number})),
    "gravity_gradient": _flag,
    "target": _one("inertial", "orbital", "history"),
    "history": _or_none(_within(_HISTORY)),
    "target_rate": _number,
    "target_acceleration": _number,
    "modelled_torque": _VECTOR,
    "modelled_torque_norm": _number,
    "disturbance": _number,
    "control_period": _number,
    "assumed_away": _list(_text),
    "parts": lambda x: type(x) is int and x >= 0,
    "wheels": _or_none(_within(_WHEELS)),
}
UNKNOWN_BODY: dict[str, Test] = {"body": _text, "law": _text}
"""The subject where nothing is known of the body."""
STATION: dict[str, Test] = {
    "law": _text,
    "gains": lambda x: _object(x) and all(map(_gain, x.values())),
    **dict.fromkeys(("plant", "nominal"), lambda x: _object(x) and all(map(_number, x.values()))),
    "model": _one("linear", "nonlinear"),
    "limit": _one("axis", "norm", "none"),
    "control_limit": _MAYBE,
    "lag": _number,
    "control_period": _number,
    "assumed_away": _list(_text),
    "parts": lambda x: type(x) is int and x >= 0,
}
"""The subject where a loop keeps a craft near a libration point."""


CLOSE = Fraction(1, 10**9)
"""The relative tolerance of the relations between the numbers of a libration point."""


@dataclass(frozen=True)
class StationSubject:
    """Check the subject of a certificate: the law and its gains, the plant and the law's model of it, and the limit."""

    law: Law
    gains: Any
    plant: Libration
    nominal: Libration
    full: bool
    limit: str
    control_limit: float | None

    @property
    def circle(self) -> bool:
        """Return whether the law declares a circle that it makes attractive."""
        return self.law.hook("errors") is not None and self.law.lyapunov is not None


def read_station(given: Mapping[str, Any]) -> StationSubject:
    """Check the subject of a certificate whose keys and types are in order; a CheckError where it is impossible."""
    law = catalogue("libration-point").get(given["law"])
    if law is None:
        raise CheckError(f"there is no law {given['law']} for libration points")
    fields = {item.name: item.gain for item in law.fields()}
    demand(set(given["gains"]) == set(fields), "the gains are not those of the law")
    gains = law.gains(**{name: gain.check(given["gains"][name]) for name, gain in fields.items()})
    points: list[Libration] = []
    for name in ("plant", "nominal"):
        demand(set(given[name]) == set(Libration._fields), f"the {name} has not the numbers of a libration point")
        points.append(Libration(**{key: float(x) for key, x in given[name].items()}))
        exactly: Any = map(Fraction, points[-1])
        _check_point(Libration(*exactly))
    limit = given["control_limit"]
    demand(limit is None or limit > 0, "the limit of the control is not positive")
    demand(given["control_period"] > 0 and given["lag"] >= 0, "the period is not positive, or the lag negative")
    plant, nominal = points
    return StationSubject(law, gains, plant, nominal, given["model"] == "nonlinear", given["limit"], limit)


def _check_point(plant: Any) -> None:
    """That two bodies, on circles about each other by Kepler's third law, have a collinear equilibrium here: where the
    pulls balance what the turning asks for, and with the stiffness that the pulls make."""
    pulls: tuple[Any, Any] = (plant.pull_larger, plant.pull_smaller)
    places: tuple[Any, Any] = (plant.from_larger, plant.from_smaller)
    square = plant.rate**2
    demand(plant.rate > 0 and min(pulls) > 0, "the rate of the axes or a pull is not positive")
    demand(all(places) and places[0] != places[1], "a body is at the point, or both are at one place")
    masses: list[Any] = [pull * abs(place) ** 3 for pull, place in zip(pulls, places, strict=True)]
    kepler = square * abs(places[0] - places[1]) ** 3
    demand(_near(kepler, masses[0] + masses[1]), "the bodies do not turn at the rate of the axes")
    turning = square * (masses[0] * places[0] + masses[1] * places[1]) / (masses[0] + masses[1])
    larger, smaller = (pull * place for pull, place in zip(pulls, places, strict=True))
    demand(abs(turning - larger - smaller) <= CLOSE * (abs(larger) + abs(smaller)), "the point is no equilibrium")
    demand(_near(plant.stiffness, pulls[0] + pulls[1]), "the stiffness is not that of the point")


def _near(one: Any, other: Any) -> bool:
    return bool(abs(one - other) <= CLOSE * abs(other))


def station_findings(
    subject: StationSubject, given: Mapping[str, Any], absent: list[str], proved: list[Proved]
) -> Iterator[tuple[str, str, Verdict, str]]:
    """Yield claim, obligation, verdict and reason of all that a certificate claims; CheckError where it is not shown."""
    decided = [claim for claim in given["claims"] if claim["outcome"] != "undecided"]
    demand(("proof" in given) == bool(decided), "what is decided has no proof, or a proof decides nothing")
    demand(len(proved) == len(decided), "the proof is of another number of claims")
    shown = iter(proved)
    for claim in given["claims"]:
        if claim["outcome"] == "undecided":
            yield from _undecided(claim, absent)
            continue
        one = next(shown)
        _flown(subject, one)
        found: dict[str, Any] = claim_of(one, subject.circle) | {"witness": {}}
        found["assumptions"] = [*found["assumptions"], *absent]
        for key, value in found.items():
            demand(claim[key] == value, f"the {key} of {claim['kind']} is not what the kernel proved")
        for obligation in claim["obligations"]:
            if claim["outcome"] == "proved":
                yield claim["kind"], obligation["name"], "holds", obligation["how"]
            else:
                yield claim["kind"], obligation["name"], "not claimed", f"refuted: {one.statement.text}"


def _undecided(claim: Mapping[str, Any], absent: list[str]) -> Iterator[tuple[str, str, Verdict, str]]:
    known = [*ASSUMPTIONS, *absent]
    demand(all(text in known for text in claim["assumptions"]), "the assumptions are not those of such a claim")
    demand(all(text in claim["assumptions"] for text in absent), "the assumptions are not those of such a claim")
    demand(not claim["witness"] and len(claim["obligations"]) == 1, "what is undecided has one reason")
    for obligation in claim["obligations"]:
        demand(obligation["outcome"] == "undecided", "what is refuted has no proof")
        yield claim["kind"], obligation["name"], "not claimed", "undecided, the claim is not proved"


def _flown(subject: StationSubject, proved: Proved) -> None:
    """That a proof is about the programs of the law and the motion, the numbers of the loop and its limit."""
    programs = point_programs(subject.law, subject.gains, subject.nominal, subject.full, subject.limit)
    for role, program in proved.claim.programs.content.items():
        demand(program.digest == digest(programs[role]), f"the {role} of the proof is not that of the loop")
    numbers = point_subject(subject.gains, subject.plant, subject.nominal)
    for name, x in proved.claim.subject.content.items():
        demand(name in numbers and x == Fraction(float.fromhex(numbers[name])), f"the proof has another number for {name}")
    for name, x in proved.claim.numbers.content.items():
        if name.startswith("limit"):
            kind = "axis" if name == "limit" else name.removeprefix("limit.")
            demand(kind == subject.limit and x == subject.control_limit, "the limit is not the loop's")
