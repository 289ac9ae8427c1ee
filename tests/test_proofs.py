"""Workers of a run find a proof once, and cases that are drawn are those of the day."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from starhold.laws.catalogue import catalogue
from tests import tiers
from tests.proofs import afresh, once


def noted(folder):
    """A function that notes that it was called."""

    def find(value):
        with (folder / "calls").open("a") as calls:
            calls.write(f"{value}\n")
        time.sleep(0.05)
        return value, catalogue()["pd"].module

    return find


def test_workers_side_by_side_find_what_is_equal_once(tmp_path):
    found = once(noted(tmp_path), tmp_path)
    with ThreadPoolExecutor(2) as workers:
        assert [*workers.map(found, [3.0, 3.0])] == [(3.0, catalogue()["pd"].module)] * 2
    assert found(3.0)[0] == 3.0
    assert found(4.0)[0] == 4.0
    assert (tmp_path / "calls").read_text() == "3.0\n4.0\n"
    with afresh():
        found(3.0)
    assert (tmp_path / "calls").read_text() == "3.0\n4.0\n3.0\n"


def test_a_part_with_another_file_is_another_subject(tmp_path):
    law, found = catalogue()["pd"], once(lambda part: part.name, tmp_path)
    assert found(law) == found(replace(law, module=catalogue()["lyapunov"].module)) == "pd"
    assert len([*tmp_path.glob("*.lock")]) == 2


@pytest.mark.parametrize(("seed", "same"), [(tiers.SEED, True), ("another day", False)])
def test_what_is_drawn_differs_from_day_to_day(seed, same, monkeypatch):
    draws = [lambda: tiers.of_the_day(range(99), 9), lambda: tiers.seeds(3), lambda: [*tiers.drawn(range(99), 9, 2)[2:]]]
    drawn = [draw() for draw in draws]
    monkeypatch.setattr(tiers, "SEED", seed)
    assert [draw() == one for draw, one in zip(draws, drawn, strict=True)] == [same] * 3
    assert [case.values for case in tiers.drawn(range(99), 9, 2)[:2]] == [(0,), (1,)]
