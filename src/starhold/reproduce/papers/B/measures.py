"""What no scenario holds of this publication: its equations tried by numbers, and counts of steps over random starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import to_body
from starhold.analysis.metrics import stays_within
from starhold.analysis.rigid_body import error_angle
from starhold.parts.craft import tensor
from starhold.parts.environments.gravity_gradient import gravity_gradient
from starhold.reproduce.figure import Curve, Figure, Panel
from starhold.reproduce.papers.B.calls import call_figure as call_figure
from starhold.reproduce.papers.B.calls import fewer_operations as fewer_operations
from starhold.reproduce.papers.B.calls import horizon_figure as horizon_figure
from starhold.reproduce.papers.B.calls import operations_ratio as operations_ratio
from starhold.reproduce.papers.B.calls import time_cases as time_cases
from starhold.reproduce.papers.B.calls import time_ratio as time_ratio
from starhold.reproduce.papers.B.calls import total_time as total_time
from starhold.reproduce.papers.B.random_starts import fewest as fewest
from starhold.reproduce.papers.B.random_starts import rises as rises
from starhold.reproduce.papers.B.random_starts import steps_figure as steps_figure
from starhold.reproduce.verdicts import Finding
from starhold.scenario.building import build
from starhold.simulation.lane import fly

if TYPE_CHECKING:
    from starhold.reproduce.desk import Desk

Array = NDArray[np.float64]
LAWS = ("lyapunov", "sliding", "mpc")
COMMON = "three-laws"


# What is flown


def gains(desk: Desk) -> Finding:
    """The gains of Table 1, as they fly: k_w, k_q, K, Q, R."""
    lyapunov, sliding, mpc = (desk.scenario(COMMON).pick(law).gains for law in LAWS)
    return Finding([lyapunov.k_rate, lyapunov.k_attitude, sliding.surface_gain[0], mpc.q_attitude[0], mpc.r[0]])


def first_command(desk: Desk, file: str, law: str, component: bool = False) -> Finding:
    """What a law asks for at the start, before any limit (N m): the norm, or the largest component."""
    asked = desk.recording(file, law)["command"][0]
    return Finding(float(np.abs(asked).max() if component else np.linalg.norm(asked)), f"{np.round(asked, 5).tolist()}")


def gravity_torque(desk: Desk) -> Finding:
    """The largest norm that the gravity torque can have (N m): 3 mu/R^3 times half the difference of the extreme moments."""
    scenario = desk.scenario(COMMON)
    craft = build(scenario, scenario.pick("lyapunov")).craft
    moments = np.linalg.eigvalsh(tensor(craft.inertia))
    radius = float(np.linalg.norm(desk.recording(COMMON, "lyapunov")["position"], axis=1).min())
    return Finding(1.5 * craft.gravity / radius**3 * (moments[-1] - moments[0]))


# The equations


def near_the_target(desk: Desk, degrees: float = 1.0) -> Finding:
    """Tell whether the Lyapunov law turns the short way from rest, a little off the target, for either sign of Q."""
    half = np.radians(degrees) / 2.0
    found: dict[str, bool] = {}
    notes: list[str] = []
    for name, sign in (("q0 > 0", 1.0), ("q0 < 0, the same attitude", -1.0)):
        start = [sign * np.cos(half), sign * np.sin(half), 0.0, 0.0]
        changes = {"initial.attitude": start, "initial.rate": [0.0, 0.0, 0.0]}
        angle = np.degrees(error_angle(desk.recording(COMMON, "lyapunov", changes)["attitude_error"]))
        found[name] = bool(angle.max() < 2.0 * degrees)
        notes.append(f"{name}: at most {angle.max():.0f} degrees off on the way")
    return Finding(found, "; ".join(notes))


def _cross(a: Any) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def _product(p: Array, q: Array) -> Array:
    """Hamilton's product, scalars first."""
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def target_motion(desk: Desk, cases: int = 100) -> Finding:
    """The largest relative errors of the two formulas (10) over random motions of a target: of the rate from the vector part
    as printed, and of the acceleration from E."""
    random = np.random.default_rng(1)
    printed: list[float] = []
    by_e: list[float] = []
    for _ in range(cases):
        q, rate, acceleration = random.normal(size=4), random.normal(size=3), random.normal(size=3)
        q /= np.linalg.norm(q)
        pure = np.array([0.0, *rate])
        first = 0.5 * _product(q, pure)
        second = 0.5 * (_product(first, pure) + _product(q, np.array([0.0, *acceleration])))
        block = q[0] * np.eye(3) + _cross(q[1:])
        # E has the scalar below.
        e = np.vstack([block, -q[1:]])
        printed.append(float(np.linalg.norm(2.0 * block @ first[1:] - rate) / np.linalg.norm(rate)))
        found = 2.0 * e.T @ np.array([*second[1:], second[0]])
        by_e.append(float(np.linalg.norm(found - acceleration) / np.linalg.norm(acceleration)))
    note = f"off by up to {max(printed):.1g} times the rate, and {max(by_e):.0e} times the acceleration"
    return Finding({"rate": max(printed) < 1e-9, "acceleration": max(by_e) < 1e-9}, note)


