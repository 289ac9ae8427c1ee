"""The theorems by name. Each yields what has to be shown about a claim's loop, and then what it says."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TypeAlias

from ..reading import Claim
from ..rules import Obligation
from ..sentences import Statement
from . import attitude, isotropic, sampling, sliding

Theorem: TypeAlias = Callable[[Claim], Generator[tuple[str, Obligation], None, Statement]]

THEOREMS: dict[str, Theorem] = {
    "converges": attitude.converges,
    "converges strictly": attitude.converges_strictly,
    "converges whatever the inertia": attitude.converges_whatever_the_inertia,
    "converges from both quaternions": attitude.converges_evenly,
    "converges from both quaternions whatever the inertia": attitude.converges_evenly_whatever_the_inertia,
    "converges without a preferred axis": isotropic.converges_without_axes,
    "stays stable between samples": sampling.sampled,
    "reaches its surface": sliding.reaches_surface,
}
