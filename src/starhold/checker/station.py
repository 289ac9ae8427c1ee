"""Certificates about loops that keep a craft near a libration point: their subject, their claims, and what refutes these."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from flint import fmpq

from starhold.algebra.polynomial import exact
from starhold.checker.circle import CircleLoop
from starhold.checker.equilibrium import EquilibriumLoop, LimitedAxis
from starhold.checker.exact import ZERO, CheckError, Obligation, demand, rational
from starhold.checker.polar import keeps_within
from starhold.checker.region import BALLS, EXACT, LASALLE, SIGN, Numbers
from starhold.laws.catalogue import Law, catalogue
from starhold.parts.bodies.libration_point import Libration

CLOSE = fmpq(1, 10**9)
"""How far the numbers of a libration point may be from what they tell of one another, as a share of their size, and those
of a refutation from what is found."""

HELD = "held at rest along Y and Z, where no Coriolis acceleration acts along X"
"""All the time, and not at the start alone: x' makes a Coriolis acceleration along Y that a limited control cannot always
undo, and then y' one along X. What holds them is not asked."""
CLEAR = "never at the centre of one of the two bodies"


@dataclass(frozen=True)
class StationSubject:
    """The subject of a certificate, its numbers exact. `full`: the motion is that of the full problem."""

    law: Law
    gains: Any
    plant: Libration
    full: bool
    limit: str
    control_limit: Any | None

    @property
    def circle(self) -> CircleLoop:
        """The loop of a law that makes a circle attractive."""
        demand(self.law.name == "l2-circle", f"the law {self.law.name} makes no circle attractive")
        return CircleLoop(self.law, self.gains, self.plant, self.full)

    @property
    def equilibrium(self) -> EquilibriumLoop:
        """The loop of a law that makes an equilibrium attractive."""
        demand(self.law.name == "l2-equilibrium", f"the law {self.law.name} makes no equilibrium attractive")
        return EquilibriumLoop(self.law, self.gains, self.plant, self.full)


def read_station(given: Mapping[str, Any]) -> StationSubject:
    """The subject in a certificate whose keys and types are in order; a CheckError where it says what cannot be."""
    law = catalogue("libration-point").get(given["law"])
    if law is None:
        raise CheckError(f"there is no law {given['law']} for libration points")
    fields = {item.name: item.gain for item in law.fields()}
    demand(set(given["gains"]) == set(fields), "the gains are not those of the law")
    gains = law.gains(**{name: _exactly(gain.check(given["gains"][name])) for name, gain in fields.items()})
    demand(set(given["plant"]) == set(Libration._fields), "the plant has not the numbers of a libration point")
    plant = Libration(**{name: rational(x) for name, x in given["plant"].items()})
    _check_point(plant)
    limit = given["control_limit"]
    demand(limit is None or limit > 0, "the limit of the control is not positive")
    demand(given["control_period"] > 0 and given["lag"] >= 0, "the period is not positive, or the lag negative")
    return StationSubject(
        law=law,
        gains=gains,
        plant=plant,
        full=given["model"] == "nonlinear",
        limit=given["limit"],
        control_limit=None if limit is None else rational(limit),
    )


def _exactly(value: Any) -> Any:
    """A gain with every number at its exact value; the place of a choice stays an int."""
    if isinstance(value, tuple):
        return tuple(map(_exactly, value))  # pyright: ignore
    return value if isinstance(value, int) else exact(value)


def _check_point(plant: Libration) -> None:
    """That two bodies, on circles about each other by Kepler's third law, have a collinear equilibrium here: where the
    pulls balance what the turning asks for, and with the stiffness that the pulls make."""
    pulls: tuple[Any, Any] = (plant.pull_larger, plant.pull_smaller)
    places: tuple[Any, Any] = (plant.from_larger, plant.from_smaller)
    square: Any = plant.rate**2
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


