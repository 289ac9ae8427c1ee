"""Certificates of station-keeping loops: their subjects and their claims. These depend on the set that a law declares to
make attractive: errors that vanish there, with their V, or an equilibrium."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from starhold.certification.certificate import BALLS, EXACT, EXACT_SIGN, Certificate, Claim, Obligation, Proof
from starhold.certification.evidence.finding import certificate
from starhold.certification.evidence.station import HELD, MORE, UNSHOWN, Station, full_problem
from starhold.certification.proofs import steps_of
from starhold.certification.subject import described_gains
from starhold.certification.unmodelled import assumed_away, named
from starhold.kernel.check import Proved, check
from starhold.loop.closed_loop import ClosedLoop

SURE = ("circling-bodies", "exact-place", "continuous-control")
"""The assumptions about every loop."""
WEAK, ASIDE = "the feedback is too weak", "the other axes cannot be held with so little control"


def certify_station(loop: ClosedLoop, name: str = "") -> Certificate:
    """Return the certificate of a station-keeping loop; without claims, which is undecided, for a law that declares nothing
    that it makes attractive, or keeps a memory."""
    station, claims, law = Station(loop), list[Claim | None](), loop.law
    circle = law.hook("errors") is not None and law.lyapunov is not None
    # What overflows in a guess is caught where the guess is verified.
    with np.errstate(all="ignore"):
        if circle and not loop.remembers:
            claims = _circle(station)
        elif law.hook("rest") is not None and not loop.remembers:
            claims = _rest(station)
    content = certificate(list(station.programs.values()), station.claims)
    shown = zip(check(json.dumps(content)) if station.claims else (), station.claims, strict=True)
    made = [made_of_station(*next(shown), station) if claim is None else claim for claim in claims]
    return Certificate(name or law.name, described_station(loop), named(made, loop))


def _circle(station: Station) -> list[Claim | None]:
    """Return claims that are undecided, and None for each that the station has evidence of."""
    loop, limit = station.loop, station.loop.saturation_limit()
    if why_not := _tried(station.show_circle):
        other = _tried(station.show_astray) and _tried(station.show_held)
        return [_undecided(loop, "circle", "form", why_not) if other else None]
    if loop.limit == "none" or not math.isfinite(limit):
        return [None]
    why = "only for a law that undoes the linear model alone"
    if not full_problem(loop):
        why = _tried(lambda: station.show_limit(loop.limit, limit))
    details = {"limit": limit, "kind": loop.limit}
    return [None, _undecided(loop, "control-limit", "control", why, details) if why else None]


def _rest(station: Station) -> list[Claim | None]:
    loop, limit = station.loop, station.loop.saturation_limit()
    if why_not := _tried(station.show_rest):
        return [_undecided(loop, "equilibrium", "form", why_not) if _tried(station.show_astray) else None]
    if loop.limit != "axis" or not math.isfinite(limit) or full_problem(loop):
        return [None]
    why = _tried(lambda: station.show_limited_axis(limit))
    details = {"limit": limit}
    return [None, _undecided(loop, "saturated-axis", "stays", ASIDE if "held" in why else WEAK, details) if why else None]


def _tried(show: Callable[[], None]) -> str:
    """Return why no evidence was found; empty where some was."""
    try:
        show()
    except UNSHOWN as reason:
        return str(reason)
    except (OverflowError, ZeroDivisionError, ValueError) as reason:
        return f"gains and plant are too far apart in size: {reason}"
    return ""


def _undecided(loop: ClosedLoop, kind: str, obligation: str, why: str, details: Any = None) -> Claim:
    beside = {"control-limit": "in-the-plane", "saturated-axis": "held-aside"}.get(kind, "unlimited-control")
    names = ["whole-field" if full_problem(loop) else "linear-field", *SURE, beside]
    names += ["off-the-bodies"] if kind == "equilibrium" and full_problem(loop) else []
    how = EXACT if obligation == "form" else BALLS
    reason = {"reason": _mismatch(loop) or why}
    return Claim(kind, details or {}, {}, tuple(names), (Obligation(obligation, how, "undecided", reason),))


def _mismatch(loop: ClosedLoop) -> str:
    """Return how the model that a law cancels differs from the one that flies; empty where it does not."""
    undoes = bool(getattr(loop.gains, "model", full_problem(loop)))
    if undoes == full_problem(loop):
        return ""
    if undoes:
        return "the law cancels terms that the linear model lacks"
    return "the law cancels the linear model, but the full problem is flown"


STATED = ("level", "inner", "outer", "velocity", "limit", "width", "reach", "boundary")
"""The numbers that a claim states."""
AGAINST = {MORE: ("control", "control", "y", "z"), HELD: ("only the circle", "radius", "needs", "of")}
"""The obligation that fails by each theorem that refutes, and the numbers that show it."""


def made_of_station(proved: Proved, given: Mapping[str, Any], station: Station) -> Claim:
    """Return a claim with the numbers, assumptions and obligations that the kernel reports."""
    statement = proved.statement
    numbers = {name: float(x) for name, x in proved.claim.numbers.content.items()}
    limit = next((name for name in ("norm", "axis") if f"limit.{name}" in numbers), None)
    details: dict[str, Any] = {} if limit is None else {"limit": numbers[f"limit.{limit}"], "kind": limit}
    details |= {name: x for name, x in numbers.items() if name in STATED and not statement.refutes}
    shown = steps_of(proved)
    if statement.refutes:
        returns = "x returns" if statement.label == "circle" else "each axis returns"
        name, *against = AGAINST.get(given["theorem"], (returns,))
        shown = [Obligation(name, EXACT_SIGN, "refuted", {key: numbers[key] for key in against})]
    programs = {name: station.by_digest[name] for name in given["programs"].values()}
    return Claim(statement.label, details, {}, statement.assumptions, tuple(shown), Proof(dict(given), programs))


def described_station(loop: ClosedLoop) -> dict[str, Any]:
    """Return the loop as plain numbers and names, with which its programs are recorded again."""
    lag = loop.find("lag")
    return {
        "law": loop.law.name,
        "gains": described_gains(loop.law, loop.gains),
        "plant": loop.craft._asdict(),
        "nominal": loop.known._asdict(),
        "model": "nonlinear" if full_problem(loop) else "linear",
        "limit": loop.limit,
        "control_limit": loop.saturation_limit() if math.isfinite(loop.saturation_limit()) else None,
        "lag": 0.0 if lag is None else lag.params.lag,
        "control_period": loop.period,
        "assumed_away": assumed_away(loop),
        "parts": len(loop.parts),
    }
