"""Campaigns for the tests of their reports: made from random numbers, judged and searched for drivers as flown ones are."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from starhold.campaign.drivers import find_drivers
from starhold.campaign.envelopes import Envelope
from starhold.campaign.results import Again, Bracket, CampaignResult, LawResult, Spread
from starhold.campaign.sensitivity import Morris, Refused, Sobol
from starhold.campaign.summary import spreads_of
from starhold.campaign.verdicts import judge
from starhold.studies.requirements import Requirement

UNITS = {
    "settling_time": "s",
    "final_attitude_error": "rad",
    "peak_rate": "rad/s",
    "effort": "N m s",
    "limit_share": "1",
    "attitude_settling_time": "s",
}
OVER = {
    "initial.attitude": "uniform on all rotations",
    "initial.rate": "shell from 0.02 rad/s to 0.07 rad/s",
    "spacecraft.inertia": "normal, sigma 5 % of the file's value, known before flight",
    "law.lyapunov.k_rate": "uniform from 0.08 N m s to 0.1 N m s",
    "sensor.rate_noise": "log-normal, median 0.0001 rad/s, sigma 0.5",
    "spacecraft.limit": "axis (75 %), norm (25 %)",
}


ASKED = (
    Requirement(
        "pointing", "final_attitude_error", "final_attitude_error", "rad", float(np.radians(0.1)), True, 0.9973, 0.9
    ),
    Requirement("settling", "settling_time", "settling_time", "s", 420.0, True, 0.95, 0.9),
    Requirement("not lost", "lost", "lost", "1", np.nan, True, 0.9973, 0.9),
)


def inputs(runs: int) -> dict[str, Any]:
    """Draw what runs differ in; the same for all laws."""
    rng = np.random.default_rng(1)
    rate = rng.normal(size=(runs, 3))
    rate *= rng.uniform(0.02, 0.07, runs)[:, None] / np.linalg.norm(rate, axis=1, keepdims=True)
    return {
        **{f"initial.rate[{k + 1}]": rate[:, k] for k in range(3)},
        **{f"spacecraft.inertia[{k}][{k}]": 10.0 + k + rng.normal(0.0, 0.5, runs) for k in (1, 2, 3)},
        "sensor.rate_noise": 1e-4 * np.exp(0.5 * rng.normal(size=runs)),
        "law.lyapunov.k_rate": rng.uniform(0.08, 0.1, runs),
        "spacecraft.limit": np.where(rng.random(runs) < 0.75, "axis", "norm"),
    }


def _metrics(runs: int, number: int) -> dict[str, Any]:
    """Metrics of a law, which the draws make; some runs of the second law are lost."""
    drawn, rng = inputs(runs), np.random.default_rng(10 + number)
    speed = np.linalg.norm([drawn[f"initial.rate[{k}]"] for k in (1, 2, 3)], axis=0)
    heavy, noisy = drawn["spacecraft.inertia[3][3]"] / 13.0, drawn["sensor.rate_noise"] / 1e-4
    settling = (150.0 + 2500.0 * speed * heavy) * np.exp(0.08 * rng.normal(size=runs)) * (1.0 + 0.15 * number)
    error = 2e-4 * noisy**0.8 * np.exp(0.3 * rng.normal(size=runs))
    # Fast and heavy together are too much for the second law.
    both = number * (speed > 0.06) * (heavy > 1.04) * (rng.random(runs) < 0.2)
    error = np.where(both, 0.02 * np.exp(rng.normal(size=runs)), error)
    lost = (both > 0) & (rng.random(runs) < 0.3)
    found = {
        "settling_time": np.where(settling < 540.0, settling, np.nan),
        "final_attitude_error": error,
        "peak_rate": speed * (1.0 + 0.2 * rng.random(runs)),
        "effort": 0.8 * speed * heavy * 13.0,
        "limit_share": np.clip(rng.normal(0.05, 0.05, runs), 0.0, 1.0),
        "attitude_settling_time": 0.9 * settling,
    }
    found = {name: np.where(lost, np.nan, values) for name, values in found.items()}
    return found | {"lost_at": np.where(lost, 300.0 * rng.random(runs), np.nan)}


def spread(metric: str, values: Any) -> Spread:
    """The distribution of a metric's values."""
    return spreads_of(metric, UNITS[metric], [values])[0]