# --- what is claimed --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StationKind:
    """A kind of claim: what it assumes beside what all do, and from subject and claim what has to be shown. `anywhere`: it
    speaks of every place, so that in the full problem the bodies must be left out."""

    beside: str
    proofs: Callable[[StationSubject, Numbers], list[Obligation]]
    anywhere: bool = False

    def assumptions(self, subject: StationSubject) -> list[str]:
        """The assumptions of a claim about this subject."""
        motion = "motion exactly as modelled" if subject.full else "linear motion near the point"
        return [
            motion,
            "circular motion of the two bodies",
            "position and velocity exactly known",
            "control applied continuously, without lag",
            self.beside,
            *([CLEAR] if self.anywhere and subject.full else []),
        ]


def _attracts(circle: CircleLoop, numbers: Numbers) -> list[Obligation]:
    return [
        ("form", EXACT, circle.form),
        ("descent", SIGN, circle.descent),
        ("only the circle", LASALLE, circle.only),
        ("centre outside", SIGN, partial(circle.centre_outside, rational(numbers["level"]))),
    ]


def attracts(subject: StationSubject, claim: Numbers) -> list[Obligation]:
    """All motions from {V <= level}, whatever x and x', end on the circle and run through it at the rate."""
    circle, numbers = subject.circle, claim["numbers"]
    return [
        *_attracts(circle, numbers),
        ("x returns", SIGN, circle.returns),
        ("numbers", "", partial(_contents, circle, numbers)),
    ]


def control_limit(subject: StationSubject, claim: Numbers) -> list[Obligation]:
    """Motions from {V <= level} with x = x' = 0 keep the control within the limit, and so end on the circle."""
    circle, numbers = subject.circle, claim["numbers"]

    def control() -> str:
        demand(not subject.full, "the control is bounded for the linear model alone")
        # Then the control is the neutral one and the damping, which `form` shows of the whole acceleration.
        circle.form()
        limit, level = rational(numbers["limit"]), rational(numbers["level"])
        _same_limit(subject, numbers)
        circle.centre_outside(level)
        demand(keeps_within(circle, level, limit, numbers["kind"] == "axis"), "the control may exceed the limit")
        return "largest over the phase in closed form, over the rest by Bernstein coefficients"

    return [
        *_attracts(circle, numbers),
        ("control", BALLS, control),
        ("numbers", "", partial(_contents, circle, numbers)),
    ]


def returns(subject: StationSubject, claim: Numbers) -> list[Obligation]:
    """Every motion ends at the equilibrium that the law names."""
    loop = subject.equilibrium
    return [("form", EXACT, loop.form), ("each axis returns", SIGN, loop.returns)]


def saturated_axis(subject: StationSubject, claim: Numbers) -> list[Obligation]:
    """With S = x + x'/s, motions from {|S| <= width, |x| <= reach} stay there and end at x = x' = 0, though the control
    along X is limited; from |S| >= boundary none does, wherever it is."""
    limit, width, reach, boundary = (rational(claim["numbers"][key]) for key in ("limit", "width", "reach", "boundary"))
    mu = rational(claim["witness"]["mu"])
    demand(subject.limit == "axis", "the control along X is not limited by itself")
    # One side needs that the loop's limit is not lower, the other that it is not higher.
    demand(limit == subject.control_limit, "the limit is not the loop's")
    axis = LimitedAxis.of(subject.equilibrium, limit)
    return [
        ("stays", BALLS, partial(axis.stays, width, reach)),
        ("strict", BALLS, partial(axis.strict, width, reach, mu)),
        ("nothing returns from beyond", BALLS, partial(axis.beyond, boundary)),
    ]


def _same_limit(subject: StationSubject, numbers: Numbers) -> None:
    demand(numbers["kind"] == subject.limit != "none", "the limit is of another kind than the loop's")
    limit = rational(numbers["limit"])
    demand(subject.control_limit is not None and 0 < limit <= subject.control_limit, "the loop's limit is lower")


def _contents(circle: CircleLoop, numbers: Numbers) -> str:
    """Circles between the radii, run through at the rate, are in {V <= level}, and so are errors of the velocity on the
    circle itself."""
    level, inner, outer, error = (rational(numbers[key]) for key in ("level", "inner", "outer", "velocity"))
    gains = circle.gains
    demand(0 <= inner <= gains.radius <= outer, "the radii are not on either side of the circle")
    for radius, name in ((inner, "inner"), (outer, "outer")):
        demand(gains.alpha * (radius**2 - gains.radius**2) ** 2 <= 2 * level, f"the {name} circle is not in it")
    demand(error >= 0 and error**2 <= 2 * level, "the velocity's error is not in it")
    return "radii and velocity are in {V <= level}"


