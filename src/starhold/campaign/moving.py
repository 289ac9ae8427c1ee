"""Computes a loop's numbers from drawn values by one equation, recorded once and evaluated for all lanes at once. A law's
designed gains, and numbers that a part prepares without a recordable equation, are computed separately, if necessary lane by
lane."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import repeat
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import leaves, mapped, put, rebuild
from starhold.campaign.dispersions import Dispersion
from starhold.loop.kernels import numbers_of
from starhold.parts.part import Fitted
from starhold.scenario.assumed import with_assumed
from starhold.scenario.checking import read_toml
from starhold.scenario.reading import LawEntry, Scenario
from starhold.studies.flat import Flat, named
from starhold.trace.calling import Compiled, record_call
from starhold.trace.handles import Handle, RecordingError

Array: TypeAlias = NDArray[np.float64]
Columns: TypeAlias = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Ready(Fitted):
    """A part of a loop together with the numbers that it has prepared."""

    numbers: Any = ()

    def prepared(self, period: float) -> Any:
        return self.numbers


class Moving:
    """Computes the numbers of a law's loop for drawn values of the dispersions."""

    def __init__(self, scenario: Scenario, law: LawEntry, base: Flat, dispersions: tuple[Dispersion, ...]) -> None:
        self.scenario, self.law, self.base = scenario, law, base
        self.drawn = [one for one in dispersions if not one.wordy]
        self._paths: dict[str, tuple[Any, ...]] = {place.key: place.path for one in self.drawn for place in one.places}
        self._names: tuple[tuple[str, ...], ...] = ()
        self._apart: dict[str, bool] = {}
        self._compiled: tuple[Compiled, list[str]] | None = None

    def by_key(self, columns: Columns, known: bool = False) -> dict[str, Array]:
        """Return the numerical values, (components..., lanes) by key; `known`: whether to return only those known to
        laws."""
        return {
            key: np.moveaxis(values, 0, -1)
            for one in self.drawn
            if one.known or not known
            for key, values in one.arrays(columns).items()
        }

    def numbers(self, columns: Columns) -> dict[str, Array]:
        """Return the numbers that differ between lanes, (lanes,) by their names in a carry or a phase. ValueError or
        RecordingError where no equation gives them."""
        arguments = self._arguments(columns)
        varying = [leaf for leaf in leaves(arguments) if isinstance(leaf, np.ndarray)]
        if not varying:
            return {}
        equation, names = self._equation(arguments, len(varying))
        return dict(zip(names, equation.over(np.array(varying)), strict=True))

    def _arguments(self, columns: Columns) -> tuple[Any, ...]:
        """Return the arguments of the equation: the true craft, the nominal model, the parameters of parts, and the numbers
        that parts prepare without a recordable equation."""
        hooks, every = self.scenario.hooks, self.by_key(columns)
        true, known = hooks.drawn(self.scenario, every), self.by_key(columns, known=True)
        alike = self.scenario.known is self.scenario and len(known) == len(every)
        supposed = true if alike else hooks.drawn(self.scenario.known, known)
        parts, ready = dict[str, Any](), dict[str, Any]()
        for key, path in self._paths.items():
            if path[0] == "part":
                fitted = self.scenario.parts[path[1]]
                parts[fitted.called] = put(parts.get(fitted.called, fitted.params), path[2:], _rows(every[key]))
        if parts:
            fitted = [replace(one, params=parts.get(one.called, one.params)) for one in self.scenario.parts]
            parts = {one.called: one.params for one in with_assumed(fitted, self._tables) if _differ(one.params)}
        for one in self.base.loop.parts:
            if one.name in parts and self._is_apart(replace(one, params=parts[one.name])):
                lanes = _each(parts[one.name], len(next(iter(columns.values()))))
                ready[one.name] = _joined([replace(one, params=params).prepared(self.base.loop.period) for params in lanes])
        self._names = tuple(true), tuple(supposed), tuple(parts), tuple(ready)
        return tuple(true.values()), tuple(supposed.values()), tuple(parts.values()), tuple(ready.values())

    @cached_property
    def _tables(self) -> Any:
        """The raw [[part]] tables of the scenario."""
        return read_toml(self.scenario.text, self.scenario.where)["part"]

    def _is_apart(self, fitted: Fitted) -> bool:
        """Return whether a part prepares its numbers, from parameters with arrays (lanes,), without a recordable
        equation."""
        if fitted.name not in self._apart:
            count = sum(isinstance(leaf, np.ndarray) for leaf in leaves(fitted.params))

            def equation(*given: Any) -> Any:
                return replace(fitted, params=_filled(fitted.params, given)).prepared(self.base.loop.period)

            try:
                record_call(equation, (0.0,) * count)
                self._apart[fitted.name] = False
            except (RecordingError, TypeError):
                self._apart[fitted.name] = True
        return self._apart[fitted.name]

    def _equation(self, arguments: Any, count: int) -> tuple[Compiled, list[str]]:
        if self._compiled is None:
            names = list[str]()

            def equation(*given: Any) -> tuple[Any, ...]:
                bound = _filled(arguments, given)
                by_name = (dict(zip(*pair, strict=True)) for pair in zip(self._names, bound, strict=True))
                pairs = [pair for pair in self._named(*by_name) if isinstance(pair[1], Handle)]
                names[:] = [name for name, _ in pairs]
                return tuple(number for _, number in pairs)

            self._compiled = Compiled(equation, *[0.0] * count), names
        return self._compiled

    def _named(self, true: Any, supposed: Any, params: Mapping[str, Any], ready: Mapping[str, Any]) -> list[tuple[str, Any]]:
        """Return the names and numbers of the initial carry and of the phase."""
        loop = self.base.loop
        moved = self.scenario.hooks.flown(self.scenario, loop, true, supposed)
        parts = tuple(replace(one, params=params[one.name]) if one.name in params else one for one in moved.parts)
        parts = tuple(Ready(**vars(one), numbers=ready[one.name]) if one.name in ready else one for one in parts)
        setup = replace(loop, parts=parts).setup()._replace(limit=moved.limit)
        carry = loop.carry(moved.made_with, setup=setup)
        phase = {"nominal": moved.nominal, "craft": moved.craft, "setup": setup}
        return [
            *zip(self.base.names, numbers_of(carry), strict=False),
            *(pair for name, value in phase.items() for pair in named(value, name)),
        ]

    def gains(self, columns: Columns, nominal: Any) -> dict[str, Array]:
        """Return the gains of each lane, by name, from the law's design form and the nominal craft, which has arrays
        (lanes,) where lanes differ; empty for a law without a form. ValueError where the design of a lane fails."""
        spec, law = self.law.spec, self.law.law
        if self.law.form is None:
            return {}
        every = self.by_key(columns)
        for key, path in self._paths.items():
            if path[0] == "law" and self.scenario.laws[path[1]] is self.law:
                spec = put(spec, path[2:], _rows(every[key]))
        lanes = len(next(iter(columns.values())))
        cases = list(zip(_each(nominal, lanes), _each(spec, lanes), strict=True))
        every = law.design_all(cases)
        if not self.scenario.allow_unstable:
            for gains, (craft, _) in zip(every, cases, strict=True):
                law.check(gains, craft)
        return dict(named(_joined(every), "gains"))


