"""Reads the table of one key's dispersion as numbers in the key's unit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from starhold.parts.epoch import EPOCH, date_of
from starhold.scenario.checking import show
from starhold.scenario.distribution import SYMMETRIC, Distribution
from starhold.scenario.reading import Scenario
from starhold.scenario.values import Place, accepted, width_at

Numbers: TypeAlias = tuple[float, ...]


def components(shape: tuple[int, ...], symmetric: bool = False) -> list[tuple[int, ...]]:
    """Return the indices of an array's entries, row by row; of a symmetric matrix those on and above the diagonal."""
    every = [tuple(map(int, index)) for index in np.ndindex(shape)]
    return [index for index in every if index[0] <= index[1]] if symmetric else every


@dataclass(frozen=True)
class KeyReading:
    """One key and its table, while its dispersion is read."""

    scenario: Scenario
    place: Place
    table: Any
    index: tuple[tuple[int, ...], ...]
    """The indices of the drawn components."""
    relative: bool

    @staticmethod
    def of(scenario: Scenario, place: Place, table: Any) -> KeyReading:
        """Return the reading of a key's table. InputError where the key cannot have values of the distribution."""
        relative, value = getattr(table, "relative", False), place.value
        for holds, flag, what in (
            (place.wordy, "WORDS", "a word"),
            (place.whole, "WHOLE", "a whole number"),
            (place.gain == EPOCH, "WORDS", "a date"),
        ):
            if holds and not getattr(table, flag):
                allowed = f"{Distribution.named(flag)}, because the key holds {what}"
                raise place.refuse("distribution", show(table.distribution), allowed)
        if relative and (place.wordy or place.whole):
            raise place.refuse("relative", "true", "false, because the key holds a word or a whole number")
        if relative and (value is None or not np.isfinite(value).all() or not np.any(value)):
            raise place.refuse("relative", "true", f"false, for there are no shares of {_shown(value)}")
        index = components(place.shape, symmetric=is_symmetric(place))
        return KeyReading(scenario, place, table, tuple(index), relative)

    @property
    def unit(self) -> str | None:
        """The unit of shares; None for that of the key."""
        return "1" if self.relative else None

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the drawn components."""
        return tuple(self.place.key + "".join(f"[{n + 1}]" for n in item) for item in self.index)

    @property
    def nominal(self) -> tuple[Any, ...]:
        """The file's value of each drawn component, a number or a word; NaN where it has none."""
        value = self.place.value
        if self.place.wordy:
            return (word(value),)
        return self.picked(np.full(self.place.shape, np.nan) if value is None else value)

    def picked(self, array: Any) -> Numbers:
        """Return the drawn components of an array of the key's shape."""
        full = np.asarray(array, dtype=float)
        return tuple(float(full[item]) for item in self.index)

    def centre(self, name: str, checked: bool = True) -> Numbers:
        """Return the parameter `name`, a mean or a median, by default the file's value."""
        value = self.place.value
        if getattr(self.table, name) is not None:
            return self.numbers(name, checked)
        if not self.relative and (value is None or not np.isfinite(value).all()):
            raise self.place.refuse(name, "nothing", f"a value, because the file has {_shown(value)}")
        return (1.0,) * len(self.index) if self.relative else self.nominal

    def numbers(self, name: str, checked: bool = True) -> Numbers:
        """Return the numbers of a parameter in the key's unit, or as shares. InputError where `checked` is true and the key
        would not accept them."""
        return self.read(getattr(self.table, name), name, checked)

    def norm(self, name: str) -> float:
        """Return a parameter that is one number for the whole vector, in the key's unit or as a share."""
        return float(width_at(replace(self.place, shape=()), getattr(self.table, name), name, self.unit))

    def accept(self, value: Any, name: str) -> Any:
        """Return the validated value. InputError about the parameter `name` where the key does not accept it."""
        return accepted(self.scenario, self.place, value, name)

    def read(self, raw: Any, name: str, checked: bool = True) -> tuple[Any, ...]:
        """Return the numbers or the word that a raw value stands for; `name`: its name in errors; `checked` as in
        `numbers`."""
        if self.place.wordy:
            return (word(self.accept(raw, name)),)
        if self.place.gain == EPOCH and isinstance(raw, str):
            try:
                raw = list(date_of(raw))
            except ValueError as error:
                raise self.place.refuse(name, show(raw), str(error)) from None
        read = width_at(self.place, raw, name, self.unit)
        if checked:
            self.accept((read * self.place.value if self.relative else read).tolist(), name)
        return self.picked(read)

    def sigma(self, unit: str | None) -> Numbers:
        """Return standard deviations in `unit`, or for None in the key's. InputError where one is negative, or all are
        zero."""
        raw, scale = self.table.sigma, self.nominal if self.relative else (1.0,) * len(self.index)
        widths = self.picked(width_at(self.place, raw, "sigma", unit))
        if min(widths) < 0.0 or not any(share * size for share, size in zip(widths, scale, strict=True)):
            raise self.place.refuse("sigma", show(raw), "above 0")
        return widths


def _shown(value: Any) -> str:
    return "no value" if value is None else show(value)


def word(value: Any) -> Any:
    return str(value).lower() if isinstance(value, bool) else value


def is_symmetric(place: Place) -> bool:
    """Return whether a key holds a symmetric matrix."""
    if len(place.shape) != 2 or place.value is None:
        return False
    array = np.array(place.value)
    return bool(np.abs(array - array.T).max() <= SYMMETRIC * np.abs(array).max())
