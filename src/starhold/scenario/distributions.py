"""The distributions of dispersed numbers. Each class is one distribution: its table in a file, the conversion of its
parameters, and its inverse distribution function. Its field `distribution` gives its name; no other code names it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, PrivateAttr, model_validator

from starhold.errors import InputError
from starhold.scenario.checking import nearest, show, validate
from starhold.scenario.distribution import DISTRIBUTIONS, SYMMETRIC, Array, Distribution, Relative, Spread, column, ndtri
from starhold.scenario.quantity import raw
from starhold.scenario.tables import at_key, told_at

if TYPE_CHECKING:
    from starhold.scenario.key_reading import KeyReading


class Uniform(Spread):
    """The uniform distribution between two values, both included for whole numbers."""

    WHOLE = BOUNDED = True
    distribution: Literal["uniform"]
    low: Annotated[Any, *raw("the least value")]
    high: Annotated[Any, *raw("the greatest value")]

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        return _ordered(key, key.numbers("low"), key.numbers("high"))

    def draw(self, u: Array) -> Array:
        """Return the numbers at the fraction u of the interval between the two values."""
        low, high = column(self.low), column(self.high)
        if self._whole:
            return np.minimum(low + np.floor((high - low + 1.0) * u), high)
        # Rounding may exceed a bound, which the key may refuse.
        return np.clip(low + (high - low) * u, low, high)


class Normal(Spread):
    """Gauss's distribution."""

    distribution: Literal["normal"]
    mean: Annotated[Any, *raw("by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviation")]

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        return {"mean": key.centre("mean"), "sigma": key.sigma(key.unit)}

    def draw(self, u: Array) -> Array:
        """Return mean + sigma z, with z the normal quantiles of the uniforms."""
        return column(self.mean) + column(self.sigma) * ndtri(u)


class TruncatedNormal(Spread):
    """The normal distribution truncated at bounds."""

    distribution: Literal["truncated-normal"]
    mean: Annotated[Any, *raw("of the distribution before truncation; by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviation before truncation")]
    low: Annotated[Any, *raw("the least value, if there is one")] = None
    high: Annotated[Any, *raw("the greatest value, if there is one")] = None

    @model_validator(mode="after")
    def _is_cut(self) -> TruncatedNormal:
        if self.low is None and self.high is None:
            raise at_key("low", "low, high or both; without them it is normal", None)
        return self

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        none = (math.inf,) * len(key.index)
        low = tuple(-x for x in none) if self.low is None else key.numbers("low")
        ends = _ordered(key, low, none if self.high is None else key.numbers("high"))
        given = {"mean": key.centre("mean", checked=False), "sigma": key.sigma(key.unit), **ends}
        if not self.model_copy(update=given).reached:
            name = "high" if self.low is None else "low"
            raise key.place.refuse(
                name, show(getattr(self, name)), "an interval where the normal distribution has probability"
            )
        return given

    @property
    def bounded(self) -> bool:
        """Whether both bounds are finite."""
        return bool(np.isfinite([*self.low, *self.high]).all())

    @cached_property
    def _tails(self) -> tuple[NDArray[np.bool_], Array, Array]:
        """For each component, whether its interval is reflected about the mean, and the probabilities below its two ends
        after that. In the upper tail these are too close to one, so an interval there is reflected to the lower tail."""
        from scipy.special import ndtr

        mean, sigma, low, high = (column(numbers) for numbers in (self.mean, self.sigma, self.low, self.high))
        with np.errstate(divide="ignore", invalid="ignore"):
            first, last = (low - mean) / sigma, (high - mean) / sigma
        turned = first > 0.0
        return turned, ndtr(np.where(turned, -last, first)), ndtr(np.where(turned, -first, last))

    @property
    def reached(self) -> bool:
        """Whether the probability of every interval is large enough for floats."""
        _, below, above = self._tails
        return bool((above - below > 0.0).all())

    def draw(self, u: Array) -> Array:
        """Return quantiles of the truncated distribution."""
        turned, below, above = self._tails
        z = ndtri(below + np.where(turned, 1.0 - u, u) * (above - below))
        values = column(self.mean) + column(self.sigma) * np.where(turned, -z, z)
        return np.clip(values, column(self.low), column(self.high))


