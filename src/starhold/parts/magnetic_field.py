"""The Earth's magnetic field: the International Geomagnetic Reference Field, turning with the Earth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, reduce
from itertools import product
from math import ceil, cos, factorial, inf, pi, radians, sqrt
from typing import Any, NamedTuple, TypeAlias

from starhold.algebra.circular import cosine_sine
from starhold.algebra.scalar import Scalar, plus
from starhold.algebra.scalar import sqrt as root
from starhold.algebra.several import each, folded
from starhold.algebra.vector import Vector, dot, scale
from starhold.algebra.words import number_of
from starhold.parts.epoch import Date, date_text, days_of, sidereal, spun, turned

SOURCE = "International Geomagnetic Reference Field, 14th generation (2024)"
"""Source on the cards of parts that use the field."""
ASSUMPTIONS = (
    "internal field up to degree and order 8: with storms and currents outside the Earth left out",
    "inertial axes of the equator and equinox of date",
)
RADIUS = 6.3712e6
"""The reference radius of the coefficients, m."""
GROUND = 6.35e6
"""A distance (m) from the Earth's centre that is below ground everywhere."""
FIRST, LAST = (days_of((year, 1.0, 1.0, 0.0, 0.0, 0.0)) for year in (2025.0, 2030.0))
"""Range of validity of the coefficients, in days since J2000."""
GRID = radians(2.0)
"""The angle between points at which the field is computed for a bound on its strength."""
PARALLELS = 12
"""On so many parallels it is computed at once, which takes a few tens of MB."""
COARSE, DIVISIONS, CELLS, STEP, CLOSE = radians(5.0), 16, 20_000, 10.0, 0.98
"""The search for the least strength begins with cells of twice this angle, divides them so often, and ends where there are
more than so many; points at this distance (m) give a derivative; and it shows this share of the least strength."""
PLACES = 5_000
"""The most places at which the field is computed at once there, which takes megabytes for each hundred."""
MORE = 1.0 + 1e-9
Row: TypeAlias = tuple[int, int, float, float, float, float]
ROWS: tuple[Row, ...] = (
    (1, 0, -29350.0, 0.0, 12.6, 0.0),
    (1, 1, -1410.3, 4545.5, 10.0, -21.5),
    (2, 0, -2556.2, 0.0, -11.2, 0.0),
    (2, 1, 2950.9, -3133.6, -5.3, -27.3),
    (2, 2, 1648.7, -814.2, -8.3, -11.1),
    (3, 0, 1360.9, 0.0, -1.5, 0.0),
    (3, 1, -2404.2, -56.9, -4.4, 3.8),
    (3, 2, 1243.8, 237.6, 0.4, -0.2),
    (3, 3, 453.4, -549.6, -15.6, -3.9),
    (4, 0, 894.7, 0.0, -1.7, 0.0),
    (4, 1, 799.6, 278.6, -2.3, -1.3),
    (4, 2, 55.8, -134.0, -5.8, 4.1),
    (4, 3, -281.1, 212.0, 5.4, 1.6),
    (4, 4, 12.0, -375.4, -6.8, -4.1),
    (5, 0, -232.9, 0.0, 0.6, 0.0),
    (5, 1, 369.0, 45.3, 1.3, -0.5),
    (5, 2, 187.2, 220.0, 0.0, 2.1),
    (5, 3, -138.7, -122.9, 0.7, 0.5),
    (5, 4, -141.9, 42.9, 2.3, 1.7),
    (5, 5, 20.9, 106.2, 1.0, 1.9),
    (6, 0, 64.3, 0.0, -0.2, 0.0),
    (6, 1, 63.8, -18.4, -0.3, 0.3),
    (6, 2, 76.7, 16.8, 0.8, -1.6),
    (6, 3, -115.7, 48.9, 1.2, -0.4),
    (6, 4, -40.9, -59.8, -0.8, 0.8),
    (6, 5, 14.9, 10.9, 0.4, 0.7),
    (6, 6, -60.8, 72.8, 0.9, 0.9),
    (7, 0, 79.6, 0.0, -0.1, 0.0),
    (7, 1, -76.9, -48.9, -0.1, 0.6),
    (7, 2, -8.8, -14.4, -0.1, 0.5),
    (7, 3, 59.3, -1.0, 0.5, -0.7),
    (7, 4, 15.8, 23.5, -0.1, 0.0),
    (7, 5, 2.5, -7.4, -0.8, -0.9),
    (7, 6, -11.2, -25.1, -0.8, 0.5),
    (7, 7, 14.3, -2.2, 0.9, -0.3),
    (8, 0, 23.1, 0.0, -0.1, 0.0),
    (8, 1, 10.9, 7.2, 0.2, -0.3),
    (8, 2, -17.5, -12.6, 0.0, 0.4),
    (8, 3, 2.0, 11.5, 0.4, -0.3),
    (8, 4, -21.8, -9.7, -0.1, 0.4),
    (8, 5, 16.9, 12.7, 0.3, -0.5),
    (8, 6, 14.9, 0.7, 0.1, -0.6),
    (8, 7, -16.8, -5.2, 0.0, 0.3),
    (8, 8, 1.0, 3.9, 0.3, 0.2),
)
"""Degree, order, Gauss coefficients g and h at 2025.0 (nT), and their changes per year (nT), of IGRF-14."""


