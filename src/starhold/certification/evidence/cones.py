"""Programs over cones, solved by an interior point: Clarabel."""

import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from threading import active_count
from typing import Any, TypeVar

import numpy as np

from starhold.certification.evidence.sparse import Entries

T = TypeVar("T")
TOLERANCE = 1e-11
LIMIT = 30.0
"""The time limit of the interior point (s)."""
PACKAGE, TAKEN = "scipy.linalg", ("cython_blas", "cython_lapack")


def _load() -> None:
    """Load the two modules of SciPy that Clarabel takes its linear algebra from. All of their package would take longer
    than most proofs; where another thread may want it meanwhile, it is loaded all the same."""
    if PACKAGE in sys.modules or f"{PACKAGE}.{TAKEN[-1]}" in sys.modules or active_count() > 1:
        return
    spec = find_spec(PACKAGE)
    assert spec is not None
    sys.modules[PACKAGE] = module_from_spec(spec)
    try:
        for name in TAKEN:
            import_module(f"{PACKAGE}.{name}")
    finally:
        del sys.modules[PACKAGE]


_KNOWN: dict[Any, Any] = {}
MOST_KNOWN = 256


def once(key: Any, make: Callable[[], T]) -> T:
    """Return the result of `make` for this key, which contains all that it depends on. Modes of a law often do not differ in
    what is proved, and limits of axes only in their signs: results are kept for the next. The kernel checks them each time.
    """
    if key not in _KNOWN:
        if len(_KNOWN) >= MOST_KNOWN:
            _KNOWN.clear()
        _KNOWN[key] = make()
    return _KNOWN[key]


def interior_point(cost: Any, A: Entries, b: Any, equal: int, signed: int, sides: Sequence[int]) -> Any | None:
    """Minimise cost.x with A x + s = b, s in the cones; None where that fails."""
    _load()
    clarabel: Any = import_module("clarabel")
    cones = [clarabel.ZeroConeT(equal), clarabel.NonnegativeConeT(signed), *map(clarabel.PSDTriangleConeT, sides)]
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.time_limit = False, LIMIT
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    matrix, none = A.compressed(), Entries([], [], [], (len(cost), len(cost))).compressed()

    def solve() -> Any | None:
        solution = clarabel.DefaultSolver(none, cost, matrix, b, cones, settings).solve()
        return np.array(solution.x) if "Solved" in str(solution.status) or "Insufficient" in str(solution.status) else None

    numbers = cost.tobytes(), matrix.key(), b.tobytes()
    return once((numbers, equal, signed, *sides), solve)