def on_the_surface(desk: Desk, cases: int = 2000) -> Finding:
    """The sign of V_e' = q'K q' for random attitudes on the surface w = -K q, by the sign of q0, and at the published one."""
    gain = desk.scenario(COMMON).pick("sliding").gains.surface_gain[0]
    random = np.random.default_rng(2)
    attitudes = random.normal(size=(cases, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1)[:, None]

    def slope(q: Array) -> float:
        rate = -gain * q[1:]
        return float(gain * q[1:] @ (0.5 * (q[0] * rate + np.cross(q[1:], rate))))

    start = np.array([0.0, 1.0, 1.0, 1.0]) / np.sqrt(3.0)
    found = {
        "q0 > 0": all(slope(q) < 0.0 for q in attitudes if q[0] > 0.0),
        "q0 = 0, the published start": slope(start) < -1e-12,
        "q0 < 0": all(slope(q) < 0.0 for q in attitudes if q[0] < 0.0),
    }
    return Finding(found, f"{slope(start):.0e} at the published attitude")


def reaching_condition(desk: Desk, cases: int = 2000) -> Finding:
    """Tell whether V_r' = s (M - g sign s) <= 0 for random s and M within the condition (21): as printed, and of |M|."""
    random = np.random.default_rng(3)
    s, torque = random.normal(size=cases), random.normal(size=cases)
    bound = random.uniform(0.0, 2.0, size=cases)
    falls = s * (torque - bound * np.sign(s)) <= 0.0
    return Finding(
        {
            "g >= |M|": bool(falls[bound >= np.abs(torque)].all()),
            "g >= M, as printed": bool(falls[bound >= torque].all()),
        }
    )


def gravity_block(desk: Desk, cases: int = 20) -> Finding:
    """The factor that the gravity block of the printed matrix lacks: differences of the torque with the vector part of a
    small turn of the body, against (mu/R^5) ([R]J - [JR]) [R] at random attitudes."""
    scenario = desk.scenario(COMMON)
    craft = build(scenario, scenario.pick("mpc")).craft
    moments, random = tensor(craft.inertia), np.random.default_rng(4)
    factors: list[float] = []
    for _ in range(cases):
        place: Any = tuple(7.0e6 * (lambda v: v / np.linalg.norm(v))(random.normal(size=3)))
        strength = 3.0 * craft.gravity / 7.0e6**5

        def torque(turn: Array, place: Any = place, strength: float = strength) -> Array:
            quaternion: Any = (float(np.sqrt(1.0 - turn @ turn)), *map(float, turn))
            return np.array(gravity_gradient(to_body(quaternion, place), strength, craft))

        step = 1e-4
        slopes = np.column_stack([(torque(step * e) - torque(-step * e)) / (2.0 * step) for e in np.eye(3)])
        r = np.array(place)
        printed = craft.gravity / 7.0e6**5 * (_cross(r) @ moments - _cross(moments @ r)) @ _cross(r)
        factors.append(float((slopes * printed).sum() / (printed**2).sum()))
    return Finding(float(np.mean(factors)), f"from {min(factors):.6f} to {max(factors):.6f} at {cases} places")


def one_step(desk: Desk) -> Finding:
    """Tell whether x(k+1) = A x(k) with the printed A = A_c + E predicts the first control period of the published motion
    under predictive control; the errors of that and of E + A_c dt are told."""
    scenario = desk.scenario(COMMON)
    loop = build(scenario, scenario.pick("mpc"))
    state, moments = loop.start, tensor(loop.craft.inertia)
    rate, q = np.array(state.rate), np.array(state.attitude)
    flown = fly(loop, 1)[1]
    control = np.array(flown.command)
    push = np.linalg.inv(moments)
    gyroscopic = push @ (_cross(moments @ rate) - _cross(rate) @ moments)
    continuous = np.block([[-_cross(rate), 0.5 * np.eye(3)], [np.zeros((3, 3)), gyroscopic]])
    held = np.concatenate([np.zeros(3), push @ control])
    x = np.concatenate([q[1:], rate])
    end = flown.state
    true = np.concatenate([np.array(end.attitude)[1:], np.array(end.rate)])
    moved = float(np.linalg.norm(true - x))
    printed = float(np.linalg.norm(x + continuous @ x + held - true)) / moved
    stepped = float(np.linalg.norm(x + loop.period * (continuous @ x + held) - true)) / moved
    return Finding(
        printed < 0.5, f"off by {printed:.1f} times what the state moves; with the step in front, by {stepped:.2f}"
    )


# What flies


def arrives(desk: Desk, file: str, laws: Sequence[str], within: float, changes: Mapping[str, Any] | None = None) -> Finding:
    """Tell of each law whether its error of attitude stays within a bound (rad) over the last quarter of the flight."""
    return cases(desk, [{"name": law, "file": file, "law": law, "changes": changes} for law in laws], within)


def cases(desk: Desk, of: Sequence[Mapping[str, Any]], within: float) -> Finding:
    """The same of several flights: `name`, `file`, `law` and perhaps `changes` each."""
    ends = {one["name"]: _final(desk, one["file"], one["law"], one.get("changes")) for one in of}
    return Finding({name: end <= within for name, end in ends.items()}, _listed(ends, "rad"))


def _final(desk: Desk, file: str, law: str, changes: Mapping[str, Any] | None = None) -> float:
    value = desk.flight(file, law, changes).metrics["final_attitude_error"]
    return float("inf") if value is None else float(value)


def _listed(values: Mapping[str, float], unit: str = "") -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in values.items()) + (f" {unit}" if unit else "")