class Numbers(NamedTuple):
    """For each order, the coefficients of cosine and sine (T) by degree, scaled for the recursion; the Earth's rotation
    angle at the start (turns), and the control period (s)."""

    cosines: tuple[tuple[Scalar, ...], ...]
    sines: tuple[tuple[Scalar, ...], ...]
    turn: Scalar
    period: Scalar

    IN_COMMON = True  # pyright: ignore
    """Kernels merge equal numbers of this kind into one argument."""


def prepared(epoch: Date, period: float = 1.0, rows: tuple[Row, ...] = ROWS) -> Numbers:
    """Return the numbers of the field for a flight that begins at an epoch (UTC), during which the coefficients are
    constant. period: the control period (s), for `field_at`.

    Raise ValueError for an epoch that is no date, or not from 2025 to 2030."""
    days = _known(epoch)
    highest = max(row[0] for row in rows)
    pairs = [[(0.0, 0.0) for _ in range(max(m, 1), highest + 1)] for m in range(highest + 1)]
    for n, m, g, h in _at(days, rows):
        # From Schmidt normalisation to none, in T; (n - m)! collects the factors that the gradient needs.
        size = 1e-9 * sqrt((2.0 if m else 1.0) * factorial(n - m) / factorial(n + m)) / factorial(n - m)
        pairs[m][n - max(m, 1)] = (size * g, size * h)
    cosines, sines = (tuple(tuple(pair[k] for pair in order) for order in pairs) for k in (0, 1))
    return Numbers(cosines, sines, sidereal(days), period)


@cache
def strongest(epoch: Date, distance: float) -> float:
    """Return a bound on the field's strength (T) from a distance (m) from the Earth's centre on, at an epoch (UTC).

    Farther away the strength is nowhere more than the largest on this sphere, because it is subharmonic. On a great circle
    through the point of the maximum, the field's component along it is a trigonometric polynomial, of one degree more than
    the harmonics, and within an angle a of its maximum at least cos(degree a) of that (Riesz), so a grid suffices. Errors
    as in `prepared`.
    """
    import numpy as np

    most, field_of = 0.0, _columns(epoch)
    rows = list[Any]()
    for latitude in np.linspace(-pi / 2.0, pi / 2.0, round(pi / GRID) + 1):
        across = distance * np.cos(latitude)
        longitude = np.linspace(0.0, 2.0 * pi, 1 + ceil(2.0 * pi * across / distance / GRID))
        height = np.full_like(longitude, distance * np.sin(latitude))
        rows.append((across * np.cos(longitude), across * np.sin(longitude), height))
    # Many places at once, as far as what is computed at them stays small.
    for k in range(0, len(rows), PARALLELS):
        places = np.concatenate(rows[k : k + PARALLELS], axis=1)
        most = max(most, float(np.linalg.norm(field_of(places), axis=0).max()))
    # No place is as far from its nearest on the grid as three quarters of the grid's step.
    return most / cos((ROWS[-1][0] + 1) * 0.75 * GRID)


@cache
def steepest(epoch: Date, distance: float, order: int = 1) -> float:
    """Return a bound on the norm of the field's derivatives of an order, 1 or 2, with respect to the place (T/m, T/m2), from
    a distance (m) from the Earth's centre on.

    Of a degree n the squares of all derivatives of the potential of the order k, summed over the harmonics of a unit
    coefficient, are c_k (RADIUS/r)^(2n + 2k + 2)/RADIUS^(2k - 2): c_0 = 1, because the squares of such harmonics add up to
    that, and c_k = (n + k)(2n + 2k - 1) c_(k-1), half the Laplacian of the last. The rest is Cauchy-Schwarz."""
    squares: dict[int, float] = {}
    for n, _, g, h in _at(_known(epoch), ROWS):
        squares[n] = squares.get(n, 0.0) + g * g + h * h
    total = 0.0
    for n, square in squares.items():
        for k in range(1, order + 2):
            square *= (n + k) * (2 * n + 2 * k - 1)
        total += sqrt(square) * (RADIUS / distance) ** (n + 2 + order)
    return 1e-9 * total / RADIUS**order * MORE


