"""The interface of distributions: uniform numbers go in and values come out, so that random, Sobol and Latin hypercube
samples serve all of them alike. Parameters stay as in the file until `read` replaces them by numbers in the units of a key.
Every `draw` takes uniforms u (dims, n) strictly between 0 and 1 and returns values (width, n), each a function of its own
column of u alone, to the last bit: so a campaign may be cut into chunks anywhere.
"""

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
"""The classes by the names of their distributions."""


class Distribution(Table):
    """One key, or several that are drawn together."""

    WORDS: ClassVar[bool] = False
    """Whether values may be words, booleans and dates."""
    WHOLE: ClassVar[bool] = False
    """Whether values may be whole numbers."""
    SEVERAL: ClassVar[bool] = False
    """Whether several keys may be drawn together."""
    BOUNDED: ClassVar[bool] = False
    """Whether values have bounds, whatever the parameters are."""

    judged_apart: Annotated[
        Flag,
        Field(description="known before flight, as the day of a launch: runs of similar values are judged by themselves"),
    ] = False
    known_to_law: Annotated[
        Flag, Field(description="laws know each drawn value and are designed for it; else for the file's value")
    ] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        if "distribution" in cls.model_fields:
            DISTRIBUTIONS[get_args(cls.model_fields["distribution"].annotation)[0]] = cls

    @classmethod
    def named(cls, flag: str) -> str:
        """Return the names of distributions with a flag, as errors list them."""
        return " or ".join(name for name, kind in DISTRIBUTIONS.items() if getattr(kind, flag))

    DIMS: ClassVar[int] = 1
    """Return the number of uniforms of a draw, where it does not depend on the parameters."""

    @property
    def dims(self) -> int:
        """The number of uniforms of a draw."""
        return self.DIMS

    @property
    def bounded(self) -> bool:
        """Whether values have bounds."""
        return self.BOUNDED

    @property
    def independent(self) -> bool:
        """Whether each uniform determines a number of its own."""
        return False

    @property
    def shares(self) -> bool:
        """Whether the drawn numbers are shares of the file's value."""
        return getattr(self, "relative", False)

    def read(self, keys: Sequence[KeyReading]) -> Self:
        """Return the distribution with its parameters as numbers for its keys. InputError where they are impossible."""
        return self.model_copy(update=self._numbers(*keys))

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        """The numbers by parameter."""
        return {}

    @abstractmethod
    def draw(self, u: Array) -> NDArray[Any]:
        """Return values (width, n) for uniforms (dims, n)."""

    def size(self, rows: Sequence[Array]) -> tuple[str, Array] | None:
        """A name and a function of the drawn numbers (n,) that may matter more than the numbers themselves, or None."""
        return None


class Relative(Distribution):
    """One whose numbers may be shares."""

    relative: Annotated[Flag, Field(description="the numbers are shares of the file's value")] = False


class Spread(Relative):
    """A distribution that is drawn for each component by itself, or once for all; each parameter has a number for each,
    (width,)."""

    together: Annotated[Flag, Field(description="all components move together, by one draw")] = False
    _width: int = PrivateAttr(1)
    _whole: bool = PrivateAttr(False)

    def read(self, keys: Sequence[KeyReading]) -> Self:
        """The distribution with its numbers."""
        reading = super().read(keys)
        reading._width, reading._whole = len(keys[0].index), keys[0].place.whole
        return reading

    @property
    def dims(self) -> int:
        """One for each number, unless they move together."""
        return 1 if self.together else self._width

    @property
    def independent(self) -> bool:
        """Whether they do not move together."""
        return self.dims == self._width


def column(numbers: Sequence[float]) -> Array:
    """Numbers (n,) as a column (n, 1)."""
    return np.array(numbers, dtype=np.float64)[:, None]


def ndtri(u: Array) -> Array:
    """The quantiles of the normal distribution."""
    from scipy import special

    return special.ndtri(u)