def smooth(desk: Desk) -> Finding:
    """The share of the largest torque by which the Lyapunov law's changes from call to call at most, and the sliding law's."""
    steps = {law: float(np.abs(np.diff(desk.recording(COMMON, law)["torque"], axis=0)).max()) for law in LAWS[:2]}
    return Finding(steps["lyapunov"] < 0.02 * steps["sliding"], "largest change a call: " + _listed(steps, "N m"))


def alternates(desk: Desk, of: Mapping[str, Sequence[str]], quantity: str, least: float = 0.95) -> Finding:
    """Tell whether every component changes sign at nearly every call in the last 150 s: of the torque, or of the increments
    of the rate. of: file and law by the names of cases."""
    shares: dict[str, float] = {}
    for name, (file, law) in of.items():
        run = desk.recording(file, law)
        values = np.asarray(run[quantity])[-1500:]
        signs = np.sign(np.diff(values, axis=0) if quantity == "rate" else values)
        shares[name] = float((np.diff(signs, axis=0) != 0).mean(axis=0).min())
    return Finding({name: share >= least for name, share in shares.items()}, "share of calls: " + _listed(shares))


def worse_with_noise(desk: Desk) -> Finding:
    """Tell whether each law ends further from the target with noise than without, in flights as long."""
    pairs = {
        law: (_final(desk, COMMON, law, {"simulation.duration": 600.0}), _final(desk, f"{COMMON}-noise", law))
        for law in LAWS
    }
    note = "; ".join(f"{law} {calm:.2g} and {noisy:.2g} rad" for law, (calm, noisy) in pairs.items())
    return Finding({law: noisy > calm for law, (calm, noisy) in pairs.items()}, note)


