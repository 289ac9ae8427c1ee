"""A small campaign to fly, and to fly again."""

import math

import numpy as np

import starhold as sh
from starhold.campaign.dispersions import read_dispersions
from starhold.scenario.campaign import CampaignTable
from starhold.scenario.checking import validate
from starhold.scenario.making import plain
from starhold.studies.body import study_of
from starhold.studies.compare import build, record

SMALL = {
    "name": "small",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": 0.3},
    "initial": {"attitude": [0.9, 0.1, -0.3, 0.2], "rate": [0.01, 0.0, -0.02]},
    "sensor": {"rate_noise": 1e-4},
    "environment": {"torque_noise": 1e-4},
    "simulation": {"duration": 40.0, "control_period": 0.2, "seed": 7, "record_every": 1},
    "settling": {"attitude_tolerance": 0.05, "rate_tolerance": 0.02},
    "law": [{"type": "pd", "k_rate": 2.0, "k_attitude": 0.8}, {"type": "lyapunov", "k_rate": 1.6, "k_attitude": 0.7}],
}
OVER = {
    "initial.attitude": {"distribution": "rotations"},
    "initial.rate": {"distribution": "shell", "low": "0.5 deg/s", "high": "4 deg/s"},
    "spacecraft.inertia": {"distribution": "normal", "sigma": "3 %", "relative": True, "judged_apart": True},
    "sensor.rate_noise": {"distribution": "log-normal", "sigma": 0.4},
    "law.pd.k_rate": {"distribution": "uniform", "low": 1.5, "high": 2.5},
}
ASKED = [
    {"metric": "settling_time", "at_most": "30 s", "share": 0.9, "confidence": 0.9},
    {"id": "pointing", "metric": "final_attitude_error", "at_most": "0.5 deg", "share": "90 %"},
    {"id": "kept", "metric": "lost"},
    {"id": "sun", "metric": "exclusion-cone", "axis": [0, 0, 1], "direction": [0, 1, 0], "at_least": "1 deg", "share": 0.9},
]


def small(**changes):
    """The small scenario, with other entries at some keys, dots as underscores doubled."""
    scenario = sh.scenario(SMALL)
    return scenario.with_({key.replace("__", "."): value for key, value in changes.items()}) if changes else scenario


def short(duration=4.0, laws=SMALL["law"][:1], folder=".", **tables):
    """Few seconds of one law, or of these."""
    simulation = SMALL["simulation"] | {"duration": duration}
    return sh.scenario(SMALL | {"simulation": simulation, "law": [*laws]} | tables, folder=folder)


def normal(sigma, **more):
    """A table of dispersions."""
    return {"distribution": "normal", "sigma": sigma, **more}


def uniform(low, high, **more):
    """Another one."""
    return {"distribution": "uniform", "low": low, "high": high, **more}


def fly(folder=None, **options):
    """A small campaign, by one thread and without search unless more is said."""
    asked = {"runs": 90, "over": OVER, "requirement": ASKED, "threads": 1, "search": False} | options
    return sh.campaign(asked.pop("scenario", None) or small(), folder, **asked)


def own_flight(found, run, law):
    """The scenario of a run, its row and its recording by itself, whose metrics the row has."""
    flown, frame = found.again(run, law), found.frame()
    assert flown.differs == ()
    own, recording = flown.scenario, flown.flight.recording
    if own.table.simulation.record_every != 1:
        own = own.with_({"simulation.record_every": 1})
        recording = record(own, build(own, own.pick(law)))
    row = frame[(frame.law == law) & (frame.run == run)].iloc[0]
    metrics = study_of(own.body).metrics_of(recording)
    shared = set(metrics) & set(frame.columns)
    assert len(shared) > 3
    for name in shared:
        value = math.nan if metrics[name] is None else metrics[name]
        np.testing.assert_allclose(row[name], value, rtol=1e-12, atol=1e-15, err_msg=name)
    return own, row, recording


def dispersed(scenario, over):
    """The dispersions of raw tables."""
    tables = plain(over, scenario.where, "campaign.over")
    return read_dispersions(scenario, validate(CampaignTable, {"over": tables}, scenario.where, "campaign").over)


def same(a, b):
    """Whether two values are the same number, or both none."""
    return a == b or (math.isnan(a) and math.isnan(b))
