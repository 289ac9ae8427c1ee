"""Invariant sets of systems given as equations: claims by indicators V, with their proofs.

from starhold.algebra.scalar import less, where
from starhold.certification.invariant import InvariantProblem, System, WantedSet, certify

system = System.of(("x", "y"), lambda x, y: (y, where(less(0.0, y), 1.0 - x, -2.0 * x - 3.0 * y)))
wanted = WantedSet("unstable", system.function(lambda x, y: y), ((-0.5, 0.5), (-0.5, 0.5)), equilibrium=(0, 0))
certificate = certify(InvariantProblem("origin", system, (wanted,)))
"""

from starhold.certification.invariant.problem import InvariantProblem, builtin_names, certify, load, parse, write
from starhold.certification.invariant.system import System
from starhold.certification.invariant.theorems import THEOREMS, WantedSet, prove

__all__ = [
    "THEOREMS",
    "InvariantProblem",
    "System",
    "WantedSet",
    "builtin_names",
    "certify",
    "load",
    "parse",
    "prove",
    "write",
]
