"""Sheets of signs and axes: what they show, and whether mistakes that are planted are found by name."""

import random
from functools import cache

import numpy as np
import pytest

import starhold as sh
from starhold.studies.phasing_verdict import Mistake, explained, mistakes_of, outputs
from tests.refusals import refused

LOOPS = ("cubesat-nadir", "three-laws", "cubesat-detumble")


@cache
def sheet_of(name):
    return sh.phasing(name).sheet


def simulated(sheet, mistakes, noise=0.0, seed=0):
    """The column `seen` of a sheet with these mistakes, by hand that is not quite exact."""
    draw, values = random.Random(seed), []
    picks = {mistake.stage: mistake.place for mistake in mistakes}
    shown = {}
    for place, stimulus in enumerate(sheet.stimuli):
        said = {}
        for number, stage in enumerate(sheet.stages):
            if stage in stimulus.live:
                (said[stage],) = outputs(stimulus, stage, said, [picks.get(stage, 0)])
                shown[place, number] = said[stage]
    for cell in sheet.cells:
        vector = shown[cell.at][slice(*cell.block)]
        factor = 180.0 / np.pi if "deg" in cell.unit else 1.0
        error = noise * draw.uniform(-1.0, 1.0) * float(np.abs(vector).max())
        values.append(factor * (float(shown[cell.at][cell.place]) + error))
    return values


def planted(sheet, seed):
    """One or two random mistakes of different stages that the sheet shows."""
    draw = random.Random(seed)
    shown = sorted({cell.at[1] for cell in sheet.cells})
    chosen = sorted(draw.sample(shown, draw.choice((1, 2))))
    return tuple(Mistake(sheet.stages[k], draw.randrange(1, len(mistakes_of(sheet.stages[k])))) for k in chosen)


def finds(seed):
    sheet = sheet_of(LOOPS[seed % len(LOOPS)])
    mistakes = planted(sheet, seed)
    seen = simulated(sheet, mistakes, noise=0.05, seed=seed)
    found = explained(sheet, seen)
    assert mistakes in found or len(found[0]) < len(mistakes), [m.sentence for m in mistakes]
    exact = simulated(sheet, mistakes)
    for other in found:
        # Whatever else is named shows the same.
        assert other == mistakes or np.allclose(simulated(sheet, other), exact, rtol=0.3, atol=0.35 * np.abs(exact).max())
    return found == [mistakes]