class LogNormal(Spread):
    """The lognormal distribution."""

    distribution: Literal["log-normal"]
    median: Annotated[Any, *raw("by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviation of the natural logarithm, no unit")]

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        median = key.centre("median")
        if not all(median):
            given = show(key.place.value if self.median is None else self.median)
            raise key.place.refuse("median", given, "numbers that are not zero")
        return {"median": median, "sigma": key.sigma("1")}

    def draw(self, u: Array) -> Array:
        """Return median exp(sigma z), with z the normal quantiles of the uniforms."""
        return column(self.median) * np.exp(column(self.sigma) * ndtri(u))


class Choice(Relative):
    """One of several values, each a tuple of numbers or a single word, with weights."""

    WORDS = WHOLE = BOUNDED = True
    distribution: Literal["choice"]
    values: Annotated[list[Any], Field(description="words, booleans or numbers")]
    weights: Annotated[list[Any] | None, Field(description="relative probabilities; equal if absent")] = None

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        weights = [1.0] * len(self.values) if self.weights is None else self.weights
        if len(weights) != len(self.values):
            raise key.place.refuse("weights", f"{len(weights)} weights", f"one for each of the {len(self.values)} values")
        for number, weight in enumerate(weights, 1):
            if isinstance(weight, bool) or not isinstance(weight, int | float) or not 0.0 < weight < math.inf:
                raise key.place.refuse(f"weights[{number}]", show(weight), "a number above 0")
        values = [key.read(value, f"values[{number}]") for number, value in enumerate(self.values, 1)]
        if len(set(values)) < 2:
            raise key.place.refuse("values", show(self.values), "at least two values that differ")
        return {"values": values, "weights": weights}

    def draw(self, u: Array) -> NDArray[Any]:
        """Return the value whose subinterval of [0, 1], of length in proportion to its weight, contains the uniform."""
        ends = np.cumsum(np.array(self.weights, dtype=float))
        return np.array(self.values).T[:, np.searchsorted(ends[:-1] / ends[-1], u[0], side="right")]


