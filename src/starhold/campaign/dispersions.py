"""Dispersions: the keys of a scenario that differ between runs of a campaign, with the distributions of their values."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.scenario.assumed import is_assumed
from starhold.scenario.checking import read_toml
from starhold.scenario.distribution import Array, Distribution
from starhold.scenario.key_reading import KeyReading, Numbers, components
from starhold.scenario.reading import Scenario
from starhold.scenario.values import Place, locate


@dataclass(frozen=True)
class Dispersion:
    """A distribution, and the key or keys whose values are drawn from it."""

    keys: tuple[str, ...]
    columns: tuple[str, ...]
    """The names of the drawn numbers: a key, with its component from 1 as in "initial.rate[2]", or row and column; of a
    symmetric matrix the entries on and above the diagonal."""
    shape: tuple[int, ...]
    """The shape of the key: () for a number or a word, (n,) for a vector or a diagonal, (n, n) for a matrix. Several keys
    are each a number."""
    distribution: Distribution
    places: tuple[Place, ...]
    """The place of each key, with its bounds."""
    scale: Numbers | None = None
    """The numbers, one per column, by which drawn shares are multiplied; None for absolute numbers."""
    nominal_tables: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """The tables to add to [nominal], so that laws assume the file's values instead of the drawn ones."""

    @property
    def dims(self) -> int:
        """The number of uniforms that a draw uses."""
        return self.distribution.dims

    @property
    def called(self) -> str:
        """The key, or several keys separated by commas."""
        return ", ".join(self.keys)

    @property
    def known(self) -> bool:
        """Whether laws know the drawn values; else they assume the nominal ones."""
        return self.distribution.known_to_law or not self.nominal_tables

    @property
    def wordy(self) -> bool:
        """Whether the drawn values are words, or booleans by their names."""
        return self.places[0].wordy

    def draw(self, u: Array) -> NDArray[Any]:
        """Return values (columns, n), numbers or words, for uniforms u (dims, n) strictly between 0 and 1. InputError where
        a number is outside a key's bounds."""
        drawn = self._drawn(u)
        if self.wordy or not drawn.size:
            return drawn
        # No craft has numbers beyond the bounds of a key: a distribution that contains them does not model it.
        for place, numbers in zip(self.places, np.split(drawn, len(self.places)), strict=True):
            for extreme in (float(numbers.min()), float(numbers.max())):
                try:
                    place.bounds.check(extreme)
                except ValueError as error:
                    allowed = f"{str(error).removeprefix('must be ')}; a truncated-normal or uniform one keeps bounds"
                    raise place.refuse("", f"a draw of {extreme:g}", allowed) from None
        return drawn

    def _drawn(self, u: Array) -> NDArray[Any]:
        # Contiguous, so that the same machine code computes every slice of the numbers.
        values = self.distribution.draw(np.ascontiguousarray(u, dtype=np.float64))
        return values if self.scale is None else np.array(self.scale)[:, None] * values

    def possible(self, u: Array) -> NDArray[np.bool_]:
        """Return a mask (n,) of the draws for uniforms u (dims, n) whose numbers are all within the bounds of their keys."""
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
        """Return the values by key, each (n, *shape), from columns (n,), with symmetric matrices complete."""
        if not self.shape:
            return {key: np.asarray(columns[key]) for key in self.keys}
        array = np.empty((len(columns[self.columns[0]]), *self.shape))
        for name, index in zip(self.columns, components(self.shape, self._symmetric), strict=True):
            for place in {index, index[::-1]} if self._symmetric else {index}:
                array[(slice(None), *place)] = columns[name]
        return {self.keys[0]: array}

    @property
    def _symmetric(self) -> bool:
        return len(self.columns) < math.prod(self.shape)

    def change(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the argument of `Scenario.with_` that sets the keys to the values of one run, given by column."""
        arrays = self.arrays({name: np.asarray([values[name]]) for name in self.columns})
        changes: dict[str, Any] = {}
        for place in self.places:
            (value,) = arrays[place.key].tolist()
            changes |= place.change(_plain(place, value))
        return changes


def _plain(place: Place, value: Any) -> Any:
    """Return a drawn value in the form that a file has."""
    if place.gain is None and isinstance(place.value, bool):
        return value == "true"
    return int(value) if place.whole else value


def read_dispersions(scenario: Scenario, over: Mapping[str, Distribution]) -> tuple[Dispersion, ...]:
    """Return the dispersions of a scenario's keys for the tables of [campaign.over]. InputError for an invalid table."""
    dispersions: list[Dispersion] = []
    taken: list[Place] = []
    for keys, table in over.items():
        places = [replace(locate(scenario, key.strip()), table=keys) for key in keys.split(",")]
        for place in places:
            same = next((other for other in taken if _overlap(place, other)), None)
            if same is not None:
                raise place.refuse("", f"a second dispersion of {place.key}", f"only one; another is {same.table}")
            taken.append(place)
        dispersions.append(_read(scenario, places, table))
    return tuple(dispersions)


def _overlap(one: Place, other: Place) -> bool:
    """Return whether two keys are the same, one is a component of the other, or setting one removes the other."""
    size = min(len(one.path), len(other.path))
    return one.path[:size] == other.path[:size] or one.displaced == other.key or other.displaced == one.key


def _read(scenario: Scenario, places: list[Place], table: Any) -> Dispersion:
    keys = [KeyReading.of(scenario, place, table) for place in places]
    if len(keys) > 1 and not table.SEVERAL:
        given = f"{len(keys)} keys with the distribution {table.distribution}"
        allowed = f"a table for each key; several together have the distribution {table.named('SEVERAL')}"
        raise places[0].refuse("", given, allowed)
    return Dispersion(
        keys=tuple(place.key for place in places),
        columns=tuple(name for key in keys for name in key.columns),
        shape=places[0].shape,
        distribution=table.read(keys),
        places=tuple(places),
        scale=tuple(x for key in keys for x in key.nominal) if table.shares else None,
        nominal_tables=_nominal_tables(keys),
    )


def _nominal_tables(readings: Sequence[KeyReading]) -> dict[str, Any]:
    """Return the raw tables for [nominal]: tables that laws read or are designed with, but whose drawn values they do not
    know. InputError where `known_to_law` is true of values that laws cannot know, or false of values they always know."""
    scenario, table = readings[0].scenario, readings[0].table
    tables, body = read_toml(scenario.text, scenario.where), scenario.hooks
    nominal: dict[str, Any] = {}
    designed = any("form" in one for law in tables["law"] for one in (law, *law.get("mode", ())))
    for reading in readings:
        key, path = reading.place.key, reading.place.path
        name = str(path[0])
        modelled = name in body.modelled or (name in body.designed and designed and key not in scenario.table.shared)
        unknown = "mounting_error" in path
        computed = name == "part" and (
            scenario.parts[int(path[1])].part.is_known(str(path[2]))
            or is_assumed(scenario.parts, tables["part"], int(path[1]), str(path[2]))
        )
        if computed and not table.known_to_law:
            raise reading.place.refuse("known_to_law", "false", "true, because laws compute their commands with this number")
        if name == "fault" and table.known_to_law:
            raise reading.place.refuse(
                "known_to_law", "true", "false, because the action on a fault determines what laws learn about it"
            )
        if name == body.marker and not modelled and not table.known_to_law:
            raise reading.place.refuse(
                "known_to_law", "false", "true, because laws of this body know the numbers of this table"
            )
        if table.known_to_law and (unknown or not modelled) and not computed and name != body.marker:
            raise reading.place.refuse("known_to_law", "true", "false, because no law receives it or is designed with it")
        given = scenario.table.nominal
        if modelled and (name in given or not table.known_to_law):
            nominal[name] = given.get(name, tables.get(name, {}))
    return nominal
