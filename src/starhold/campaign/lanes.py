"""From sampled values to the numbers that kernels fly: many runs at once where that gives the bits of each run's own
scenario, else run by run.

What a value moves among the numbers of a loop is not told by hand: scenarios with other values are built, and compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten, leaves, mapped
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Numbers, numbers_of
from starhold.scenario.building import build
from starhold.simulation.abreast import Flying, kernel_key
from starhold.simulation.lanes import carry_columns

if TYPE_CHECKING:
    from starhold.campaign.sampling import Plan
    from starhold.scenario.reading import Scenario

Array: TypeAlias = NDArray[np.float64]
Columns: TypeAlias = Mapping[str, Any]

TRIES = 64
"""Runs that are looked at for one whose value differs from the first run's."""
PROBES = 3
"""Runs, beside those in which one value differs, on which what many runs get is compared with what each one gets."""


class Flat(NamedTuple):
    """A loop as the numbers that fly: what kernel serves it, what each number is called, and the numbers."""

    loop: ClosedLoop
    form: Any
    names: tuple[str, ...]
    numbers: Array


@dataclass(frozen=True)
class Lot:
    """Lanes that one kernel flies: run numbers (lanes,), a loop of their form, carries (numbers, lanes) and phases with an
    array (lanes,) in place of each number that differs."""

    runs: NDArray[np.int64]
    loop: ClosedLoop
    carries: Array
    phases: tuple[Phase, ...]


