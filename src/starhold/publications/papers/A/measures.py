"""Matrices, conditions and counts of the publication on linear-quadratic stabilisation that are not part of any scenario."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from starhold.algebra.vector import ZERO
from starhold.laws import lqr
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.craft import make_craft
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding
from starhold.synthesis.riccati import closed_form, linear_model, solve_riccati
from starhold.synthesis.weights import balance, kappa

ORBIT = 2.0 * np.pi / 86164.1
"""The rate of a geostationary orbit (rad/s)."""
RNG = 1812
TRIALS = 60


def gravity_torque(desk: Desk) -> Finding:
    """Return the largest gravity torque (1.1), in N m, on bodies with the publication's moments, whose least moment is
    small: the maximum of |e x J e| over all attitudes is half the difference of the largest and the least moment."""
    return Finding([1.5 * ORBIT**2 * moment for moment in (1e2, 1e4)], "for moments of 1e2 and 1e4 kg m²")


def beside_wheels(desk: Desk) -> Finding:
    """Return whether each disturbance is at least a hundred times smaller than the torque of wheels."""
    torques = {
        "gravity gradient, 10⁴ kg m²": 1.5 * ORBIT**2 * 1e4,
        "solar pressure, 10⁻⁴ N m": 1e-4,
        "solar pressure on large panels, 10⁻³ N m": 1e-3,
    }
    note = ", ".join(f"1/{0.1 / torque:.0f}" for torque in torques.values())
    return Finding({name: 0.1 / torque >= 100.0 for name, torque in torques.items()}, f"{note} of 0.1 N m")


def controllable(desk: Desk) -> Finding:
    """Return whether [B, AB] of the linear model has full rank, for random inertias."""
    ranks = set[int]()
    for inertia in _inertias():
        a, b = linear_model(inertia)
        # Scaled, because J^-1 is small.
        ranks.add(int(np.linalg.matrix_rank(np.hstack([b, a @ b]) * np.linalg.norm(inertia))))
    return Finding(ranks == {6}, f"rank {ranks.pop()} for {TRIALS} inertias")


def riccati_solution(desk: Desk, form: str) -> Finding:
    """Return whether a form's P is positive definite and equals the stabilising solution of a numerical solver, for random
    inertias and weights."""
    worst, least = 0.0, np.inf
    for inertia, spec in _specs(form):
        q, r, p = lqr.riccati_problem(make_craft(inertia), spec)
        other = np.asarray(solve_riccati(inertia, q, r).p)
        # Units differ: each entry is compared relative to its row and column.
        scale = np.sqrt(np.outer(np.diag(other), np.diag(other)))
        worst = max(worst, float(np.abs((p - other) / scale).max()))
        least = min(least, float(np.linalg.eigvalsh(p / scale).min()))
    return Finding(bool(worst < 1e-8) and least > 0.0, f"{TRIALS} trials: at most {worst:.0e} apart")


def costs_least(desk: Desk) -> Finding:
    """Return whether the feedback of form II costs less than stable feedback near it, by the functional (2.1)."""
    from scipy.linalg import solve_continuous_lyapunov

    random, fewer, tried = np.random.default_rng(RNG), 0, 0
    for inertia, spec in _specs("II"):
        q, r, p = lqr.riccati_problem(make_craft(inertia), spec)
        a, b = linear_model(inertia)
        best = np.linalg.solve(r, b.T @ p)
        other = best * (1.0 + 0.2 * random.normal(size=best.shape))
        closed = a - b @ other
        if np.linalg.eigvals(closed).real.max() < 0.0:
            tried += 1
            cost = solve_continuous_lyapunov(closed.T, -(q + other.T @ r @ other))
            fewer += bool(np.linalg.eigvalsh((cost - p) / np.linalg.norm(p)).min() < -1e-9)
    return Finding(fewer == 0, f"against {tried} other stable gains, from every start")


def middle_weight(desk: Desk) -> Finding:
    """Return whether (2.24) implies (2.23) and a positive y2, and whether weights changed by `balance` satisfy it."""
    random, worst = np.random.default_rng(RNG), 0.0
    for _ in range(TRIALS):
        moments = np.sort(10.0 ** random.uniform(2.0, 4.0, 3))
        q, r = 10.0 ** random.uniform(-2.0, 2.0, 6), 10.0 ** random.uniform(-1.0, 1.0, 3)
        y = np.sqrt(q[3:] / r)
        j1, j2, j3 = moments
        y2 = (j3 - j1) * y[0] * y[2] / ((j3 - j2) * y[2] + (j2 - j1) * y[0])
        residual = kappa(moments, np.array([y[0], y2, y[2]])) / ((j3 - j1) / y2)
        moved, _ = balance(moments, q, r, "q5")
        worst = max(worst, abs(residual), abs(np.sqrt(moved[4] / r[1]) / y2 - 1.0))
        if y2 <= 0.0:
            return Finding(False, f"y2 = {y2:g}")
    return Finding(bool(worst < 1e-9), f"{TRIALS} trials: off by {worst:.0e} of its terms")


def sign_of_term(desk: Desk) -> Finding:
    """Return whether the gyroscopic term of V' takes both signs wherever (2.23) does not hold: it is kappa w1 w2 w3."""
    random, both = np.random.default_rng(RNG), 0
    for _ in range(TRIALS):
        moments, y = 10.0 ** random.uniform(2.0, 4.0, 3), 10.0 ** random.uniform(-2.0, 0.0, 3)
        rate = random.normal(size=3)
        power = [float((w / y) @ np.cross(w, moments * w)) for w in (rate, rate * (1.0, 1.0, -1.0))]
        both += power[0] * power[1] < 0.0
    return Finding(both == TRIALS, f"{both} of {TRIALS} random weights")


