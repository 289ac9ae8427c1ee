"""The epoch at which a flight begins, for parts that need the Earth's rotation or the Sun's direction.

Inertial axes are those of the mean equator and equinox of date: the third along the Earth's axis, the first to the equinox.
They are kept fixed during a flight.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, date, datetime, timedelta
from math import cos, radians, sin
from typing import TypeAlias

from starhold.algebra.quaternion import Quaternion, multiply
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector
from starhold.parts.contract import Parameter

Date: TypeAlias = tuple[float, float, float, float, float, float]
"""Year, month, day, hour, minute and second of Universal Time."""
EPOCH = Parameter(
    shape=(6,),
    spread=False,
    text="when the flight begins, UTC: year, month, day, hour, minute, second; scenarios give it by epoch in [orbit]",
    shared="orbit.epoch",
)
"""The declaration of the epoch, common to all parts; a scenario gives it to all of them."""
START: Date = (2026.0, 1.0, 1.0, 0.0, 0.0, 0.0)
"""The default epoch of a flight."""
WRITTEN = 'a date as "2026-03-20T12:00:00Z", or as whole year, month, day, hour, minute and a second below 60, UTC'
"""The accepted forms of an epoch."""
OF_DATE, OF_J2000 = "MOD_EARTH", "EME2000"
"""The CCSDS names of the Earth's mean equator and equinox of date, and of J2000."""
DAY = 86400.0
SIDEREAL = 360.98564736629 / 360.0
"""Rotation of the Earth in a day of Universal Time, in turns."""
_J2000 = datetime(2000, 1, 1, 12)


def date_of(given: str | date | Sequence[float]) -> Date:
    """Return the epoch given in ISO 8601, as the standard library reads it (UTC unless it has another offset), or as six
    numbers. Raise ValueError for anything else."""
    try:
        parsed = datetime.fromisoformat(given.strip()) if isinstance(given, str) else given
        if not isinstance(parsed, date):
            epoch: Date = EPOCH.check(parsed)
            days_of(epoch)
            return epoch
        begun = parsed if isinstance(parsed, datetime) else datetime(parsed.year, parsed.month, parsed.day)
        begun = begun.astimezone(UTC) if begun.tzinfo else begun
    except (ValueError, OverflowError):
        raise ValueError(WRITTEN) from None
    *whole, second = begun.year, begun.month, begun.day, begun.hour, begun.minute, begun.second + 1e-6 * begun.microsecond
    year, month, day, hour, minute = map(float, whole)
    return year, month, day, hour, minute, second


def days_of(epoch: Date) -> float:
    """Return the days since J2000, 2000 January 1 at noon. Raise ValueError if the epoch is no date."""
    return (_instant(epoch) - _J2000) / timedelta(days=1)


def iso_text(epoch: Date) -> str:
    """Return the date in ISO 8601, UTC, to the microsecond, such as "2026-03-20T12:00:00". Raise ValueError if the epoch is
    no date."""
    return _instant(epoch).isoformat()


def date_after(epoch: Date, time: float) -> str:
    """Return the date in ISO 8601, UTC, at a time (s) after an epoch, to the millisecond."""
    return (_instant(epoch) + timedelta(seconds=time)).isoformat(timespec="milliseconds")


def precession(days: float) -> Quaternion:
    """Return the rotation from the mean equator and equinox of J2000 to those `days` later (IAU 2006; Capitaine, Wallace
    and Chapront, Expressions for IAU 2000 precession quantities, 2003)."""
    t = days / 36525.0
    zeta = 2.650545 + t * (2306.083227 + t * (0.2988499 + t * (0.01801828 + t * (-5.971e-6 - 3.173e-7 * t))))
    z = -2.650545 + t * (2306.077181 + t * (1.0927348 + t * (0.01826837 + t * (-2.8596e-5 - 2.904e-7 * t))))
    theta = t * (2004.191903 + t * (-0.4294934 + t * (-0.04182264 + t * (-7.089e-6 - 1.274e-7 * t))))
    # Half of each angle, from arcseconds.
    a, b, c = (radians(angle / 7200.0) for angle in (zeta, theta, z))
    about_y: Quaternion = (cos(b), 0.0, sin(b), 0.0)
    return multiply(multiply((cos(a), 0.0, 0.0, -sin(a)), about_y), (cos(c), 0.0, 0.0, -sin(c)))


def true_to_mean(days: float) -> Quaternion:
    """Return the rotation from the true equator and mean equinox (TEME) `days` after J2000 to the mean equator and equinox
    of that date, to 0.2": the four largest terms of the nutation (Meeus, Astronomical Algorithms, chapter 22)."""
    t = days / 36525.0
    node, sun, moon = (
        radians(at + rate * t) for at, rate in ((125.04452, -1934.136261), (280.4665, 36000.7698), (218.3165, 481267.8813))
    )
    along = -17.20 * sin(node) - 1.32 * sin(2.0 * sun) - 0.23 * sin(2.0 * moon) + 0.21 * sin(2.0 * node)
    slope = 9.20 * cos(node) + 0.57 * cos(2.0 * sun) + 0.10 * cos(2.0 * moon) - 0.09 * cos(2.0 * node)
    mean = radians((84381.448 - 46.8150 * t) / 3600.0)
    # Half of each angle, in rad. The equinoxes differ by the nutation along the equator.
    psi, epsilon = (radians(angle / 7200.0) for angle in (along, slope))
    half, equinox = 0.5 * mean + epsilon, psi * cos(mean)
    turns = ((cos(equinox), 0.0, 0.0, -sin(equinox)), (cos(half), sin(half), 0.0, 0.0), (cos(psi), 0.0, 0.0, sin(psi)))
    first: Quaternion = turns[0]
    return multiply(multiply(multiply(first, turns[1]), turns[2]), (cos(0.5 * mean), -sin(0.5 * mean), 0.0, 0.0))


def _instant(epoch: Date) -> datetime:
    *whole, second = epoch
    if any(number != int(number) for number in whole) or not 0.0 <= second < 60.0:
        raise ValueError(
            f"the epoch is a whole year, month, day, hour and minute, and a second below 60, not {date_text(epoch)}"
        )
    try:
        year, month, day, hour, minute = (int(number) for number in whole)
        return datetime(year, month, day, hour, minute) + timedelta(seconds=second)
    except (ValueError, OverflowError) as error:
        raise ValueError(f"the epoch {date_text(epoch)} is no date: {error}") from None


def date_text(epoch: Date) -> str:
    """Return the epoch as written in error messages."""
    return f"[{', '.join(f'{number:g}' for number in epoch)}]"


def sidereal(days: float) -> float:
    """Return Greenwich mean sidereal time in turns, from 0 to 1, at `days` after J2000 (Meeus, Astronomical Algorithms,
    12.4). UTC is used as UT1, from which it differs by less than 0.9 s."""
    centuries = days / 36525.0
    more = (280.46061837 + 0.000387933 * centuries**2) / 360.0 + (SIDEREAL - 1.0) * days
    return (days % 1.0 + more) % 1.0


def turned(start: float, time: Scalar) -> Scalar:
    """Return the Earth's rotation angle (turns) at a time (s) after the start, where it was `start`."""
    return start + (SIDEREAL / DAY) * time


def spun(vector: Vector, cosine: Scalar, sine: Scalar) -> Vector:
    """Return a vector turned about the third axis by an angle of this cosine and sine; the Earth's rotation angle takes
    Earth-fixed to inertial components."""
    return (cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1], vector[2])
