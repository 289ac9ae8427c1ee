"""Judges a completed sheet of signs and axes: which mistakes of which parts explain the observations."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations, permutations, product
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.scenario.checking import nearest
from starhold.scenario.reading import LawEntry, Scenario
from starhold.studies.phasing import Cell, Sheet, sheet_of
from starhold.studies.phasing_bench import ACTUATORS, AXES, MOTORS, ORDER, STATED, Array, Stage, Stimulus

Test: TypeAlias = Callable[[Array], Any]
"""Returns a mask of the vectors (n, k) that agree with the observations."""
SEEN = "seen"
MOST = 2
"""The largest number of stages that are assumed wrong at once."""
NEAR = 0.35
"""Numbers agree if they differ by at most this share of the largest in their vector: the craft is turned by hand."""
CLEAR = 0.15
"""A number has a sign if it is at least this share of the largest in its vector."""
TINY, FLOOR = 0.02, 0.1
"""An observed vector counts as absent below the first share of the expected one, and as possibly absent below the second."""
FAR = 3.0
"""The factor by which a vector must be longer or shorter than expected to count as of wrong magnitude."""
SIGNS = {"+": 1.0, "-": -1.0, "\N{MINUS SIGN}": -1.0, "0": 0.0}
SHOWN = 12
"""The largest number of explanations listed."""
ALIKE = 1
"""The number of decimals, relative to a vector's largest number, to which the search distinguishes outputs."""


class Seen(NamedTuple):
    """A completed sheet: the file's name, and its rows with their line numbers."""

    where: str
    rows: list[tuple[int, dict[str, str]]]


class Mistake(NamedTuple):
    """A mistake: a stage outputs a signed permutation of the right vector."""

    stage: Stage
    place: int
    """Its index in `mistakes_of(stage)`."""

    @property
    def sentence(self) -> str:
        """The part and its mistake in words."""
        stage = self.stage
        matrix = mistakes_of(stage)[self.place][: stage.blocks[0].size, : stage.blocks[0].size]
        whose = {
            "estimate": f"estimate of {stage.part}",
            "command": f"command of {stage.part}",
            "share": f"{stage.part}, by {'wheel' if stage.blocks[0].name == MOTORS else stage.blocks[0].name}",
            "torque": f"{stage.part} as mounted" if stage.part != ACTUATORS else stage.part,
        }
        return f"{whose.get(stage.kind, stage.part)}: {described(matrix, stage.blocks[0].labels)}"


@dataclass(frozen=True)
class Phasing:
    """A sheet, and for a completed one the observations (None: an empty cell), the explanations with the fewest mistakes,
    the single mistakes that would not show if all observations are right, and sentences about magnitudes."""

    sheet: Sheet
    seen: list[float | str | None] | None
    explanations: list[tuple[Mistake, ...]]
    hidden: list[tuple[Mistake, ...]]
    sizes: list[str]

    @property
    def outcome(self) -> Literal["met", "missed", "undecided"]:
        """The outcome: "met" if all signs are right, "missed" if one is wrong, "undecided" where rows are empty, a mistake
        would not show, or a magnitude is unexpected."""
        if self.seen is None:
            return "met"
        if self.explanations != [()]:
            return "missed"
        return "undecided" if None in self.seen or self.hidden or self.sizes else "met"

    @property
    def verdict(self) -> list[str]:
        """The outcome in sentences."""
        if self.seen is None:
            return []
        empty = sum(value is None for value in self.seen)
        rest = [f"{empty} of {len(self.seen)} rows are empty: what they would show is not decided."] if empty else []
        rest += self.sizes
        if self.explanations == [()]:
            hidden = [f"{len(self.hidden)} mistakes of one part would not show in these rows:", *_listed(self.hidden)]
            words = "All signs that were seen are right." if empty or self.hidden else "All signs are right."
            return [words, *(hidden if self.hidden else []), *rest]
        if not self.explanations:
            return ["A sign is wrong, and no mistake of one or two parts explains what was seen.", *rest]
        listed = _listed(self.explanations)
        if len(listed) == 1:
            return [f"A sign is wrong. {listed[0]}", *rest]
        count = len(self.explanations)
        return [f"A sign is wrong. {count} explanations fit equally; the rows do not tell them apart:", *listed, *rest]


