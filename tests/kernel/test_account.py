"""The account of a check's work: what operations cost by the length of their numbers, to the last one that it allows."""

from fractions import Fraction

import pytest

from starhold.certification.matrices import inverted, least, unlimited
from starhold.kernel.numbers import LONGEST, WORK, Account, RefusedError


@pytest.fixture(autouse=True)
def _opened(monkeypatch):
    monkeypatch.setattr(Account, "left", 0)
    Account.open()


@pytest.mark.parametrize(("bits", "cost"), [(1, 2), (63, 2), (64, 3), (127, 3), (128, 4), (6400, 102)])
def test_an_operation_costs_a_unit_more_for_each_word_of_its_numbers(bits, cost):
    Account.spend(WORK // cost, bits)
    assert Account.left == WORK % cost
    with pytest.raises(RefusedError, match="too much work"):
        Account.spend(1, bits)


def test_the_longest_number_is_the_last_one_that_is_taken():
    Account.spend(1, LONGEST)
    with pytest.raises(RefusedError, match="too long"):
        Account.spend(1, LONGEST + 1)


@pytest.mark.parametrize("computed", [inverted, least])
def test_a_search_goes_on_without_a_limit_after_what_it_computes(computed):
    """The account of a check that was opened in a search ended it after a while."""
    unlimited()
    computed([[Fraction(2), Fraction(1)], [Fraction(1), Fraction(3)]])
    assert Account.left > 1000 * WORK
