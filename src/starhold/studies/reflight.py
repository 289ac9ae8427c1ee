"""Programs with which a scenario flies again elsewhere with other numbers: each law's loop, and the equations that compute
its numbers from values of the file's keys. A key whose effect no equation gives, as on a law's matrices, cannot be changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import or_
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten, leaves, mapped
from starhold.errors import InputError
from starhold.laws.interface import Field
from starhold.laws.modes import mode_laws
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import Arguments, Numbers, make_program, numbers_of
from starhold.loop.programs import one
from starhold.scenario.building import build
from starhold.scenario.checking import read_toml
from starhold.scenario.making import changed, names_of, path_of, plain, variants
from starhold.scenario.reading import LawEntry, Scenario
from starhold.scenario.writing import toml_text
from starhold.simulation.lane import recorded
from starhold.studies.flat import Flat
from starhold.studies.questions import Asked, ask
from starhold.trace.calling import record_call
from starhold.trace.handles import Handle
from starhold.trace.program import Load, Program, statements
from starhold.trace.rows import unrolled

Array: TypeAlias = NDArray[np.float64]
Values: TypeAlias = dict[str, Any]
"""Numbers, vectors or matrices by the keys of a file."""

FAULTS = "faults change the loop in flight"
SUPPOSED = "its nominal model is not the craft that flies"
MODES = "its modes have their own gains, which the page cannot change"
COMPUTED = "it affects numbers that no recorded equation gives, such as a law's matrices"
ALONE = "no other value than the file's is allowed"
TRIED = ((1.05, 0.97, 1.02), (1.02, 1.02, 1.02), (0.9, 0.9, 0.9))
"""Factors by which components are changed to determine their effects; the first that the scenario accepts is used."""
NUDGE = 1e-3
"""The value that replaces a zero for this."""


@dataclass(frozen=True)
class Reflown:
    """One law's loop, to be flown elsewhere.

    program: `fly` as recorded by `kernels.one`; derive: computes, from the values of the keys `follows` in order, the
    numbers at `places`, indices in the carry followed by the shared arguments; numbers, tables: those of the scenario;
    unfollowed: the reasons why other keys are not followed; every, steps, seed, run, period: as for `fly`; columns: the
    recorded quantities with their numbers of components; reads: the numbers of the nominal model that the law uses,
    "inertia" or "torque_limit"."""

    name: str
    program: Program
    derive: Program | None
    follows: tuple[str, ...]
    places: tuple[int, ...]
    carried: int
    numbers: Array
    tables: Array
    lost_place: int
    columns: tuple[tuple[str, int], ...]
    steps: int
    seed: int
    run: int
    period: float
    unfollowed: dict[str, str] = field(default_factory=dict[str, str])
    reads: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Reflight:
    """A scenario to be flown again: the keys that can be changed, with their values; the laws; the reasons why other laws
    cannot fly again; and the file, with blanks for the keys' values, see `pieces`."""

    scenario: Scenario
    dials: Values
    gains: dict[str, Field]
    laws: tuple[Reflown, ...]
    grounded: dict[str, str]
    pieces: tuple[Piece, ...]
    checks: Asked

    def changed(self, values: Mapping[str, Any]) -> Scenario:
        """Return the scenario with these values of keys of `dials`, as in the file that the page writes."""
        return changed(self.scenario, _changes(self.scenario, values))


class Piece(NamedTuple):
    """A piece of a file: a text, or the value of a key. `only`: a key; unless it is changed, the piece is left out."""

    text: str = ""
    key: str = ""
    only: str = ""


def reflight(scenario: Scenario, laws: Collection[str] | None = None) -> Reflight:
    """Return the programs that fly the laws of these names, or all laws, again. Designed gains keep their values, which the
    scenario then states as numbers."""
    explicit = _explicit(scenario)
    dials = dict(explicit.hooks.dials(explicit))
    shared = list(dials)
    gains: dict[str, Field] = {}
    grounded: dict[str, str] = {}
    for entry in explicit.laws:
        if mode_laws(entry.law, entry.gains):
            grounded[entry.name] = MODES
            continue
        for item, value in zip(entry.law.fields(), entry.gains, strict=True):
            if _is_numbers(value) and not item.gain.whole and not item.gain.choices:
                key = f"law.{entry.name}.{item.name}"
                dials[key], gains[key] = value, item
    # An attitude given by angles is changed as a quaternion.
    explicit = changed(explicit, _changes(explicit, {key: dials[key] for key in shared if key == "initial.attitude"}))
    tried = _Tried(explicit, dials)
    reflown: list[Reflown] = []
    flown = {entry.name for entry in explicit.laws if laws is None or entry.name in laws}
    makers = {entry.name: build if entry.name in flown else explicit.hooks.build for entry in explicit.laws}
    loops = {entry.name: makers[entry.name](explicit, entry) for entry in explicit.laws}
    checks = ask(explicit, loops, dials, flown)
    for entry in explicit.laws:
        loop = loops[entry.name]
        if entry.name in grounded or entry.name not in flown:
            continue
        if loop.events:
            grounded[entry.name] = FAULTS
        elif loop.nominal is not None:
            grounded[entry.name] = SUPPOSED
        else:
            names = {f"law.{entry.name}.{item.name}" for item in entry.law.fields()}
            gain_keys = [key for key in gains if key in names]
            reflown.append(
                _reflown(explicit, entry, loop, {key: dials[key] for key in (*shared, *gain_keys)}, tried, checks.fixed)
            )
    return Reflight(explicit, dials, gains, tuple(reflown), grounded, tuple(_pieces(explicit, dials)), checks)


