"""The interface of distributions. Each maps uniform numbers to values, so random, Sobol and Latin hypercube samples work
with all of them. Parameters stay as in the file until `read` replaces them by numbers in the key's unit. Every `draw` takes
uniforms u (dims, n) strictly between 0 and 1 and returns values (width, n). Each value depends, to the last bit, only on its
own column of u, so a campaign may be split into chunks anywhere."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from starhold.scenario.tables import Flag, Table

if TYPE_CHECKING:
    from starhold.scenario.key_reading import KeyReading

Array: TypeAlias = NDArray[np.float64]
SYMMETRIC = 1e-9
"""A matrix counts as symmetric if it differs from its transpose by at most this share of its largest entry."""
DISTRIBUTIONS: dict[str, type[Distribution]] = {}
"""The classes of distributions by name."""


class Distribution(Table):
    """The distribution of one key, or of several keys that are drawn together."""

    WORDS: ClassVar[bool] = False
    """Whether values may be words, booleans and dates."""
    WHOLE: ClassVar[bool] = False
    """Whether values may be whole numbers."""
    SEVERAL: ClassVar[bool] = False
    """Whether several keys may be drawn together."""
    BOUNDED: ClassVar[bool] = False
    """Whether values have bounds, whatever the parameters are."""

    judged_apart: Annotated[
        Flag, Field(description="known before flight, such as the launch date: runs of similar values are judged separately")
    ] = False
    known_to_law: Annotated[
        Flag, Field(description="whether laws know and are designed for the drawn value, not the file's")
    ] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        if "distribution" in cls.model_fields:
            DISTRIBUTIONS[get_args(cls.model_fields["distribution"].annotation)[0]] = cls

    @classmethod
    def named(cls, flag: str) -> str:
        """Return the names of the distributions with a flag, as listed in errors."""
        return " or ".join(name for name, kind in DISTRIBUTIONS.items() if getattr(kind, flag))

    DIMS: ClassVar[int] = 1
    """The number of uniforms per draw, where it does not depend on the parameters."""

    @property
    def dims(self) -> int:
        """The number of uniforms per draw."""
        return self.DIMS

    @property
    def bounded(self) -> bool:
        """Whether values have bounds."""
        return self.BOUNDED

    @property
    def independent(self) -> bool:
        """Whether each drawn number depends on a different uniform."""
        return False

    @property
    def shares(self) -> bool:
        """Whether the drawn numbers are shares of the file's value."""
        return getattr(self, "relative", False)

    def read(self, keys: Sequence[KeyReading]) -> Self:
        """Return the distribution with its parameters converted to numbers in the units of its keys. InputError where they
        are impossible."""
        return self.model_copy(update=self._numbers(*keys))

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        """Return the numbers by the names of the parameters."""
        return {}

    @abstractmethod
    def draw(self, u: Array) -> NDArray[Any]:
        """Return values (width, n) for uniforms (dims, n)."""

    def size(self, rows: Sequence[Array]) -> tuple[str, Array] | None:
        """Return the name and values (n,) of a function of the drawn components that may explain results better than each
        component does, such as their norm; or None."""
        return None


class Relative(Distribution):
    """A distribution whose parameters may be shares of the file's value."""

    relative: Annotated[Flag, Field(description="the numbers are shares of the file's value")] = False


class Spread(Relative):
    """A distribution that is drawn for each component separately, or once for all components; each parameter holds a number
    per component, (width,)."""

    together: Annotated[Flag, Field(description="whether one draw moves all components")] = False
    _width: int = PrivateAttr(1)
    _whole: bool = PrivateAttr(False)

    def read(self, keys: Sequence[KeyReading]) -> Self:
        """Return the distribution with its parameters as numbers."""
        reading = super().read(keys)
        reading._width, reading._whole = len(keys[0].index), keys[0].place.whole
        return reading

    @property
    def dims(self) -> int:
        """One uniform per component, or a single one if they move together."""
        return 1 if self.together else self._width

    @property
    def independent(self) -> bool:
        """Whether the components are drawn separately."""
        return self.dims == self._width


def column(numbers: Sequence[float]) -> Array:
    """Return numbers (n,) as a column (n, 1)."""
    return np.array(numbers, dtype=np.float64)[:, None]


def ndtri(u: Array) -> Array:
    """Return the standard normal quantiles of probabilities u, in an array of the same shape."""
    from scipy import special

    return special.ndtri(u)
