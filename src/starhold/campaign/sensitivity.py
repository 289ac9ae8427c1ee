"""Morris's screening and Sobol's indices tell how much each input moves a metric, from campaigns sampled for that.

Both need designs of their own, which `sampling` lays out in the unit cube: "morris" one step of one input at a time (M. D.
Morris, Technometrics 33, 1991; mu* of F. Campolongo et al., Environ. Model. Softw. 22, 2007), "saltelli" two samples and
their crossings (A. Saltelli et al., Comput. Phys. Commun. 181, 2010). SALib computes the indices. A failed run leaves a
hole: a Morris design loses the trajectory with it and no more; Sobol's estimators have no answer to it, and filling it in
would be made up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.errors import InputError

Array: TypeAlias = NDArray[np.float64]
RESAMPLES = 200
"""Of the bootstrap for the half-widths."""
NO_SALTELLI = "the runs are no Saltelli design of two samples and their crossings"
STEP_ERROR = 0.05
"""By which a step of a Morris design, as a share of it, may differ from the grid's: ends of the unit interval may be drawn
in."""


@dataclass(frozen=True)
class Refused:
    """There are no indices, for a reason."""

    reason: str

    def sentence(self) -> str:
        """Tell the reason."""
        return f"No sensitivity indices: {self.reason}."


@dataclass(frozen=True)
class Morris:
    """Elementary effects of each input, in the metric's unit for its range, from the lowest to the highest level of the
    design (an eighth and seven eighths of the probability, see `sampling.LEVELS`): the mean `mu`, the mean
    magnitude `mu_star` with the half-width of its interval of `confidence`, and the standard deviation `sigma`, which is
    not small against mu_star where an input acts unevenly or together with others. All (inputs,).

    Of the `trajectories` flown, `dropped` had a run without a value.
    """

    names: tuple[str, ...]
    mu: Array
    mu_star: Array
    mu_star_width: Array
    sigma: Array
    trajectories: int
    dropped: int
    confidence: float

    def sentence(self) -> str:
        """Tell the input that matters most, and what was dropped."""
        first = int(np.argmax(self.mu_star))
        lost = (
            f"; {self.dropped} of {self.trajectories} trajectories were dropped, which hold failed runs"
            if self.dropped
            else ""
        )
        return f"{self.names[first]} moves it most: mu* = {_pm(self.mu_star[first], self.mu_star_width[first])}{lost}."


@dataclass(frozen=True)
class Sobol:
    """Shares of a metric's variance that each input makes by itself (`first`) and with all others (`total`), with the
    half-widths of their intervals of `confidence`; all (inputs,)."""

    names: tuple[str, ...]
    first: Array
    first_width: Array
    total: Array
    total_width: Array
    confidence: float

    def sentence(self) -> str:
        """Tell the input that matters most."""
        most = int(np.argmax(self.total))
        alone, all_in = _pm(self.first[most], self.first_width[most]), _pm(self.total[most], self.total_width[most])
        return f"{self.names[most]} moves it most: {alone} of the variance by itself, {all_in} with others."


def problem(names: Sequence[str]) -> dict[str, Any]:
    """Describe the unit cube of the inputs as SALib has it, for sampling and for analysis alike."""
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}


def morris(names: Sequence[str], unit: Array, values: Array, confidence: float = 0.95, seed: int = 0) -> Morris | Refused:
    """Compute elementary effects from points of the unit cube (runs, inputs) and the metric's values (runs,), NaN where a
    run has none; runs in the order of the design. `seed` is that of the bootstrap for the half-widths."""
    unit, values, size = np.asarray(unit, float), np.asarray(values, float), len(names) + 1
    if not names or unit.shape != (len(values), len(names)) or not len(values) or len(values) % size:
        return Refused(f"{len(values)} runs are no whole number of trajectories of {size} runs")
    steps = np.diff(unit.reshape(-1, size, len(names)), axis=1)
    step = float(np.abs(steps).max())
    moved = np.abs(steps) > 0.5 * step
    if not (step > 0.5 and (moved.sum(1) == 1).all() and (moved.sum(2) == 1).all() and _even(steps, moved, step)):
        return Refused("the runs are no Morris design, in which each step is of one input and each input takes one step")
    there = np.isfinite(values.reshape(-1, size)).all(axis=1)
    flown, kept = there.size, int(there.sum())
    if kept < 2:
        return Refused(f"{kept} of {flown} trajectories have all their values, two are the least")
    rows = np.repeat(there, size)
    found = _salib("morris").analyze(
        problem(names),
        unit[rows],
        values[rows],
        num_resamples=RESAMPLES,
        conf_level=confidence,
        # A step is p / (2 (p - 1)) for p levels.
        num_levels=2 * round(step / (2.0 * step - 1.0)),
        seed=seed,
    )
    columns = (np.asarray(found[key], dtype=np.float64) for key in ("mu", "mu_star", "mu_star_conf", "sigma"))
    return Morris(tuple(names), *columns, trajectories=flown, dropped=flown - kept, confidence=confidence)


def sobol(names: Sequence[str], unit: Array, values: Array, confidence: float = 0.95, seed: int = 0) -> Sobol | Refused:
    """Compute Sobol's indices from points of the unit cube (runs, inputs) and the metric's values (runs,), NaN where a run
    has none; runs in the order of the design, with or without what second-order indices need. `seed` as for `morris`."""
    unit, values, count = np.asarray(unit, float), np.asarray(values, float), len(names)
    if not count or unit.shape != (len(values), count):
        return Refused(NO_SALTELLI)
    second_order = next((second for second in (False, True) if _crossed(unit, second)), None)
    if second_order is None:
        return Refused(NO_SALTELLI)
    missing = int((~np.isfinite(values)).sum())
    if missing:
        have = "1 run has" if missing == 1 else f"{missing} runs have"
        return Refused(f"{have} no value, and Sobol's estimators need all {len(values)}; Morris designs and drivers do not")
    if np.ptp(values) == 0.0:
        return Refused("all runs have the same value")
    found = _salib("sobol").analyze(
        problem(names),
        values,
        calc_second_order=second_order,
        num_resamples=RESAMPLES,
        conf_level=confidence,
        # Zero would be taken for no seed at all.
        seed=seed + 1,
    )
    columns = (np.asarray(found[key], dtype=np.float64) for key in ("S1", "S1_conf", "ST", "ST_conf"))
    return Sobol(tuple(names), *columns, confidence=confidence)


def _even(steps: Array, moved: NDArray[np.bool_], step: float) -> bool:
    """Tell whether all steps are that of a grid with an even number of levels, and nothing else moves."""
    levels = 2 * round(step / (2.0 * step - 1.0)) if step > 0.5 else 0
    grid = levels / (2.0 * (levels - 1))
    return bool(np.abs(np.abs(steps) - grid * moved).max() <= STEP_ERROR * grid)


def _crossed(unit: Array, second_order: bool) -> bool:
    """Tell whether runs are blocks of a point, the point with each coordinate in turn from another, (the reverse,) and the
    other."""
    count = unit.shape[1]
    size = 2 * count + 2 if second_order else count + 2
    if not len(unit) or len(unit) % size:
        return False
    blocks = unit.reshape(-1, size, count)
    one, other = blocks[:, :1], blocks[:, -1:]
    swap = np.eye(count, dtype=bool)
    crossed = np.array_equal(blocks[:, 1 : count + 1], np.where(swap, other, one))
    return crossed and (not second_order or np.array_equal(blocks[:, count + 1 : -1], np.where(swap, one, other)))


def _salib(method: str) -> Any:
    """Import one of SALib's analyses."""
    from importlib import import_module

    try:
        return import_module(f"SALib.analyze.{method}")
    except ImportError:
        raise InputError("sensitivity", "SALib", "", "is not installed; starhold[campaign] brings it") from None


def _pm(value: float, width: float) -> str:
    """Show a value and its half-width with the digits that the half-width leaves."""
    digits = max(0, min(6, 1 - math.floor(math.log10(width)))) if width > 0.0 and math.isfinite(width) else 3
    return f"{value:.{digits}f} ± {width:.{digits}f}"