def pattern(desk: Desk, files: Mapping[str, str], least: float) -> Finding:
    """Tell whether the torque with noise goes like that without: the correlation of means over 5 s in the first 200 s, the
    least of the laws, by the names of readings."""

    def means(file: str, law: str) -> Array:
        return np.asarray(desk.recording(file, law)["torque"])[:2000].reshape(40, 50, 3).mean(axis=1).ravel()

    found = {
        name: {law: float(np.corrcoef(means(COMMON, law), means(file, law))[0, 1]) for law in LAWS}
        for name, file in files.items()
    }
    note = "; ".join(f"{name}: {_listed(of)}" for name, of in found.items())
    return Finding({name: min(of.values()) >= least for name, of in found.items()}, note)


def sooner(desk: Desk, of: Sequence[Mapping[str, Any]], factor: float = 1.0) -> Finding:
    """Tell of each case whether the first flight stays within an accuracy after fewer steps than `factor` times those of the
    second; one that never does comes last. Each has a name, a metric, and two flights (file, law, perhaps changes)."""
    found: dict[str, bool] = {}
    notes: list[str] = []
    for one in of:
        first, second = (
            desk.flight(file, law, *changes).metrics[one["metric"]] for file, law, *changes in (one["first"], one["second"])
        )
        found[one["name"]] = first is not None and (second is None or first < factor * second)
        notes.append(f"{one['name']}: {_count(first)}, {_count(second)}")
    return Finding(found, "; ".join(notes))


def _count(steps: Any) -> str:
    return "never" if steps is None else str(int(steps))


def least_accurate(desk: Desk, of: Sequence[Mapping[str, Any]], law: str) -> Finding:
    """Tell in which cases a law ends further from the target than both others; each has a name, and the file and the law for
    every law."""
    found: dict[str, bool] = {}
    notes: list[str] = []
    for one in of:
        ends = {name: _final(desk, *flight) for name, flight in one["flights"].items()}
        found[one["name"]] = max(ends, key=lambda name: ends[name]) == law
        notes.append(f"{one['name']}: {_listed(ends, 'rad')}")
    return Finding(found, "; ".join(notes))


def run_length_matters(desk: Desk, law: str, bound: float, short: float) -> Finding:
    """Tell whether the step after which the error stays within a bound is the same in a flight that ends sooner (s)."""
    error = _deviation(desk, COMMON, law)
    cut, whole = stays_within(error[: int(10.0 * short) + 1], bound), stays_within(error, bound)
    return Finding(cut == whole, f"{_count(cut)} after {short:.0f} s, {_count(whole)} in the end")


def _deviation(desk: Desk, file: str, law: str) -> Array:
    return np.linalg.norm(desk.recording(file, law)["attitude_error"][:, 1:], axis=1)


def quotients(desk: Desk, totals: Sequence[float], calls: int) -> Finding:
    """Totals by the number of calls."""
    return Finding([total / calls for total in totals])


# Figures


def plans(desk: Desk, file: str, law: str, instants: Sequence[int], until: float) -> Figure:
    """The attitude that predictive control foresees at some control instants, and the moves that it plans, with what was
    flown."""
    from starhold.laws.mpc import program
    from starhold.laws.predictive.problem import carve

    scenario = desk.scenario(file)
    loop = build(scenario, scenario.pick(law))
    run = desk.recording(file, law)
    shown = run["time"] <= until
    time = run["time"][shown]
    states = [Curve(time, run["attitude_error"][shown, 1], "flown")]
    moves = [Curve(time, 1e3 * run["torque"][shown, 0], "flown", "steps")]
    for number, instant in enumerate(instants):
        memory: Any = fly(loop, instant + 1)[1].memory
        store = carve(program(loop.gains, memory))
        n = loop.gains.horizon
        ahead = np.array(store.states.row(0, 6 * n + 6)).reshape(-1, 6)[:, 0]
        planned = np.array(store.plan.row(0, 3 * n)).reshape(-1, 3)[:, 0]
        begun = instant * loop.period
        foreseen = begun + loop.period * np.arange(n + 1)
        label = f"planned at {begun:.0f} s"
        states.append(Curve(foreseen, ahead, label, "dashed", number + 1))
        moves.append(Curve(foreseen[:-1], 1e3 * planned, label, "dashed", number + 1))
    return Figure([Panel("time, s", "q1", states), Panel("time, s", "torque about x, mN m", moves)], columns=2)


