"""Computes a loop's numbers from drawn values by one equation, recorded once and evaluated for all lanes at once; gains by
their law's own formula, at once where the law has a way, else lane by lane."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import repeat
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import leaves, mapped, put, rebuild
from starhold.campaign.dispersions import Dispersion
from starhold.loop.kernels import numbers_of
from starhold.scenario.reading import LawEntry, Scenario
from starhold.studies.flat import Flat, named
from starhold.trace.calling import Compiled
from starhold.trace.handles import Handle

Array: TypeAlias = NDArray[np.float64]
Columns: TypeAlias = Mapping[str, NDArray[Any]]


class Moving:
    """The numbers that a law's loop has under the values of dispersions."""

    def __init__(self, scenario: Scenario, law: LawEntry, base: Flat, dispersions: tuple[Dispersion, ...]) -> None:
        self.scenario, self.law, self.base = scenario, law, base
        self.drawn = [one for one in dispersions if not one.wordy]
        self._paths: dict[str, tuple[Any, ...]] = {place.key: place.path for one in self.drawn for place in one.places}
        self._names: tuple[tuple[str, ...], ...] = ()
        self._compiled: tuple[Compiled, list[str]] | None = None

    def by_key(self, columns: Columns, known: bool = False) -> dict[str, Array]:
        """Return the values that are numbers, (components..., lanes), by key; `known`: only those known to laws."""
        return {
            key: np.moveaxis(values, 0, -1)
            for one in self.drawn
            if one.known or not known
            for key, values in one.arrays(columns).items()
        }

    def numbers(self, columns: Columns) -> dict[str, Array]:
        """Return the numbers that differ, (lanes,), by their names in a carry or a phase. ValueError or RecordingError where
        no equation gives them."""
        arguments = self._arguments(columns)
        varying = [leaf for leaf in leaves(arguments) if isinstance(leaf, np.ndarray)]
        if not varying:
            return {}
        equation, names = self._equation(arguments, len(varying))
        return dict(zip(names, equation.over(np.array(varying)), strict=True))

    def _arguments(self, columns: Columns) -> tuple[Any, ...]:
        """The arguments of the equation: the flying craft, the nominal model, and the parameters of parts."""
        hooks, every = self.scenario.hooks, self.by_key(columns)
        true = hooks.drawn(self.scenario, every)
        supposed = hooks.drawn(self.scenario.known, self.by_key(columns, known=True))
        parts = dict[str, Any]()
        for key, path in self._paths.items():
            if path[0] == "part":
                fitted = self.scenario.parts[path[1]]
                parts[fitted.called] = put(parts.get(fitted.called, fitted.params), path[2:], _rows(every[key]))
        self._names = tuple(true), tuple(supposed), tuple(parts)
        return tuple(true.values()), tuple(supposed.values()), tuple(parts.values())

    def _equation(self, arguments: Any, count: int) -> tuple[Compiled, list[str]]:
        if self._compiled is None:
            names = list[str]()

            def equation(*given: Any) -> tuple[Any, ...]:
                values = iter(given)
                bound = mapped(arguments, lambda leaf: next(values) if isinstance(leaf, np.ndarray) else leaf)
                by_name = (dict(zip(*pair, strict=True)) for pair in zip(self._names, bound, strict=True))
                pairs = [pair for pair in self._named(*by_name) if isinstance(pair[1], Handle)]
                names[:] = [name for name, _ in pairs]
                return tuple(number for _, number in pairs)

            self._compiled = Compiled(equation, *[0.0] * count), names
        return self._compiled

    def _named(self, true: Any, supposed: Any, params: Mapping[str, Any]) -> list[tuple[str, Any]]:
        """The numbers of the loop with their names: the initial carry, and the phases."""
        loop = self.base.loop
        moved = self.scenario.hooks.flown(self.scenario, loop, true, supposed)
        parts = tuple(replace(one, params=params[one.name]) if one.name in params else one for one in moved.parts)
        setup = replace(loop, parts=parts).setup()._replace(limit=moved.limit)
        carry = loop.carry(moved.made_with, setup=setup)
        phase = {"nominal": moved.nominal, "craft": moved.craft, "setup": setup}
        return [
            *zip(self.base.names, numbers_of(carry), strict=False),
            *(pair for name, value in phase.items() for pair in named(value, name)),
        ]

    def gains(self, columns: Columns, nominal: Any) -> dict[str, Array]:
        """Return by name the gains of each lane from the law's form and the nominal craft, which has arrays (lanes,) where
        lanes differ; none for a law without a form. ValueError where a lane has none."""
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
        rows = [[leaf for leaf in leaves(gains) if isinstance(leaf, float)] for gains in every]
        names = [name for name, _ in named(self.base.loop.gains, "gains")]
        return dict(zip(names, np.array(rows).T, strict=True))


def _each(value: Any, lanes: int) -> Iterable[Any]:
    """Return a structure with arrays (lanes,) as that of each lane, with numbers."""
    if isinstance(value, np.ndarray) and value.ndim:
        return value.astype(float).tolist()
    parts = [_each(part, lanes) for part in cast(Any, value)] if isinstance(value, tuple) else []
    if all(isinstance(part, repeat) for part in parts):
        return repeat(value, lanes)
    return [rebuild(value, row) for row in zip(*parts, strict=True)]


def _rows(new: Array) -> Any:
    """An array (components..., lanes) as nested tuples of arrays (lanes,)."""
    return tuple(_rows(row) for row in new) if new.ndim > 1 else new
