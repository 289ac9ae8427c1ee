"""Evidence that is taken from a sum's mirror image."""

from starhold.certification.evidence.mirrored import different, shown_once
from starhold.certification.evidence.squares import squares
from starhold.kernel.numbers import Account
from starhold.kernel.polynomials import dot, poly, variables
from starhold.kernel.rules import Squares

w, h = variables("w"), variables("h")


def limited(sign, most=3, odd=w):
    """That a torque, of feedback and of momentum that turns with the body, is within a limit one way where w and h are at
    most 1."""
    known = [1 - dot(w, w), 1 - dot(h, h), 2 - sign * odd[1] + dot(w, w)]
    return Squares(most - sign * (w[0] + w[1] * h[2] - w[2] * h[1]), [poly(1), *w, *h], 0, known)


def shown(o):
    """Evidence, and how often it was searched for."""
    searched = []
    evidence = shown_once(o, lambda: searched.append(o) or squares(o, {}))
    o.check(evidence)
    return evidence, len(searched)


def test_a_limit_in_the_other_direction_has_the_evidence_of_its_mirror_image():
    Account.open()
    evidence, searched = shown(limited(1, 4))
    assert searched == 1
    mirrored, searched = shown(limited(-1, 4))
    assert searched == 0
    assert mirrored["gram"] != evidence["gram"]
    assert sorted(mirrored["multipliers"]) == sorted(evidence["multipliers"])


def test_what_is_no_mirror_image_is_searched_for():
    Account.open()
    assert shown(limited(1, 5))[1] == 1
    assert shown(limited(-1, 6))[1] == 1
    # What is known differs.
    assert shown(limited(-1, 5, [2 * x for x in w]))[1] == 1
    # Where all three are turned, no image differs in one of them alone.
    product = w[0] * w[1] * w[2]
    sums = [Squares(9 - sign * product, [poly(1), *w], 0, [2 - product]) for sign in (1, -1)]
    assert different(sums) == sums


def test_a_limit_about_half_turned_axes_has_the_evidence_of_its_image():
    Account.open()

    def leaning(*signs):
        return Squares(4 - dot(signs, w), [poly(1), *w], 0, [1 - dot(w, w)])

    assert shown(leaning(1, 2, 3))[1] == 1
    sums = [leaning(*signs) for signs in ((1, 2, 3), (1, -2, -3), (-1, -2, 3), (-1, -2, -3), (1, 2, -3), (2, 1, 3))]
    assert [shown(o)[1] for o in sums] == [1, 0, 0, 0, 0, 1]
    assert different(sums) == [sums[0], sums[-1]]


def test_a_sum_without_evidence_is_searched_for_each_time():
    Account.open()
    asked = []
    for _ in range(2):
        assert shown_once(limited(1, 0), lambda: asked.append(1)) is None
    assert len(asked) == 2
