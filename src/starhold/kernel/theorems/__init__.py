"""The theorems by name. Each yields the obligations about a claim's loop, and then its statement."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

from ..reading import Claim
from ..rules import Proof
from . import appendages, attitude, detumbling, invariant, pointing, refuted, sampling, sliding, station

Theorem: TypeAlias = Callable[[Claim], Proof]

THEOREMS: dict[str, Theorem] = {
    "converges": attitude.converges,
    "converges strictly": partial(attitude.converges, strictly=True),
    "converges near the inertia": partial(attitude.converges, strictly=True, near=True),
    "converges whatever the inertia": partial(attitude.converges, any_inertia=True),
    "converges from both quaternions": attitude.converges_evenly,
    "converges from both quaternions whatever the inertia": partial(attitude.converges_evenly, any_inertia=True),
    "converges without a preferred axis": attitude.converges_without_axes,
    "stays stable between samples": sampling.sampled,
    "reaches its surface": sliding.reaches_surface,
    "points": pointing.points,
    "points with appendages": appendages.points_with_appendages,
    "detumbles": detumbling.detumbles,
    "V rises": refuted.rises,
    "V rises near the target": refuted.rises_near_target,
    "V is negative": refuted.is_negative,
    "asks for more than the limit": refuted.exceeds_limit,
    "does not settle between samples": refuted.does_not_settle,
    "is pushed off its surface": refuted.is_pushed_off,
    "turns away on its surface": refuted.leads_away,
    "attracts": invariant.attracts,
    "is stable": invariant.stays,
    "is unstable": invariant.leaves,
    "avoids": invariant.avoids,
    "fails": invariant.fails,
    "ends on the circle": station.ends_on_circle,
    "comes to rest": station.comes_to_rest,
    "returns with limited control": station.returns_with_limited_control,
    "needs more control on the circle": station.needs_more_control,
    "does not return": station.does_not_return,
    "holds another circle": station.holds_another_circle,
}
