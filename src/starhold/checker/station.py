"""Certificates about loops that keep a craft near a libration point: the kernel decides their proof, and here it is compared
with the law and with what the certificate tells."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from starhold.checker.shapes import CheckError, Verdict, demand
from starhold.kernel.check import Proved
from starhold.kernel.programs import digest
from starhold.kernel.sentences import ASSUMPTIONS
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.point_programs import claim_of, point_programs, point_subject
from starhold.parts.bodies.libration_point import Libration

CLOSE = Fraction(1, 10**9)
"""How far the numbers of a libration point may be from what they tell of one another, as a share of their size."""


@dataclass(frozen=True)
class StationSubject:
    """The subject of a certificate: the law and its gains, the plant and what the law takes it to be, and the limit."""

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
    """The subject in a certificate whose keys and types are in order; a CheckError where it says what cannot be."""
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