@cache
def weakest(epoch: Date, nearest: float, farthest: float) -> float:
    """Return a strength (T) that the field nowhere falls below between two distances (m) from the centre of the Earth;
    within 2 % of the least, or 0 where none is found.

    In a cell of distance, latitude and longitude about a point p the strength is no less than the component along the field
    at p, of which the first derivatives there are computed, and `steepest` bounds the second. Cells in which that is less
    are divided."""
    import numpy as np

    columns = _columns(epoch)

    def at(places: Any) -> Any:
        # All steps of a program keep their values.
        return np.hstack([columns(part) for part in np.array_split(places, 1 + places.shape[1] // PLACES, axis=1)])

    half = np.array([(farthest - nearest) / 2.0, COARSE, COARSE])
    axes = [np.arange(-limit + COARSE, limit, 2.0 * COARSE) for limit in (pi / 2.0, pi)]
    cells = np.array([x.ravel() for x in np.meshgrid((nearest + farthest) / 2.0, *axes)])
    curved, least = steepest(epoch, nearest, 2), inf
    for _ in range(DIVISIONS):
        r, latitude, longitude = cells
        across, height = np.cos(latitude), np.sin(latitude)
        places = r * np.array([across * np.cos(longitude), across * np.sin(longitude), height])
        steps = STEP * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)])
        fields = at((places[:, None] + steps.T[:, :, None]).reshape(3, -1)).reshape(3, len(steps), -1)
        strength = np.linalg.norm(fields[:, 0], axis=0)
        slopes = np.einsum("ik,ijk->jk", fields[:, 0] / strength, fields[:, 1:4] - fields[:, 4:]) / (2.0 * STEP)
        # From the middle of a cell along the radius, the meridian and a parallel to any of its points.
        parallel = np.minimum(np.cos(np.maximum(np.abs(latitude) - half[1], 0.0)), 1.0)
        away = np.sqrt(half[0] ** 2 + (r + half[0]) ** 2 * (half[1] + parallel * half[2]) ** 2) * MORE
        least = min(least, float(strength.min()))
        first = np.linalg.norm(slopes, axis=0) + curved * STEP
        cells = cells[:, strength - first * away - curved * away**2 / 2.0 < CLOSE * least]
        if not cells.size:
            return float(f"{CLOSE * least:.6g}") * (1.0 - 1e-5)
        if cells.shape[1] > CELLS:
            return 0.0
        # In two across their longest sides.
        lengths = half * (1.0, farthest, farthest)
        parted = lengths > lengths.max() / 2.0
        half = np.where(parted, half / 2.0, half)
        corners = np.array([x for x in product((-1, 0, 1), repeat=3) if np.all((np.array(x) != 0) == parted)]).T
        cells = (cells[:, :, None] + (half[:, None] * corners)[:, None, :]).reshape(3, -1)
    return 0.0


def _columns(epoch: Date) -> Callable[[Any], Any]:
    """Return the field (T) as a function of many places (m), both in Earth-fixed axes, (3, n)."""
    import numpy as np

    from starhold.trace.straight_line import evaluated

    numbers = prepared(epoch)
    given: dict[str, Any] = {"cosines": numbers.cosines, "sines": numbers.sines}
    return lambda places: np.array(evaluated(_recorded(), position=tuple(places), **given))


@cache
def _recorded() -> dict[str, Any]:
    """Return the program of the field, which is the same at all epochs."""
    from starhold.trace.straight_line import straight_line

    numbers = prepared((2025.0, 1.0, 1.0, 0.0, 0.0, 0.0))

    def equation(position: Vector, cosines: Any, sines: Any) -> Vector:
        return earth_fixed(position, numbers._replace(cosines=cosines, sines=sines))

    return straight_line(equation, position=(0.0, 0.0, 0.0), cosines=numbers.cosines, sines=numbers.sines)


def _known(epoch: Date) -> float:
    """Return the days since J2000. Raise ValueError for an epoch that is no date, or beyond the coefficients."""
    days = days_of(epoch)
    if not FIRST <= days <= LAST:
        raise ValueError(f"the magnetic field is known from 2025 to 2030, not at the epoch {date_text(epoch)}")
    return days


def _at(days: float, rows: tuple[Row, ...]) -> Iterator[tuple[int, int, float, float]]:
    """Return degree, order and coefficients (nT) at this many days after J2000."""
    years = 5.0 * (days - FIRST) / (LAST - FIRST)
    for n, m, g, h, g_change, h_change in rows:
        yield n, m, g + years * g_change, h + years * h_change