class Lanes:
    """The lanes of one law of a scenario under a plan of draws."""

    def __init__(self, scenario: Scenario, law: str, plan: Plan) -> None:
        self.scenario, self.law, self.plan = scenario, law, plan
        self.steps = scenario.table.simulation.steps
        self.base = self.exact(plan.columns(0, 1))
        self._names = {name: place for place, name in enumerate(self.base.names)}
        self.moved, self._varied, same_form = self._probe()
        self.derived = same_form and self._agrees()
        """Whether numbers of many runs are made at once."""
        self.flown = self._read_back()
        """The numbers that are read back from what flies, by their names."""

    def scenario_of(self, columns: Columns) -> Scenario:
        """The scenario of one run, from its columns (one number each)."""
        change = self.plan.change({name: values[0] for name, values in columns.items()})
        return self.scenario.with_(change)

    def exact(self, columns: Columns) -> Flat:
        """The numbers of one run, from its own scenario."""
        other = self.scenario_of(columns)
        return _flat(build(other, other.pick(self.law)), self.steps)

    def lots(self, first: int, count: int) -> Iterator[tuple[Lot, dict[str, Array]]]:
        """The lanes of runs first .. first+count-1, and the numbers read back of them."""
        columns = self.plan.columns(first, count)
        runs = np.arange(first, first + count)
        if self.derived:
            lot = self._together(columns, runs)
            yield lot, self._told(lot)
            return
        flats = [self.exact({name: values[k : k + 1] for name, values in columns.items()}) for k in range(count)]
        groups: dict[Any, list[int]] = {}
        for place, flat in enumerate(flats):
            groups.setdefault(flat.form, []).append(place)
        for places in groups.values():
            lot = self._alone([flats[place] for place in places], runs[places])
            yield lot, self._told(lot)

    def examine(self, first: int, count: int) -> None:
        """InputError where a run has a value that its scenario refuses: of many, those with the least and the greatest of
        each number, and those with a body that cannot be, are read as scenarios."""
        columns = self.plan.columns(first, count)
        looked = {
            int(pick(values)) for values in columns.values() if values.dtype.kind == "f" for pick in (np.argmin, np.argmax)
        }
        refused = self.scenario.hooks.refused(self._by_key(columns))
        if refused is not None and refused.any():
            looked = {int(np.flatnonzero(refused)[0])}
        for place in sorted(looked) if self.derived else ():
            own = {name: values[place : place + 1] for name, values in columns.items()}
            try:
                exact = self.exact(own)
            except InputError as error:
                where = f"{self.scenario.where}, run {first + place}"
                raise InputError(where, error.key, error.found, f"{error.allowed}; or another dispersion") from None
            lot = self._together(own, np.array([first + place]))
            if not _same(exact.numbers, self._column(lot)):
                # Then nothing is made at once any more.
                self.derived = False
                return

    def _probe(self) -> tuple[dict[str, set[int]], list[Flat], bool]:
        """What each dispersion moves, the loops with one of them moved, and whether all are of one form."""
        first = self.plan.columns(0, 1)
        more = self.plan.columns(0, min(TRIES, self.plan.runs))
        moved: dict[str, set[int]] = {}
        varied: list[Flat] = []
        same_form = True
        for dispersion in self.plan.dispersions:
            name = ", ".join(dispersion.keys)
            others = [k for k in range(len(more[dispersion.columns[0]])) if _differs(more, first, dispersion.columns, k)]
            moved[name] = set()
            for other in others[:2]:
                own = dict(first) | {column: more[column][other : other + 1] for column in dispersion.columns}
                flat = self.exact(own)
                varied.append(flat)
                if flat.form != self.base.form:
                    same_form = False
                    moved[name].add(-1)
                else:
                    apart = ~((flat.numbers == self.base.numbers) | (np.isnan(flat.numbers) & np.isnan(self.base.numbers)))
                    moved[name] |= set(np.flatnonzero(apart).tolist())
            if not others and self.plan.runs > 1:
                moved[name].add(-1)
        return moved, varied, same_form

    def _agrees(self) -> bool:
        """Whether numbers made at once are those of each run's own scenario, as far as is looked."""
        first, count = self.plan.columns(0, 1), min(self.plan.runs, 1 + PROBES)
        probes = [{name: values[k : k + 1] for name, values in self.plan.columns(0, count).items()} for k in range(count)]
        try:
            flats = [self.base, *(self.exact(own) for own in probes[1:])]
            for own, flat in zip(probes, flats, strict=True):
                if flat.form != self.base.form or not _same(flat.numbers, self._column(self._together(own, np.zeros(1)))):
                    return False
            del first
        except (InputError, ValueError, TypeError):
            return False
        return True

    def _by_key(self, columns: Columns) -> dict[str, Array]:
        """Values (components..., lanes) of the keys that are numbers."""
        found: dict[str, Array] = {}
        for dispersion in self.plan.dispersions:
            rows = [columns[name] for name in dispersion.columns]
            if len(dispersion.keys) == 1 and all(row.dtype.kind == "f" for row in rows):
                found[dispersion.keys[0]] = np.array(rows).reshape(*dispersion.shape, -1)
        return found

    def _together(self, columns: Columns, runs: NDArray[np.int64]) -> Lot:
        """Lanes made at once: numbers that follow one value are that value, others are derived by the body."""
        base, lanes = self.base, len(runs)
        rows: dict[int, Array] = {}
        for dispersion in self.plan.dispersions:
            for place in self.moved[", ".join(dispersion.keys)] - {-1}:
                name = self._follows(place, dispersion)
                if name is not None:
                    rows[place] = columns[name]
        found = self.scenario.hooks.derive(self.scenario, self._by_key(columns))
        structures = {"start": ("state",), "craft": ("craft", "nominal")}
        for kind, value in found.items():
            for prefix in structures[kind]:
                for name, leaf in _named(value, prefix):
                    for place in self._places(name):
                        if isinstance(leaf, np.ndarray):
                            rows[place] = leaf
        everything = set().union(*self.moved.values()) - {-1}
        phases, at = [], len(numbers_of(base.loop.carry()))
        before: Any = None
        for phase in base.loop.phases(self.steps):
            numbers = Numbers.of(phase)
            values: list[Any] = []
            for leaf in leaves(numbers):
                if isinstance(leaf, float):
                    values.append(rows.get(at, leaf) if at in everything else leaf)
                    at += 1
                else:
                    values.append(leaf)
            own = iter(values)
            made = mapped(numbers, lambda _, own=own: next(own))
            phases.append(phase._replace(**made._asdict(), before=made.craft if before is None else before))
            before = made.craft
        like = base.loop.carry()
        moving = len(flatten((like.state, like.effectors)))
        starts = np.repeat(base.numbers[:moving, None], lanes, axis=1)
        for place, row in rows.items():
            if place < moving:
                starts[place] = row
        return Lot(runs, base.loop, carry_columns(base.loop, starts, phases[0]), tuple(phases))

    def _follows(self, place: int, dispersion: Any) -> str | None:
        """The column whose value a number is, None where it is another."""
        base = self.plan.columns(0, 1)
        return next(
            (
                name
                for name in dispersion.columns
                if base[name].dtype.kind == "f" and base[name][0] == self.base.numbers[place]
            ),
            None,
        )

    def _places(self, name: str) -> list[int]:
        """The places of a number of the carry, or of the same number in every phase."""
        return [place for own, place in self._names.items() if own == name or own.endswith(f"].{name}")]

    def _alone(self, flats: Sequence[Flat], runs: NDArray[np.int64]) -> Lot:
        """Lanes of one form, each made by itself."""
        first, table = flats[0], np.array([flat.numbers for flat in flats]).T
        carried = len(numbers_of(first.loop.carry()))
        phases, at = [], carried
        before: Any = None
        for phase in first.loop.phases(self.steps):

            def leaf(value: Any) -> Any:
                nonlocal at
                if not isinstance(value, float):
                    return value
                at += 1
                row = table[at - 1]
                return value if (row == row[0]).all() else row

            made = mapped(Numbers.of(phase), leaf)
            phases.append(phase._replace(**made._asdict(), before=made.craft if before is None else before))
            before = made.craft
        return Lot(runs, first.loop, np.ascontiguousarray(table[:carried]), tuple(phases))

    def _column(self, lot: Lot) -> Array:
        """The numbers of a lot's first lane, as `Flat` has them."""
        own = [leaf for phase in lot.phases for leaf in leaves(Numbers.of(phase)) if isinstance(leaf, float | np.ndarray)]
        return np.array([*lot.carries[:, 0], *(float(np.ravel(leaf)[0]) for leaf in own)])

    def _read_back(self) -> tuple[str, ...]:
        """The names of numbers that show each dispersion: those that are its values, else all that it moves; of numbers that
        are always equal the first."""
        kept: list[int] = []
        for dispersion in self.plan.dispersions:
            places = sorted(self.moved[", ".join(dispersion.keys)] - {-1})
            same = [place for place in places if self._follows(place, dispersion) is not None]
            told: set[bytes] = set()
            for place in same or places:
                values = np.array(
                    [self.base.numbers[place], *(f.numbers[place] for f in self._varied if f.form == self.base.form)]
                )
                if values.tobytes() not in told:
                    told.add(values.tobytes())
                    kept.append(place)
        return tuple(self.base.names[place] for place in sorted(set(kept)))

    def _told(self, lot: Lot) -> dict[str, Array]:
        """The numbers read back of a lot, from the arrays that fly."""
        lanes = len(lot.runs)
        carried = dict(zip((name for name, _ in _named_carry(lot.loop)), lot.carries, strict=True))
        own = dict(_named_phases(lot.phases))
        found = carried | own
        return {
            f"flown.{name}": np.broadcast_to(found[name], (lanes,)).astype(float)
            if name in found
            else np.full(lanes, np.nan)
            for name in self.flown
        }


