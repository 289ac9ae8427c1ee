"""Invariant sets of systems given as equations: claims by indicators V, with their proofs.

from starhold.algebra.scalar import less, where
from starhold.certification.invariant import Problem, System, Wanted, certify

system = System.of(("x", "y"), lambda x, y: (y, where(less(0.0, y), 1.0 - x, -2.0 * x - 3.0 * y)))
wanted = Wanted("unstable", system.function(lambda x, y: y), ((-0.5, 0.5), (-0.5, 0.5)), rest=(0, 0))
certificate = certify(Problem("origin", system, (wanted,)))
"""

from starhold.certification.invariant.problem import Problem, builtin_names, certify, load, parse, write
from starhold.certification.invariant.system import System
from starhold.certification.invariant.theorems import THEOREMS, Wanted, prove

__all__ = ["THEOREMS", "Problem", "System", "Wanted", "builtin_names", "certify", "load", "parse", "prove", "write"]