def field(position: Vector, time: Scalar, params: Numbers) -> Vector:
    """Return the magnetic field (T) at a position (m) and a time (s) after the start, both in inertial axes; not defined at
    the centre."""
    cosine, sine = cosine_sine(turned(params.turn, time))
    return spun(earth_fixed(spun(position, cosine, -sine), params), cosine, sine)


def field_at(position: Vector, step: Any, params: Numbers) -> Vector:
    """Return the magnetic field (T) at a position (m) at the start of a control step, both in inertial axes. A kernel
    computes it once for all parts that need it at the same position."""
    return field(position, number_of(step) * params.period, params)


def earth_fixed(position: Vector, params: Numbers) -> Vector:
    """Return the magnetic field (T) at a position (m), both in Earth-fixed axes: minus the gradient of the potential.

    The harmonics are Cunningham's, functions of x, y, z alone, so no angles are needed and the poles are regular
    (Montenbruck and Gill, Satellite Orbits, 3.2.4)."""
    highest = len(params.cosines) - 1
    inverse_square = 1.0 / dot(position, position)
    x, y, z = scale(RADIUS * inverse_square, position)
    square = RADIUS * RADIUS * inverse_square
    # Powers of x + i y, and their factors.
    powers: list[tuple[Scalar, Scalar]] = [(1.0, 0.0)]
    begins: list[Scalar] = [root(square)]
    for m in range(highest + 1):
        c, s = powers[-1]
        powers.append((x * c - y * s, x * s + y * c))
        begins.append((2.0 * m + 1.0) * begins[-1])
    # The harmonics of degree m + k and order m are the m-th of the k-th list.
    harmonics: list[tuple[Scalar, ...]] = [tuple(begins)]
    for k in range(1, highest + 2):
        rising = tuple(2.0 * (m + k) - 1.0 for m in range(highest + 2 - k))
        last = harmonics[-1][: len(rising)]
        if k == 1:
            harmonics.append(each(_first, (rising, last), z))
            continue
        falling = tuple(float((2 * m + k - 1) * (k - 1)) for m in range(len(rising)))
        harmonics.append(each(_higher, (rising, falling, last, harmonics[-2][: len(rising)]), z, square))

    def along(order: int) -> Scalar:
        """Return the sum over degrees of the weights of order 0 times the harmonics of `order` and the next degree."""
        weights = params.cosines[0]
        return reduce(plus, (weights[j] * harmonics[j + 2 - order][order] for j in range(highest)))

    first, (c, s) = along(1), powers[1]
    east, north, up = first * c, first * s, along(0)
    orders = range(1, highest + 1)
    weights = [[*zip(params.cosines[m], params.sines[m], strict=True)] for m in orders]
    rows = [
        [(g, h, harmonics[j][m + 1], harmonics[j + 2][m - 1], harmonics[j + 1][m]) for j, (g, h) in enumerate(pairs)]
        for m, pairs in zip(orders, weights, strict=True)
    ]
    # Sums over degrees of an order's weights times the harmonics of the next degree, of the next, the previous and this
    # order.
    for m, sums in zip(orders, folded(_begun, _further, rows), strict=True):
        terms = _gradient(sums, powers[m + 1], powers[m - 1], powers[m])
        east, north, up = east + terms[0], north + terms[1], up + terms[2]
    return (east, north, up)


def _first(rising: Scalar, last: Scalar, z: Scalar) -> Scalar:
    return rising * z * last


def _higher(rising: Scalar, falling: Scalar, last: Scalar, before: Scalar, z: Scalar, square: Scalar) -> Scalar:
    return rising * z * last - falling * square * before


def _begun(g: Scalar, h: Scalar, *harmonics: Scalar) -> tuple[Scalar, ...]:
    return tuple(weight * harmonic for harmonic in harmonics for weight in (g, h))


def _further(sums: tuple[Scalar, ...], *columns: Scalar) -> tuple[Scalar, ...]:
    return tuple(map(plus, sums, _begun(*columns)))


def _gradient(sums: tuple[Scalar, ...], *circles: tuple[Scalar, Scalar]) -> Vector:
    """Return the contribution of an order to the field."""
    outer_g, outer_h, inner_g, inner_h, here_g, here_h = sums
    (c, s), (below_c, below_s), (here_c, here_s) = circles
    return (
        0.5 * ((outer_g * c + outer_h * s) - (inner_g * below_c + inner_h * below_s)),
        0.5 * ((outer_g * s - outer_h * c) + (inner_g * below_s - inner_h * below_c)),
        here_g * here_c + here_h * here_s,
    )