def _flat(loop: ClosedLoop, steps: int) -> Flat:
    phases = loop.phases(steps)
    pairs = [*_named_carry(loop), *_named_phases(phases)]
    values = [*numbers_of(loop.carry()), *(value for _, value in _named_phases(phases))]
    return Flat(loop, kernel_key(Flying(loop, steps, 1)), tuple(name for name, _ in pairs), np.array(values))


def _named_carry(loop: ClosedLoop) -> list[tuple[str, Any]]:
    carry = loop.carry()
    named = list(_named(carry, ""))
    return [*named, *((f"buffer[{k}]", 0.0) for k in range(len(numbers_of(carry)) - len(named)))]


def _named_phases(phases: Sequence[Phase]) -> list[tuple[str, Any]]:
    """The numbers of phases by name; those of later phases are told apart by the number of the event."""
    found: list[tuple[str, Any]] = []
    for number, phase in enumerate(phases):
        prefix = f"event[{number}]." if number else ""
        found += [(f"{prefix}{name}", value) for name, value in _named(Numbers.of(phase), "")]
    return found


def _named(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """The numbers of a structure by name, in the order of its leaves."""
    if isinstance(value, tuple):
        fields = getattr(value, "_fields", None)
        for place, part in enumerate(value):
            own = f"{name}.{fields[place]}".lstrip(".") if fields else f"{name}[{place + 1}]"
            yield from _named(part, own)
    elif isinstance(value, float | np.ndarray):
        yield name, value


def _same(a: Array, b: Array) -> bool:
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def _differs(more: Columns, first: Columns, names: Sequence[str], run: int) -> bool:
    return any(more[name][run] != first[name][0] for name in names)
