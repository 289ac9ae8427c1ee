"""Compares the publication's linear model, levels and regulators with pole placement by the general algorithm."""

from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra import vector
from starhold.algebra.vector import ZERO
from starhold.laws import modal
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.craft import make_craft
from starhold.publications.desk import Desk
from starhold.publications.verdicts import Finding
from starhold.synthesis.pole_placement import UncontrollableError, displacement, is_stable, levels, place, reached

Array: TypeAlias = NDArray[np.float64]

RNG = 1074
TRIALS = 40
"""The number of random states, bodies and spectra on which each identity is tested."""
EXACT = 1e-9
"""The relative error up to which two formulas count as equal."""
ONE, NONE = np.eye(3), np.zeros((3, 3))


class Case(NamedTuple):
    """A state at the beginning of a control step, a body, and the torque on it without control: attitude (4,), rate (3,) in
    rad/s, inertia (3, 3) in kg m2, torque (3,) in N m and its Jacobian (3, 7) with respect to attitude and rate."""

    attitude: Array
    rate: Array
    inertia: Array
    torque: Array
    jacobian: Array

    @property
    def straighten(self) -> Array:
        """J D^-1 with D = E + [q]x, (3, 3)."""
        return self.inertia @ np.linalg.inv(ONE + skew(self.attitude[1:]))

    @property
    def state(self) -> Array:
        """x = (q0 - 1, q, w), (7,)."""
        return np.r_[self.attitude[0] - 1.0, self.attitude[1:], self.rate]

    def model(self) -> tuple[Array, Array]:
        """A (7, 7) and B (7, 3) of (2.4)."""
        a, b = np.zeros((7, 7)), np.zeros((7, 3))
        a[0, 1:4], a[1:4, 0] = -0.5 * self.rate, 0.5 * self.rate
        a[1:4, 4:] = 0.5 * (ONE + skew(self.attitude[1:]))
        a[4:], b[4:] = np.linalg.solve(self.inertia, self.jacobian), np.linalg.inv(self.inertia)
        return a, b

    def control(self, gain: Array) -> Array:
        """u = -xi - K x of (3.2), (3,), in N m."""
        return -(self.torque - self.jacobian @ self.state) - gain @ self.state


class Spectra(NamedTuple):
    """The spectra of the three levels: matrices (3, 3) and a number, 1/s."""

    phi_0: Array
    phi_1: Array
    phi_2: float

    def poles(self) -> NDArray[np.complex128]:
        """All seven of them."""
        return np.concatenate([np.linalg.eigvals(self.phi_0), np.linalg.eigvals(self.phi_1), [self.phi_2]]).astype(complex)


def skew(v: Array) -> Array:
    """[v]x (3, 3) of v (3,)."""
    return np.array(vector.skew(_numbers(v)))


def cases(count: int = TRIALS) -> Iterator[tuple[Case, Spectra]]:
    """Yield random states, bodies and torques, each with random spectra: real, non-diagonal matrices."""
    random = np.random.default_rng(RNG)
    for _ in range(count):
        attitude = random.normal(size=4)
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        inertia = turn @ np.diag(1000.0 * random.uniform(2.5, 4.9, 3)) @ turn.T
        rate = random.normal(size=3) * 10.0 ** random.uniform(-1.5, 0.0)
        torque, jacobian = 100.0 * random.normal(size=3), 300.0 * random.normal(size=(3, 7))
        bases = np.eye(3) + 0.2 * random.normal(size=(2, 3, 3))
        first, second = (basis @ np.diag(random.uniform(-2.0, -0.2, 3)) @ np.linalg.inv(basis) for basis in bases)
        yield (
            Case(attitude / np.linalg.norm(attitude), rate, 0.5 * (inertia + inertia.T), torque, jacobian),
            Spectra(first, second, -float(random.uniform(0.05, 0.5))),
        )