def channels(desk: Desk) -> Finding:
    """Return the numbers of gains that the nine weights of form II change independently: in general, and on the surface
    (2.23)."""
    moments, random = np.array([2500.0, 9000.0, 9800.0]), np.random.default_rng(RNG)
    weights = np.log(balance(moments, 10.0 ** random.uniform(-1.0, 1.0, 6), np.ones(3), "q5")[0])
    start = np.concatenate([weights, np.zeros(3)])

    def gains(logs: Any) -> Any:
        return np.log(
            np.concatenate([np.asarray(part) for part in closed_form(moments, np.exp(logs[:6]), np.exp(logs[6:]))])
        )

    def condition(logs: Any) -> float:
        return kappa(moments, np.exp(0.5 * (logs[3:6] - logs[6:]))) / 1e4

    def slopes(function: Any) -> Any:
        return np.array([(function(start + one) - function(start - one)) / 2e-5 for one in 1e-5 * np.eye(9)]).T

    # Changes of the weights along the surface are orthogonal to its normal.
    every, along = slopes(gains), np.linalg.svd(slopes(condition)[None, :])[2][1:].T
    ranks = [np.linalg.matrix_rank(moved, tol=1e-6) for moved in (every, every @ along)]
    return Finding([float(rank) for rank in ranks], "ranks of the gains' derivative by the weights")


def conditions(desk: Desk, file: str, laws: Sequence[str], claim: str) -> Finding:
    """Return for each law whether a claim is proved."""
    issued = {law: desk.claims(file, law).get(claim) for law in laws}
    proved = {law: one is not None and one.outcome == "proved" for law, one in issued.items()}
    return Finding(proved, f"{claim} proved by certificate")


def falling(desk: Desk, runs: Sequence[tuple[str, str]]) -> Finding:
    """Return for each flight whether V is non-increasing along it, up to rounding."""
    verdicts: dict[str, bool] = {}
    for file, law in runs:
        values = _lyapunov(desk, file, law)
        verdicts[law] = bool((np.diff(values) <= 1e-12 * values[0]).all())
    return Finding(verdicts, "sample by sample, over the whole flights")


def gyroscopic_beyond(desk: Desk, rates: Sequence[Sequence[str]]) -> Finding:
    """Return for each initial rate whether form I fails to settle in 12 h; at none of them can wheels of 0.1 N m balance the
    gyroscopic torque."""
    verdicts: dict[str, bool] = {}
    notes: list[str] = []
    for rate in rates:
        limit = {"spacecraft.limit": "axis", "spacecraft.torque_limit": 0.1}
        changes = limit | {"initial.rate": list(rate), "simulation.duration": "12 h"}
        flight = desk.flight("stabilisation", "lqr-I", changes)
        spin = np.asarray(flight.recording["rate"])[0]
        torque = float(np.abs(np.cross(spin, np.array([2500.0, 9000.0, 9800.0]) * spin)).max())
        time, name = flight.metrics["settling_time"], f"{np.degrees(np.linalg.norm(spin)):.1f}°/s"
        verdicts[name] = time is None
        notes.append(
            f"{torque:.2f} N m, settled after {time:.0f} s" if time is not None else f"{torque:.2f} N m, not settled"
        )
    return Finding(verdicts, "; ".join(notes))


