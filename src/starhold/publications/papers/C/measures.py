"""The closed loop of the publication on reaction wheels, its regions of gains and its optimum, as computed outside
scenarios."""

from collections.abc import Sequence
from itertools import permutations
from typing import Any

import numpy as np

from starhold.algebra.cosines import to_angles
from starhold.algebra.vector import ZERO
from starhold.laws import wheel
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.craft import tensor
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.measures import samples
from starhold.publications.verdicts import Finding
from starhold.synthesis.stability_degree import boundary, brute_force, degree, design_gains, optimum

RNG = 2012
TRIALS = 400
WEAK = 0.002
"""The largest torque (N m) of the wheel about y after its fault."""
EXAMPLE = ((1.0, 1.5, 2.0), 0.5, 0.3, 2.0)
"""Ratios of the moments, largest angle (rad), largest rate and budget, in the publication's units."""


def closed_loop(desk: Desk, file: str, law: str) -> Finding:
    """Return whether the flight of a law satisfies (9) up to the first wheel fault, by differences of its recorded rates."""
    whole = {"fault": None}
    run, loop = desk.recording(file, law, whole), desk.loop(file, law, whole)
    q, rate, time = (np.asarray(run[name]) for name in ("attitude_error", "rate_error", "time"))
    slope = (rate[2:] - rate[:-2]) / (time[2:] - time[:-2])[:, None]
    # The torque is held over a period, so the central difference at a sample corresponds to the mean of two commands.
    restoring = loop.gains.k_rate * rate + np.asarray(loop.gains.k_attitude) * 4.0 * q[:, :1] * q[:, 1:]
    acting = 0.5 * (restoring[1:-1] + restoring[:-2])
    off = float(np.abs(slope @ tensor(loop.craft.inertia) + acting).max() / np.abs(acting).max())
    return Finding(off < 2e-3, f"off by at most {off:.0e} of the largest torque, held for {loop.period:g} s")


def roots_match(desk: Desk) -> Finding:
    """Return whether the roots (19) are the eigenvalues of (17), for random gains and moments."""
    random, worst = np.random.default_rng(RNG), 0.0
    for _ in range(TRIALS):
        ratios, stiffness, damping = _ratios(random), random.uniform(0.1, 3.0), random.uniform(0.1, 6.0)
        matrix = np.zeros((6, 6))
        matrix[:3, :3], matrix[:3, 3:] = np.diag(-damping / ratios), np.diag(-2.0 * stiffness / ratios)
        matrix[3:, :3] = np.eye(3)
        inside = np.sqrt(damping**2 - 8.0 * ratios * stiffness + 0.0j)
        printed = np.concatenate([(-damping + inside) / (2.0 * ratios), (-damping - inside) / (2.0 * ratios)])
        eigenvalues = np.linalg.eigvals(matrix)
        worst = max(worst, max(float(np.abs(eigenvalues - root).min()) for root in printed))
    # At a double root eigenvalues are accurate to half the digits only.
    return Finding(worst < 1e-6, f"{TRIALS} trials: at most {worst:.0e} apart")


def first_region(desk: Desk) -> Finding:
    """Return whether (21) is the degree of stability in the first region of (20), where all axes oscillate."""
    return _in_region(lambda s1, s2, k: np.sqrt(8.0 * k) * 0.999, lambda s1, s2, k, w: w / (2.0 * (1.0 + s2)))


def fourth_region(desk: Desk) -> Finding:
    """Return whether (22) is the degree of stability in the last region of (20), where no axis oscillates."""
    return _in_region(
        lambda s1, s2, k: np.sqrt(8.0 * (1.0 + s2) * k) * 1.3, lambda s1, s2, k, w: 0.5 * (w - np.sqrt(w * w - 8.0 * k))
    )


def middle_regions(desk: Desk) -> Finding:
    """Return whether the degree of stability in the second and third regions is the smaller of (21) and (22)."""
    return _in_region(
        lambda s1, s2, k: np.sqrt(8.0 * k * (1.0 + 0.7 * s2)),
        lambda s1, s2, k, w: min(w / (2.0 * (1.0 + s2)), 0.5 * (w - np.sqrt(w * w - 8.0 * k))),
    )


