"""Measures of section 2: the example (2.2), and an example of each theorem."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from starhold.algebra.polynomial import Polynomial
from starhold.algebra.scalar import less, maximum, where
from starhold.certification.certificate import Certificate
from starhold.certification.invariant import InvariantProblem, certify, load
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding
from starhold.studies.phase_portraits import paths, portraits

WINDOW = ((-1.5, 3.5), (-2.0, 2.5))
"""The ranges of x and y in figure 1, from the numbers on its axes."""
TIGHT: dict[str, Any] = {"rtol": 1e-9, "atol": 1e-11, "max_step": 0.05}


def rates(x: float, y: float) -> tuple[float, float]:
    """Return the right-hand sides of (2.2) as restored."""
    if y <= 0.0:
        return y, -2.0 * x - 3.0 * y
    if (x - 1.0) ** 2 + y * y > 1.0:
        return y, 1.0 - x
    return y, (y * y - x * x) / (2.0 * x)


def constant(x: Any, y: Any) -> Any:
    """Return c, which is constant on a loop of (2.2)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(y > 0.0, (x * x + y * y) / (2.0 * x), (2.0 * x + y) ** 2 / (8.0 * (x + y)))


def flown(start: Sequence[float], until: float, near: float = 0.0, far: float = 1e9) -> Any:
    """Integrate (2.2) to a time (negative: backwards), or until the distance from the origin is `near` or `far`. Returns
    times (m,) and states (2, m)."""
    from scipy.integrate import solve_ivp

    def ends(_: float, state: Any) -> float:
        away = math.hypot(*state)
        return (away - near) * (away - far)

    setattr(ends, "terminal", True)  # noqa: B010 -- a function has no such attribute
    solution = solve_ivp(lambda _, state: rates(*state), (0.0, until), list(start), events=ends, **TIGHT)
    return solution.t, solution.y


def draws(count: int, seed: int = 1) -> Any:
    """Return random states (count, 2) in the window of figure 1."""
    low, high = np.array(WINDOW).T
    return np.random.default_rng(seed).uniform(low, high, (count, 2))


def phi(x: Any, y: Any) -> Any:
    """Return the printed function whose zero line is the boundary of the loops."""
    return np.where(y > 0.0, (x - 1.0) ** 2 + y * y - 1.0, (2.0 * x + y) ** 2 - 8.0 * (x + y))


def certificate(desk: Desk, problem: str) -> tuple[InvariantProblem, Certificate]:
    """Prove the claims of a built-in problem."""

    def make() -> tuple[InvariantProblem, Certificate]:
        read = load(problem)
        return read, certify(read)

    return desk.once(("invariant", problem), make)


def theorem(desk: Desk, problem: str, claim: int = 0) -> Finding:
    """Return whether a claim of a built-in problem is proved."""
    read, made = certificate(desk, problem)
    proved = made.claims[claim]
    level = proved.numbers.get("level")
    note = f"{read.description}: {proved.witness['name'] or proved.numbers['theorem']}, {proved.outcome}"
    return Finding(proved.outcome == "proved", note + ("" if level is None else f", V up to {level:.5g}"))


def largest_level(desk: Desk, problem: str) -> Finding:
    """Return whether a level of V is certified, and one at most 1 % above it refuted."""
    _, made = certificate(desk, problem)
    proved = made.claims[0]
    level, beyond = proved.numbers["level"], proved.numbers["refuted_level"]
    note = f"V up to {level:.5g} is certified, up to {beyond:.5g} refuted: {proved.numbers['limited_by']}"
    return Finding(proved.outcome == "proved" and beyond < 1.01 * level, note)


def only_equilibrium(desk: Desk) -> Finding:
    """Return whether rates vanish only at the origin: x' = y vanishes only on the line y = 0."""
    places = np.concatenate([-np.geomspace(1e-6, 1e3, 200), np.geomspace(1e-6, 1e3, 200)])
    others = all(rates(float(x), 0.0)[1] != 0.0 for x in places)
    return Finding(others and rates(0.0, 0.0) == (0.0, 0.0), "x' = y vanishes on y = 0 only, where y' = -2x")


def all_come(desk: Desk, count: int) -> Finding:
    """Return whether motions from all over the window of figure 1 end at the origin."""
    ends = [float(np.linalg.norm(flown(start, 25.0)[1][:, -1])) for start in draws(count)]
    return Finding(max(ends) < 1e-6, f"{count} motions are within {max(ends):.0e} after 25 units of time")


