"""starhold designs, certifies, flies and compares control laws for spacecraft.

import starhold as sh

scenario = sh.load("three-laws")
run = sh.simulate(scenario, law="lyapunov")      # an xarray Dataset
flights = sh.compare(scenario)                   # runs and metrics of every law
certificates = sh.certify(scenario)              # what is proved of every law
designs = sh.design("my.toml")                   # gains that formulas give, and figures to judge them by
certificate = sh.invariant("van-der-pol")        # what is proved of an invariant set of any small system
placed = sh.place(A, B, poles)                   # u = -K x that gives A - B K these poles, for any linear system
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from starhold.api import certify, compare, design, failures, invariant, load, modal_roots, place, simulate
    from starhold.errors import InputError

__version__ = "0.1.0"
__all__ = [
    "InputError",
    "__version__",
    "certify",
    "compare",
    "design",
    "failures",
    "invariant",
    "load",
    "modal_roots",
    "place",
    "simulate",
]


def __getattr__(name: str) -> Any:
    # Loaded on first use, so that `import starhold` and the command line start at once.
    from importlib import import_module

    if name == "InputError":
        return import_module("starhold.errors").InputError
    if name in __all__:
        return getattr(import_module("starhold.api"), name)
    raise AttributeError(f"module 'starhold' has no attribute {name!r}")