def _filled(structure: Any, values: Iterable[Any]) -> Any:
    """Return a structure with these values in place of its arrays (lanes,)."""
    rest = iter(values)
    return mapped(structure, lambda leaf: next(rest) if isinstance(leaf, np.ndarray) else leaf)


def _differ(value: Any) -> bool:
    """Return whether lanes differ in a number of a structure."""
    return any(isinstance(leaf, np.ndarray) for leaf in leaves(value))


def _each(value: Any, lanes: int) -> Iterable[Any]:
    """Return the structure of each lane, with a number in place of each array (lanes,)."""
    if isinstance(value, np.ndarray) and value.ndim:
        return value.astype(float).tolist()
    parts = [_each(part, lanes) for part in cast(Any, value)] if isinstance(value, tuple) else []
    if all(isinstance(part, repeat) for part in parts):
        return repeat(value, lanes)
    return [rebuild(value, row) for row in zip(*parts, strict=True)]


def _joined(every: Sequence[Any]) -> Any:
    """Return the structures of many lanes joined into one, with an array (lanes,) in place of each number. ValueError where
    they differ in more than numbers."""
    apart = [list(leaves(one)) for one in every]
    form = [None if isinstance(leaf, float) else leaf for leaf in apart[0]]
    if any([None if isinstance(leaf, float) else leaf for leaf in row] != form for row in apart):
        raise ValueError("lanes differ in more than numbers")
    rows = iter(np.array([[leaf for leaf in row if isinstance(leaf, float)] for row in apart]).T)
    return mapped(every[0], lambda leaf: next(rows) if isinstance(leaf, float) else leaf)


def _rows(new: Array) -> Any:
    """Return an array (components..., lanes) as nested tuples of arrays (lanes,)."""
    return tuple(_rows(row) for row in new) if new.ndim > 1 else new