def where_from(desk: Desk, count: int) -> Finding:
    """Return whether motions come from the origin where they are bounded, and from far away elsewhere."""
    bounded, others = [], []
    for start in draws(count, 2):
        _, states = flown(start, -30.0, 1e-5, 1e3)
        (bounded if phi(*start) < 0.0 else others).append(float(np.linalg.norm(states[:, -1])))
    note = f"backwards, {len(bounded)} within G come to the origin, {len(others)} others go beyond 1000"
    return Finding(max(bounded) < 2e-5 and min(others) > 999.0, note)


def loops_kept(desk: Desk, count: int) -> Finding:
    """Return whether motions of G keep their c, and thus stay in G."""
    drift: list[float] = []
    for start in draws(count, 3):
        if phi(*start) < 0.0:
            _, states = flown(start, 8.0)
            kept = constant(*states[:, np.linalg.norm(states, axis=0) > 1e-2])
            drift.append(float(np.ptp(kept)))
    return Finding(max(drift) < 1e-5, f"c changes by {max(drift):.0e} at most along {len(drift)} motions")


def border(desk: Desk) -> Finding:
    """Return whether the motion through (2, 0) follows the zero line of the printed function, from the origin to the
    origin."""
    ahead = flown((2.0, 0.0), 20.0)[1]
    back = flown((2.0, 0.0), -10.0, 1e-3)[1]
    off = max(float(np.abs(phi(*states)).max()) for states in (ahead, back))
    ends = max(float(np.linalg.norm(states[:, -1])) for states in (ahead, back))
    return Finding(off < 1e-6 and ends < 2e-3, f"the function is within {off:.0e} of zero along it")


def slopes(desk: Desk) -> Finding:
    """Return whether outside G the printed function decreases below the axis and is constant above it, as exact
    identities."""
    x, y = Polynomial.variable("x"), Polynomial.variable("y")
    below, above = (2 * x + y) * (2 * x + y) - 8 * (x + y), (x - 1) * (x - 1) + y * y - 1

    def along(function: Polynomial, slope: Any) -> Polynomial:
        return function.slope("x") * y + function.slope("y") * slope

    falls = (along(below, -2 * x - 3 * y) + 2 * below).value == 0
    return Finding(falls and along(above, 1 - x).value == 0, "V' = -2V for y < 0 and V' = 0 for y > 0, exactly")


def printed_halves(desk: Desk) -> Finding:
    """Return whether the printed function, set to zero in G, is an indicator function, for which it must be continuous."""
    read = load("switching")
    x, y = (cast(Any, Polynomial.variable(name)) for name in read.system.names)
    below, above = (2 * x + y) * (2 * x + y) - 8 * (x + y), x * x + y * y - 2 * x
    V = maximum(where(less(0.0, y), above, below), 0.0)
    made = certify(replace(read, claims=(replace(read.claims[0], V=V),)))
    states = [o.evidence["state"] for o in made.claims[0].obligations if o.outcome == "refuted"]
    note = f"refuted at {tuple(float(states[0][name]) for name in ('x', 'y'))}" if states else made.claims[0].outcome
    return Finding(made.claims[0].outcome == "proved", f"{note}; on y = 0 the halves are 4x(x - 2) and x(x - 2)")


def strict_subsets(desk: Desk, inner: float, wider: float) -> Finding:
    """Return whether {c <= inner} is stable and not attracting, by the motion on a wider loop that starts close to it."""
    angle = 1e-3
    start = (wider * (1.0 - np.cos(angle)), wider * np.sin(angle))
    _, states = flown(start, 25.0)
    turn = np.linspace(0.0, np.pi, 400)
    ring = inner * np.array([1.0 - np.cos(turn), np.sin(turn)])
    # The lower arc of the set lies within 2 inner of the upper one.
    away = np.linalg.norm(states[:, :, None] - ring[:, None, :], axis=0).min(axis=1)
    gone, end = float(away.max() - 2.0 * inner), float(np.linalg.norm(states[:, -1]))
    near = float(np.linalg.norm(start))
    note = f"from within {near:.4f} of c <= {inner:g} a motion goes more than {gone:.1f} away, then comes to it"
    return Finding({"it is stable": gone < 0.1, "it does not attract": end > 1e-6}, note)


def definition(desk: Desk, near: float) -> Finding:
    """Return whether the origin is unstable by two definitions: Lyapunov's, by excursions from ever closer starts, and
    definition 1, by the motion after a time common to all starts."""
    excursion: list[float] = []
    late: list[float] = []
    for size in (0.1, 0.01, 0.001):
        far, last = 0.0, 0.0
        for angle in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
            times, states = flown((size * np.cos(angle), size * np.sin(angle)), 15.0)
            distance = np.linalg.norm(states, axis=0)
            far, last = max(far, float(distance.max())), max(last, float(times[distance > near].max(initial=0.0)))
        excursion.append(far)
        late.append(last)
    note = f"from within 0.001 motions go {excursion[-1]:.2f} away; after {max(late):.1f} all stay within {near:g}"
    cases = {"by Lyapunov's definition": min(excursion) > 1.0, "by definition 1 as printed": max(late) > 14.0}
    return Finding(cases, note)


