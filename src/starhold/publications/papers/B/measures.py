"""Compares flights of the three laws with the statements of the publication, and makes its figures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.meter import stays_within
from starhold.parts.craft import tensor
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.measures import samples
from starhold.publications.verdicts import Finding
from starhold.simulation.lane import fly

Array = NDArray[np.float64]
LAWS = ("lyapunov", "sliding", "mpc")
COMMON = "three-laws"


# Scenarios


def gains(desk: Desk) -> Finding:
    """Return the gains of Table 1 as flown: k_w, k_q, K, Q, R."""
    lyapunov, sliding, mpc = (desk.scenario(COMMON).pick(law).gains for law in LAWS)
    return Finding([lyapunov.k_rate, lyapunov.k_attitude, sliding.surface_gain[0], mpc.q_attitude[0], mpc.r[0]])


def first_command(desk: Desk, file: str, law: str, component: bool = False) -> Finding:
    """Return a law's command (N m) at the start, before any limit: its norm or its largest component."""
    command = desk.recording(file, law)["command"][0]
    size = np.abs(command).max() if component else np.linalg.norm(command)
    return Finding(float(size), f"about the axes {np.round(command, 5).tolist()}")


def gravity_torque(desk: Desk) -> Finding:
    """Return the largest norm (N m) of the gravity torque: 3 mu/R^3 times half the difference of the extreme moments."""
    craft = desk.loop(COMMON, "lyapunov").craft
    moments = np.linalg.eigvalsh(tensor(craft.inertia))
    radius = float(np.linalg.norm(desk.recording(COMMON, "lyapunov")["position"], axis=1).min())
    return Finding(1.5 * craft.gravity / radius**3 * (moments[-1] - moments[0]))


# Flights


def _final(desk: Desk, file: str, law: str, changes: Mapping[str, Any] | None = None) -> float:
    value = desk.flight(file, law, changes).metrics["final_attitude_error"]
    return float("inf") if value is None else float(value)


def _listed(values: Mapping[str, float], unit: str = "") -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in values.items()) + (f" {unit}" if unit else "")


def smooth(desk: Desk) -> Finding:
    """Return whether the Lyapunov torque changes little from call to call compared with the sliding torque."""
    steps = {law: float(np.abs(np.diff(desk.recording(COMMON, law)["torque"], axis=0)).max()) for law in LAWS[:2]}
    return Finding(steps["lyapunov"] < 0.02 * steps["sliding"], "largest change per call: " + _listed(steps, "N m"))


def alternates(desk: Desk, of: Mapping[str, Sequence[str]], quantity: str) -> Finding:
    """Return whether every component of the torque, or of the increments of the rate, changes sign at nearly every call in
    the last 150 s. of: file and law by the names of cases."""
    shares: dict[str, float] = {}
    for name, (file, law) in of.items():
        run = desk.recording(file, law)
        values = np.asarray(run[quantity])[-1500:]
        signs = np.sign(np.diff(values, axis=0) if quantity == "rate" else values)
        shares[name] = float((np.diff(signs, axis=0) != 0).mean(axis=0).min())
    return Finding({name: share >= 0.95 for name, share in shares.items()}, "share of calls: " + _listed(shares))


def worse_with_noise(desk: Desk) -> Finding:
    """Return whether each law ends further from the target with noise than without, after flights of equal length."""
    pairs = {
        law: (_final(desk, COMMON, law, {"simulation.duration": 600.0}), _final(desk, f"{COMMON}-noise", law))
        for law in LAWS
    }
    note = "; ".join(f"{law} {calm:.2g} and {noisy:.2g} rad" for law, (calm, noisy) in pairs.items())
    return Finding({law: noisy > calm for law, (calm, noisy) in pairs.items()}, note)


def pattern(desk: Desk, files: Mapping[str, str], least: float) -> Finding:
    """Return whether the torque with noise follows that without, by the correlation of means over 5 s in the first 200 s,
    the least over the laws, for each interpretation of the noise."""

    def means(file: str, law: str) -> Array:
        return np.asarray(desk.recording(file, law)["torque"])[:2000].reshape(40, 50, 3).mean(axis=1).ravel()

    correlations = {
        name: {law: float(np.corrcoef(means(COMMON, law), means(file, law))[0, 1]) for law in LAWS}
        for name, file in files.items()
    }
    note = "; ".join(f"{name}: {_listed(of)}" for name, of in correlations.items())
    return Finding({name: min(of.values()) >= least for name, of in correlations.items()}, note)


def sooner(desk: Desk, of: Sequence[Mapping[str, Any]], factor: float = 1.0) -> Finding:
    """Return for each case whether the first flight stays within an accuracy after fewer steps than `factor` times those of
    the second; a flight that never does counts as slower. A case has a name, a metric, and two flights (file, law, changes
    if any)."""
    verdicts: dict[str, bool] = {}
    notes: list[str] = []
    for one in of:
        first, second = (
            desk.flight(file, law, *changes).metrics[one["metric"]] for file, law, *changes in (one["first"], one["second"])
        )
        verdicts[one["name"]] = first is not None and (second is None or first < factor * second)
        notes.append(f"{one['name']}: {_count(first)}, {_count(second)}")
    return Finding(verdicts, "; ".join(notes))


def _count(steps: Any) -> str:
    return "never" if steps is None else str(int(steps))


def least_accurate(desk: Desk, of: Sequence[Mapping[str, Any]], law: str) -> Finding:
    """Return for each case whether a law ends further from the target than both others; a case has a name, and the file and
    the name of every law."""
    verdicts: dict[str, bool] = {}
    notes: list[str] = []
    for one in of:
        ends = {name: _final(desk, *flight) for name, flight in one["flights"].items()}
        verdicts[one["name"]] = max(ends, key=lambda name: ends[name]) == law
        notes.append(f"{one['name']}: {_listed(ends, 'rad')}")
    return Finding(verdicts, "; ".join(notes))


