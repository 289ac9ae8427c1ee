"""Certificates that the certifier makes once for all tests of the checker."""

import json
from functools import cache
from pathlib import Path

import pytest

from starhold.certification.certificate import write
from tests.certification.loops import certified


@cache
def _made(name, sign_policy, disturbance, tmp):
    path = Path(tmp) / f"{name}-{sign_policy}-{disturbance}.json"
    write([certified(name, sign_policy, disturbance)], "made", path)
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    folder = str(tmp_path_factory.mktemp("certificates"))
    return lambda name, sign_policy="as_published", disturbance=0.0: json.loads(
        _made(name, sign_policy, disturbance, folder)
    )
