"""Plans of a campaign: the values drawn for each run, which are the same for any division into chunks and on any machine."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.dispersions import Dispersion
from starhold.campaign.extras import extra
from starhold.campaign.sensitivity import points_of, saltelli_design
from starhold.errors import InputError
from starhold.scenario.checking import nearest, show
from starhold.scenario.distribution import Array
from starhold.scenario.making import path_of

SAMPLINGS = ("random", "sobol", "latin-hypercube", "morris", "saltelli")
LEVELS = 4
"""The number of levels of each uniform in Morris's design, the middles of as many equal parts of [0, 1]."""
INNERMOST = 2.0**-53
"""The least uniform, and 1 minus the greatest."""
BITS = 52
"""The number of random bits in a uniform; half a unit of the last bit is added, which floats still represent exactly."""


@dataclass(frozen=True)
class Plan:
    """The draws of all runs of a campaign: the dispersions, the placement of their uniforms, the seed, and the number of
    runs.

    random: independent, by one counter-based generator per dispersion, keyed by the seed and its keys, so that the draws for
    one key do not depend on the others. sobol: a scrambled Sobol sequence over all dispersions, best with a power of 2 of
    runs. latin-hypercube: [0, 1] is divided into as many equal parts as there are runs, and each uniform falls once into
    each. morris: SALib's design for elementary effects (Morris 1991), analysed as if its levels reached from 0 to 1.
    saltelli: crossings of pairs of points for Sobol indices (see `sensitivity.saltelli_design`).

    InputError for an unknown sampling, or where the number of runs does not fit the design; `where`: the scenario's name in
    it."""

    dispersions: tuple[Dispersion, ...]
    sampling: str
    seed: int
    runs: int
    where: str = ""

    def __post_init__(self) -> None:
        if self.sampling not in SAMPLINGS:
            raise self._refuse("sampling", show(self.sampling), nearest(str(self.sampling), list(SAMPLINGS)))
        if self.runs < 1:
            raise self._refuse("runs", str(self.runs), "at least 1")
        if self.sampling not in ("morris", "saltelli"):
            return
        if not self.dims:
            raise self._refuse("sampling", show(self.sampling), "random, because nothing is dispersed")
        self._check_design()

    def _refuse(self, key: str, given: str, allowed: str) -> InputError:
        return InputError(self.where, f"campaign.{key}", given, allowed)

    def _check_design(self) -> None:
        block, count = self.block, self.runs // self.block
        if self.sampling == "morris":
            sizes, rule = [max(2, count), max(2, count) + 1], "from 2 on"
        else:
            power = max(1, count.bit_length() - 1)
            sizes, rule = [2**power, 2 ** (power + 1)], "a power of 2 from 2 on"
        if self.runs not in [block * size for size in sizes]:
            near = " or ".join(str(block * size) for size in sizes)
            allowed = f"{near}: {block} times a number, {rule}, for {self.dims} drawn numbers by {self.sampling}"
            raise self._refuse("runs", str(self.runs), allowed)

    @property
    def block(self) -> int:
        """The number of runs in a group of the design: D + 1 for Morris, 2 D + 2 for Saltelli, with D uniforms; else 1."""
        return {"morris": self.dims + 1, "saltelli": 2 * self.dims + 2}.get(self.sampling, 1)

    @cached_property
    def dims(self) -> int:
        """The number of uniforms per run."""
        return sum(dispersion.dims for dispersion in self.dispersions)

    @property
    def factors(self) -> tuple[str, ...]:
        """The names of the uniforms: the column's name if the dispersion has one uniform, else the key and an index from
        1."""
        names: list[str] = []
        for dispersion in self.dispersions:
            name, dims = dispersion.called, dispersion.dims
            if dims > 1 and dispersion.distribution.independent:
                names += dispersion.columns
            else:
                names += [name] if dims == 1 else [f"{name} ({number} of {dims})" for number in range(1, dims + 1)]
        return tuple(names)

    def unit(self, first: int, count: int) -> Array:
        """Return the uniforms (dims, count), strictly between 0 and 1, of `count` runs from `first` on."""
        if not 0 <= first <= first + count <= self.runs:
            raise ValueError(f"runs {first} to {first + count - 1} of {self.runs}")
        if not self.dims or not count:
            return np.empty((self.dims, count))
        if self.sampling == "random":
            return np.vstack([_random(self._key(one), one.dims, first, count) for one in self.dispersions])
        if self.sampling == "sobol":
            points = _sobol(self.dims, self.seed, first, count)
        elif self.sampling == "latin-hypercube":
            keys = tuple((self._key(one), one.dims) for one in self.dispersions)
            points = _latin_hypercube(keys, self.runs)[first : first + count]
        else:
            points = _design(self.sampling, self.dims, self.seed, self.runs // self.block)[first : first + count]
        return np.clip(np.ascontiguousarray(points.T), INNERMOST, 1.0 - INNERMOST)

    def points(self) -> Array:
        """Return the points (runs, dims) of the whole design for its analysis: for Morris, the grid from 0 to 1."""
        unit = self.unit(0, self.runs).T
        return (unit * LEVELS - 0.5) / (LEVELS - 1) if self.sampling == "morris" else unit

    def _key(self, dispersion: Dispersion) -> int:
        """Return 128 bits that identify the seed and the dispersion."""
        label = f"starhold campaign {self.seed} {dispersion.called}"
        return int.from_bytes(hashlib.sha256(label.encode()).digest()[:16], "little")

    def columns(self, first: int, count: int) -> dict[str, NDArray[Any]]:
        """Return the values, (count,) by column, drawn for `count` runs from `first` on. InputError where a key refuses
        one."""
        return self.values(self.unit(first, count))

    def values(self, unit: Array) -> dict[str, NDArray[Any]]:
        """Return the values, (n,) by column, for uniforms (dims, n). InputError where a key refuses one."""
        columns: dict[str, NDArray[Any]] = {}
        for dispersion, numbers in self._each(unit):
            columns |= dict(zip(dispersion.columns, dispersion.draw(numbers), strict=True))
        return columns

    def possible(self, unit: Array) -> NDArray[np.bool_]:
        """Return a mask (n,) of the uniforms (dims, n) whose values are within the bounds of all keys."""
        return np.logical_and.reduce([dispersion.possible(numbers) for dispersion, numbers in self._each(unit)])

    def _each(self, unit: Array) -> Iterator[tuple[Dispersion, Array]]:
        begun = 0
        for dispersion in self.dispersions:
            yield dispersion, unit[begun : begun + dispersion.dims]
            begun += dispersion.dims

    def change(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the argument of `Scenario.with_` for the scenario of one run with these values by column."""
        nominal = {name: table for one in self.dispersions for name, table in one.nominal_tables.items()}
        changes: dict[str, Any] = {f"nominal.{name}": table for name, table in nominal.items()}
        for dispersion in self.dispersions:
            changed = dispersion.change(values)
            changes |= changed
            if dispersion.known:
                changes |= {f"nominal.{key}": value for key, value in changed.items() if path_of(key, {}, "")[0] in nominal}
        return changes


def _random(key: int, dims: int, first: int, count: int) -> Array:
    """Return uniforms (dims, count) from a generator that is a function of its key and a counter; each run has its own
    counter values."""
    # Philox gives four numbers for each value of its counter.
    each = -(-dims // 4)
    raw = np.random.Philox(key=key, counter=first * each).random_raw(count * each * 4).reshape(count, each * 4)
    whole = np.ascontiguousarray(raw[:, :dims].T) >> np.uint64(64 - BITS)
    return whole.astype(np.float64) * 2.0**-BITS + 2.0 ** -(BITS + 1)


def _generator(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


def _sobol(dims: int, seed: int, first: int, count: int) -> Array:
    sequence = points_of("Sobol", dims, _generator(seed))
    # The first point is drawn alone: the library warns unless the first draw is a power of 2, but the caller chooses where
    # to split.
    head = sequence.random(1)
    if first > 1:
        sequence.fast_forward(first - 1)
    rest = sequence.random(count - 1 if first == 0 else count)
    # Moved to the middle of the interval that a point of 30 bits represents.
    return (np.vstack([head, rest]) if first == 0 else rest) + 2.0**-31


@lru_cache(maxsize=1)
def _latin_hypercube(keys: tuple[tuple[int, int], ...], runs: int) -> Array:
    """Return the whole sample (runs, dims); keys: for each dispersion its key and its number of uniforms."""
    return np.hstack([points_of("LatinHypercube", dims, _generator(key)).random(runs) for key, dims in keys])


@lru_cache(maxsize=1)
def _design(sampling: str, dims: int, seed: int, size: int) -> Array:
    """Return the whole design (runs, dims); size: the number of trajectories (Morris) or of base points (Saltelli)."""
    if sampling == "saltelli":
        return saltelli_design(dims, size, _generator(seed))
    problem = {"num_vars": dims, "names": [str(n) for n in range(dims)], "bounds": [[0.0, 1.0]] * dims}
    levels = extra("SALib.sample.morris").sample(problem, size, num_levels=LEVELS, seed=_generator(seed))
    # At 0 and 1 many distributions are infinite.
    return (levels * (LEVELS - 1) + 0.5) / LEVELS