def regulators(case: Case, spectra: Spectra) -> tuple[Array, Array, Array]:
    """Return K_2 (3, 1), K_1 (3, 4) and K_0 (3, 7) as printed in (4.9), (4.10) and (4.11)."""
    w, jd = case.rate[:, None], case.straighten
    phi_0, phi_1, last = spectra.phi_0, spectra.phi_1, 4.0 * spectra.phi_2 / float(case.rate @ case.rate)
    p, q = -(phi_0 + phi_1), phi_0 @ phi_1
    k_2 = last * jd @ w
    k_1 = np.hstack([(ONE - last * phi_1) @ jd @ w, -2.0 * (0.25 * last * jd @ w @ w.T + phi_1 @ jd)])
    by_scalar, by_vector, by_rate = case.jacobian[:, :1], case.jacobian[:, 1:4], case.jacobian[:, 4:]
    d = ONE + skew(case.attitude[1:])
    k_0 = np.hstack(
        [
            by_scalar - (spectra.phi_2 * ONE - p - last * q) @ jd @ w,
            by_vector - 0.5 * (ONE + last * p) @ jd @ w @ w.T + 2.0 * q @ jd,
            by_rate - 0.25 * last * jd @ w @ w.T @ d + p @ case.inertia,
        ]
    )
    return k_2, k_1, k_0


def single_root_regulator(case: Case, a: float, b: float = -0.01) -> Array:
    """Return K (3, 7) as printed in (5.1) for the root a (1/s), with the b = -0.01 that is written out there as a
    parameter."""
    w, jd, square = case.rate[:, None], case.straighten, float(case.rate @ case.rate)
    d = ONE + skew(case.attitude[1:])
    return case.jacobian + np.hstack(
        [
            -jd @ w * (2.0 * a * (1.0 - 2.0 * b * a) + b * square),
            -jd @ (0.5 * (1.0 - 8.0 * b * a) * w @ w.T - 2.0 * a * a * ONE),
            -2.0 * a * case.inertia - b * jd @ w @ w.T @ d,
        ]
    )


def closed_loop(case: Case, a: float, b: float = -0.01) -> Array:
    """Return the derivative of the rate (3,), rad/s2, as printed in (5.2)."""
    q0, q, w = case.attitude[0], case.attitude[1:], case.rate
    k = 2.0 * a * (1.0 - 2.0 * a * b) * (q0 - 1.0) + 0.5 * (1.0 - 8.0 * a * b) * (w @ q) + b * q0 * (w @ w)
    back = np.linalg.inv(ONE + skew(q))
    return 2.0 * a * w - 2.0 * a * a * back @ q + k * back @ w


def model_at_the_start_of_a_step(desk: Desk) -> Finding:
    """Return the difference of A x + B u + N xi from the derivative by (1.1) and (1.4) at the state itself."""
    worst = 0.0
    for case, _ in cases():
        (a, b), u = case.model(), 50.0 * case.rate
        q0, q, w = case.attitude[0], case.attitude[1:], case.rate
        turning = np.r_[-0.5 * w @ q, 0.5 * (q0 * w + np.cross(q, w)), np.linalg.solve(case.inertia, case.torque + u)]
        xi = case.torque - case.jacobian @ case.state
        worst = max(worst, _apart(a @ case.state + b @ (u + xi), turning))
    return _identity(worst)


def gyroscopic_sign(desk: Desk) -> Finding:
    """Return for which sign of w x J w among the torques the motion (1.1) under (3.2) equals that of (5.2)."""
    worst = {"−ω × Jω, as (1.1) wants it": 0.0, "ω × Jω, as printed": 0.0}
    for case, spectra in cases():
        gyroscopic = np.cross(case.rate, case.inertia @ case.rate)
        for name, sign in zip(worst, (-1.0, 1.0), strict=True):
            known = case._replace(torque=case.torque + sign * gyroscopic)
            u = known.control(single_root_regulator(known, spectra.phi_2))
            swing = np.linalg.solve(case.inertia, u + case.torque - gyroscopic)
            worst[name] = max(worst[name], _apart(swing, closed_loop(case, spectra.phi_2)))
    return Finding({name: error < EXACT for name, error in worst.items()}, _errors(worst))


def controllable(desk: Desk) -> Finding:
    """Return, by the numbers of poles placed at the levels, whether the pair of (3.1) is controllable while the body
    rotates, and at rest."""
    turning = [levels(*case.model()) == [3, 3, 1] for case, _ in cases()]
    resting = [_controllable(case._replace(rate=np.zeros(3))) for case, _ in cases()]
    verdicts = {"while the body turns": all(turning), "at rest, where turns begin and end": any(resting)}
    return Finding(verdicts, "levels of 3, 3 and 1 poles")


