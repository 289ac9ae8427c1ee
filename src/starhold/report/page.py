"""The page of a comparison, self-contained for offline use, and the data with which it flies its scenario again."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.algebra.structure import flatten
from starhold.analysis.rigid_body import recorded_meter
from starhold.analysis.validity_notes import column_of
from starhold.certification.assumptions import standing
from starhold.laws.interface import Gain
from starhold.report.answer import columns_list, facts, key_metrics, lost_alarm, proofs, ranking, verdicts
from starhold.report.body import report_of
from starhold.report.page_parts import beside, document, fold, law_data, laws_table, plot_box, transient_switch, versions
from starhold.report.plots import colour
from starhold.report.proved import section as proved
from starhold.report.settings import settings, with_units
from starhold.report.tables import note
from starhold.report.text import pretty_unit
from starhold.scenario.quantity import LEAST, MOST, declared
from starhold.scenario.reading import Scenario
from starhold.studies.flight import Flight
from starhold.studies.questions import NEAR, RANGE
from starhold.studies.reflight import Reflight, Reflown, reflight
from starhold.trace.javascript import JavaScript

if TYPE_CHECKING:
    from starhold.report.body import Sampling
    from starhold.trace.program import Program


LABELS = {
    "spacecraft.inertia": "inertia",
    "fault[1].inertia": "true inertia",
    "spacecraft.torque_limit": "torque limit",
    "initial.attitude": "attitude",
    "initial.rate": "rate",
}


FOLDS = {
    "Motion": "attitude, rates, positions",
    "Actuators": "torque, wheels, limits",
    "Sensors and estimate": "what the law measures",
    "Proofs": "every claim, its assumptions, and how it was shown",
    "Linear loop": "margins, Bode and Nichols plots",
    "Numbers and settings": "gains, the spacecraft, what the key numbers mean",
}
"""The folds below the first screen, with a note on the contents of each."""


def living_data(scenario: Scenario, flights: Sequence[Flight], sampling: Sampling) -> dict[str, Any] | str:
    """Return the data of the page's sliders, or the reason why there are none."""
    numbers = {flight.name: number for number, flight in enumerate(flights)}
    made = reflight(scenario, numbers)
    laws = made.laws
    if not any(law.follows for law in laws):
        return "; ".join(sorted({*made.grounded.values(), *(why for law in laws for why in law.unfollowed.values())}))
    table = scenario.table
    keys = [key for key in made.dials if key not in made.gains or key.partition(".")[2].rpartition(".")[0] in numbers]
    return {
        "dials": [_dial(made, key) for key in keys],
        "asked": [
            {"law": one.law, "keys": one.keys, "program": _script(one.program), "refusals": one.refusals}
            for one in made.checks.questions
        ],
        "ranged": made.checks.ranged,
        "ranges": {"near": NEAR, "range": RANGE, "least": LEAST, "most": MOST},
        "linked": dict(scenario.hooks.linked),
        "file": [piece._asdict() for piece in made.pieces],
        "laws": {str(numbers[law.name]): _law(law) | _measured(law, flights[numbers[law.name]], table) for law in laws},
        "grounded": {str(numbers[name]): why for name, why in made.grounded.items() if name in numbers},
        "every": table.simulation.record_every,
        "factor": sampling.factor,
        "early": None if sampling.early is None else dict(zip(("samples", "factor"), sampling.early, strict=True)),
        "claims": _claims(flights, {law.name: law for law in laws}),
        "ranking": _ranking(flights),
    }


def _dial(made: Reflight, key: str) -> dict[str, Any]:
    """Return the numbers, bounds and texts of a key with a slider."""
    item = made.gains.get(key)
    gain = _declared(made.scenario, key) if item is None else item.gain
    bounds = {"above": gain.above, "least": gain.at_least, "most": gain.at_most}
    unit = "" if gain.unit == "1" else pretty_unit(gain.unit)
    dial: dict[str, Any] = {"key": key, "value": made.dials[key], "unit": unit} | bounds
    if item is None:
        dial["degrees"] = unit.startswith("rad") and "deg" in _written(made.scenario, key, made.dials[key])
        return dial | {"label": LABELS.get(key, key), "law": None, "text": ""}
    return dial | {"label": item.name, "law": key.partition(".")[2].rpartition(".")[0], "text": gain.text}


def _declared(scenario: Scenario, key: str) -> Gain:
    """Return the declaration of a key of the scenario's own tables; keys of faults are declared by the craft."""
    table, _, name = key.replace("fault[1]", "spacecraft").partition(".")
    return declared(type(getattr(scenario.table, table)).model_fields[name]) or Gain()


def _written(scenario: Scenario, key: str, value: Any) -> str:
    """Return the text in the file of a key of the scenario's own tables, if it has a unit; else ""."""
    table, _, name = key.partition(".")
    return with_units(scenario.raw.get(table, {}).get(name), value)


def _law(law: Reflown) -> dict[str, Any]:
    """Return the data with which the page flies a law; numbers are encoded as bytes of 64-bit floats."""
    return {
        "name": law.name,
        "fly": _script(law.program),
        "derive": None if law.derive is None else _script(law.derive),
        "follows": law.follows,
        "held": law.unfollowed,
        "places": law.places,
        "carried": law.carried,
        "numbers": _bytes(law.numbers),
        "tables": _bytes(law.tables),
        "memories": [memory.name for memory in law.program.memories],
        "lost": law.lost_place,
        "columns": law.columns,
        "steps": law.steps,
        "seed": [law.seed >> 32, law.seed & 0xFFFFFFFF],
        "run": [law.run >> 32, law.run & 0xFFFFFFFF],
        "period": law.period,
    }