class CorrelatedNormal(Relative):
    """The joint normal distribution of several numbers: of keys separated by commas, or of one vector or matrix. Of a
    symmetric matrix the numbers on and above the diagonal are drawn, row by row."""

    SEVERAL = True
    distribution: Literal["correlated-normal"]
    mean: Annotated[Any, *raw("by default the file's value")] = None
    sigma: Annotated[Any, *raw("standard deviations")] = None
    correlation: Annotated[Any, *raw("correlations, a row for each number")] = None
    covariance: Annotated[Any, *raw("covariances (SI), a row for each number, in place of sigma and correlation")] = None
    _factor: Any = PrivateAttr(())
    """The rows of the lower triangular L; L L^T is the covariance."""

    @model_validator(mode="after")
    def _one_matrix(self) -> CorrelatedNormal:
        if (self.covariance is None) == (self.correlation is None):
            raise at_key("correlation", "either correlation with sigma, or covariance", self.correlation)
        if (self.covariance is None) == (self.sigma is None):
            allowed = "the standard deviations" if self.sigma is None else "no sigma beside a covariance"
            raise at_key("sigma", allowed, self.sigma)
        return self

    @property
    def dims(self) -> int:
        """One uniform per number."""
        return len(self.mean)

    def read(self, keys: Sequence[KeyReading]) -> Self:
        """Return the distribution with its parameters as numbers, for one key that is a vector or matrix, or for several
        keys that are numbers."""
        first = keys[0]
        if any(bool(key.place.shape) != (len(keys) == 1) for key in keys):
            allowed = "numbers of several keys, or the vector or matrix of one"
            raise first.place.refuse("distribution", show(self.distribution), allowed)
        mean = tuple(x for key in keys for x in key.centre("mean")) if self.mean is None else self._each(keys, "mean")
        name = "covariance" if self.correlation is None else "correlation"
        reading = self.model_copy(update={"mean": mean})
        reading._factor = np.linalg.cholesky(_positive(first, getattr(self, name), len(mean), name))
        if name == "correlation":
            sigma = self._each(keys, "sigma", checked=False)
            if min(sigma) <= 0.0:
                raise first.place.refuse("sigma", show(self.sigma), "above 0")
            reading._factor = np.array(sigma)[:, None] * reading._factor
        return reading

    def _each(self, keys: Sequence[KeyReading], name: str, checked: bool = True) -> tuple[float, ...]:
        """Return the parameter `name` for each of several keys, or for each component of one."""
        if len(keys) == 1:
            return keys[0].numbers(name, checked)
        given = getattr(self, name)
        if not isinstance(given, list) or len(cast(list[Any], given)) != len(keys):
            raise keys[0].place.refuse(name, show(given), f"{len(keys)} values, one for each key")
        pairs = enumerate(zip(keys, cast(list[Any], given), strict=True), 1)
        return tuple(key.read(item, f"{name}[{number}]", checked)[0] for number, (key, item) in pairs)

    def draw(self, u: Array) -> Array:
        """Return mean + L z, with z the normal quantiles of the uniforms."""
        z, values = ndtri(u), np.empty_like(u)
        # Term by term, because the order of summation of a matrix product depends on its width.
        for place, (mean, row) in enumerate(zip(self.mean, self._factor, strict=True)):
            total = np.full(u.shape[1], mean)
            for other in range(place + 1):
                total += row[other] * z[other]
            values[place] = total
        return values


class Rotations(Distribution):
    """An attitude, uniform on the rotation group: both signs of each quaternion are equally likely, because laws may
    distinguish them.

    Source: K. Shoemake, Uniform random rotations, Graphics Gems III (1992): the subgroup algorithm."""

    BOUNDED, DIMS = True, 3
    distribution: Literal["rotations"]

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        if key.place.shape != (4,):
            allowed = "another, because this is for an attitude as a quaternion"
            raise key.place.refuse("distribution", show(self.distribution), allowed)
        return {}

    def draw(self, u: Array) -> Array:
        """Return quaternions (4, n): a random turn about one axis, followed by a rotation of that axis to a random point of
        the sphere."""
        near, far = np.sqrt(1.0 - u[0]), np.sqrt(u[0])
        first, second = math.tau * u[1], math.tau * u[2]
        return np.stack([far * np.cos(second), near * np.sin(first), near * np.cos(first), far * np.sin(second)])

    def size(self, rows: Sequence[Array]) -> tuple[str, Array]:
        """Return the name and values (n,) of the rotation angle."""
        return "angle", 2.0 * np.arccos(np.minimum(np.abs(rows[0]), 1.0))