def figure_1(desk: Desk) -> Figure:
    """Return the phase portrait of (2.2): the loops and their surroundings."""
    starts = [(2.0 * c, 0.0) for c in (0.15, 0.3, 0.45, 0.6, 0.75, 0.9)]
    starts += [(-x, 0.0) for x in (0.25, 0.5, 0.75, 1.0, 1.25, 1.45)] + [(2.3, -2.0), (3.0, -2.0)]

    def both_ways(start: tuple[float, float]) -> Any:
        # Not into the origin itself, where directions have no limit.
        back, ahead = (flown(start, way, 1e-3, 20.0)[1] for way in (-8.0, 20.0))
        return np.concatenate([back[:, ::-1], ahead], axis=1)

    lines, edge = [both_ways(start) for start in starts], both_ways((2.0, 0.0))
    curves = [
        Curve.along(edge, "G, the loops", "area", 0),
        *(Curve.along(line, style="faint") for line in lines),
        Curve.along(edge, "through (2, 0)", hue=1),
        Curve([0.0], [0.0], "equilibrium", "points", 1),
    ]
    return Figure([Panel("x", "y", curves, x_span=WINDOW[0], y_span=WINDOW[1], equal=True)])


def theorems(desk: Desk) -> Figure:
    """Return a figure with an example of each theorem: motions, the set, and its certified part."""
    about = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    spin = load("spin")
    # States of equal energy near the axis of the largest inertia, viewed along it.
    starts = [(size, np.sqrt(1.0 - size**2 / 3.0), 0.0) for size in (0.2, 0.4, 0.6, 0.8)]
    stable = paths(spin.system, [(-2.0, 2.0)] * 3, np.array(starts).T, 8.0)
    middle = [(0.05 * np.cos(a), 0.05 * np.sin(a), 1.0) for a in about]
    leaving = paths(spin.system, [(-2.0, 2.0)] * 3, np.array(middle).T, 2.5)
    panels = [
        _panel("1: spin about the largest inertia is stable", "p", "q", [line[[0, 2]] for line in stable], [(0.0, 0.0)]),
        _certified(
            desk,
            "circle",
            0,
            np.array([[0.1, 0.6, -1.3, 1.4, 0.05], [0.0, 1.35, 1.3, -1.3, -0.2]]),
            "2: the circle attracts",
        ),
        _panel("3: spin about the middle axis is unstable", "p", "r", [line[:2] for line in leaving], [(0.0, 0.0)]),
        _certified(
            desk,
            "dead-zone",
            0,
            np.array([[-3.0, -1.0, 1.0, 3.0, 2.2, -2.2], [5.0, 4.0, -4.0, -5.0, 2.0, -2.0]]),
            "4: the intersection attracts",
        ),
    ]
    return Figure(panels, 2)


def _panel(title: str, x: str, y: str, lines: Sequence[Any], points: Sequence[tuple[float, float]]) -> Panel:
    marks = [Curve.along(np.transpose(points), "", "points", 1)] if points else []
    return Panel(x, y, [*(Curve.along(line, hue=0) for line in lines), *marks], title, equal=True)


def _certified(desk: Desk, problem: str, claim: int, starts: Any, title: str) -> Panel:
    """Return a panel of motions with the boundaries of the certified set and of the set itself."""
    from contourpy import contour_generator

    read, made = certificate(desk, problem)
    drawn = portraits(replace(read, claims=(read.claims[claim],)), replace(made, claims=(made.claims[claim],)))[0]
    lines = paths(read.system, read.claims[claim].box, starts, 9.0)
    contours = contour_generator(drawn.x, drawn.y, drawn.V)
    level = made.claims[claim].numbers["level"]
    curves = [Curve.along(line, hue=0) for line in lines]
    for value, label, hue in ((level, "certified", 2), (2e-3 * level, "the set", 1)):
        border: Any = contours.lines(value)
        curves += [Curve.along(np.transpose(line), label if k == 0 else "", hue=hue) for k, line in enumerate(border)]
    x_span, y_span = ((float(side[0]), float(side[-1])) for side in (drawn.x, drawn.y))
    across, up = drawn.names[:2]
    return Panel(across, up, curves, title, x_span, y_span)