def _measured(law: Reflown, flight: Flight, table: Any) -> dict[str, Any]:
    """Return the equations of a law's metrics; numbers that a slider or the duration changes are given by name."""
    run, settling = flight.recording, table.settling
    every, limit = table.simulation.record_every, run.attrs["limit"]
    tolerances, estimated = (
        (settling.attitude_tolerance, settling.rate_tolerance),
        column_of(run.arrays, run.attrs) is not None,
    )
    transient = () if table.transient is None else (table.transient.angle_end, table.transient.rate_end)
    meter = recorded_meter(0, law.period, every, limit, *tolerances, estimated=estimated, transient=transient)
    program = meter.program(tuple((name, run[name].shape[1:]) for name, _ in law.columns), 0.0)
    known = {
        "memories": [memory.name for memory in program.memories],
        "first": flatten(meter.first),
        "numbers": [*flatten(meter.numbers._replace(tail="tail", last="last")), "limit"],
        "windows": [window.row for window in meter.windows.values()],
        "table": {name: metric._asdict() for name, metric in meter.table.items()},
    }
    return {"note": _script(program), "meter": known}


def _script(program: Program) -> dict[str, str]:
    """Return a program's text and the names of its functions that are called."""
    text = JavaScript(program)
    return {"text": str(text), "name": text.name}


def _bytes(numbers: Any) -> str:
    return base64.b64encode(np.asarray(numbers, dtype="<f8").tobytes()).decode()


def _claims(flights: Sequence[Flight], laws: Mapping[str, Reflown]) -> list[dict[str, Any]]:
    """Return the conditions under which each claim on the page remains valid."""
    claims: list[dict[str, Any]] = []
    for number, flight in enumerate(flights):
        if flight.name not in laws:
            continue
        for place, certificate in enumerate(flight.certificates):
            for i, claim in enumerate(certificate.claims):
                conditions = asdict(standing(claim, laws[flight.name].reads))
                moments = (
                    [certificate.subject["inertia"][k][k] for k in range(3)] if "inertia" in certificate.subject else []
                )
                claims.append({"mark": f"{number}:{place}:{i}", "law": flight.name, "moments": moments, **conditions})
    return claims


def _ranking(flights: Sequence[Flight]) -> dict[str, Any]:
    """Return the measures by which the page ranks laws, and the initial metrics of its table."""
    metric_set = flights[0].metric_set
    metrics = key_metrics(metric_set, {flight.name: flight.metrics for flight in flights})
    shown = [{"name": name} | asdict(metric_set.measures[name]) for name in metrics]
    rows = [
        {
            "name": flight.name,
            "law": flight.law,
            "colour": colour(number),
            "metrics": {name: flight.metrics.get(name) for name in (*metrics, "diverged_at", "cut_off")},
            "limit": _limit(flight),
        }
        for number, flight in enumerate(flights)
    ]
    return {"measures": shown, "order": list(metric_set.order), "rows": rows}


def _flown_again(flight: Flight) -> str:
    """Return a note on the commands in the page's flights, where a process commanded the recorded flight."""
    process = flight.recording.attrs.get("law_process")
    said = f"Flights in this page are commanded by the file's law {flight.name}, not by {process}."
    return note(said) if process else ""


def _limit(flight: Flight) -> dict[str, Any]:
    attrs = flight.recording.attrs
    limit = float(attrs["torque_limit"])
    return {"kind": attrs["limit"], "size": limit if np.isfinite(limit) else None}


def render(scenario: Scenario, flights: Sequence[Flight]) -> str:
    """Return the report of a scenario's flights as HTML; equal flights give equal text. Text from files is escaped."""
    parts = report_of(scenario.body).page(flights, scenario)
    living = "the page of this body has none" if parts.sampling is None else living_data(scenario, flights, parts.sampling)
    (lead, *plots), (required, counts) = parts.data["plots"], verdicts(scenario, flights)
    folds = dict.fromkeys(FOLDS, "") | {"Proofs": proved(flights)}
    for plot in plots:
        folds[plot["topic"]] += plot_box(plot)
    for name, content in parts.folds.items():
        folds[name] += content
    folds["Numbers and settings"] += laws_table(flights) + settings(scenario) + columns_list(flights)
    if isinstance(living, str):
        folds["Try it"] = note(f"Nothing here can be flown again with sliders: {living}.")
    sections = [
        lost_alarm(flights),
        required,
        ranking(flights),
        "" if isinstance(living, str) else _flown_again(flights[0]),
        parts.measured,
        beside(plot_box(lead, 2, transient_switch(parts.transient)), parts.views),
        proofs(flights),
        *(fold(name, content, FOLDS.get(name, "")) for name, content in folds.items()),
    ]
    data, moved = {"laws": law_data(flights), **parts.data}, None if isinstance(living, str) else living
    footer = f"{versions()}{parts.footer}."
    return document(scenario, sections, data, parts.scripts, footer, facts(scenario, flights), counts, moved)