def globally(desk: Desk) -> Finding:
    """Return for each law whether the required attitude attracts every start; it does not if the torque also vanishes at
    q0 = -1, which is the same attitude."""
    verdicts: dict[str, bool] = {}
    for entry in desk.scenario("stabilisation").laws:
        loop = desk.loop("stabilisation", entry.name)
        turned = Measurement((-1.0, 0.0, 0.0, 0.0), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, loop.period)
        torque, _ = loop.law.module.torque(turned, loop.gains, loop.craft, NoMemory())
        verdicts[entry.name] = any(part != 0.0 for part in torque)
    return Finding(verdicts, "at q0 = -1, a full turn away, the torque is zero")


def offset(desk: Desk, law: str) -> Finding:
    """Return whether a law's error under a disturbance M is that at which its stiffness balances M: |q| = |K^-1 M|, to
    within a tenth."""
    run = desk.recording("disturbed", law)
    gain = desk.loop("disturbed", law).gains.k_attitude
    stiffness = np.full(3, gain) if isinstance(gain, float) else np.diag(gain) if np.ndim(gain) == 2 else np.asarray(gain)
    error = float(np.linalg.norm(np.asarray(run["attitude_error"])[-1, 1:]))
    pressure = np.array([6e-5, 6e-5, 5.29e-5])
    wanted = float(np.linalg.norm(pressure / stiffness))
    angle = np.degrees(2.0 * error)
    return Finding(
        bool(abs(error / wanted - 1.0) < 0.1), f"{angle:.4f}° left, {np.degrees(2.0 * wanted):.4f}° by the formula"
    )


def lyapunov_functions(desk: Desk, runs: Sequence[tuple[str, str]]) -> Figure:
    """Return a figure of V over time along several flights, as a share of its initial value."""
    curves: list[Curve] = []
    for file, law in runs:
        values = _lyapunov(desk, file, law)
        curves.append(Curve(np.asarray(desk.recording(file, law)["time"]) / 60.0, values / values[0], law))
    return Figure([Panel("time, min", "V / V(0)", curves, log_y=True, y_span=(1e-14, 3.0))])


def _lyapunov(desk: Desk, file: str, law: str) -> Any:
    """Return V at each sample of a flight."""
    run, loop = desk.recording(file, law), desk.loop(file, law)
    q, rate = (tuple(np.asarray(run[name]).T) for name in ("attitude_error", "rate_error"))
    given: Any = Measurement(q, rate, rate, ZERO, ZERO, ZERO, ZERO, loop.period)
    assert loop.law.lyapunov is not None
    return np.asarray(loop.law.lyapunov(given, loop.gains, loop.craft))


def _inertias() -> list[Any]:
    """Return random inertias whose moments differ by up to a factor of ten, in random axes."""
    random = np.random.default_rng(RNG)
    inertias: list[Any] = []
    for _ in range(TRIALS):
        axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
        moments = 10.0 ** random.uniform(3.0, 4.0, 3)
        moments[np.argmax(moments)] = min(moments.max(), 0.99 * (moments.sum() - moments.max()))
        inertias.append(axes * moments @ axes.T)
    return inertias


def _specs(form: str) -> list[tuple[Any, Any]]:
    """Return random inertias, diagonal for form II, with random weights."""
    random, specs = np.random.default_rng(RNG + 1), []
    for inertia in _inertias():
        if form == "I":
            specs.append((inertia, lqr.FormI(float(10.0 ** random.uniform(-6, -4)), float(10.0 ** random.uniform(-6, -4)))))
            continue
        weights = tuple((10.0 ** np.r_[random.uniform(1.0, 4.0, 3), random.uniform(-2.0, 0.0, 3)]).tolist())
        costs = tuple((10.0 ** random.uniform(-1.0, 1.0, 3)).tolist())
        if form == "II":
            specs.append((np.diag(np.sort(np.linalg.eigvalsh(inertia))), lqr.FormII(weights, costs)))
        else:
            specs.append((inertia, lqr.FormIII(weights, costs)))
    return specs
