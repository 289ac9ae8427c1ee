"""Chooses which of the two quaternions of an attitude a law receives: q and -q are the same attitude, but not the same
feedback.

Each function takes the error attitude, the memory h = +-1 and the hysteresis half-width, and returns the attitude to feed
back and the new memory.
"""

from __future__ import annotations

from starhold.algebra.quaternion import Quaternion, stretch
from starhold.algebra.scalar import Scalar, less, side, where


def as_published(attitude: Quaternion, h: Scalar, width: Scalar) -> tuple[Quaternion, Scalar]:
    """Feed back q itself: continuous, but the body may turn the long way (unwinding)."""
    return attitude, h


def shortest(attitude: Quaternion, h: Scalar, width: Scalar) -> tuple[Quaternion, Scalar]:
    """Feed back sign(q0) q: the shorter way, without memory and so not robust to noise near a half turn."""
    return stretch(side(attitude[0]), attitude), h


def hysteresis(attitude: Quaternion, h: Scalar, width: Scalar) -> tuple[Quaternion, Scalar]:
    """Feed back h q; h flips when h q0 < -width ("Quaternion-Based Hybrid Control for Robust Global Attitude Tracking")."""
    h = where(less(h * attitude[0], -width), -h, h)
    return stretch(h, attitude), h


SIGN_POLICIES = {"as_published": as_published, "shortest": shortest, "hysteresis": hysteresis}
