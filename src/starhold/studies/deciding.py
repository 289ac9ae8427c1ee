"""Verdicts on requirements from proofs, margins of the linear loop and the pointing budget."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from starhold.analysis.departure import momentum_of, shown_at
from starhold.analysis.margins import margins
from starhold.certification.assumptions import FRICTIONLESS, UNLIMITED, WHEELS
from starhold.certification.wording import angle, enumerated, sentence
from starhold.errors import InputError
from starhold.laws.modes import names_of_modes
from starhold.scenario.checking import show
from starhold.studies.body import study_of
from starhold.studies.budget import TOGETHER
from starhold.studies.requirements import Requirement, at_most, read_requirements, tables_of, times_of
from starhold.studies.verification import RequirementVerdict, check_modes, compared, limits, undecided

if TYPE_CHECKING:
    from starhold.analysis.linear import Linear
    from starhold.certification.certificate import Claim
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.scenario.requirement import RequirementTable
    from starhold.studies.body import Issued
    from starhold.studies.budget import Budget

Verdicts = dict[str, RequirementVerdict]
POINTING = "pointing"
BOUNDS: Mapping[str, tuple[str, str, str]] = {
    "final_attitude_error": ("rad", POINTING, "angle"),
    "peak_attitude_error": ("rad", POINTING, "angle"),
    "final_rate_error": ("rad/s", POINTING, "rate"),
    "peak_rate_error": ("rad/s", POINTING, "rate"),
    "settling_time": ("s", POINTING, "settling"),
    "peak_torque": ("N m", "torque-limit", "limit"),
    "peak_wheel_momentum": ("N m s", "wheels", "wheel_momentum"),
}
"""The metrics that claims bound from above, each with its unit, the kind of claim, and the name of the claim's number."""
IDEAL = {
    "continuous-torque": "the zero-order hold of the torque",
    UNLIMITED: "the limit of the torque",
    WHEELS: "the limits and the friction of the wheels",
    FRICTIONLESS: "the friction of the wheels",
    "settled-estimate": "the time until the estimate has settled",
}
"""The text of what a claim leaves out besides parts, by the assumption that stands for it."""
MARGINS = {
    "gain_margin": "gain",
    "lower_gain_margin": "less",
    "phase_margin": "phase",
    "delay_margin": "delay",
    "crossover": "crossover",
    "sensitivity": "sensitivity",
}
"""The metrics of the linear loop, each for the worst of three axes, with their names among the margins of an axis."""
OF_MARGINS = dict(zip(MARGINS, ("1", "1", "rad", "s", "rad/s", "1"), strict=True))


def refuse_other_bodies(scenario: Scenario) -> None:
    """Raise InputError where a requirement names a method that is not available for the scenario's body."""
    for method in ("proof", "budget", "margin"):
        for key in tables_of(scenario, method) if scenario.body != "rigid-body" else ():
            raise InputError(scenario.where, f"{key}.method", show(method), "flight, campaign or inspection, for this body")


# --- by proof ---------------------------------------------------------------------------------------------------------


def check_proofs(scenario: Scenario, entry: LawEntry) -> tuple[Requirement, ...]:
    """Return the requirements that claims decide. InputError for a metric that no claim bounds from above, and for invalid
    modes and times."""
    tables = tables_of(scenario, "proof")
    check_modes(scenario, entry, tables)
    for key, table in tables.items():
        # A proof covers all times, whatever the duration of the flight.
        times_of(scenario, key, table)
    return at_most(scenario, tables, {metric: unit for metric, (unit, _, _) in BOUNDS.items()})


def by_proof(scenario: Scenario, entry: LawEntry, loop: ClosedLoop, issued: Sequence[Issued] | str) -> Verdicts:
    """Return the verdicts from the claims about a law's loop: met, or not decided, because a requirement may hold without a
    proof. issued: the certificates, or the reason why there are none."""
    tables = tables_of(scenario, "proof")
    if isinstance(issued, str):
        return {key: undecided(table, issued) for key, table in tables.items()}
    required = check_proofs(scenario, entry)
    # Later loops have their own certificates, which begin at states that this flight does not reach.
    begun = [one for one in issued if one.step == 0 and one.before is None]
    changes = [f"what changes at {event.step * loop.period:g} s" for event in loop.events][:1]
    return {
        key: _proved(scenario, entry, key, table, one, begun, changes)
        for (key, table), one in zip(tables.items(), required, strict=True)
    }