def unstable_by_itself(desk: Desk) -> Finding:
    """Return whether A has an eigenvalue in the right half-plane for some bodies and torques."""
    right = sum(float(np.linalg.eigvals(case.model()[0]).real.max()) > 1e-6 for case, _ in cases())
    return Finding(right > 0, f"{right} of {TRIALS} random states")


def pseudo_inverse_formulas(desk: Desk) -> Finding:
    """Return whether (B'B)^-1 B', B'(BB')^-1 and B^-1 equal the pseudo-inverse by a singular-value decomposition."""
    random, worst = np.random.default_rng(RNG), 0.0
    for _ in range(TRIALS):
        tall, square = random.normal(size=(7, 3)), random.normal(size=(3, 3))
        worst = max(
            worst,
            _apart(np.linalg.solve(tall.T @ tall, tall.T), np.linalg.pinv(tall)),
            _apart(tall @ np.linalg.inv(tall.T @ tall), np.linalg.pinv(tall.T)),
            1e-3 * _apart(np.linalg.inv(square), np.linalg.pinv(square)),
        )
    return _identity(worst)


def printed_levels(desk: Desk) -> Finding:
    """Return whether the matrices printed for the levels follow from the annihilators [E 0] and [1 0 0 0]."""
    worst = 0.0
    for case, _ in cases():
        (a, b), jd, w = case.model(), case.straighten, case.rate
        first, second = np.eye(4, 7), np.eye(1, 4)
        a_1, b_1 = first @ a @ first.T, first @ a @ b
        a_2, b_2 = second @ a_1 @ second.T, second @ a_1 @ b_1
        back = np.vstack([np.zeros((1, 3)), 0.5 * np.linalg.inv(jd)])
        pairs = [
            (np.linalg.pinv(b), np.hstack([NONE, np.zeros((3, 1)), case.inertia])),
            (b_1, back),
            (np.linalg.pinv(b_1), np.hstack([np.zeros((3, 1)), 2.0 * jd])),
            (b_2, -0.25 * w[None] @ np.linalg.inv(jd)),
        ]
        worst = max(worst, float(abs(a_2[0, 0])), *(_apart(computed, printed) for computed, printed in pairs))
    return _identity(worst)


def classical_algorithm(desk: Desk) -> Finding:
    """Return whether the last level has more inputs than states, so that its B does not have full column rank."""
    sizes = [levels(*case.model())[-1] for case, _ in cases()]
    return Finding(all(size == 1 for size in sizes), "one pole for three inputs")


def inverse_of_the_skeleton(desk: Desk) -> Finding:
    """Return whether (4.7) is the pseudo-inverse of T_2, and (4.8) a generalised inverse that violates only the condition
    that it may."""
    kept = {"(4.7) is the pseudo-inverse": True, "(4.8) keeps (4.5) and all of (4.2) but one symmetry": True}
    for case, _ in cases():
        jd, w = case.straighten, case.rate[:, None]
        t = -0.25 * w.T @ np.linalg.inv(jd)
        back = np.linalg.inv(jd).T
        full = -4.0 * back @ w / (w.T @ np.linalg.inv(jd) @ back @ w)
        short = -4.0 * jd @ w / (w.T @ w)
        rules = (
            _apart(t @ short @ t, t) < EXACT,
            _apart(short @ t @ short, short) < EXACT,
            _apart(t @ short, np.eye(1)) < EXACT,
            _apart(short @ t, (short @ t).T) > 1e-6,
        )
        first, second = kept
        kept[first] = kept[first] and _apart(full, np.linalg.pinv(t)) < EXACT
        kept[second] = kept[second] and all(rules)
    return Finding(kept)


def placed_poles(desk: Desk, level: int) -> Finding:
    """Return the error of the poles under the printed regulator of a level, relative to the spectra of this and lower
    levels, by partial fractions of the characteristic polynomial with 512 bits."""
    worst = 0.0
    for case, spectra in cases():
        a, b = case.model()
        for annihilator in (np.eye(4, 7), np.eye(1, 4))[:level]:
            a, b = annihilator @ a @ annihilator.T, annihilator @ a @ b
        gain = regulators(case, spectra)[2 - level]
        wanted = spectra.poles()[3 * level :]
        wanted = np.where(np.abs(wanted.imag) < EXACT, wanted.real, wanted)
        worst = max(worst, displacement(a, b, gain, wanted))
    return Finding(worst < EXACT, f"poles off by at most {worst:.0e} of themselves, {TRIALS} random cases")


