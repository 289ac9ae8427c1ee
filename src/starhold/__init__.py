# ruff: noqa: F403, F405
"""starhold designs, certifies, flies and compares control laws for spacecraft.

import starhold as sh

scenario = sh.load("three-laws")                 # or sh.scenario({...}), and scenario.with_({"law.lyapunov.k_rate": 0.1})
run = sh.simulate(scenario, law="lyapunov")      # an xarray Dataset
flight = sh.stepper(scenario)                    # a control period at a call: readings = flight.step(command)
flights = sh.compare(scenario)                   # runs and metrics of every law
numbers = sh.metrics(run)                        # settling time, overshoot, effort and all the others, in SI
result = sh.campaign(scenario, runs=10_000, over={"initial.attitude": {"distribution": "rotations"}})    # and verdicts
table = sh.sweep(scenario, {"law.lyapunov.k_rate": gains})    # a DataFrame, a row for each flight
frame = sh.to_pandas(flights)                    # runs, flights, certificates and designs as tidy tables
certificates = sh.certify(scenario)              # what is proved of every law
designs = sh.design("my.toml")                   # gains that formulas give, and figures to judge them by
exported = sh.export_c(scenario, "flight")       # a law as C99, with a self-test that demands the simulation's bits
linear = sh.linearise(scenario, "lyapunov")       # the loop near rest as systems of python-control; sh.margins tells margins
path = sh.export_aem(run, "run.aem")              # attitudes as a CCSDS message; sh.export_oem the orbit
certificate = sh.invariant("van-der-pol")        # what is proved of an invariant set of any small system
made = sh.reproduce("D")                         # a publication's figures and numbers, beside what it prints
told = sh.budget("cubesat-slew")                 # the pointing error by source, over the windows of ECSS
placed = sh.place(A, B, poles)                   # u = -K x that gives A - B K these poles, for any linear system
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from starhold.version import __version__

if TYPE_CHECKING:
    # The functions below, for those who read types.
    from starhold.api import *
    from starhold.api import make_scenario as scenario
    from starhold.errors import InputError

__all__ = [
    "InputError",
    "__version__",
    "budget",
    "campaign",
    "certify",
    "compare",
    "design",
    "environment",
    "export_aem",
    "export_c",
    "export_oem",
    "export_requirements",
    "failures",
    "invariant",
    "linearise",
    "load",
    "margins",
    "metrics",
    "modal_roots",
    "place",
    "read_aem",
    "read_oem",
    "reproduce",
    "review",
    "scenario",
    "serve",
    "simulate",
    "stepper",
    "steppers",
    "sweep",
    "to_pandas",
    "verify",
]


def __getattr__(name: str) -> Any:
    # Loaded on first use, so that `import starhold` and the command line start at once.
    from functools import partial
    from importlib import import_module

    if name == "InputError":
        return import_module("starhold.errors").InputError
    if name in ("scenario", "campaign"):
        # The package of that name, which can be called.
        return import_module(f"starhold.{name}")
    if name in __all__:
        return getattr(import_module("starhold.api"), name)
    if (command := name.replace("_", "-")) in import_module("starhold.report.commands").names():
        # One that has no types of its own.
        return partial(import_module("starhold.api").studied, command)
    raise AttributeError(f"module 'starhold' has no attribute {name!r}")