def _proved(
    scenario: Scenario,
    entry: LawEntry,
    key: str,
    table: RequirementTable,
    required: Requirement,
    issued: Sequence[Issued],
    changes: Sequence[str],
) -> RequirementVerdict:
    """Return the verdict from the claim that meets the limit and leaves out the least, else from the smallest bound, else
    the reason why there is none."""
    _, kind, name = BOUNDS[required.metric]
    modes, place = names_of_modes(entry.law), None
    if modes and table.in_mode is None:
        return undecided(table, f"claims are about single modes: in_mode = {modes[0]}", **limits(table, required))
    place = modes.index(str(table.in_mode)) + 1 if modes else None
    why, verdicts = f"no claim {kind} is proved", list[RequirementVerdict]()
    for one in (one for one in issued if one.mode == place):
        claim = one.certificate.claim(kind)
        if claim is None or claim.outcome != "proved":
            continue
        if not study_of(scenario.body).start_inside(one).get(kind):
            where = "the mode does not begin with the flight, or outside of" if modes else "the flight begins outside of"
            why = f"{where} the set of the claim: {sentence(claim, one.certificate.subject)}"
            continue
        why = _late(scenario, key, table, claim) if kind == POINTING else ""
        times = times_of(scenario, key, table)
        # A requirement without an end covers the flight, or the time after it where it begins there.
        until = times.end if math.isfinite(times.end) else max(scenario.table.simulation.duration, times.begin)
        grown = _grown(one, claim, until)
        unloaded = bool(grown) and any(_unloads(fitted.part) for fitted in one.loop.used("effector"))
        limited = claim.limited_to(until)
        why = why or ("" if unloaded else grown) or (f"the claim holds only if {limited}" if limited else "")
        if why:
            continue
        absent = [*([enumerated(claim.left_out)] if claim.left_out else []), *changes]
        if unloaded:
            absent.append(f"whether unloading keeps the total momentum within {claim.numbers['momentum']:.3g} N m s")
        absent += [text for assumed, text in IDEAL.items() if assumed in claim.assumptions]
        number = claim.numbers.get(name)
        most = max((x for x in number if x is not None), default=None) if isinstance(number, list) else number
        said = sentence(claim, one.certificate.subject)
        if (kind, name) == (POINTING, "angle"):
            begin = _begin(scenario, key, table)
            most = claim.angle_from(begin)
            said = (
                f"within {angle(most, up=True)} from {begin:g} s on; {said}" if begin < claim.numbers["settling"] else said
            )
        evidence = f"proved: {said}"
        verdict = compared(table, required, most, evidence, left_out=tuple(absent))
        if verdict.verdict != "met":
            # A bound beyond the limit does not decide about the number itself.
            said = f"only this bound is {verdict.evidence}"
            verdict = undecided(table, said, number=verdict.number, **limits(table, required))
        verdicts.append(verdict)
    return min(verdicts, key=lambda one: (one.verdict != "met", len(one.left_out)), default=None) or undecided(
        table, why, **limits(table, required)
    )


def _grown(one: Issued, claim: Claim, until: float) -> str:
    """Return a clause with the momentum of body and wheels that external torques may accumulate by a time (s), if it exceeds
    the claim's assumption; else ""."""
    if "bounded-momentum" not in claim.assumptions:
        return ""
    n, subject = claim.numbers, one.certificate.subject
    loop = one.loop.without("sensor", "estimator")
    begun = float(momentum_of(loop, shown_at(loop, loop.start)))
    # The modelled torque, which the law is given, adds to the unmodelled one.
    torque = n.get("torque", 0.0) + (subject["modelled_torque_norm"] if n.get("told", True) else 0.0)
    most = math.inf if n.get("torque_per_rate") else begun + torque * until
    if most <= n["momentum"] * (1.0 + 1e-9):
        return ""
    said = f"of up to {most:.3g} N m s by {until:g} s" if math.isfinite(most) else "without a bound"
    return (
        f"external torques may accumulate a total momentum {said}, but the claim assumes {n['momentum']:.3g} N m s: "
        "set a larger momentum in [certify]"
    )