def _envelopes(number: int) -> tuple[Envelope, ...]:
    times = np.linspace(10.0, 600.0, 60)
    rng = np.random.default_rng(20 + number)
    slow = 55.0 * (1.0 + 0.3 * number)
    angle = np.pi * np.exp(-times / slow)[:, None] * np.exp(0.5 * rng.normal(size=400)) + 2e-4
    torque = np.minimum(0.02, 0.03 * np.exp(-times / slow)[:, None] * np.exp(0.6 * rng.normal(size=400)))
    kinds = {
        "attitude_error": ("rad", "angle to the target", np.minimum(angle, np.pi)),
        "rate_error": ("rad/s", "rate relative to the target", 0.02 * angle),
        "torque": ("N m", "norm of the torque applied", torque),
    }
    return tuple(
        Envelope(name, unit, meaning, times, *np.quantile(values, (0.0, 0.05, 0.5, 0.95, 1.0), axis=1))
        for name, (unit, meaning, values) in kinds.items()
    )


def law(name: str, number: int, runs: int, sampling: str = "random") -> LawResult:
    """What a campaign of a law comes to."""
    metrics, drawn = _metrics(runs, number), inputs(runs)
    lost = ~np.isnan(metrics.pop("lost_at"))
    margins = {
        item.name: np.where(lost, -np.inf, 1.0) if item.column == "lost" else item.bound - metrics[item.column]
        for item in ASKED
    }
    failed = np.any([~(values >= 0.0) for values in margins.values()], axis=0)
    known = {"spacecraft.inertia[3][3]": drawn["spacecraft.inertia[3][3]"]}
    verdicts = tuple(
        judge(item.name, margins[item.name], item.share, 0.9, known, independent=sampling == "random") for item in ASKED
    )
    worst = [verdict.worst_run for verdict in verdicts]
    again = tuple(
        Again(run, why, f"starhold rerun results/detumbling {run} --law {name}")
        for run, why in zip(
            [*worst, *np.flatnonzero(lost)[:6].tolist()],
            ["worst of pointing", "worst of settling", "lost first"] + ["lost"] * 6,
            strict=False,
        )
    )
    brackets = (
        Bracket(
            "peak_rate",
            "rad/s",
            0.0912,
            f"results/detumbling/worst/{name}-peak-rate.toml",
            640,
            0.11,
            "no disturbance, exact sensors",
        ),
        Bracket("final_attitude_error", "rad", 0.0021, f"results/detumbling/worst/{name}-pointing.toml", 640, None, ""),
    )
    drivers = find_drivers(drawn, failed, metrics)
    return LawResult(
        name,
        runs,
        int(lost.sum()),
        int(failed.sum()),
        tuple(spread(*item) for item in metrics.items()),
        _envelopes(number),
        verdicts,
        drivers,
        {},
        again,
        brackets,
    )


@cache
def result(runs: int = 3000, sampling: str = "random", names: tuple[str, ...] = ("lyapunov", "pd")) -> CampaignResult:
    """A campaign of some laws."""
    laws = tuple(law(name, number, runs, sampling) for number, name in enumerate(names))
    return CampaignResult(
        "detumbling", Path("results/detumbling"), runs, sampling, OVER, laws, "5f" * 32, 12.5, 2 * runs, ASKED
    )


def indices() -> dict[str, Any]:
    """Sensitivity indices of every kind."""
    names = ("initial.rate[1]", "sensor.rate_noise", "law.lyapunov.k_rate")
    wide = np.array([0.01, 0.02, 0.005])
    return {
        "settling_time": Morris(
            names,
            np.array([40.0, -3.0, 1.0]),
            np.array([44.0, 6.0, 1.5]),
            100.0 * wide,
            np.array([12.0, 5.0, 0.4]),
            40,
            3,
        ),
        "final_attitude_error": Sobol(names, np.array([0.1, 0.7, 0.02]), wide, np.array([0.15, 0.85, 0.03]), wide),
        "effort": Refused("3 runs have no value, and Sobol's estimators need all 640"),
    }
