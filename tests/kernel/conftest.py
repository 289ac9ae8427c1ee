import pytest

from starhold.kernel.numbers import Account


@pytest.fixture(autouse=True)
def account():
    """Tests that call the kernel's arithmetic by itself have a whole account, whatever ran before."""
    Account.open()
