"""What certificates cost: proving and checking, law by law, beside deriving V' in SymPy and solving a Riccati equation.

For each law of each built-in scenario: all its claims by `certify`, without the flights that try them, and all of them
again by the independent checker. Then one step of a proof alone, V' along the closed loop as an exact polynomial, beside
SymPy, which is given the same equations and the same rational numbers; both must find the same terms. Last, for scale,
SciPy's Riccati solver on this spacecraft: what a numerical design costs that proves nothing.

The tasks take turns and the fastest round counts; all run on one thread, so the processor's time is shown. SymPy keeps
what it has computed, and its cache is cleared before each round.

Run: python benchmarks/certify.py
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import sympy
from scipy.linalg import solve_continuous_are
from sympy.core.cache import clear_cache

from common import header, interleaved, show
from starhold import checker
from starhold.algebra.quaternion import derivative
from starhold.algebra.vector import add
from starhold.certification.certificate import Certificate, write
from starhold.certification.certify import certify
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import read
from starhold.certification.subject import make_subject
from starhold.kernel.loops import OUTSIDE, AttitudeLoop
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.parts.craft import Craft, tensor
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_names, load
from starhold.synthesis.riccati import linear_model

ROUNDS = 3
ATTITUDE, RATE, TORQUES = ("q0", "q1", "q2", "q3"), ("w1", "w2", "w3"), ("e1", "e2", "e3")


def in_polynomials(loop: ClosedLoop) -> dict[tuple[str, ...], Any]:
    """V' of a loop at a target at rest, from variables to coefficients, as the proof kernel wires it."""
    own = Loop(make_subject(loop))
    wired = AttitudeLoop(read(own.claim("converges", [OUTSIDE], own.lyapunov()), own.by_digest))
    return {tuple(sorted(names)): x for names, x in wired.slopes_along(wired.lyapunov, wired.acceleration).terms.items()}


def in_sympy(loop: ClosedLoop) -> dict[tuple[str, ...], Any]:
    """The same by SymPy."""
    clear_cache()
    q, w, e = (tuple(sympy.Symbol(name, real=True) for name in names) for names in (ATTITUDE, RATE, TORQUES))
    zero = (sympy.Integer(0),) * 3
    inertia = sympy.Matrix(3, 3, [sympy.Rational(x) for x in tensor(loop.craft.inertia).ravel().tolist()])
    craft: Any = Craft(_rows(inertia), _rows(inertia.inv()), sympy.oo, sympy.Integer(1))
    seen: Any = Measurement(q, w, w, zero, zero, e, zero, sympy.Rational(loop.period))
    gains = type(loop.gains)(*(_rational(value) for value in loop.gains))
    memory = loop.law.remember(loop.gains, loop.craft, loop.period)
    torque, _ = loop.law.command(seen, gains, craft, memory)
    function = loop.law.lyapunov
    assert function is not None
    moving: Any = angular_acceleration(w, add(torque, e), craft)  # type: ignore[arg-type]
    rates: list[Any] = [_exact(rate) for rate in (*derivative(q, w), *moving)]
    value = _exact(function(seen, gains, craft))
    slope = sum(sympy.diff(value, x) * rate for x, rate in zip([*q, *w], rates, strict=True))
    variables = [*q, *w, *e]
    found: dict[tuple[str, ...], Any] = {}
    for powers, c in sympy.Poly(slope, *variables).terms():
        monomial = tuple(sorted(x.name for x, power in zip(variables, powers, strict=True) for _ in range(power)))
        if c:
            found[monomial] = Fraction(int(c.p), int(c.q))
    return found


def _rows(matrix: Any) -> Any:
    return tuple(tuple(matrix.row(i)) for i in range(3))


def _exact(expression: Any) -> Any:
    # The equations' own 0.5 and 2.0 would make SymPy round all that they meet.
    return sympy.nsimplify(expression, rational=True, rational_conversion="exact")


def _rational(value: Any) -> Any:
    return tuple(map(_rational, value)) if isinstance(value, tuple) else sympy.Rational(value)


def content(certificate: Certificate) -> Any:
    """A certificate as it is read from its file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "certificate.json"
        write([certificate], "benchmark", path)
        return json.loads(path.read_text(encoding="utf-8"))


def tasks(loop: ClosedLoop) -> dict[str, Callable[[], Any]]:
    """What is timed of one loop."""
    certificate = certify(loop)
    given = content(certificate)
    failed = [finding for finding in checker.check(given) if finding.verdict == "fails"]
    assert not failed, failed
    a, b = linear_model(tensor(loop.craft.inertia))
    found: dict[str, Callable[[], Any]] = {
        "certify": lambda: certify(loop),
        "check": lambda: checker.check(given),
        "riccati": lambda: solve_continuous_are(a, b, np.eye(6), np.eye(3)),
    }
    # What SymPy is given of a law on wheels it multiplies in another order.
    if loop.law.lyapunov is not None and loop.wheels is None:
        ours, theirs = in_polynomials(loop), in_sympy(loop)
        assert ours == theirs
        found |= {"ours": lambda: in_polynomials(loop), "sympy": lambda: in_sympy(loop)}
    return found


def main() -> None:
    """Prove, check, derive, time and print."""
    print(header("python-flint", "sympy", "scipy"))
    rows: list[list[str]] = []
    for name in builtin_names():
        scenario = load(name)
        if scenario.body != "rigid-body":
            continue
        for entry in scenario.laws:
            loop = build(scenario, entry)
            claims = certify(loop).claims
            cells = [f"{name}: {entry.name}", str(len(claims))]
            if not claims:
                rows.append([*cells, *[""] * 7])
                continue
            spent = {task: time.work * 1e3 for task, time in interleaved(tasks(loop), ROUNDS).items()}
            cells += [f"{spent['certify']:.0f}", f"{spent['check']:.0f}", f"{spent['check'] / spent['certify']:.2f}"]
            if "ours" in spent:
                cells += [f"{spent['ours']:.2f}", f"{spent['sympy']:.1f}", f"{spent['sympy'] / spent['ours']:.0f}"]
            else:
                cells += ["", "", ""]
            rows.append([*cells, f"{spent['certify'] / spent['riccati']:.0f}"])
    heads = ["law", "claims", "certify ms", "check ms", "check/certify", "V' ms", "SymPy ms", "SymPy/V'", "certify/Riccati"]
    show(heads, rows)
    print("Where V' is derived twice, the terms are equal. A certificate of a law without claims is empty.")


if __name__ == "__main__":
    main()
