"""The theorems by name. Each yields the obligations about a claim's loop, and then its statement."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import TypeAlias

from ..reading import Claim
from ..rules import Proof

Theorem: TypeAlias = Callable[[Claim], Proof]


def _of(file: str, name: str, claim: Claim, **fixed: bool) -> Proof:
    """Return what a theorem demands of a claim; its file is loaded here, so that a check loads only what it needs."""
    return getattr(import_module(f"{__name__}.{file}"), name)(claim, **fixed)


THEOREMS: dict[str, Theorem] = {
    "converges": partial(_of, "attitude", "converges"),
    "converges strictly": partial(_of, "attitude", "converges", strictly=True),
    "converges near the inertia": partial(_of, "attitude", "converges", strictly=True, near=True),
    "converges whatever the inertia": partial(_of, "attitude", "converges", any_inertia=True),
    "converges from both quaternions": partial(_of, "attitude", "converges_evenly"),
    "converges from both quaternions whatever the inertia": partial(_of, "attitude", "converges_evenly", any_inertia=True),
    "converges without a preferred axis": partial(_of, "attitude", "converges_without_axes"),
    "stays stable between samples": partial(_of, "sampling", "sampled"),
    "reaches its surface": partial(_of, "sliding", "reaches_surface"),
    "points": partial(_of, "pointing", "points"),
    "points with appendages": partial(_of, "appendages", "points_with_appendages"),
    "detumbles": partial(_of, "detumbling", "detumbles"),
    "V rises": partial(_of, "refuted", "rises"),
    "V rises near the target": partial(_of, "refuted", "rises_near_target"),
    "V is negative": partial(_of, "refuted", "is_negative"),
    "asks for more than the limit": partial(_of, "refuted", "exceeds_limit"),
    "does not settle between samples": partial(_of, "refuted", "does_not_settle"),
    "is pushed off its surface": partial(_of, "refuted", "is_pushed_off"),
    "turns away on its surface": partial(_of, "refuted", "leads_away"),
    "attracts": partial(_of, "invariant", "attracts"),
    "is stable": partial(_of, "invariant", "stays"),
    "is unstable": partial(_of, "invariant", "leaves"),
    "avoids": partial(_of, "invariant", "avoids"),
    "fails": partial(_of, "invariant", "fails"),
    "ends on the circle": partial(_of, "station", "ends_on_circle"),
    "comes to rest": partial(_of, "station", "comes_to_rest"),
    "returns with limited control": partial(_of, "station", "returns_with_limited_control"),
    "needs more control on the circle": partial(_of, "station", "needs_more_control"),
    "does not return": partial(_of, "station", "does_not_return"),
    "holds another circle": partial(_of, "station", "holds_another_circle"),
}
