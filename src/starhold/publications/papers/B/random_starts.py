"""Counts control steps from random starts: until the error stays below a bound, as in the campaign, and until it first
passes the bound."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.rigid_body import DECADES
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding
from starhold.simulation.batched import Flying, fly_batched
from starhold.simulation.lane import Recording, label

Array = NDArray[np.float64]
FILE = "random-starts"
LAWS = ("lyapunov", "sliding", "mpc")
PREFIXES = {"attitude": "", "rate": "rate_"}
PASSAGES = 16
"""The number of starts for which first passages are counted."""


def counts(desk: Desk, kind: str) -> dict[str, Array]:
    """Return the steps after which the error stays within 10^-1 to 10^-6, (starts, 6) by law; inf where it never does."""

    def make() -> dict[str, Array]:
        frame: Any = desk.campaign(FILE).frame()
        names = [f"{PREFIXES[kind]}iterations_1e-{k}" for k in DECADES]
        return {law: frame[frame["law"] == law][names].fillna(np.inf).to_numpy(dtype=float) for law in LAWS}

    return desk.once(("counts", kind), make)


def first_passages(desk: Desk, kind: str) -> dict[str, Array]:
    """Return, in the same form for the first starts, the steps after which the error is first within 10^-1 to 10^-6."""

    def make() -> dict[str, dict[str, Array]]:
        steps, frame = desk.scenario(FILE).table.simulation.steps, desk.campaign(FILE).frame()
        first: dict[str, dict[str, Array]] = {"attitude": {}, "rate": {}}
        for law in LAWS:
            loop = desk.loop(FILE, law)
            rows: Any = frame[frame["law"] == law].head(PASSAGES)
            drawn = [f"flown.state.{name}[{k}]" for name, size in (("attitude", 4), ("rate", 3)) for k in range(1, 1 + size)]
            starts = [
                loop.start._replace(attitude=tuple(row[:4]), rate=tuple(row[4:]))
                for row in rows[drawn].to_numpy(dtype=float).tolist()
            ]
            flights = [Flying(replace(loop, start=start), steps, 1) for start in starts]

            def passages(number: int, samples: Array, carry: Any, flights: Any = flights) -> list[list[float]]:
                return _passages(label(flights[number].loop, samples, carry, 1))

            flown = fly_batched(flights, passages)
            for number, name in enumerate(first):
                first[name][law] = np.array([each[number] for each in flown])
        return first

    return desk.once(("first passages",), make)[kind]


def _passages(run: Recording) -> list[list[float]]:
    """Return the first passages of attitude and of rate in a flight."""
    errors = np.linalg.norm(run["attitude_error"][:, 1:], axis=1), np.linalg.norm(run["rate_error"], axis=1)
    return [[first_within(error, 10.0**-k) for k in DECADES] for error in errors]


def first_within(error: Array, bound: float) -> float:
    """Return the index at which an error is first within a bound; inf where it never is."""
    inside = np.flatnonzero(error <= bound)
    return float(inside[0]) if inside.size else float("inf")


def steps_figure(desk: Desk, kind: str) -> Figure:
    """Return a figure, over the order of the deviation, of the steps (medians, 10 % and 90 % quantiles, first passages) and
    of the share of starts that stay within it."""
    steps, first = counts(desk, kind), first_passages(desk, kind)
    orders = np.array(DECADES, dtype=float)
    curves: list[Curve] = []
    shares: list[Curve] = []
    for hue, law in enumerate(LAWS):
        low, middle, high = (_quantile(steps[law], share) for share in (0.1, 0.5, 0.9))
        there = np.isfinite(high)
        if there.any():
            outline = np.concatenate([orders[there], orders[there][::-1]])
            curves.append(Curve(outline, np.concatenate([low[there], high[there][::-1]]), "", "area", hue))
        curves.append(Curve(orders, _drawn(middle), law, "line", hue))
        curves.append(Curve(orders, _drawn(_quantile(first[law])), "first passage" if hue == 0 else "", "dotted", hue))
        shares.append(Curve(orders, 100.0 * np.isfinite(steps[law]).mean(axis=0), law, "line", hue))
    symbol = "|q|" if kind == "attitude" else "|ω| in rad/s"
    across = f"k of {symbol} ≤ 10^-k"
    return Figure([Panel(across, "control steps", curves), Panel(across, "starts that stay within, %", shares)], columns=2)


def _drawn(steps: Array) -> Array:
    return np.where(np.isfinite(steps), steps, np.nan)


def medians(desk: Desk, kind: str, first: bool = False) -> dict[str, Array]:
    """Return the medians of the counts, (6,) by law."""
    steps = first_passages(desk, kind) if first else counts(desk, kind)
    return {law: _quantile(steps[law]) for law in LAWS}


def _quantile(steps: Array, share: float = 0.5) -> Array:
    return np.quantile(steps, share, axis=0, method="higher")


def fewest(desk: Desk, kind: str, law: str, against: Sequence[str], orders: Sequence[int], first: bool = False) -> Finding:
    """Return for each accuracy whether a law takes fewer steps than others, by the medians over random starts."""
    steps = medians(desk, kind, first)
    cases = {f"to 10^-{k}": all(steps[law][k - 1] < steps[other][k - 1] for other in against) for k in orders}
    note = "; ".join(f"{one}: {', '.join(_count(steps[one][k - 1]) for k in orders)}" for one in (law, *against))
    return Finding(cases, note)


def rises(desk: Desk, law: str, orders: dict[str, int], factor: float) -> Finding:
    """Return whether going from one accuracy to the next takes a law more than `factor` times as many steps as the others;
    orders: the k reached, for attitude and for rate."""
    cases: dict[str, bool] = {}
    notes: list[str] = []
    for kind, k in orders.items():
        steps = medians(desk, kind)
        rise = {one: float(steps[one][k - 1] - steps[one][k - 2]) for one in LAWS}
        cases[f"{kind} from 10^-{k - 1} to 10^-{k}"] = all(rise[law] > factor * rise[one] for one in LAWS if one != law)
        notes.append(f"{kind}: " + ", ".join(f"{one} {_count(rise[one])}" for one in LAWS))
    return Finding(cases, "; ".join(notes))


def _count(steps: float) -> str:
    return f"{steps:.0f}" if np.isfinite(steps) else "never"
