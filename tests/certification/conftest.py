"""Files of certificates that the certifier makes once for all tests of a worker."""

import json

import pytest

from starhold.certification.certificate import write
from tests.certification.loops import certified


@pytest.fixture
def made(tmp_path):
    """Make what stands in the file of a textbook loop's certificate."""

    def make(name, sign_policy="as_published"):
        write([certified(name, sign_policy)], "made", tmp_path / "made.json")
        return json.loads((tmp_path / "made.json").read_text(encoding="utf-8"))

    return make