STATION_CLAIMS: dict[str, StationKind] = {
    "circle": StationKind("control not limited", attracts),
    "control-limit": StationKind("starts in the plane x = 0 without a rate along X", control_limit),
    "equilibrium": StationKind("control not limited", returns, anywhere=True),
    "saturated-axis": StationKind(HELD, saturated_axis),
}


# --- what refutes it --------------------------------------------------------------------------------------------------


def station_refutation(subject: StationSubject, claim: Numbers, obligation: Mapping[str, Any]) -> str:
    """Check the evidence against an obligation and say what it shows; a CheckError where it does not refute."""
    name, evidence = obligation["name"], obligation["evidence"]
    match claim["kind"], name:
        case "circle", "only the circle":
            return _holds_another(subject.circle, evidence)
        case "circle", "x returns":
            return _leaves(subject.circle, evidence)
        case "control-limit", "control":
            return _needs_more(subject, claim["numbers"], evidence)
        case "equilibrium", "each axis returns":
            return _does_not_return(subject.equilibrium, evidence)
        case _:
            raise CheckError(f"nothing refutes {name}")


def _holds_another(circle: CircleLoop, evidence: Numbers) -> str:
    """A relay holds f2 = f3 = 0 where it has to be 2 alpha |f1| r at most its size; on the circle of evidence, and then on
    all nearer ones: outside of the circle and down to radius/sqrt(3) this falls towards it."""
    demand(set(evidence) == {"radius", "needs", "of"}, "the evidence is not that of another circle")
    circle.form()
    gains, (radius, needs, of) = circle.gains, (rational(evidence[key]) for key in ("radius", "needs", "of"))
    demand(circle.bare, "the feedback is no relay without a layer")
    demand(radius > 0 and radius != gains.radius and 3 * radius**2 >= gains.radius**2, "it is no other circle near this one")
    asked = 2 * gains.alpha * abs(radius**2 - gains.radius**2) * radius
    demand(of == gains.k and _near(needs, asked), "the evidence tells of another relay")
    demand(asked <= gains.k, "the relay does not hold that circle")
    return "the relay holds another circle"


def _leaves(circle: CircleLoop, evidence: Numbers) -> str:
    """A negative or no coefficient lets x be anywhere and stay, or grow; this needs no state to show it."""
    demand(not evidence, "the evidence is not that of a motion along X")
    circle.form()
    position, velocity = circle.across
    demand(position <= 0 or velocity <= 0, "x returns")
    return "x does not return"


def _needs_more(subject: StationSubject, numbers: Numbers, evidence: Numbers) -> str:
    """The law commands more than the limit on the circle itself, near an angle from Y at which all is rational."""
    demand(set(evidence) == {"control", "angle"}, "the evidence is not that of a control")
    _same_limit(subject, numbers)
    demand(rational(numbers["limit"]) == subject.control_limit, "a limit is refuted that is not the loop's")
    circle = subject.circle
    demand(not subject.full and not circle.bare, "the control is read for the linear model, and with a layer")
    # Then the control is the neutral one where f2 = f3 = 0.
    circle.form()
    state = circle.on_it(rational(evidence["angle"]))
    squares = [part.at(state) ** 2 for part in circle.neutral]
    largest = max(squares) if numbers["kind"] == "axis" else sum(squares, ZERO)
    demand(largest > rational(numbers["limit"]) ** 2, "the circle needs no more than the limit")
    told = rational(evidence["control"])
    demand(_near(largest, told**2), "the circle needs another control than told")
    return "the circle itself needs more than the limit"


def _does_not_return(loop: EquilibriumLoop, evidence: Numbers) -> str:
    """An axis r^2 + c r + k with c or k not positive has a root that is not on the left, and a motion that does not decay,
    as near the equilibrium as one likes; this needs no state to show it."""
    demand(not evidence, "the evidence is not that of an axis")
    loop.form()
    demand(not all(loop.stable), "every axis returns")
    return "an axis does not return"