class Shell(Relative):
    """A vector in any direction, uniform in the volume between two norms."""

    BOUNDED, DIMS = True, 3
    distribution: Literal["shell"]
    low: Annotated[Any, *raw("the least norm")] = 0.0
    high: Annotated[Any, *raw("the greatest norm")]

    @property
    def shares(self) -> bool:
        """False, because `read` has converted shares to norms."""
        return False

    def _numbers(self, key: KeyReading) -> dict[str, Any]:
        if key.place.shape != (3,) or key.place.gain is None or key.place.gain.shape != (3,):
            raise key.place.refuse("distribution", '"shell"', "another, because this one is for a vector of three numbers")
        low, high = key.norm("low"), key.norm("high")
        if not 0.0 <= low < high:
            raise key.place.refuse("low", show(self.low), f"from 0 to below high, which is {show(self.high)}")
        size = math.hypot(*key.nominal) if self.relative else 1.0
        # The key is tested with vectors in one direction only.
        key.accept([high * size, 0.0, 0.0], "high")
        return {"low": low * size, "high": high * size}

    def draw(self, u: Array) -> Array:
        """Return vectors (3, n) from uniforms for the cube of the radius, the height on the unit sphere (Archimedes) and the
        longitude."""
        hollow = (self.low / self.high) ** 3
        radius = np.clip(self.high * np.cbrt(hollow + u[0] * (1.0 - hollow)), self.low, self.high)
        height, longitude = 2.0 * u[1] - 1.0, math.tau * u[2]
        level = np.sqrt(4.0 * u[1] * (1.0 - u[1]))
        return radius * np.stack([level * np.cos(longitude), level * np.sin(longitude), height])

    def size(self, rows: Sequence[Array]) -> tuple[str, Array]:
        """Return the name and values (n,) of the vector's norm."""
        return "norm", np.sqrt(sum(np.square(row) for row in rows))


def _ordered(key: KeyReading, low: Sequence[float], high: Sequence[float]) -> dict[str, Any]:
    """Return the bounds by name. InputError where low is not below high."""
    if not all(a < b for a, b in zip(low, high, strict=True)):
        raise key.place.refuse("low", show(key.table.low), f"below high, which is {show(key.table.high)}")
    return {"low": low, "high": high}


def _positive(key: KeyReading, given: Any, size: int, name: str) -> Array:
    """Return a correlation or covariance matrix (size, size). InputError where it is not symmetric positive definite."""
    allowed = f"{size} rows of {size} plain numbers"
    try:
        matrix = np.array(given, dtype=float)
    except ValueError:
        raise key.place.refuse(name, show(given), allowed) from None
    if matrix.shape != (size, size) or any(isinstance(item, str) for row in given for item in row):
        raise key.place.refuse(name, show(given), allowed)
    if np.abs(matrix - matrix.T).max() > SYMMETRIC * np.abs(matrix).max():
        raise key.place.refuse(name, show(given), "a symmetric matrix")
    if name == "correlation" and np.abs(np.diagonal(matrix) - 1.0).max() > SYMMETRIC:
        raise key.place.refuse(name, show(given), "ones on the diagonal")
    # Scaled to correlations, because covariances may have various units.
    size_of = np.sqrt(np.abs(np.diagonal(matrix)))
    with np.errstate(all="ignore"):
        scaled = matrix / np.outer(size_of, size_of)
    if not np.isfinite(scaled).all() or np.linalg.eigvalsh(scaled)[0] <= size * np.finfo(float).eps:
        raise key.place.refuse(name, show(given), "a positive definite matrix")
    return matrix


def _read(given: Any) -> Distribution:
    if isinstance(given, Distribution):
        return given
    if not isinstance(given, Mapping):
        raise told_at("", show(given), 'a table such as { distribution = "normal", sigma = 0.1 }')
    table = cast(Mapping[str, Any], given)
    name = table.get("distribution")
    if not isinstance(name, str) or name not in DISTRIBUTIONS:
        given = "nothing" if name is None else show(name)
        raise told_at("distribution", given, nearest(str(name), list(DISTRIBUTIONS)))
    try:
        return validate(DISTRIBUTIONS[name], dict(table), "", "")
    except InputError as error:
        # The enclosing table raises it again with the full key.
        raise told_at(error.key, error.given, error.allowed) from None


class _AnyDistribution:
    """The JSON Schema of a dispersion, made only when it is asked for."""

    @staticmethod
    def __get_pydantic_json_schema__(schema: object, handler: object) -> dict[str, Any]:
        return {"anyOf": [table.model_json_schema() for table in DISTRIBUTIONS.values()]}


Dispersed: TypeAlias = Annotated[Any, BeforeValidator(_read), _AnyDistribution]
"""The table of one dispersion, validated by the class that its `distribution` names."""
