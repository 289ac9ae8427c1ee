"""Flights for the tests of the report: short runs of built-in scenarios."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from starhold.analysis.rigid_body import METRICS, measure
from starhold.report.body import report_of
from starhold.report.figures import paint
from starhold.report.plots import colour
from starhold.scenario.building import build
from starhold.scenario.reading import Scenario, builtin_text, parse
from starhold.simulation.lane import Recording, fly, label
from starhold.studies.compare import compare
from starhold.studies.flight import Flight

GAINS = {"k_rate": (0.09, "N m s"), "switching_gain": ("<5>", "mN m")}
HOSTILE = '</script><script>alert("ruse")</script><b>$x_1$ & co'


@cache
def text() -> str:
    """Twenty seconds of the three laws without the predictive one."""
    return builtin_text("three-laws").split('[[law]]\ntype = "mpc"')[0].replace("duration = 2000.0", "duration = 20.0")


def scenario(name: str = "three-laws", description: str = "A turn & a <half>") -> Scenario:
    """The short scenario under another name and description."""
    head, rest = text().split("[spacecraft]", 1)
    assert 'name = "three-laws"' in head
    return called(parse(f"name = 'plain'\ndescription = '{description}'\n[spacecraft]{rest}", "test"), name)


def called(scenario: Any, name: str) -> Any:
    """The scenario under any name: a file with such a one is refused, and pages show what they get as it stands."""
    return replace(scenario, table=scenario.table.model_copy(update={"name": name}))


@cache
def flights() -> tuple[Flight, ...]:
    """The laws of the short scenario, flown."""
    found = scenario()
    table = found.table
    made: list[Flight] = []
    for entry in found.laws:
        loop = build(found, entry)
        run = label(loop, *fly(loop, table.simulation.steps), 1)
        metrics = measure(run, table.settling.attitude_tolerance, table.settling.rate_tolerance)
        made.append(Flight(entry.name, entry.law.name, run, metrics, GAINS, METRICS))
    return tuple(made)


@cache
def told(name: str, duration: str = "1 yr") -> Scenario:
    """A built-in scenario, shorter."""
    text = builtin_text(name)
    for years in ("1 yr", "2 yr", "4 yr", "10 yr"):
        text = text.replace(f'duration = "{years}"', f'duration = "{duration}"')
    return parse(text, name)


@cache
def stations(name: str) -> tuple[Flight, ...]:
    """Its laws, flown."""
    return tuple(compare(told(name)))


def draw(flights: Any, folder: Path, scenario: Any) -> list[Path]:
    """Draw the pictures of some flights into a folder."""
    return paint(report_of(scenario.body).picture(flights, scenario), folder)


def pixels(path: Path) -> np.ndarray:
    """A picture as an array (rows, columns, 3)."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def shows_laws(picture: np.ndarray, count: int) -> bool:
    """Whether a picture has curves in the colours of the first laws."""
    wanted = [np.array([int(colour(number)[i : i + 2], 16) for i in (1, 3, 5)]) for number in range(count)]
    return all((np.abs(picture - one).max(axis=2) < 12).sum() > 20 for one in wanted)


def lost(name: str = "wild") -> Flight:
    """A run that ends after a third of the others' time, faster and faster."""
    first = flights()[0]
    arrays = {name: values[:67] for name, values in first.recording.arrays.items()}
    arrays["rate_error"] = np.repeat(np.exp(np.linspace(0.0, 20.0, 67))[:, None], 3, axis=1)
    run = Recording(arrays, first.recording.attrs | {"diverged_at": 6.7})
    return Flight(name, "pd", run, measure(run, 2e-3, 1e-3), {}, METRICS)


def still() -> Flight:
    """A run at rest on target: all errors and torques are zero."""
    first = flights()[0]
    arrays = {name: values.copy() for name, values in first.recording.arrays.items()}
    arrays["attitude_error"][:] = (1.0, 0.0, 0.0, 0.0)
    arrays["rate_error"][:] = 0.0
    arrays["torque"][:] = 0.0
    run = Recording(arrays, first.recording.attrs)
    return Flight("still", "pd", run, measure(run, 2e-3, 1e-3), {}, METRICS)


def renamed(flight: Flight, name: str) -> Flight:
    """A flight under another name."""
    return Flight(name, flight.law, flight.recording, flight.metrics, flight.gains, METRICS)