def _is_numbers(value: Any) -> bool:
    return all(isinstance(leaf, float) and math.isfinite(leaf) for leaf in leaves(value)) and value != ()


def _explicit(scenario: Scenario) -> Scenario:
    """Return the scenario with designed gains written as numbers."""
    if all(entry.form is None for entry in scenario.laws):
        return scenario
    changes: dict[str, Any] = {}
    for place, entry in enumerate(scenario.laws, 1):
        if entry.form is None:
            continue
        changes |= {f"law[{place}].{item.name}": None for item in entry.law.fields(entry.form)}
        changes[f"law[{place}].form"] = None
        for item, value in zip(entry.law.fields(), entry.gains, strict=True):
            changes[f"law[{place}].{item.name}"] = item.written(value)
    return changed(scenario, changes)


def _changes(scenario: Scenario, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the changes of the file that set dials to these values."""
    of_law = {key: value for key, value in values.items() if key.startswith("law.")}
    return scenario.hooks.changes({key: value for key, value in values.items() if key not in of_law}) | of_law


class _Tried:
    """Scenarios with other values of some keys, each read once for all laws."""

    def __init__(self, scenario: Scenario, dials: Values) -> None:
        self.scenario, self.dials = scenario, dials
        self._known: dict[tuple[str, ...], tuple[Values, Scenario] | None] = {}

    def of(self, first: str, *more: str) -> tuple[Values, Scenario] | None:
        """Return other values of these keys, each allowed on its own, and the scenario with them; None where no other is
        allowed."""
        keys = (first, *more)
        if keys not in self._known:
            alone = [pair[0] for pair in map(self.of, keys) if pair] if more else []
            ways = [reduce(or_, alone)] if more else ({first: value} for value in _others(self.dials[first]))
            self._known[keys] = next(((values, other) for values in ways for other in self._with(values)), None)
        return self._known[keys]

    def _with(self, values: Values) -> Iterator[Scenario]:
        try:
            yield from variants(self.scenario, [_changes(self.scenario, values)])
        except InputError:
            return


def _others(value: Any) -> Iterator[Any]:
    for factors in TRIED:
        turn = iter(range(1 << 20))
        moved = mapped(value, lambda x, f=factors, t=turn: x * f[next(t) % 3] if x else NUDGE)
        # A symmetric matrix stays symmetric.
        if isinstance(moved, tuple) and isinstance(moved[0], tuple):
            moved = tuple(tuple(moved[min(i, j)][max(i, j)] for j in range(3)) for i in range(3))
        yield moved


def _reflown(
    scenario: Scenario, entry: LawEntry, loop: ClosedLoop, by_key: Values, tried: _Tried, fixed: Mapping[str, str]
) -> Reflown:
    steps = scenario.table.simulation.steps
    flat = Flat.of(loop, steps, entered=True)

    def follows(*keys: str) -> bool:
        """Return whether the equation of all kept keys gives the numbers of a scenario in which these keys are changed."""
        if (other_values := tried.of(*keys)) is None:
            return False
        values, other = other_values
        try:
            # Not flown for a step, as `build` does: only its numbers are needed.
            made = other.hooks.build(other, other.pick(entry.name))
            # A key that follows another has its value, unless it is changed itself.
            along = {key: values[leader] for key, leader in scenario.hooks.linked.items() if leader in values}
            given = {key: (by_key | along | values)[key] for key in kept}
            return flat.gives(Flat.of(made, steps, entered=True), _given(scenario, loop, given))
        except (InputError, ValueError, ZeroDivisionError):
            return False

    unfollowed: dict[str, str] = {}
    # With all keys at their values, the start must be that of the file.
    kept = [key for key in by_key if not key.startswith("law.")]
    kept = kept if flat.gives(flat, _given(scenario, loop, {key: by_key[key] for key in kept})) else []
    unfollowed |= {key: COMPUTED for key in by_key if not key.startswith("law.") and key not in kept}
    kept += [key for key in by_key if key.startswith("law.")]
    unfollowed |= {key: fixed[key] for key in kept if key in fixed}
    unfollowed |= {key: ALONE for key in kept if key not in unfollowed and not tried.of(key)}
    kept = [key for key in kept if key not in unfollowed]
    # All keys at once, and separately those that others follow; one by one only where this fails.
    if kept and not (follows(*kept) and all(follows(key) for key in scenario.hooks.linked.values() if key in kept)):
        unfollowed |= {key: COMPUTED for key in kept if not follows(key)}
        kept = [key for key in kept if key not in unfollowed]
        if kept and not follows(*kept):
            unfollowed |= dict.fromkeys(kept, COMPUTED)
            kept = []
    derive, places = _recorded(scenario, loop, {key: by_key[key] for key in kept}) if kept else (None, ())
    carry, phase = loop.carry(), loop.phases(steps)[0]
    program = unrolled(make_program(one, loop.composition(), carry, Numbers.of(phase), loop.substeps, True))
    lost = len(flatten(carry)) - 1
    return Reflown(
        entry.name,
        program,
        derive,
        tuple(kept),
        places,
        len(numbers_of(carry)),
        flat.numbers,
        Arguments(*Numbers.of(phase)).tables,
        lost,
        tuple((name, size) for name, _, size in recorded(loop)),
        steps,
        loop.seed,
        loop.run,
        loop.period,
        unfollowed,
        _reads(program, phase),
    )


def _shared(numbers: Any) -> list[Any]:
    return [leaf for leaf in leaves(numbers) if isinstance(leaf, float | Handle)]


def _equation(scenario: Scenario, loop: ClosedLoop, keys: Sequence[str]) -> Callable[[Any], list[Any]]:
    """Return the equation that gives all numbers of a loop from values of these keys, in order."""
    names = [item.name for item in loop.law.fields()]

    def numbers(values: Any) -> list[Any]:
        given = dict(zip(keys, values, strict=True))
        given_gains = {key.rpartition(".")[2]: value for key, value in given.items() if key.startswith("law.")}
        gains = loop.gains._replace(**{name: given_gains[name] for name in names if name in given_gains})
        moved = scenario.hooks.moved(scenario, loop, {k: v for k, v in given.items() if not k.startswith("law.")})
        setup = loop.setup()
        setup = setup._replace(limit=moved.limit)
        # A law computes its memory itself, from the file's numbers.
        carry = loop.carry(moved.made_with, loop.gains, loop.craft, setup)._replace(state=moved.start)
        shared = Numbers(gains, moved.nominal, moved.craft, setup)
        return [*numbers_of(carry), *_shared(shared)]

    return numbers


def _given(scenario: Scenario, loop: ClosedLoop, values: Values) -> list[Any]:
    return _equation(scenario, loop, list(values))(tuple(values.values()))


def _recorded(scenario: Scenario, loop: ClosedLoop, by_key: Values) -> tuple[Program, tuple[int, ...]]:
    """Return the equation as a program for only those numbers that depend on the values, and their indices."""
    equation, places = _equation(scenario, loop, list(by_key)), list[int]()

    def depending(values: Any) -> tuple[Any, ...]:
        numbers = equation(values)
        places[:] = [place for place, number in enumerate(numbers) if isinstance(number, Handle)]
        return tuple(numbers[place] for place in places)

    return record_call(depending, (tuple(by_key.values()),))[0], tuple(places)


def _reads(program: Program, phase: Any) -> frozenset[str]:
    """Return the numbers of the nominal model that a program uses; only the law does."""
    first = len(_shared(phase.gains))
    places: dict[int, str] = {}
    for name, value in phase.nominal._asdict().items():
        for _ in _shared(value):
            places[first + len(places)] = name
    read: set[int] = set()
    for function in program.functions:
        read |= {
            s.index
            for s in statements(function.body)
            if isinstance(s, Load) and s.memory == "shared" and isinstance(s.index, int)
        }
    return frozenset("inertia" if "inertia" in name else name for place, name in places.items() if place in read)


MARK = "\ue000"


def _pieces(scenario: Scenario, dials: Values) -> Iterator[Piece]:
    """Yield the scenario's file in pieces, with blanks for the values of the keys `dials`."""
    tables = read_toml(scenario.text, scenario.where)
    last: list[str] = []
    for key in dials:
        changes = _changes(scenario, {key: f"{MARK}{key}{MARK}"})
        if "fault" in changes:
            last.append(key)
            continue
        for name, value in changes.items():
            here: Any = tables
            *way, end = path_of(name, names_of(scenario), scenario.where)
            for part in way:
                here = here[part] if isinstance(part, int) else here.setdefault(part, {})
            if value is None:
                here.pop(end, None)
            else:
                here[end] = value
    text = toml_text(plain(tables, scenario.where, ""))
    for place, part in enumerate(text.replace(f'"{MARK}', MARK).replace(f'{MARK}"', MARK).split(MARK)):
        yield Piece(key=part) if place % 2 else Piece(part)
    for key in last:
        faults = toml_text(plain(_changes(scenario, {key: f"{MARK}{key}{MARK}"}), scenario.where, ""))
        before, _, after = faults.replace(f'"{MARK}', MARK).replace(f'{MARK}"', MARK).split(MARK)
        yield from (Piece(before, only=key), Piece(key=key, only=key), Piece(after, only=key))
