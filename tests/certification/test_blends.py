"""Derivatives of V from those of its parts, and what is left at once because V is far from decreasing."""

from starhold.certification.evidence.chains import Chain
from starhold.certification.evidence.shapes import Shape
from starhold.kernel.held import Held
from tests.kernel.lagging import plain


def terms(motion):
    falling, last, share = motion.motion
    return {ends: [p.terms for p in kinds] for ends, kinds in falling.items()}, last.terms, share


def test_derivatives_of_v_are_those_that_the_kernel_makes_whatever_v_it_shares_parts_with():
    _, pushed = plain()
    lean = pushed.usual[1].epsilon
    shapes = [Shape(lean, soft, moment) for soft in (0.5, 0.85) for moment in (None, 3.0)]
    for shape in (pushed.usual[0], *shapes):
        motion = pushed.sampled(shape).motion
        assert terms(motion) == terms(Held(motion.loop, motion.plan))
    # Of two moments, with the potential: each in units of a coefficient.
    assert len(pushed.shared.parts) == 5


def test_v_that_rises_far_too_much_is_told_from_one_that_decreases():
    _, pushed = plain()
    _, V, motion, _ = pushed.sampled(pushed.usual[0])
    assert not Chain(motion, V, float(motion.s) / 10).rises()
    _, V, motion, _ = pushed.sampled(Shape(-pushed.usual[0].epsilon))
    chain = Chain(motion, V, float(motion.s) / 10)
    assert chain.rises()
    assert not chain.decreases()
    assert not chain.tried