def _listed(sets: Sequence[tuple[Mistake, ...]]) -> list[str]:
    """Return the first sets of mistakes in words."""
    listed = [f"{' and '.join(mistake.sentence for mistake in one)}." for one in sets[:SHOWN]]
    return listed + [f"And {len(sets) - SHOWN} more."] * (len(sets) > SHOWN)


def study(scenario: Scenario, entry: LawEntry, seen: Seen | None = None) -> Phasing:
    """Return the sheet of a law of a scenario, with the judgement of a completed one, if given. InputError for a file that
    is not this sheet."""
    sheet = sheet_of(build(scenario, entry), entry.name)
    if seen is None:
        return Phasing(sheet, None, [()], [], [])
    values = filled(sheet, seen)
    explanations = explained(sheet, values)
    right = explanations == [()]
    hidden = list(_fitting(sheet, _tests(sheet, values), 1)) if right else []
    return Phasing(sheet, values, explanations, hidden, _sizes(sheet, values) if right else [])


# --- Mistakes ---------------------------------------------------------------------------------------------------------


@cache
def mistakes_of(stage: Stage) -> Array:
    """Return the matrices (n, k, k) by which a mistake may multiply a stage's vector (k,), the identity first: all 48 signed
    permutations of three axes, the same for each of its vectors; for N units any two exchanges and reversals, and the
    reversal of all."""
    size = stage.blocks[0].size
    if size == 3:
        signs = product((1.0, -1.0), repeat=3)
        orders = (np.eye(3)[list(order)] for order in permutations(range(3)))
        plain: list[Any] = [np.diag(sign) @ order for order, sign in product(orders, list(signs))]
        return np.array([np.kron(np.eye(len(stage.blocks)), matrix) for matrix in plain])
    unit = np.eye(size)
    once: list[Any] = [np.diag(1.0 - 2.0 * row) for row in unit]
    for i, j in combinations(range(size), 2):
        order = np.arange(size)
        order[[i, j]] = j, i
        once.append(unit[order])
    twice = [a @ b for a in once for b in once]
    return np.array(list({matrix.tobytes(): matrix for matrix in (unit, *once, -unit, *twice)}.values()))


def described(matrix: Any, labels: list[str]) -> str:
    """Return a signed permutation in words: the exchanges and then the reversals, or, for three axes, the rotation about an
    axis, if it is one."""
    order, reversed_ = np.abs(matrix).argmax(axis=1), matrix.sum(axis=1) < 0.0
    words: list[str] = []
    if (order[order] == np.arange(len(order))).all():
        words += [f"{labels[i]} and {labels[j]} swapped" for i, j in enumerate(order) if i < j]
    else:
        words.append(f"{', '.join(labels)} show {', '.join(labels[j] for j in order)}")
    if reversed_.all():
        words.append("all reversed")
    elif reversed_.any():
        words.append(f"{' and '.join(label for label, back in zip(labels, reversed_, strict=True) if back)} reversed")
    text = "; ".join(words)
    if labels != list(AXES) or np.linalg.det(matrix) < 0.0:
        return text
    fixed = [k for k in range(3) if matrix[k, k] > 0.0]
    if len(fixed) != 1:
        return text
    i, j = (fixed[0] + 1) % 3, (fixed[0] + 2) % 3
    angle = "180" if order[i] == i else f"{90.0 * matrix[i, j]:+.0f}"
    return f"turned by {angle} deg about {AXES[fixed[0]]} ({text})"


# --- The search -------------------------------------------------------------------------------------------------------


def explained(sheet: Sheet, values: Sequence[float | str | None]) -> list[tuple[Mistake, ...]]:
    """Return the smallest sets of mistakes, at most one per stage and MOST in all, that explain the observations."""
    tests = _tests(sheet, values)
    for most in range(MOST + 1):
        if sets := list(_fitting(sheet, tests, most)):
            return sets
    return []


