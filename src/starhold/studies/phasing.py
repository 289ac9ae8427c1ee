"""Sheets for the polarity and axes test before launch: the expected output of each stage of a loop under each stimulus."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from starhold.laws.modes import mode_laws
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.modes import loop_of_mode
from starhold.studies.phasing_bench import ORDER, TORQUE, Bench, Stage, Stimulus, blocks_of

SMALL = 0.25
"""A number below this share of the largest of its vector counts as 0."""
NOTHING = 1e-9
"""A vector below this share of the largest of its kind is left out."""


class Cell(NamedTuple):
    """A number of a sheet: its expected sign, its value in `unit`, the indices of its stimulus and stage, and its index in
    the stage's vector, which is in SI."""

    stimulus: str
    stage: str
    axis: str
    sign: str
    value: float
    unit: str
    at: tuple[int, int]
    place: int
    block: tuple[int, int]
    """The first index of its vector, and the one after the last."""


@dataclass(frozen=True)
class Sheet:
    """The sheet of a law: its cells, the stages in the order of the loop, the stimuli, and sentences about omissions."""

    cells: list[Cell]
    stages: list[Stage]
    stimuli: list[Stimulus]
    notes: list[str]


def sheet_of(loop: ClosedLoop, law: str) -> Sheet:
    """Return the sheet of a loop; for a law with modes it covers each mode, without rows that an earlier mode has."""
    modes = mode_laws(loop.law, loop.gains)
    loops = [(f"{mode}: ", loop_of_mode(loop, place), mode) for place, (mode, _, _) in enumerate(modes)]
    benches = [(before, Bench(alone, name)) for before, alone, name in loops or [("", loop, law)]]
    stages = sorted(dict.fromkeys(s for _, b in benches for s in b.stages), key=lambda s: ORDER.index(s.kind))
    every: dict[str, Stimulus] = {}
    for before, bench in benches:
        for stimulus in bench.stimuli(before):
            every.setdefault(stimulus.name, stimulus)
    stimuli = list(every.values())
    seen: set[Any] = set()
    cells: list[Cell] = []
    expected = [stimulus.bench.vectors(stimulus, {}) for stimulus in stimuli]
    most: dict[tuple[str, str], float] = {}
    for vectors in expected:
        for stage, vector in vectors.items():
            for block, first in blocks_of(stage):
                size = float(np.abs(vector[first : first + block.size]).max())
                most[stage.part, block.name] = max(size, most.get((stage.part, block.name), 0.0))
    for place, (stimulus, vectors) in enumerate(zip(stimuli, expected, strict=True)):
        for number, stage in enumerate(stages):
            if stage not in stimulus.live:
                continue
            for block, first in blocks_of(stage):
                shown = block.name in stimulus.shown or stage.kind not in ("reading", "estimate")
                vector = vectors[stage][first : first + block.size]
                size = float(np.abs(vector).max())
                base = (stimulus.name.rpartition(": ")[2], stage, block, tuple(np.round(vector, 12)))
                if not shown or size <= NOTHING * most[stage.part, block.name] or base in seen:
                    continue
                seen.add(base)
                unit, factor = (
                    (block.unit.replace("rad", "deg"), math.degrees(1.0)) if "rad" in block.unit else (block.unit, 1.0)
                )
                for k, value in enumerate(np.where(np.abs(vector) < NOTHING * size, 0.0, vector)):
                    sign = "0" if abs(value) < SMALL * size else "+" if value > 0.0 else "-"
                    name = f"{stage.part}: {block.name.replace('_', ' ')}"
                    tail = (place, number), first + k, (first, first + block.size)
                    cells.append(
                        Cell(stimulus.name, name, block.labels[k], sign, float(f"{factor * value:.6g}"), unit, *tail)
                    )
    return Sheet(cells, stages, stimuli, _notes(loop, cells, [bench.command.part for _, bench in benches]))


def _notes(loop: ClosedLoop, cells: Sequence[Cell], laws: Sequence[str]) -> list[str]:
    """Return sentences about what the sheet does not test."""
    shown = {cell.stage.partition(":")[0] for cell in cells}
    parts = [f.called for role in ("sensor", "estimator", "effector") for f in loop.used(role)]
    notes = [f"{name}: no stimulus of this sheet moves it in body axes." for name in parts if name not in shown]
    whole = [
        n for n in parts if n in shown and {c.stage for c in cells if c.stage.startswith(f"{n}: ")} == {f"{n}: {TORQUE}"}
    ]
    notes += [f"{name}: the sheet gives its total torque, not what each of its units does." for name in whole]
    notes += [
        f"{f.called}: the sheet leaves it out, as if it passed the command on unchanged." for f in loop.used("actuator")
    ]
    silent = [name for name in laws if name not in shown]
    notes += [f"{name}: this law commands nothing at its first instant; the sheet begins with a torque." for name in silent]
    if not loop.used("sensor"):
        notes.insert(0, "The loop has no sensors: the law is given the true state.")
    return notes
