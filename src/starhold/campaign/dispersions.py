"""Dispersions: the keys of a scenario that runs of a campaign differ in, with the distributions that their values are drawn
from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from starhold.campaign.distributions import (
    Array,
    Choice,
    CorrelatedNormal,
    Distribution,
    LogNormal,
    Normal,
    Numbers,
    Rotations,
    Shell,
    TruncatedNormal,
    Uniform,
)
from starhold.campaign.key_reading import SYMMETRIC, KeyReading, components, word
from starhold.campaign.values import Place, accepted, locate, width_at
from starhold.scenario.campaign import DispersionTable, read_over
from starhold.scenario.checking import read_toml, show
from starhold.scenario.making import plain
from starhold.scenario.reading import Scenario


@dataclass(frozen=True)
class Dispersion:
    """A distribution, and the key or the several keys whose values are drawn from it."""

    keys: tuple[str, ...]
    columns: tuple[str, ...]
    """The names of the numbers that are drawn: a key, with its component from 1, "initial.rate[2]", or its row and column;
    of a symmetric matrix those on and above the diagonal."""
    shape: tuple[int, ...]
    """The key has this shape: () a number or a word, (n,) a vector or a diagonal, (n, n) a matrix. Several keys hold a
    number each."""
    judged_apart: bool
    """Whether the values are known before flight, so that runs of like values are judged by themselves."""
    known_to_law: bool
    """Whether laws are told the values, and designed for them."""
    distribution: Distribution
    nominal: tuple[Any, ...]
    """The numbers or the word that the file has, for each column; NaN where it has none."""
    places: tuple[Place, ...]
    """Each key is found there, with its bounds."""
    scale: Numbers | None = None
    """Numbers drawn as shares are shares of these, one for each column; None where they are no shares."""
    nominal_tables: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """The tables that stand in [nominal] beside the values, as laws are to take the file's own for true."""

    @property
    def dims(self) -> int:
        """Uniforms that a draw takes."""
        return self.distribution.dims

    @property
    def independent(self) -> bool:
        """Whether each uniform moves a column of its own."""
        alone = isinstance(self.distribution, Uniform | Normal | TruncatedNormal | LogNormal)
        return alone and self.dims == len(self.columns)

    @property
    def wordy(self) -> bool:
        """Whether a word is drawn, or a truth by its word."""
        return self.places[0].wordy

    def draw(self, u: Array) -> NDArray[Any]:
        """Values (columns, n), numbers or words, for uniforms u (dims, n) strictly between 0 and 1. InputError where a key
        refuses a number."""
        found = self._drawn(u)
        if self.wordy or not found.size:
            return found
        # Numbers beyond the bounds of a key are no craft's: a distribution that has them is no model of it.
        for place, numbers in zip(self.places, np.split(found, len(self.places)), strict=True):
            for extreme in (float(numbers.min()), float(numbers.max())):
                try:
                    place.bounds.check(extreme)
                except ValueError as error:
                    allowed = f"{str(error).removeprefix('must be ')}; a truncated-normal or uniform one keeps bounds"
                    raise place.refuse("", f"a draw of {extreme:g}", allowed) from None
        return found

    def _drawn(self, u: Array) -> NDArray[Any]:
        # Contiguous, so that the same machine code computes every cut of the same numbers.
        found = self.distribution.draw(np.ascontiguousarray(u, dtype=np.float64))
        return found if self.scale is None else np.array(self.scale)[:, None] * found

    def possible(self, u: Array) -> NDArray[np.bool_]:
        """Which of the draws (n,) for uniforms u (dims, n) their keys take, as far as bounds of each number tell."""
        kept = np.ones(u.shape[1], dtype=bool)
        if self.wordy:
            return kept
        for place, numbers in zip(self.places, np.split(self._drawn(u), len(self.places)), strict=True):
            least, most, bounds = numbers.min(axis=0), numbers.max(axis=0), place.bounds
            kept &= least > (-np.inf if bounds.above is None else bounds.above)
            kept &= least >= (-np.inf if bounds.at_least is None else bounds.at_least)
            kept &= most <= (np.inf if bounds.at_most is None else bounds.at_most)
        return kept

    def arrays(self, columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """The values by key, each (n, *shape), of columns (n,): the whole of symmetric matrices."""
        if not self.shape:
            return {key: np.asarray(columns[key]) for key in self.keys}
        found = np.empty((len(columns[self.columns[0]]), *self.shape))
        for name, index in zip(self.columns, components(self.shape, self._symmetric), strict=True):
            for place in {index, index[::-1]} if self._symmetric else {index}:
                found[(slice(None), *place)] = columns[name]
        return {self.keys[0]: found}

    @property
    def _symmetric(self) -> bool:
        return len(self.columns) < math.prod(self.shape)

    def change(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The change that gives the keys the values of one run, by column, for `Scenario.with_`."""
        arrays = self.arrays({name: np.asarray([values[name]]) for name in self.columns})
        found: dict[str, Any] = {}
        for place in self.places:
            (value,) = arrays[place.key].tolist()
            found |= place.change(_plain(place, value))
        return found


def _plain(place: Place, value: Any) -> Any:
    """The value that a file holds in place of a drawn one."""
    if place.gain is None and isinstance(place.value, bool):
        return value == "true"
    return int(value) if place.whole else value


def read_dispersions(scenario: Scenario, over: Mapping[str, Any]) -> tuple[Dispersion, ...]:
    """The dispersions of a scenario's keys, from the tables of [campaign.over], raw or validated. InputError where one of
    them cannot be."""
    tables = {
        key: table if isinstance(table, DispersionTable) else plain(table, scenario.where, f'campaign.over."{key}"')
        for key, table in over.items()
    }
    found: list[Dispersion] = []
    taken: list[Place] = []
    for told, table in read_over(tables, scenario.where).items():
        places = [replace(locate(scenario, key.strip()), table=told) for key in told.split(",")]
        for place in places:
            same = next((other for other in taken if _overlap(place, other)), None)
            if same is not None:
                raise place.refuse("", f"a second dispersion of {place.key}", f"one; there is that of {same.table}")
            taken.append(place)
        found.append(_read(scenario, places, table))
    return tuple(found)


def _overlap(one: Place, other: Place) -> bool:
    """Whether two keys are the same, or one is a component of the other, or takes the other away."""
    size = min(len(one.path), len(other.path))
    return one.path[:size] == other.path[:size] or one.displaced == other.key or other.displaced == one.key


def _read(scenario: Scenario, places: list[Place], table: Any) -> Dispersion:
    first, kind = places[0], table.distribution
    readings = [KeyReading.of(scenario, place, table) for place in places]
    if kind == "correlated-normal":
        return _read_correlated(readings)
    if len(places) > 1:
        allowed = "a table for each key; several together have the distribution correlated-normal"
        raise first.refuse("", f"{len(places)} keys with the distribution {kind}", allowed)
    (reading,) = readings
    if kind == "choice":
        return _read_choice(reading)
    if kind == "shell":
        return _read_shell(reading)
    if kind == "rotations":
        if first.shape != (4,):
            raise first.refuse("distribution", show(kind), "another, for these are of an attitude as a quaternion")
        return _made(readings, Rotations())
    return _made(readings, _read_components(reading), scaled=reading.relative)


def _made(readings: Sequence[KeyReading], distribution: Distribution, scaled: bool = False) -> Dispersion:
    """The dispersion of one key, or of several; `scaled`: whether shares are drawn."""
    nominal = tuple(x for reading in readings for x in reading.nominal)
    return Dispersion(
        keys=tuple(reading.place.key for reading in readings),
        columns=tuple(name for reading in readings for name in reading.columns),
        shape=readings[0].place.shape,
        judged_apart=readings[0].table.judged_apart,
        known_to_law=readings[0].table.known_to_law,
        distribution=distribution,
        nominal=nominal,
        places=tuple(reading.place for reading in readings),
        scale=nominal if scaled else None,
        nominal_tables=_nominal_tables(readings),
    )


def _nominal_tables(readings: Sequence[KeyReading]) -> dict[str, Any]:
    """The raw tables for [nominal]: of what laws take the craft for or are designed with, and are not told. InputError for
    `known_to_law` of what they cannot know, or not otherwise."""
    scenario, table = readings[0].scenario, readings[0].table
    tables, body = read_toml(scenario.text, scenario.where), scenario.hooks
    found: dict[str, Any] = {}
    for reading in readings:
        key, name = reading.place.key, str(reading.place.path[0])
        modelled = name in body.modelled or (name in body.designed and _designs(tables) and key not in scenario.table.shared)
        if name == body.marker and not modelled and not table.known_to_law:
            raise reading.place.refuse("known_to_law", "false", "true, for laws of this body know the numbers of this table")
        if table.known_to_law and not modelled and name != body.marker:
            raise reading.place.refuse("known_to_law", "true", "false, for no law is told it or designed with it")
        given = scenario.table.nominal
        if modelled and (name in given or not table.known_to_law):
            found[name] = given.get(name, tables.get(name, {}))
    return found


def _designs(tables: Mapping[str, Any]) -> bool:
    """Whether a law, or that of a mode, has a design form."""
    return any("form" in one for law in tables["law"] for one in (law, *law.get("mode", ())))


def _read_components(reading: KeyReading) -> Distribution:
    """The distributions whose components are drawn one by one."""
    kind, table, place = reading.table.distribution, reading.table, reading.place
    if kind == "uniform":
        low, high = reading.numbers("low"), reading.numbers("high")
        _check_order(reading, low, high)
        return Uniform(low, high, reading.dims, place.whole)
    if kind == "normal":
        return Normal(reading.centre("mean"), reading.sigma(reading.unit), reading.dims)
    if kind == "log-normal":
        median = reading.centre("median")
        if not all(median):
            raise place.refuse(
                "median", show(place.value if table.median is None else table.median), "numbers that are not zero"
            )
        return LogNormal(median, reading.sigma("1"), reading.dims)
    none = (math.inf,) * len(reading.index)
    low = tuple(-x for x in none) if table.low is None else reading.numbers("low")
    high = none if table.high is None else reading.numbers("high")
    _check_order(reading, low, high)
    found = TruncatedNormal(reading.centre("mean", held=False), reading.sigma(reading.unit), low, high, reading.dims)
    if not found.reached:
        name = "high" if table.low is None else "low"
        raise place.refuse(name, show(getattr(table, name)), "an interval that the normal distribution reaches")
    return found


def _check_order(reading: KeyReading, low: Numbers, high: Numbers) -> None:
    if not all(a < b for a, b in zip(low, high, strict=True)):
        raise reading.place.refuse("low", show(reading.table.low), f"below high, which is {show(reading.table.high)}")


def _read_shell(reading: KeyReading) -> Dispersion:
    place, table = reading.place, reading.table
    if place.shape != (3,) or place.gain is None or place.gain.shape != (3,):
        raise place.refuse("distribution", '"shell"', "another, for this one is of a vector of three numbers")
    number = replace(place, shape=())
    low, high = (float(width_at(number, getattr(table, name), name, reading.unit)) for name in ("low", "high"))
    if not 0.0 <= low < high:
        raise place.refuse("low", show(table.low), f"from 0 to below high, which is {show(table.high)}")
    size = math.hypot(*reading.nominal) if reading.relative else 1.0
    # One direction stands for all.
    accepted(reading.scenario, place, [high * size, 0.0, 0.0], "high")
    return _made([reading], Shell(low * size, high * size))


def _read_choice(reading: KeyReading) -> Dispersion:
    place, table = reading.place, reading.table
    weights = [1.0] * len(table.values) if table.weights is None else table.weights
    if len(weights) != len(table.values):
        raise place.refuse("weights", f"{len(weights)} weights", f"one for each of the {len(table.values)} values")
    for number, weight in enumerate(weights, 1):
        if isinstance(weight, bool) or not isinstance(weight, int | float) or not 0.0 < weight < math.inf:
            raise place.refuse(f"weights[{number}]", show(weight), "a number above 0")
    values: list[tuple[Any, ...]] = []
    for number, raw in enumerate(table.values, 1):
        name = f"values[{number}]"
        if place.wordy:
            values.append((word(accepted(reading.scenario, place, raw, name)),))
        else:
            values.append(reading.read(raw, name))
    if len(set(values)) < 2:
        raise place.refuse("values", show(table.values), "at least two values that differ")
    return _made([reading], Choice(tuple(values), tuple(map(float, weights))), scaled=reading.relative)


def _read_correlated(readings: list[KeyReading]) -> Dispersion:
    first, table = readings[0], readings[0].table
    # Of the vector of one key, or of keys of a number each.
    wanted = 1 if len(readings) == 1 else 0
    if any(len(reading.place.shape) != wanted for reading in readings):
        raise first.place.refuse("distribution", show(table.distribution), "numbers of several keys, or the vector of one")
    nominal = tuple(x for reading in readings for x in reading.nominal)
    mean = _each(readings, table.mean, "mean") if table.mean is not None else tuple(
        x for reading in readings for x in reading.centre("mean")
    )  # fmt: skip
    name = "covariance" if table.correlation is None else "correlation"
    matrix = _positive(first, getattr(table, name), len(nominal), name)
    if name == "correlation":
        sigma = _each(readings, table.sigma, "sigma", held=False)
        if min(sigma) <= 0.0:
            raise first.place.refuse("sigma", show(table.sigma), "above 0")
        factor = np.array(sigma)[:, None] * np.linalg.cholesky(matrix)
    else:
        factor = np.linalg.cholesky(matrix)
    return _made(readings, CorrelatedNormal(mean, tuple(map(tuple, factor.tolist()))), scaled=first.relative)


def _each(readings: list[KeyReading], raw: Any, name: str, held: bool = True) -> Numbers:
    """A number for each of several keys, or for each component of one vector."""
    if len(readings) == 1:
        return readings[0].read(raw, name, held)
    if not isinstance(raw, list) or len(cast(list[Any], raw)) != len(readings):
        raise readings[0].place.refuse(name, show(raw), f"{len(readings)} values, one for each key")
    pairs = zip(readings, cast(list[Any], raw), strict=True)
    return tuple(reading.read(item, f"{name}[{n}]", held)[0] for n, (reading, item) in enumerate(pairs, 1))


def _positive(reading: KeyReading, raw: Any, size: int, name: str) -> Array:
    """A matrix of correlations or covariances. InputError where it is none."""
    allowed = f"{size} rows of {size} plain numbers"
    try:
        matrix = np.array(raw, dtype=float)
    except ValueError:
        raise reading.place.refuse(name, show(raw), allowed) from None
    if matrix.shape != (size, size) or any(isinstance(item, str) for row in raw for item in row):
        raise reading.place.refuse(name, show(raw), allowed)
    if np.abs(matrix - matrix.T).max() > SYMMETRIC * np.abs(matrix).max():
        raise reading.place.refuse(name, show(raw), "a symmetric matrix")
    if name == "correlation" and np.abs(np.diagonal(matrix) - 1.0).max() > SYMMETRIC:
        raise reading.place.refuse(name, show(raw), "ones on the diagonal")
    # Scaled to correlations, for covariances may be of many units.
    size_of = np.sqrt(np.abs(np.diagonal(matrix)))
    with np.errstate(all="ignore"):
        scaled = matrix / np.outer(size_of, size_of)
    if not np.isfinite(scaled).all() or np.linalg.eigvalsh(scaled)[0] <= size * np.finfo(float).eps:
        raise reading.place.refuse(name, show(raw), "a positive definite matrix")
    return matrix
