"""Certificates of invariant sets: what the file says, read again and shown by other methods than the certifier's.

What these methods do not reach is "not checked", and such a certificate does not pass.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from typing import Any, TypeAlias

from flint import fmpq

from starhold.algebra.scalar import maximum
from starhold.checker.area import area
from starhold.checker.cells import polynomial, split
from starhold.checker.exact import CheckError, NotCheckedError, Verdict, demand, limited, rational
from starhold.checker.indicator import Indicator
from starhold.checker.reading import number, read, read_names
from starhold.checker.shapes import CLAIM, OBLIGATION, certificate_shaped, outcome_of, shaped

FORMAT = "starhold invariant certificate 2"
THEOREMS = ("stable", "attracts", "region", "unstable", "intersection")
HOW = ("exact identity", "exact inequality", "interval arithmetic")
ASSUMED = [
    "the equations exactly as given",
    "where the right-hand side jumps, motions in the sense of Filippov: x' is any mean of what it is on the sides and on "
    "the surface",
]
MOST = 6
NAMES = (
    "equilibrium",
    "continuous",
    "set",
    "positive",
    "positive nearby",
    "bounded",
    "falls",
    "grows",
    "switching",
    "leaves",
    "invariant",
)
Told: TypeAlias = tuple[str, str, Verdict, str]
"""Claim, obligation, verdict and reason."""


def told(work: Callable[[], str]) -> tuple[Verdict, str]:
    """Verdict and reason of a piece of work."""
    try:
        with limited():
            return "holds", work()
    except NotCheckedError as open_:
        return "not checked", str(open_)
    except CheckError as fault:
        return "fails", str(fault)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        return "fails", f"cannot be verified: {error}"


def invariant_findings(given: Any) -> Iterator[Told]:
    """The findings about one certificate."""
    verdict, reason = told(lambda: _shape(given))
    if verdict != "holds":
        yield "", "", verdict, reason
        return
    for place, claim in enumerate(given["claims"]):
        kind = str(claim.get("kind", ""))
        found: list[Told] = []
        verdict, reason = told(lambda: _claim(given["subject"], place, claim, found))  # noqa: B023
        if verdict == "holds":
            yield from found
        else:
            yield kind, "", verdict, reason


def _shape(given: Any) -> str:
    certificate_shaped(given)
    demand(len(given["claims"]) > 0, "there are no claims")
    demand(given["outcome"] == outcome_of([c.get("outcome") for c in given["claims"]]), "the outcome does not follow")
    allowed = {"variables", "parameters", "define", "rates", "V", "equilibrium", "escape", "squares"}
    demand(set(given["subject"]) <= allowed and {"variables", "parameters", "rates"} <= set(given["subject"]), "the subject")
    return ""


def _claim(subject: Mapping[str, Any], place: int, claim: Any, found: list[Told]) -> str:
    shaped(claim, CLAIM, "the claim")
    for obligation in claim["obligations"]:
        shaped(obligation, OBLIGATION, "an obligation")
        demand(obligation["name"] in NAMES and obligation["how"] in HOW, "an obligation is none of such a claim")
    demand(claim["outcome"] == outcome_of([o["outcome"] for o in claim["obligations"]]), "the outcome does not follow")
    what = _indicator(subject, place, claim)
    named = ASSUMED if len(claim["assumptions"]) > 1 else ASSUMED[:1]
    demand(claim["assumptions"] == named, "the assumptions are not those of such a claim")
    kind = claim["kind"]
    if claim["outcome"] != "proved":
        for obligation in claim["obligations"]:
            name, outcome = obligation["name"], obligation["outcome"]
            verdict, reason = "not claimed", f"{outcome}, the claim is not proved"
            if outcome == "refuted":
                shown, why = told(lambda: refuted(what, obligation))  # noqa: B023
                verdict, reason = ("not claimed", f"refuted: {why}") if shown == "holds" else (shown, f"not refuted: {why}")
            found.append((kind, name, verdict, reason))
        return ""
    demand([o["name"] for o in claim["obligations"]] == _needed(what), f"the obligations are not {', '.join(_needed(what))}")
    demand(not what.jumps or len(named) == 2, "motions where the right-hand side jumps are not told of")
    for obligation in claim["obligations"]:
        found.append((kind, obligation["name"], *told(lambda: _proof(what, obligation))))  # noqa: B023
    found += [(kind, name, *told(work)) for name, work in _remarks(what, claim)]
    if "known" in claim["numbers"]:
        found.append((kind, "known", "not claimed", "how large the true region is, is told and not shown"))
    return ""


def _indicator(subject: Mapping[str, Any], place: int, claim: Mapping[str, Any]) -> Indicator:
    numbers, witness = claim["numbers"], claim["witness"]
    theorem = numbers.get("theorem")
    demand(theorem in THEOREMS and claim["kind"] == f"invariant-{theorem}", "the kind is not that of the theorem")
    demand(set(numbers) <= {"theorem", "level", "limited_by", "refuted_level", "size", "known"}, "there are other numbers")
    demand({"box"} <= set(witness) <= {"name", "box", "limit"}, "the witness has not the keys of such a claim")
    if "V" not in subject or not all(isinstance(text, (str, int, float)) for text in subject["rates"].values()):
        raise NotCheckedError("the certificate does not hold the text of the system")
    variables, parameters = subject["variables"], subject["parameters"]
    names = [*variables, *parameters]
    demand(0 < len(variables) <= len(names) <= MOST and all(isinstance(n, str) for n in names), "the variables")
    known = read_names(names, subject.get("define", {}))
    demand(set(subject["rates"]) == set(variables), "the rates are not those of the variables")
    rates = [read(subject["rates"][name], known) for name in variables]
    text = subject["V"][place]
    V = reduce(maximum, (*(read(t, known) for t in text), 0)) if theorem == "intersection" else read(text, known)
    box = [(rational(low), rational(high)) for low, high in witness["box"]]
    demand(len(box) == len(names) and all(low < high for low, high in box), "the box has not a side for every name")
    at = _of(subject, "equilibrium", place)
    if at is not None:
        demand(set(at) == set(variables), "the equilibrium has not the names of the variables")
        at = (*(fmpq(*number(at[name]).as_integer_ratio()) for name in variables), *(None for _ in parameters))
    listed = [o["name"] for o in claim["obligations"]]
    named = {"equilibrium", "positive", "positive nearby"} & set(listed)
    demand(at is not None or not named, "there is no equilibrium in the subject")
    pieces = split(names, len(variables), box, at, rates, V)
    ring = pieces.cells[0].V.context()
    escape, squares = _of(subject, "escape", place), _of(subject, "squares", place) or ()
    level = numbers.get("level")
    if theorem != "unstable" and claim["outcome"] == "proved":
        demand(isinstance(level, (int, float)) and not isinstance(level, bool) and level > 0, "there is no level")
    return Indicator(
        pieces,
        theorem,
        None if level is None or theorem == "unstable" else rational(level),
        None if escape is None else polynomial(ring, names, read(escape, known)),
        tuple(polynomial(ring, names, read(h, known)) for h in squares),
        frozenset(listed),
    )


def _of(subject: Mapping[str, Any], key: str, place: int) -> Any:
    """The entry of the subject for one claim, None if there is none."""
    return subject[key][place] if key in subject else None


def _needed(what: Indicator) -> list[str]:
    """The obligations of a proved claim, in their order. What more is told where the checker can do without is shown too."""
    unstable, point = what.theorem == "unstable", what.pieces.equilibrium is not None
    names = ["equilibrium", "continuous", "set"] if point else ["continuous", "set"]
    if unstable:
        names += ["positive nearby" if point else "bounded", "grows"]
    else:
        names += ["positive", "bounded", "falls"] if point else ["bounded", "falls"]
    if what.jumps or "switching" in what.told:
        names.append("switching")
    if "leaves" in what.told and what.theorem in ("attracts", "region", "intersection"):
        names.append("leaves")
    return names if point or unstable else [*names, "invariant"]


def _proof(what: Indicator, obligation: Mapping[str, Any]) -> str:
    demand(obligation["outcome"] == "proved", "it is not proved")
    name, evidence = obligation["name"], obligation["evidence"]
    demand(
        set(evidence) <= {"set": {"state"}, "positive nearby": {"direction"}}.get(name, set()),
        "there is evidence against it",
    )
    if name == "set":
        return what.set(_numbers(evidence.get("state", {})))
    if name == "positive nearby":
        return what.positive_nearby(_ordered(what, evidence["direction"]))
    return {
        "equilibrium": what.equilibrium,
        "continuous": what.continuous,
        "positive": what.positive,
        "bounded": what.bounded,
        "falls": what.falls,
        "grows": what.falls,
        "switching": what.switching,
        "leaves": what.leaves,
        "invariant": what.invariant,
    }[name]()


def _numbers(state: Any) -> dict[str, Any]:
    return {name: rational(x) for name, x in state.items()}


def _ordered(what: Indicator, values: Any) -> list[Any]:
    demand(set(values) == set(what.pieces.names), "a direction has not the names of the variables")
    return [rational(values[name]) for name in what.pieces.names]


def _remarks(what: Indicator, claim: Mapping[str, Any]) -> Iterator[tuple[str, Callable[[], str]]]:
    """Checks of what is said beside the obligations: why the level is not larger, and the size of the set."""
    numbers = claim["numbers"]
    if "limited_by" in numbers or "refuted_level" in numbers:
        yield "limit", lambda: _limit(what, numbers, claim["witness"].get("limit"))
    if "size" in numbers:
        yield "size", lambda: area(what, *map(rational, numbers["size"]))


def _limit(what: Indicator, numbers: Mapping[str, Any], state: Any) -> str:
    if state is None:
        raise NotCheckedError("no state that limits the level is in the file")
    # V is told as the nearest float.
    level = rational(numbers["refuted_level"]) * (1 + fmpq(1, 2**50))
    demand(what.level is not None and what.level < level, "the level is not below what limits it")
    limit = {"V rises": _rises, "border": _reaches}[numbers["limited_by"]]
    return limit(what, _numbers(state), level)


def _rises(what: Indicator, values: Mapping[str, Any], level: Any) -> str:
    """That V does not fall (for instability: grow) at a state with 0 < V <= level, or that the state is an equilibrium."""
    sense = what.sense
    state = what.pieces.state(values)
    cells = what.pieces.around(state)
    demand(len(cells) == 1, "a state is not inside of one cell")
    V, slope = cells[0].V(*state), sense * cells[0].slope(cells[0].V)(*state)
    still = sense < 0 or (what.theorem != "stable" and all(rate(*state) == 0 for rate in cells[0].rates))
    demand(V > 0 and (level is None or level >= V), "V is not between zero and the level at the state")
    demand(slope > 0 or (slope == 0 and still), "V changes at the state as it has to")
    return "V at a state"


def _reaches(what: Indicator, values: Mapping[str, Any], level: Any) -> str:
    """That V is not above the level at a state on the border."""
    state = what.pieces.state(values)
    sides = list(zip(state, what.pieces.box, strict=True))[: what.pieces.moving]
    demand(any(x in side for x, side in sides), "the state is not on the border of the box")
    demand(what.pieces.value(state) <= (0 if level is None else level), "V is above the level at the state")
    return "V at a state on the border"


def refuted(what: Indicator, obligation: Mapping[str, Any]) -> str:
    """That an obligation is false at the state that the file has."""
    name, evidence = obligation["name"], obligation["evidence"]
    if "direction" in evidence and name == "falls":
        demand(what.grows_near(_ordered(what, evidence["direction"])), "V does not rise on the way")
        return "V rises however near the equilibrium"
    if "state" not in evidence or name in ("invariant", "leaves", "switching", "positive nearby"):
        raise NotCheckedError("a refutation of this form")
    if name in ("equilibrium", "set"):
        return _at_the_equilibrium(what, name)
    values = _numbers(evidence["state"])
    if name in ("falls", "grows"):
        return _rises(what, values, what.level)
    if name == "bounded":
        return _reaches(what, values, what.level)
    state = what.pieces.state(values)
    if name == "continuous":
        found = {str(cell.V(*state)) for cell in what.pieces.around(state)}
        demand(len(found) > 1, "V is the same from all sides at the state")
        return "V jumps at a state"
    point = what.pieces.equilibrium or ()
    demand(any(p is not None and p != x for p, x in zip(point, state, strict=True)), "the state is the equilibrium")
    demand(what.pieces.value(state) <= 0, "V is positive at the state")
    return "V is not positive at a state"


def _at_the_equilibrium(what: Indicator, name: str) -> str:
    try:
        what.equilibrium() if name == "equilibrium" else what.set({})
    except NotCheckedError:
        raise
    except CheckError as fault:
        return str(fault)
    raise CheckError("it holds")
