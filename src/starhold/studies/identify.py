"""Fits numbers of a scenario to telemetry, by weighted least squares with Gauss-Newton steps over multiple shooting.

The flight is divided into segments that begin where readings determine the state, so that a poor initial guess does no harm;
the gaps between segments close as the iteration proceeds (H. G. Bock's condensing: the columns of the Jacobian are
propagated through the nodes, with one more column for the gaps). Weights are the noise that sensors state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import multiply
from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.scenario.checking import nearest
from starhold.scenario.reading import LawEntry, Scenario
from starhold.studies.fitting import START, Array, Free, Nodes, Prediction, Predictor, Reading
from starhold.studies.observable import UNDETERMINED, Posterior, posterior_of
from starhold.studies.residuals import Weighed, ljung_box, noise_of
from starhold.studies.telemetry import Telemetry, read

COMMANDS = {
    "recorded": "The recorded commands act on the plant, each held until the next.",
    "law": "The scenario's own law flies on noise-free readings; motion caused by noise through the law is neglected.",
    "none": "No command acts: the craft tumbles freely.",
}
SPAN, SEGMENTS = 0.5, 500
"""The approximate angle (rad) by which the craft turns in a segment of the flight, and the most segments."""
STEPS = 40
NEAR = 2.0
"""The distance in control periods below which a reading is used for the state at an instant."""
TURN = 0.5
"""The largest turn of the initial attitude in a step (rad)."""
CLOSED = 1.0
"""Gaps count as closed if they change residuals by less than this, in standard deviations of their noise."""
SETTLED = 1e-6
"""The iteration has converged once the predicted decrease of the sum of squares is smaller than this."""
RELAXED = 0.1
"""The factor by which each step over the whole flight reduces the damping."""
HALVINGS = 12


@dataclass(frozen=True)
class Identified:
    """The result of a fit. values: those of the free numbers; start: attitude and rate (7,) at time 0; posterior: their
    covariance and the undetermined combinations; residuals: times and residuals (n, size) in standard deviations, by
    reading; readings: the measured rows and the fitted ones; whiteness: the p-value of Ljung and Box, by residual; chi2: the
    sum of squared residuals, with its degrees of freedom; units: those of the readings; notes: sentences about omissions."""

    scenario: Scenario
    free: Free
    values: Array
    start: Array
    posterior: Posterior
    residuals: Mapping[str, tuple[Array, Array]]
    readings: Mapping[str, tuple[Array, Array]]
    whiteness: Mapping[str, float]
    chi2: float
    degrees: int
    iterations: int
    settled: bool
    telemetry: str
    commands: str
    units: Mapping[str, str]
    notes: tuple[str, ...]

    @property
    def consistent(self) -> float:
        """The probability of a chi-squared statistic at least as large as this one, if the noise is as stated."""
        return float(stats.chi2.sf(self.chi2, self.degrees))

    @property
    def white(self) -> bool:
        """Whether no residual is correlated in time, at a significance level of 1 % for all of them together."""
        return min(self.whiteness.values()) * len(self.whiteness) >= 0.01

    def summary(self) -> dict[str, Any]:
        """Return all numbers of the fit, for summary.json."""
        posterior, names = self.posterior, self.free.names
        return {
            "estimates": dict(zip(names, self.values.tolist(), strict=True)),
            "deviations": dict(zip(names, posterior.deviations.tolist(), strict=True)),
            "correlations": posterior.correlations.tolist(),
            "start": self.start.tolist(),
            "singular_values": posterior.singular.tolist(),
            "not_told": list(posterior.sentences),
            "chi2": self.chi2,
            "degrees_of_freedom": self.degrees,
            "probability": self.consistent,
            "ljung_box": dict(self.whiteness),
            "settled": self.settled,
        }

    def fitted(self) -> dict[str, Any]:
        """Return the fitted values by key, as a change of the scenario."""
        shaped = self.free.shaped(self.values.tolist())
        return {place.key: np.array(value).tolist() for place, value in zip(self.free.places, shaped, strict=True)}

    def learnt(self) -> Scenario:
        """Return the scenario with the estimated numbers and a campaign over their remaining uncertainty."""
        changed = self.scenario.with_(self.fitted())
        return self.posterior.over(changed, self.free, self.values)


def study(
    scenario: Scenario, entry: LawEntry, source: Any, mapping: Any = None, free: Any = None, commands: Any = None
) -> Identified:
    """Fit the numbers at some keys, and the initial state, to the telemetry in a file, a run's folder or a Dataset.

    mapping: see `telemetry.read`; free: the keys, as a list or separated by commas; commands: "recorded", "law" or "none",
    by default the recorded ones if any, else the law's. Returns the result of the fit. InputError for keys that cannot be
    fitted, sensors without telemetry or without stated noise, and fewer data than free numbers."""
    keys = [key.strip() for key in free.split(",")] if isinstance(free, str) else list(free or ())
    if not any(keys):
        raise InputError(scenario.where, "--free", "nothing", 'keys separated by commas, such as "spacecraft.inertia"')
    telemetry = read(scenario, build(scenario, entry), source, mapping)
    kinds = [kind for kind in COMMANDS if kind != "recorded" or "command" in telemetry.columns]
    kind = kinds[0] if commands is None else commands
    if kind not in kinds:
        raise InputError(scenario.where, "--commands", str(kind), nearest(str(kind), kinds))
    predictor = Predictor(scenario, entry, Free.of(scenario, keys), kind != "law")
    return Fit(scenario, predictor, telemetry, kind).solved()


class Fit:
    """Telemetry with the predictor of a scenario. One predictor serves any number of flights."""

    def __init__(self, scenario: Scenario, predictor: Predictor, telemetry: Telemetry, kind: str = "recorded") -> None:
        """kind: the kind of commands, see COMMANDS."""
        self.scenario, self.predictor, self.telemetry, self.kind = scenario, predictor, telemetry, kind
        self.period = predictor.loop.period
        self.notes = tuple[str, ...]()
        # The damping lets a number change by about the size of its key; the start and keys that are 0 have none.
        sizes = np.concatenate([np.zeros(len(START)), predictor.free.sizes])
        self._damping = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
        times = telemetry.times
        if not len(times) or times[0] < 0.0:
            given = f"{telemetry.name} begins at {times[0]:g} s" if len(times) else f"{telemetry.name} is empty"
            raise InputError(scenario.where, "", given, "samples from the start of the scenario, time 0, on")
        # Times that differ from a control instant only by rounding are moved to it.
        places = times / self.period
        whole = np.round(places)
        places = np.where(np.abs(places - whole) < 1e-6, whole, places)
        self.steps = max(1, int(np.ceil(places[-1])))
        self.commands = self._held(places)
        self.weighed = [self._weighed(reading, places) for reading in predictor.readings]
        count, free = sum(int(np.size(one.rows)) for one in self.weighed), predictor.count
        if count < free:
            raise InputError(scenario.where, "--free", f"{free} free numbers with the start", f"at most the {count} data")

    def _held(self, places: Array) -> Array:
        """Return the command at each instant: the last recorded one, zero before the first."""
        commands = np.zeros((self.steps + 1, 3))
        given = self.telemetry.columns.get("command") if self.kind == "recorded" else None
        if given is not None:
            known = np.isfinite(given).all(axis=1)
            latest = np.searchsorted(places[known], np.arange(self.steps + 1), side="right") - 1
            commands[latest >= 0] = given[known][latest[latest >= 0]]
        return commands

    def _weighed(self, reading: Reading, places: Array) -> Weighed:
        columns = self.telemetry.columns
        if reading.name not in columns:
            given = f"{self.telemetry.name} without {reading.name}"
            raise InputError(self.scenario.where, "", given, "telemetry of every sensor of the scenario, or one without it")
        good = np.isfinite(columns[reading.name]).all(axis=1)
        for gate, _ in reading.gates:
            good &= columns[gate][:, 0] > 0.5 if gate in columns else True
        noise = noise_of(self.predictor.loop, reading)
        if noise is None:
            allowed = "a sensor that states its noise, because readings are weighted by it"
            raise InputError(self.scenario.where, reading.name, "no noise", allowed)
        if noise.accumulates:
            self.notes += (f"Accumulating noise of {reading.name}, such as a bias random walk, is neglected.",)
        return Weighed.of(reading, columns[reading.name][good], places[good], self.steps, noise)

    def residuals(self, given: Prediction) -> tuple[Array, Array]:
        """Return all residuals (n,) in standard deviations, and their slopes (n, free + 1)."""
        every = [one.residuals(given) for one in self.weighed]
        slopes = [by.reshape(-1, by.shape[-1]) for _, by in every]
        return np.concatenate([values.ravel() for values, _ in every]), np.concatenate(slopes)

    def _read(self, name: str) -> tuple[Array, Array]:
        """Return the instants and rows of a reading of a state component, such as the rate; empty without one."""
        those = [one for one in self.weighed if one.reading.name.endswith(f"_{name}") and len(one.rows)]
        return (those[0].times, those[0].rows) if those else (np.empty(0), np.empty(0))

    def _begun(self) -> tuple[Array, list[int], Nodes]:
        """Return the initial guess: the parameters, the steps at which segments begin, and their initial states."""
        start, attitude, rate = self.predictor.loop.start, self._read("attitude"), self._read("rate")
        fastest = max(np.linalg.norm(rate[1].reshape(-1, 3), axis=1), default=0.0)
        length = max(1, -(-self.steps // SEGMENTS), int(SPAN / max(1e-9, fastest * self.period)))
        cuts = [*range(length, self.steps, length)] if len(rate[0]) or len(attitude[0]) else []

        def read(place: int, end: Array) -> Array:
            begun = end.copy()
            for part, (places, rows) in ((slice(0, 4), attitude), (slice(4, 7), rate)):
                near = int(np.argmin(np.abs(places - place))) if len(places) else -1
                if near >= 0 and abs(places[near] - place) < NEAR:
                    begun[part] = rows[near]
            begun[:4] *= np.sign(begun[:4] @ end[:4]) or 1.0
            return begun

        def node(number: int, end: Array) -> Array:
            return read(cuts[number], end)

        first = read(0, np.array([*start.attitude, *start.rate]))
        guesses = [(1.0, 0.0, 0.0, 0.0)]
        if not (len(attitude[0]) and attitude[0][0] < NEAR):
            guesses = [tuple(turn) for turn in Rotation.create_group("O").as_quat(scalar_first=True).tolist()]
        every = [self.predictor.begun(multiply(tuple(first[:4].tolist()), turn), first[4:]) for turn in guesses]
        x = min(every, key=lambda guess: self._cost(guess, cuts, node)) if len(every) > 1 else every[0]
        return x, cuts, node

    def _cost(self, x: Array, cuts: Sequence[int], node: Any) -> float:
        values = self.residuals(self.predictor(x, self.steps, self.commands, cuts, node))[0]
        return float(values @ values) if np.isfinite(values).all() else np.inf

    def solved(self) -> Identified:
        """Fit the free numbers and return the result."""
        return self.identified(*self.descended(self._closed(*self._begun())))

    def _closed(self, x: Array, cuts: Sequence[int], node: Nodes) -> Array:
        """Return the parameters once the gaps between segments are closed, or nearly so."""
        nodes = node
        for _ in range(STEPS if cuts else 0):
            given = self.predictor(x, self.steps, self.commands, cuts, nodes)
            values, slopes = self.residuals(given)
            if float(np.abs(slopes[:, -1]).max()) < CLOSED:
                break
            step, part = self._step(values + slopes[:, -1], slopes, 1.0)
            starts = given.starts + part * (given.of_starts @ np.append(step, 1.0))
            starts[:, :4] /= np.linalg.norm(starts[:, :4], axis=1)[:, None]
            x, nodes = self.predictor.moved(x, part * step), lambda n, _, s=starts: s[n]
        return x

    def descended(self, x: Array) -> tuple[Array, Prediction, int, bool]:
        """Return the parameters of the least-squares solution reached from x, the flight there, the number of steps, and
        whether the iteration has converged."""
        given, settled, number = self._whole(x), False, 0
        for number in range(1, STEPS + 1):
            values, slopes = self.residuals(given)
            step, part = self._step(values, slopes, RELAXED**number)
            lowered = values @ values - float(((values + slopes[:, :-1] @ step) ** 2).sum())
            if lowered < SETTLED and settled:
                break
            if lowered < SETTLED:
                # Once more, with undetermined combinations as close to the file's numbers as possible.
                settled, x = True, self._restored(x, slopes[:, :-1])
                given = self._whole(x)
                continue
            for _ in range(HALVINGS):
                other = self._whole(self.predictor.moved(x, part * step))
                now = self.residuals(other)[0]
                if now @ now < values @ values:
                    break
                part *= 0.5
            else:
                break
            x, given = self.predictor.moved(x, part * step), other
        return x, given, number, settled

    def _step(self, values: Array, slopes: Array, relaxed: float) -> tuple[Array, float]:
        """Return a Gauss-Newton step (free,) and the fraction of it to take. The step is damped, so that weakly observable
        directions do not run away while residuals are large, and is 0 along unobservable ones."""
        if not np.isfinite(slopes).all():
            raise InputError(self.scenario.where, "", "", "the flight diverges with the numbers of the file")
        damping = self._damping * relaxed * np.sqrt(values @ values / len(values))
        # Reduced to as many rows as there are numbers, with the same sum of squares.
        few: Any = np.linalg.qr(np.column_stack([slopes[:, :-1], values]), mode="r")
        rows = np.vstack([few[:, :-1], np.diag(damping)])
        sizes = np.linalg.norm(rows, axis=0)
        sizes[sizes == 0.0] = 1.0
        step = np.linalg.lstsq(rows / sizes, -np.append(few[:, -1], np.zeros(len(damping))), rcond=UNDETERMINED)[0] / sizes
        return step, min(1.0, TURN / max(1e-300, float(np.abs(step[:3]).max())))

    def _restored(self, x: Array, slopes: Array) -> Array:
        """Return the parameters moved along unobservable directions to be as close as possible to the file's numbers."""
        free, now = self.predictor.free, x[len(START) : -4]
        sizes = np.where(free.sizes > 0.0, free.sizes, 1.0)
        undetermined, off = posterior_of(slopes, free, now).undetermined / sizes, (now - free.values) / sizes
        back = undetermined.T @ np.linalg.lstsq(undetermined.T, off)[0] if len(undetermined) else 0.0 * off
        return np.concatenate([x[: len(START)], now - back * sizes, x[-4:]])

    def _whole(self, x: Array) -> Prediction:
        return self.predictor(x, self.steps, self.commands)

    def identified(self, x: Array, given: Prediction, number: int, settled: bool) -> Identified:
        """Return the result of a fit that has ended at these parameters."""
        values, slopes = self.residuals(given)
        free = self.predictor.free
        posterior = posterior_of(slopes[:, :-1], free, x[len(START) : -4])
        residuals, readings, white = dict[str, tuple[Array, Array]](), dict[str, tuple[Array, Array]](), dict[str, float]()
        degrees = 0
        for one in self.weighed:
            times = one.times * self.period
            errors = one.residuals(given)[0]
            residuals[one.reading.name] = times, errors
            readings[one.reading.name] = one.rows, one.at(given.values[:, one.reading.rows])
            degrees += one.degrees * len(errors)
            white |= {f"{one.reading.name}[{k + 1}]": ljung_box(errors[:, k]) for k in range(errors.shape[1])}
        start = np.array([*x[-4:], *x[3:6]])
        chi2 = float(values @ values)
        return Identified(
            self.scenario, free, x[len(START) : -4], start, posterior, residuals, readings, white, chi2,
            max(1, degrees - posterior.rank), number, settled, self.telemetry.name, self.kind,
            {one.reading.name: self.telemetry.known[one.reading.name].unit for one in self.weighed}, self.notes,
        )  # fmt: skip