def same_after(desk: Desk, law: str, bound: float, short: float) -> Finding:
    """Return whether the step after which the error stays within a bound is the same in a flight cut off at `short` (s)."""
    _, error = _deviation(desk, COMMON, law)
    cut, whole = stays_within(error[: int(10.0 * short) + 1], bound), stays_within(error, bound)
    return Finding(cut == whole, f"{_count(cut)} after {short:.0f} s, {_count(whole)} in the end")


def _deviation(desk: Desk, file: str, law: str, until: float = np.inf) -> tuple[Array, Array]:
    """Return the times of a flight and |q| at these."""
    time, error = samples(desk, file, law, "attitude_error", until)
    return time, np.linalg.norm(error[:, 1:], axis=1)


def quotients(desk: Desk, totals: Sequence[float], calls: int) -> Finding:
    """Return the totals divided by the number of calls."""
    return Finding([total / calls for total in totals])


# Figures


def plans(desk: Desk, file: str, law: str, instants: Sequence[int], until: float) -> Figure:
    """Return a figure of the attitudes that predictive control predicts at some control instants and the torques that it
    plans, with the flown ones."""
    from starhold.laws.mpc import program
    from starhold.laws.predictive.problem import carve

    loop = desk.loop(file, law)
    time, torque = samples(desk, file, law, "torque", until)
    states = [Curve(time, samples(desk, file, law, "attitude_error", until)[1][:, 1], "flown")]
    moves = [Curve(time, 1e3 * torque[:, 0], "flown", "steps")]
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
    desk: Desk,
    file: str,
    law: str,
    quantity: str,
    label: str,
    names: Sequence[str],
    detail: Sequence[float],
    scale: float = 1.0,
) -> Figure:
    """Return a figure with a panel per component of a recorded quantity, up to the later of two instants (s), and below each
    its detail between them."""
    run = desk.recording(file, law)
    time, values = run["time"], scale * np.asarray(run[quantity])
    first, last = detail
    whole, part = time <= last, (time >= first) & (time <= last)
    style: Any = "steps" if quantity == "torque" else "line"
    above = [Panel("time, s", label, [Curve(time[whole], values[whole, k])], name) for k, name in enumerate(names)]
    below = [
        Panel(f"time after {first:g} s, s", label, [Curve(time[part] - first, values[part, k], "", style)]) for k in range(3)
    ]
    return Figure([*above, *below], columns=3)


def fall(desk: Desk, of: Mapping[str, Sequence[str]], until: float, levels: Sequence[float] = ()) -> Figure:
    """Return a figure of |q| over time for several flights, given by name as file and law."""
    flown = {name: _deviation(desk, file, law, until) for name, (file, law) in of.items()}
    curves = [Curve(time, np.maximum(error, 1e-9), name) for name, (time, error) in flown.items()]
    return Figure([Panel("time, s", "|q|", curves, log_y=True, levels=levels)])


def by_gain(desk: Desk, least: float, most: float, count: int, limits: Mapping[str, str]) -> Figure:
    """Return a figure of the steps that the sliding law takes, and of its final error, over its switching torque."""
    from starhold.studies.sweep import sweep

    values = np.geomspace(least, most, count)
    table = sweep(desk.scenario(COMMON), {"law.sliding.switching_gain": values}, "sliding")

    def over_gain(name: str, label: str, hue: int | None = None) -> Curve:
        gain, column = (table[key].to_numpy(dtype=float) for key in ("law.sliding.switching_gain", name))
        return Curve(1e3 * gain, column, label, "points", hue)

    curves = [over_gain(f"iterations_1e-{k}", f"to 10^-{k}", k - 1) for k in (1, 2, 3, 4)]
    ends = [over_gain("final_attitude_error", "sliding")]
    levels = [_final(desk, COMMON, law) for law in limits.values()]
    notes = [(3.0 * ends[0].x[0], 2.2 * level, name) for level, name in zip(levels, limits, strict=True)]
    drawn: dict[str, Any] = {"x_span": (0.9e3 * least, 1.1e3 * most), "log_x": True, "log_y": True}
    label, up = "switching torque g, mN m", "largest angle in the last quarter, rad"
    steps, angle = Panel(label, "steps to stay within", curves, **drawn), Panel(label, up, ends, **drawn)
    return Figure([steps, replace(angle, levels=levels, notes=notes)], columns=2)


def by_period(desk: Desk, periods: Sequence[float], duration: float) -> Figure:
    """Return a figure of the final error of each law after a flight of this duration (s), over the control period."""
    curves: list[Curve] = []
    for law in LAWS:
        flights = [{"simulation.duration": duration, "simulation.control_period": h} for h in periods]
        ends, hue = [_final(desk, COMMON, law, changes) for changes in flights], len(curves) // 2
        curves += [Curve(periods, ends, law, "line", hue), Curve(periods, ends, "", "points", hue)]
    return Figure([Panel("control period, s", "largest angle in the last quarter, rad", curves, log_x=True, log_y=True)])


def noise_figure(desk: Desk, files: Mapping[str, str]) -> Figure:
    """Return a figure of |q| over time for each law, with a panel per interpretation of the noise."""
    lines = {name: [Curve(*_deviation(desk, file, law), law) for law in LAWS] for name, file in files.items()}
    drawn = [Panel("time, s", "|q|", curves, name, y_span=(1e-4, 1.5), log_y=True) for name, curves in lines.items()]
    return Figure(drawn, columns=3)