def with_detail(
    desk: Desk, file: str, law: str, quantity: str, label: str, names: Sequence[str], until: float, detail: Sequence[float],
    scale: float = 1.0,
) -> Figure:  # fmt: skip
    """The components of a recorded quantity, and in a second panel those between two instants (s)."""
    run = desk.recording(file, law)
    time, values = run["time"], scale * np.asarray(run[quantity])

    def panel(first: float, last: float, style: Any, title: str) -> Panel:
        shown = (time >= first) & (time <= last)
        curves = [Curve(time[shown], values[shown, k], name, style) for k, name in enumerate(names)]
        return Panel("time, s", label, curves, title)

    parts = [panel(0.0, until, "line", "")]
    parts.append(panel(detail[0], detail[1], "steps" if quantity == "torque" else "line", "the same, magnified"))
    return Figure(parts, columns=2)


def fall(desk: Desk, of: Mapping[str, Sequence[str]], until: float, levels: Sequence[float] = ()) -> Figure:
    """|q| over time of several flights: file and law by their names."""
    curves: list[Curve] = []
    for name, (file, law) in of.items():
        time = desk.recording(file, law)["time"]
        shown = time <= until
        curves.append(Curve(time[shown], np.maximum(_deviation(desk, file, law)[shown], 1e-9), name))
    return Figure([Panel("time, s", "|q|", curves, log_y=True, levels=levels)])


def by_gain(desk: Desk, least: float, most: float, count: int, limits: Mapping[str, str]) -> Figure:
    """The steps that the sliding law takes, and where it ends, over its switching torque."""
    from starhold.studies.sweep import sweep

    values = np.geomspace(least, most, count)
    table = sweep(desk.scenario(COMMON), {"law.sliding.switching_gain": values}, "sliding")
    mine = 1e3 * table["law.sliding.switching_gain"].to_numpy(dtype=float)
    curves = [
        Curve(mine, table[f"iterations_1e-{k}"].to_numpy(dtype=float), f"to 10^-{k}", "points", k - 1) for k in (1, 2, 3, 4)
    ]
    ends = [Curve(mine, table["final_attitude_error"].to_numpy(dtype=float), "sliding", "points")]
    levels = [_final(desk, COMMON, law) for law in limits.values()]
    notes = [(3.0 * mine[0], 2.2 * level, name) for level, name in zip(levels, limits, strict=True)]
    label = "switching torque g, mN m"
    return Figure(
        [
            Panel(label, "steps to stay within", curves, log_x=True, log_y=True),
            Panel(label, "largest angle in the last quarter, rad", ends, log_x=True, log_y=True, levels=levels, notes=notes),
        ],
        columns=2,
    )


def by_period(desk: Desk, periods: Sequence[float], duration: float) -> Figure:
    """Where each law ends after a flight of some length, over the control period."""
    curves: list[Curve] = []
    for law in LAWS:
        ends = [
            _final(desk, COMMON, law, {"simulation.duration": duration, "simulation.control_period": h}) for h in periods
        ]
        curves += [Curve(periods, ends, law, "line"), Curve(periods, ends, "", "points", len(curves) // 2)]
    curves = [replace(curve, hue=number // 2) for number, curve in enumerate(curves)]
    return Figure([Panel("control period, s", "largest angle in the last quarter, rad", curves, log_x=True, log_y=True)])


def noise_figure(desk: Desk, files: Mapping[str, str]) -> Figure:
    """|q| over time of each law, a panel each reading of the noise."""
    panels: list[Panel] = []
    for name, file in files.items():
        curves: list[Curve] = []
        for law in LAWS:
            curves.append(Curve(desk.recording(file, law)["time"], _deviation(desk, file, law), law))
        panels.append(Panel("time, s", "|q|", curves, name, y_span=(1e-4, 1.5), log_y=True))
    return Figure(panels, columns=3)
