"""Scenarios changed at random are read and built, or refused in one line."""

import warnings

import pytest

from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.scenario.reading import load
from tests.scenario.mutants import mutant
from tests.tiers import leading

EACH = 120


@pytest.mark.parametrize("block", leading(range(5)))
def test_a_mutant_is_built_or_refused_in_one_line(block, tmp_path):
    said = []
    for seed in range(block * EACH, (block + 1) * EACH):
        path = tmp_path / "mutant.toml"
        path.write_text(mutant(seed), encoding="utf-8")
        with warnings.catch_warnings():
            # An orbit that comes down after the run is not refused.
            warnings.simplefilter("ignore", UserWarning)
            try:
                scenario = load(path, allow_unstable=seed % 2 == 0)
                for entry in scenario.laws:
                    build(scenario, entry)
            except InputError as error:
                said.append(str(error))
    assert 10 < len(said) < EACH
    assert all("\n" not in line and len(line) < 700 for line in said)
