"""What tests of campaigns share."""

import pytest

from starhold.campaign import worst


@pytest.fixture
def brief(monkeypatch):
    """A search that flies little."""
    monkeypatch.setattr(worst, "MANY", worst.Effort(32, 4, 16, 3))
    monkeypatch.setattr(worst, "FEW", worst.Effort(4, 2, 4, 3))
