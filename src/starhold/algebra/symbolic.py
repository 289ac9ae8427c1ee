"""SymPy is named at run time because its types are too loose for a strict checker."""

from __future__ import annotations

from typing import Any

from starhold.algebra.operations import library

sympy: Any = library("sympy")
