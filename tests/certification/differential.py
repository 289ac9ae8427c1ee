"""Scenarios that differ from another one in one key, or in one part, and what is said of them with its certificate."""

import copy
import math
import warnings

import numpy as np

import starhold as sh
from starhold.analysis.departure import start_inside
from starhold.errors import InputError
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import PACKAGES, parts
from starhold.scenario.building import build
from starhold.scenario.writing import part_table
from starhold.simulation.lane import fly, label
from starhold.studies.certificates import compare_programs, left_open

WORDS = {
    "limit": ("axis", "norm", "none"),
    "quaternion_sign": ("as_published", "shortest", "hysteresis"),
    "layout": ("orthogonal", "pyramid", "nasa-standard"),
    "allocation": ("least-squares", "least-peak"),
    "mode": ("inertial", "orbital"),
}
"""The words that keys may have."""
NOT_FLOWN = ("name", "description", "requirement", "campaign", "settling", "budget", "initial", "transient")
"""Tables and keys of no loop, or of its start alone."""
SAYING = ("bound", "error", "motion", "noise", "perturbation")
"""With one of these a part says what it does at most."""
STEPS = 4000


def others(tables):
    """What is changed, and tables with that: every number a little more or less, other words, parts that are added or not
    there."""
    for path, value in _leaves({name: one for name, one in tables.items() if name not in NOT_FLOWN}):
        for other in _altered(value, path[-1] if isinstance(path[-1], str) else path[-2]):
            yield ".".join(map(str, path)), _with(tables, path, other)
    for place, one in enumerate(tables.get("part", ())):
        yield f"without {one['type']}", tables | {"part": tables["part"][:place] + tables["part"][place + 1 :]}
    for role in PACKAGES.keys() - {"body"}:
        for name, part in parts(role).items():
            if not part.table:
                added = part_table(part, part.examples()[0])
                yield f"with {name}", tables | {"part": [*tables.get("part", ()), added]}


def _leaves(x, path=()):
    if isinstance(x, dict):
        for name, one in x.items():
            yield from _leaves(one, (*path, name))
    elif isinstance(x, list):
        for place, one in enumerate(x):
            yield from _leaves(one, (*path, place))
    else:
        yield path, x


def _altered(value, key):
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int | float):
        return [1.3 * value, 0.7 * value] if value else [1e-3]
    number, _, unit = value.partition(" ")
    try:
        return [f"{share * float(number)!r} {unit}" for share in (1.3, 0.7)]
    except ValueError:
        return [word for word in WORDS.get(key, ()) if word != value]


def _with(tables, path, value):
    tables = copy.deepcopy(tables)
    place = tables
    for one in path[:-1]:
        place = place[one]
    place[path[-1]] = value
    return tables


def judged(path, issued, said, changed, tables):
    """Yield, for each law of the certificates at a path, its name, what is wrong with what is said of other tables with
    its own one, and how they were judged. issued: of each law its name, its certificate, its claim as it flies, if that is
    proved, and its loop; said: what is left open of the scenario that they were made for."""
    try:
        with warnings.catch_warnings(action="ignore"):
            # Of an orbit that meets the ground, say.
            scenario = sh.scenario(tables)
        differing = compare_programs(path, scenario)
        loops = {name: build(scenario, scenario.pick(name)) for name, *_ in issued}
        # As `check` does, it is asked only about loops that the proofs are of.
        left = [] if differing else [text for text in left_open(path, scenario) if text not in said]
    except InputError:
        yield from ((name, "", "refused") for name, *_ in issued)
        return
    for name, certificate, claim, base in issued:
        if any(text.startswith(f"{name}: ") for text in differing):
            yield name, "", "another"
        elif differing or claim is None:
            yield name, "", "not judged"
        elif any(text.startswith(f"{name}: ") for text in left):
            yield name, "", "said"
        elif not start_inside(certificate, loops[name])["pointing"]:
            yield name, "", "outside"
        else:
            yield name, _unsaid(loops[name], base, changed) or _beyond(loops[name], claim, changed), "silent"


def _unsaid(loop, base, changed):
    """Which parts act of which nothing is said."""
    parts = [f.called for f in loop.parts if f not in base.parts and not any(map(f.part.hook, SAYING)) and _acts(f)]
    return f"{changed}: nothing is said of {parts}" if parts else ""


def _beyond(loop, claim, changed):
    """How a flight contradicts a claim."""
    run = label(loop, *fly(loop, STEPS), 1)
    angles = 2.0 * np.arcsin(np.minimum(np.linalg.norm(run.arrays["attitude_error"][:, 1:], axis=1), 1.0))
    for time, most in claim.numbers["funnel"]:
        later = angles[math.ceil(time / loop.period) :]
        if len(later) and later.max() > most * (1.0 + 1e-6):
            return f"{changed}: {later.max():.3g} rad after {time:.4g} s, and not {most:.3g}"
    return ""


def _acts(fitted):
    """Whether a part does more than hold the orbit, pull as laws are told, or show what no law reads by itself."""
    if fitted.part.role == "sensor":
        return bool({*fitted.part.module.Reading._fields} & {*State._fields})
    return fitted.part.name not in ("two-body", "gravity-gradient")