def _late(scenario: Scenario, key: str, table: RequirementTable, claim: Claim) -> str:
    """Return the reason why a claim of an ultimate bound does not cover the time or the tolerances of a requirement; ""
    where it does."""
    settling, tolerances = claim.numbers["settling"], scenario.table.settling
    if table.metric == "settling_time":
        ends = claim.numbers["angle"] <= tolerances.attitude_tolerance and claim.numbers["rate"] <= tolerances.rate_tolerance
        return "" if ends else "the ultimate bound proved exceeds the tolerances of [settling]"
    if str(table.metric).startswith("final") and table.in_mode is not None:
        return "the last quarter of a mode is not known beforehand; use a peak after some time"
    begin = _begin(scenario, key, table)
    # The angle has a bound at all times.
    covered = settling <= begin or BOUNDS[str(table.metric)][2] == "angle"
    return "" if covered else f"the ultimate bound is proved after {settling:.6g} s, not by {begin:g} s"


def _begin(scenario: Scenario, key: str, table: RequirementTable) -> float:
    """Return the time (s) from which a requirement applies."""
    begin = times_of(scenario, key, table).begin
    late = str(table.metric).startswith("final")
    return begin + 0.75 * (scenario.table.simulation.duration - begin) * late


# --- by margins -------------------------------------------------------------------------------------------------------


def check_margins(scenario: Scenario) -> tuple[Requirement, ...]:
    """Return the requirements that the linear loop decides. InputError for a metric that it does not have."""
    return read_requirements(tables_of(scenario, "margin"), OF_MARGINS, scenario.where)


def by_margins(scenario: Scenario, linear: Linear | str) -> Verdicts:
    """Return the verdicts from the margins of a linear loop, each for the worst axis. linear: the loop, or the reason why
    there is none."""
    tables, required = tables_of(scenario, "margin"), check_margins(scenario)
    pairs = list(zip(tables.items(), required, strict=True))
    if isinstance(linear, str):
        return {key: undecided(table, linear, **limits(table, one)) for (key, table), one in pairs}
    axes = margins(linear) if linear.is_stable else []
    verdicts: Verdicts = {}
    for (key, table), one in pairs:
        values = [(getattr(axis, MARGINS[one.metric]), axis.axis) for axis in axes]
        values = [pair for pair in values if not math.isnan(pair[0])]
        number, axis = (max if one.at_most else min)(values, default=(None, ""))
        evidence = f"the linear loop near rest, about {axis}" if values else "the linear loop is not stable"
        verdicts[key] = compared(table, one, number, evidence, left_out=linear.left_out)
    return verdicts


# --- by budget --------------------------------------------------------------------------------------------------------


def by_budget(scenario: Scenario, budget: Budget | str) -> Verdicts:
    """Return the verdicts from a pointing budget, by the level of all sources together. budget: the budget, or the reason
    why there is none."""
    tables = tables_of(scenario, "budget")
    units = {f"{table.metric}": "rad" for table in tables.values()}
    pairs: Any = zip(tables.items(), at_most(scenario, tables, units), strict=True)
    if isinstance(budget, str):
        return {key: undecided(table, f"no budget: {budget}", **limits(table, one)) for (key, table), one in pairs}
    settings = budget.settings
    share = f"{100.0 * settings.confidence:.6g} % of errors from {settings.start:g} s on, {settings.runs} runs"
    faults = ("faults, which a budget leaves out",) if scenario.table.fault else ()
    return {
        key: compared(table, one, budget.level(TOGETHER, one.metric.upper()), f"budget: {share}", left_out=faults)
        for (key, table), one in pairs
    }


def _unloads(part: Any) -> bool:
    """Return whether an effector unloads the wheels by an external torque and does not take the command."""
    return part.flag("OUTSIDE") and not part.flag("ACTS") and "wheels" in part.needs