def curve_in_second(desk: Desk) -> Finding:
    """Return for each set of moments whether the curve (23) lies in the second region of (20)."""
    verdicts: dict[str, bool] = {}
    for s1, s2 in ((0.1, 0.5), (0.4, 0.5), (0.2, 0.6), (0.1, 0.9), (0.8, 0.9)):
        square = 1.0 / boundary((1.0, 1.0 + s1, 1.0 + s2))
        verdicts[f"σ1 = {s1}, σ2 = {s2}"] = 8.0 < square <= 8.0 * (1.0 + s1)
    return Finding(verdicts, "it does where σ1 ≥ σ2²/(1 + 2σ2)")


def printed_optimum(desk: Desk) -> Finding:
    """Return for each order of the moments whether (25) as printed gives the largest degree of stability."""
    verdicts: dict[str, bool] = {}
    for order in permutations((1.0, 1.5, 2.0)):
        x, y, z = order
        ratios = np.array([1.0, y / x, z / x])
        share = _share(ratios[2])
        best, reached = brute_force(ratios, 0.5, 0.3, 2.0).eta, 0.0
        if share > 0.0:
            K_w = _on_line(share, 0.5, 0.3, 2.0)
            reached = float(degree(share * K_w**2, K_w, ratios))
        verdicts[f"{x:g} : {y:g} : {z:g}"] = reached > best * (1.0 - 1e-6)
    return Finding(verdicts, "moments about x, y and z")


def general_optimum(desk: Desk) -> Finding:
    """Return whether the formula with the smallest and the largest moment gives the optimum for any order of the moments,
    compared with a search over all gains."""
    random, worst = np.random.default_rng(RNG), 0.0
    for _ in range(25):
        ratios, alpha, omega, budget = _ratios(random), *random.uniform((0.1, 0.0, 0.5), (3.0, 1.0, 4.0)).tolist()
        searched = brute_force(ratios, alpha, omega, budget)
        worst = max(worst, searched.eta / optimum(ratios, alpha, omega, budget).eta - 1.0)
    return Finding(worst < 1e-8, f"25 trials: a search finds at most {max(worst, 0.0):.0e} more")


def example(desk: Desk) -> Finding:
    """Return whether (25) gives the optimum for moments of 1 : 1.5 : 2, an angle of 0.5, a rate of 0.3 and a budget of 2."""
    ratios, alpha, omega, budget = EXAMPLE
    share = _share(ratios[2])
    K_w = _on_line(share, alpha, omega, budget)
    eta, best = K_w / (2.0 * ratios[2]), brute_force(ratios, alpha, omega, budget)
    note = f"K_ω = {K_w:.4f}, K_a = {share * K_w**2:.4f}, degree of stability {eta:.4f}"
    return Finding(bool(abs(best.eta / eta - 1.0) < 1e-8), note)


def degree_after(desk: Desk, file: str, law: str) -> Finding:
    """Return whether a retuned law is proved to converge, and with which degree of stability."""
    issued = [one.certificate for one in desk.certificates(file, law)]
    kept = {certificate.name: certificate.claims[0].outcome == "proved" for certificate in issued}
    moments = np.diagonal(tensor(desk.scenario(file).craft.inertia))
    etas = [design_gains(moments, torque, 0.4, *np.radians([40.0, 0.3])).eta_per_second for torque in (0.02, WEAK)]
    return Finding(
        kept, f"degree of stability {etas[0]:.4f} 1/s with all of the torque, {etas[1]:.4f} 1/s with a tenth of it"
    )


def within_torque(desk: Desk, file: str, laws: Sequence[str]) -> Finding:
    """Return for each law whether it demands no more torque than the weak wheel has, at every sample after the fault."""
    verdicts, notes = dict[str, bool](), list[str]()
    for law in laws:
        time, command = samples(desk, file, law, "wheel_command")
        demanded = float(np.abs(command[time >= 6.0, 1]).max())
        verdicts[law] = demanded <= WEAK
        notes.append(f"{law} {1e3 * demanded:.2f} mN m of {1e3 * WEAK:g}")
    return Finding(verdicts, "; ".join(notes))


def settles(desk: Desk, file: str, laws: Sequence[str]) -> Finding:
    """Return for each law whether it fails to settle."""
    times = {law: desk.flight(file, law).metrics["settling_time"] for law in laws}
    note = ", ".join(f"{law} after {time:.0f} s" for law, time in times.items() if time is not None)
    return Finding({law: time is None for law, time in times.items()}, f"settles: {note}")