def general_placement(desk: Desk) -> Finding:
    """Return the difference of (4.11) from the gain that the general algorithm computes numerically, with (4.8) given."""
    worst = 0.0
    for case, spectra in cases():
        turned = case.straighten @ case.rate[:, None]
        given = [spectra.phi_0, spectra.phi_1, [[spectra.phi_2]]]
        gain = place(*case.model(), spectra=given, directions=[None, None, turned]).K
        worst = max(worst, _apart(regulators(case, spectra)[2], gain))
    return _identity(worst, 1e-8)


def single_root(desk: Desk) -> Finding:
    """Return the difference of (5.1) from (4.11) with the spectra chosen in section 5."""
    worst = 0.0
    for case, spectra in cases():
        a = spectra.phi_2
        chosen = Spectra(a * ONE, a * ONE, -0.01 * float(case.rate @ case.rate))
        worst = max(worst, _apart(single_root_regulator(case, a), regulators(case, chosen)[2]))
    return _identity(worst)


def loop_of_the_law(desk: Desk) -> Finding:
    """Return the differences from (5.2) of the motion under the law `modal` and under (3.2) with (5.1)."""
    worst = {"(3.2) with (5.1)": 0.0, "the law `modal`": 0.0}
    for case, spectra in cases():
        a, craft = spectra.phi_2, make_craft(case.inertia)
        gyroscopic = np.cross(case.rate, case.inertia @ case.rate)
        known = case._replace(torque=case.torque - gyroscopic)
        rate = _numbers(case.rate)
        seen = Measurement(_numbers(case.attitude), rate, rate, ZERO, ZERO, _numbers(case.torque), ZERO, 0.1)
        flown, _ = modal.torque(seen, modal.Gains((a, a, a), (a, a, a), -0.01), craft, NoMemory())
        for name, u in zip(worst, (known.control(single_root_regulator(known, a)), np.array(flown)), strict=True):
            swing = np.linalg.solve(case.inertia, u + known.torque)
            worst[name] = max(worst[name], _apart(swing, closed_loop(case, a)))
    return Finding({name: error < EXACT for name, error in worst.items()}, _errors(worst))


def stable_sign(desk: Desk) -> Finding:
    """Return whether A - B K with (5.1) is stable at each state for a < 0, and not for a > 0."""
    stable: dict[float, list[bool]] = {-0.428: [], 0.428: []}
    for case, _ in cases():
        for a, verdicts in stable.items():
            verdicts.append(is_stable(reached(*case.model(), single_root_regulator(case, a))))
    return Finding(all(stable[-0.428]) and not any(stable[0.428]), f"{TRIALS} random states")


def at_rest(desk: Desk) -> Finding:
    """Return whether the law's torque tends to -2 a^2 J q as the rate vanishes, where the poles cannot be placed."""
    worst, a = 0.0, -0.428
    for case, _ in cases():
        crept = np.linalg.norm(case.rate)
        still = case._replace(rate=1e-9 * case.rate / crept, torque=np.zeros(3), jacobian=np.zeros((3, 7)))
        wanted = -2.0 * a * a * case.inertia @ case.attitude[1:]
        worst = max(worst, _apart(still.control(single_root_regulator(still, a)), wanted))
    return Finding(worst < 1e-7, f"off by at most {worst:.0e} at 1e-9 rad/s")


def _controllable(case: Case) -> bool:
    try:
        levels(*case.model())
    except UncontrollableError:
        return False
    return True


def _apart(value: Any, wanted: Any) -> float:
    """Return the largest difference, as a share of the largest number."""
    return float(np.abs(value - wanted).max() / np.abs(wanted).max())


def _identity(worst: float, allowed: float = EXACT) -> Finding:
    return Finding(worst < allowed, f"relative difference at most {worst:.0e}, {TRIALS} random cases")


def _errors(worst: dict[str, float]) -> str:
    return "relative difference at most " + ", ".join(f"{error:.0e}" for error in worst.values())


def _numbers(vector: Array) -> Any:
    return tuple(vector.tolist())