def _fitting(sheet: Sheet, tests: Mapping[tuple[int, int], Sequence[Test]], most: int) -> Iterator[tuple[Mistake, ...]]:
    """Yield all sets of `most` mistakes that pass the tests. All sets are tried together, stage by stage along the loop. For
    each stimulus a set has the index of a state, the outputs of the previous stages; the equations are called once per
    state."""
    states: list[list[dict[Stage, Array]]] = [[{}] for _ in sheet.stimuli]
    shown = {cell.at[1] for cell in sheet.cells}
    sets, ids = np.zeros((1, 0), dtype=int), np.zeros((1, len(sheet.stimuli)), dtype=int)
    for number, stage in enumerate(sheet.stages):
        count = len(mistakes_of(stage)) if number in shown else 1
        free = np.flatnonzero((sets > 0).sum(axis=1) < most)
        rows = np.concatenate([np.arange(len(sets)), np.repeat(free, count - 1)])
        picks = np.concatenate([np.zeros(len(sets), dtype=int), np.tile(np.arange(1, count), len(free))])
        for place, stimulus in enumerate(sheet.stimuli):
            if stage not in stimulus.live:
                continue
            pairs, back = np.unique(ids[rows, place] * count + picks, return_inverse=True)
            fits, new = np.ones(len(pairs), dtype=bool), np.zeros(len(pairs), dtype=int)
            known: dict[Any, int] = {}
            after: list[dict[Stage, Array]] = []
            for state in np.unique(pairs // count):
                here = np.flatnonzero(pairs // count == state)
                before = states[place][state]
                vectors = outputs(stimulus, stage, before, pairs[here] % count)
                for test in tests.get((place, number), ()):
                    fits[here] &= test(vectors)
                for k, vector in zip(here, vectors, strict=True):
                    left = _left(before | {stage: vector}, stage)
                    key = tuple((one, *np.round(v / max(np.abs(v).max(), 1e-300), ALIKE) + 0.0) for one, v in left.items())
                    if key not in known:
                        known[key] = len(after)
                        after.append(left)
                    new[k] = known[key]
            states[place] = after
            ids = ids[rows][fits[back]]
            ids[:, place] = new[back][fits[back]]
            sets, picks = sets[rows][fits[back]], picks[fits[back]]
            rows = np.arange(len(picks))
        sets, ids = np.column_stack([sets[rows], picks]), ids[rows]
    for row in sets[(sets > 0).sum(axis=1) == most]:
        yield tuple(Mistake(stage, int(k)) for stage, k in zip(sheet.stages, row, strict=True) if k)


def outputs(stimulus: Stimulus, stage: Stage, before: Mapping[Stage, Array], picks: Any) -> Array:
    """Return the outputs (n, k) of a stage, given those of the stages before it, with each of the mistakes `picks`."""
    vector = stimulus.bench.vectors(stimulus, before)[stage]
    matrices = mistakes_of(stage)[np.asarray(picks)]
    if stage.kind == "torque" and stage.part != ACTUATORS:
        return np.array([stimulus.bench.mounts[stage](matrix) for matrix in matrices])
    return matrices @ vector


def _left(state: dict[Stage, Array], stage: Stage) -> dict[Stage, Array]:
    """Return the part of a state on which later stages depend."""
    passed = ORDER[: ORDER.index(stage.kind)]
    gone = {
        "reading": lambda one: "reading" in passed and one.blocks[0].name in STATED,
        "estimate": lambda one: "estimate" in passed,
        "command": lambda one: False,
        "share": lambda one: stage.kind == "torque" and one.part == stage.part,
        "torque": lambda one: True,
    }
    return {one: vector for one, vector in state.items() if not gone[one.kind](one)}


def _tests(sheet: Sheet, values: Sequence[float | str | None]) -> dict[tuple[int, int], list[Test]]:
    """Return, by stimulus and stage, the tests whether output vectors (n, k) agree with the observations."""
    tests: dict[tuple[int, int], list[Test]] = {}
    for (at, (first, last)), cells in _blocks(sheet, values).items():
        expected = max(abs(cell.value) for cell, _ in cells)
        factor = math.degrees(1.0) if "deg" in cells[0][0].unit else 1.0
        seen = {cell.place: value for cell, value in cells if value is not None}
        largest = max((abs(value) for value in seen.values() if not isinstance(value, str)), default=0.0)

        def test(vectors: Array, seen: Any = seen, more: Any = (first, last, factor, expected, largest or 1.0)) -> Any:
            first, last, factor, expected, largest = more
            sizes = np.abs(factor * vectors[:, first:last]).max(axis=1)
            none = sizes < TINY * expected
            shares = factor * vectors / np.where(none, expected, sizes)[:, None]
            good = np.ones(len(vectors), dtype=bool)
            for place, value in seen.items():
                share = shares[:, place]
                if isinstance(value, str):
                    good &= abs(share) < NEAR if value == "0" else share * SIGNS[value] > CLEAR
                else:
                    small = abs(value) <= FLOOR * expected
                    good &= np.where(none, small, abs(share - value / largest) <= NEAR)
            return good

        if seen:
            tests.setdefault(at, []).append(test)
    return tests


def _blocks(sheet: Sheet, values: Sequence[float | str | None]) -> dict[Any, list[tuple[Cell, float | str | None]]]:
    """Return the cells of each vector with their observations."""
    blocks: dict[Any, list[tuple[Cell, float | str | None]]] = {}
    for cell, value in zip(sheet.cells, values, strict=True):
        blocks.setdefault((cell.at, cell.block), []).append((cell, value))
    return blocks


def _sizes(sheet: Sheet, values: Sequence[float | str | None]) -> list[str]:
    """Return sentences about vectors of unexpected magnitude."""
    sentences: list[str] = []
    for cells in _blocks(sheet, values).values():
        numbers = [abs(value) for _, value in cells if isinstance(value, float)]
        ratio = max(numbers) / max(abs(cell.value) for cell, _ in cells) if len(numbers) == len(cells) else 1.0
        if not 1.0 / FAR <= ratio <= FAR:
            first = cells[0][0]
            sentences.append(f"{first.stimulus}, {first.stage}: {ratio:.2g} times the expected magnitude.")
    return sentences


# --- The file ---------------------------------------------------------------------------------------------------------

KEYS, EXPECTED = ("stimulus", "stage", "axis"), "expected sign"


def opened(path: str) -> Seen:
    """Return the completed sheet in a file. InputError for a file that is not a table with the columns of a sheet."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        rows = csv.DictReader(text.splitlines(), strict=True)
        heads = rows.fieldnames or []
        for name in (*KEYS, SEEN):
            if name not in heads:
                raise InputError(path, "", f"no column {name}", f"the columns of phasing.csv: {', '.join((*KEYS, SEEN))}")
        names = (*KEYS, EXPECTED, SEEN)
        return Seen(path, [(rows.line_num, {name: (row.get(name) or "").strip() for name in names}) for row in rows])
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(path, "", getattr(error, "strerror", None) or str(error), "a completed phasing.csv") from None


def filled(sheet: Sheet, seen: Seen) -> list[float | str | None]:
    """Return the observation in each cell of a sheet: a number, a sign, or None. InputError for rows of another sheet."""
    places = {(cell.stimulus, cell.stage, cell.axis): place for place, cell in enumerate(sheet.cells)}
    values: list[float | str | None] = [None] * len(sheet.cells)
    met: set[int] = set()
    for line, row in seen.rows:
        where = f"row {line}"
        for name, known in zip(KEYS, map(list, zip(*places, strict=True)), strict=True):
            if row[name] not in known:
                raise InputError(
                    seen.where, f"{where}, {name}", row[name] or "nothing", nearest(row[name], sorted({*known}))
                )
        place = places.get((row["stimulus"], row["stage"], row["axis"]))
        if place is None or place in met:
            given = "a row that is there twice" if place is not None else f"{row['stage']} {row['axis']} under this stimulus"
            raise InputError(seen.where, f"{where}, {row['stimulus']}", given, "each row of the sheet once")
        if row[EXPECTED] not in ("", sheet.cells[place].sign):
            allowed = f"{sheet.cells[place].sign}: this sheet is of another scenario"
            raise InputError(seen.where, f"{where}, {EXPECTED}", row[EXPECTED], allowed)
        met.add(place)
        values[place] = _read(row[SEEN], seen.where, where)
    if all(value is None for value in values):
        raise InputError(seen.where, SEEN, "nothing filled in", "numbers, or the signs +, - and 0")
    return values


def _read(text: str, where: str, key: str) -> float | str | None:
    if text in SIGNS or not text:
        return text.replace("\N{MINUS SIGN}", "-") or None
    try:
        if math.isfinite(number := float(text)):
            return number
    except ValueError:
        pass
    raise InputError(where, f"{key}, {SEEN}", text, "a number, or a sign: +, - or 0")