def globally(desk: Desk) -> Finding:
    """Return whether the law's torque vanishes only at the required attitude; in fact it vanishes half a turn away too."""
    random, gains = np.random.default_rng(RNG), wheel.Gains(1.0, (1.0, 1.0, 1.0))
    craft, torques = desk.loop("three-wheels", desk.scenario("three-wheels").laws[0].name).craft, []
    for axis in random.normal(size=(50, 3)):
        half_turn: Any = (0.0, *(axis / np.linalg.norm(axis)))
        still = Measurement(half_turn, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.1)
        torques.append(float(np.linalg.norm(wheel.torque(still, gains, craft, NoMemory())[0])))
    return Finding(max(torques) > 0.0, "no torque at rest, half a turn away about any of 50 axes")


def tait_bryan(desk: Desk, file: str, laws: Sequence[str], until: float) -> Figure:
    """Return a figure of yaw, pitch and roll from the orbital frame over time, with a panel per law."""
    panels: list[Panel] = []
    for law in laws:
        time, error = (part[::5] for part in samples(desk, file, law, "attitude_error", until))
        angles = np.degrees([[float(a) for a in to_angles(tuple(q))] for q in error])
        curves = [Curve(time, angles[:, n], name) for n, name in enumerate(("yaw", "pitch", "roll"))]
        panels.append(Panel("time, s", "angle, °", curves, law))
    return Figure(panels, columns=2)


def regions(desk: Desk) -> Figure:
    """Return a figure of the plane of gains of the example: the regions (20), the curve (23), the line (24), and contours of
    the degree of stability."""
    ratios, alpha, omega, budget = EXAMPLE
    best = optimum(ratios, alpha, omega, budget)
    top = 1.7 * best.K_w
    K_w = np.linspace(0.0, top, 400)
    curves = [Curve(K_w**2 / (8.0 * i), K_w, f"K_ω² = {8.0 * i:g} K_a", "dashed", 6) for i in ratios]
    curves.append(Curve(boundary(ratios) * K_w**2, K_w, "(23)", hue=0))
    curves.append(Curve((budget - omega * K_w) / (2.0 * alpha), K_w, "(24), the wheels' torque", hue=1))
    for share in (0.4, 0.7, 1.0):
        eta, b, a = share * best.eta, max(ratios), min(ratios)
        # The set with at least this degree lies to the right of a corner on (23).
        corner, rise = 2.0 * b * eta, np.linspace(2.0 * b * eta, top, 100)
        x = np.concatenate([[2.2 * best.K_a, 0.5 * (2.0 * b - a) * eta**2], 0.5 * (rise * eta - a * eta**2)])
        curves.append(Curve(x, np.concatenate([[corner, corner], rise]), f"η = {eta:.3f}", "dotted", 2))
    curves.append(Curve([best.K_a], [best.K_w], "(25)", "points", 3))
    panel = Panel("K_a", "K_ω", curves, x_span=(0.0, 2.2 * best.K_a), y_span=(0.0, top))
    return Figure([panel])


def _share(largest: float) -> float:
    """K_a / K_w^2 of (25), as printed, where the last moment is `largest` times the first."""
    return (2.0 * largest - 1.0) / (8.0 * largest**2)


def _on_line(share: float, alpha: float, omega: float, budget: float) -> float:
    """K_w of (25), where the curve K_a = share K_w^2 meets the line (24); a share must be positive."""
    return (-omega + np.sqrt(omega**2 + 8.0 * share * alpha * budget)) / (4.0 * share * alpha)


def _ratios(random: Any) -> Any:
    """Return the moments of a random possible body in units of the first."""
    while True:
        moments = random.uniform(0.4, 2.0, 3)
        if moments.max() < moments.sum() - moments.max():
            return moments / moments[0]


def _in_region(damping: Any, formula: Any) -> Finding:
    """Return whether a formula equals the degree of stability, at random sigma1 <= sigma2 and stiffness."""
    random, worst = np.random.default_rng(RNG), 0.0
    for _ in range(TRIALS):
        s1, s2 = np.sort(random.uniform(0.0, 1.0, 2))
        stiffness = random.uniform(0.1, 3.0)
        K_w = damping(s1, s2, stiffness)
        exact = float(degree(stiffness, K_w, (1.0, 1.0 + s1, 1.0 + s2)))
        worst = max(worst, abs(formula(s1, s2, stiffness, K_w) / exact - 1.0))
    return Finding(bool(worst < 1e-9), f"{TRIALS} trials: at most {worst:.0e} apart")
