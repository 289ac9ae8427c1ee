"""What tests of campaigns share."""

import pytest

from starhold.campaign import worst
from starhold.campaign.store import Store
from tests.campaign.toy import manifest


@pytest.fixture
def brief(monkeypatch):
    """A search that flies little."""
    monkeypatch.setattr(worst, "MANY", worst.Effort(32, 4, 16, 3))
    monkeypatch.setattr(worst, "FEW", worst.Effort(4, 2, 4, 3))


@pytest.fixture
def store(tmp_path):
    """The store of a campaign that has not flown."""
    return Store.create(tmp_path / "campaign", manifest())
