"""What is printed of a campaign."""

import io
import threading
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from starhold.campaign.verdicts import percent
from starhold.campaign.worst import Sought
from starhold.cli import console as printing
from starhold.cli import show, show_campaign
from starhold.cli.show_campaign import flying_campaign, print_campaign
from starhold.errors import InputError
from starhold.report.campaign_units import figure
from tests.report.campaign_made import result


@pytest.fixture
def printed(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Print to a console of some width; returns the text."""

    def to_text(work: Any, width: int = 160, terminal: bool = False) -> str:
        console = Console(file=io.StringIO(), width=width, record=True, force_terminal=terminal, legacy_windows=False)
        for module in (printing, show, show_campaign):
            monkeypatch.setattr(module, "console", console)
        work()
        return console.export_text()

    return to_text


def test_everything_that_decides_is_printed(printed: Any) -> None:
    made = result()
    text = printed(lambda: print_campaign(made, "rigid-body"), width=200)
    for one in made.laws:
        for verdict in one.verdicts:
            assert f"{percent(verdict.observed)} / {percent(verdict.share)}" in text
            assert verdict.outcome in text
        for item in one.again[:3]:
            assert item.command in text
        error = next(item for item in one.spreads if item.metric == "settling_time")
        assert figure(error.quantiles[3]) in text
        assert one.drivers is not None
        assert f"{one.law}: {one.failed} of {one.runs} runs failed" in text
    assert "provided that flights are independent draws" in text.replace("\n", " ")
    assert f"digest {made.digest}" in text
    assert "6000 runs flown in 12.5 s, 480 runs/s" in text
    for cell in ("120.3 mdeg ≤ true", "nothing is proved about it", "5.225 deg/s ≤ true ≤ 6.303 deg/s"):
        assert cell in text


def test_few_drivers_of_a_kind_are_printed_and_the_rest_is_counted(printed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(show_campaign, "DRIVERS", 1)
    made = result(20000)
    found = made.laws[1].drivers
    assert found is not None
    kinds = [[one for one in kind if one.significant] for kind in (found.inputs, found.pairs, found.metrics)]
    left = sum(max(0, len(kind) - 1) for kind in kinds)
    assert left > 1
    text = printed(lambda: print_campaign(made, "rigid-body"), width=400)
    assert f"{left} weaker significant drivers not listed" in text
    low, high = kinds[0][0].range
    assert f"nine in ten failed runs from {low:.4g} to {high:.4g}; greater than in a passed run" in text
    together = kinds[1][0]
    assert " and ".join(together.inputs) in text
    assert f"most often where {together.where}" in text


def test_names_steer_neither_the_terminal_nor_the_markup(printed: Any) -> None:
    made = result(names=("lyapunov",))
    bad = "[red]x[/red]\x1b[31m"
    one = replace(made.laws[0], law=bad, again=(replace(made.laws[0].again[0], why=bad, command=bad),))
    text = printed(lambda: print_campaign(replace(made, laws=(one,)), "rigid-body"), terminal=True)
    assert "[red]x[/red]\\x1b[31m" in text


def refused_after(flown: int) -> None:
    with flying_campaign(["pd"], 10) as notice:
        if flown:
            notice("pd", flown)
        raise InputError("a.toml", "campaign", "nothing", "something")


def test_an_error_before_any_run_stands_alone(printed: Any) -> None:
    def fly(flown: int) -> None:
        with pytest.raises(InputError):
            refused_after(flown)

    assert printed(lambda: fly(0)) == ""
    assert "10 runs of 1 law" not in printed(lambda: fly(0), terminal=True)
    assert "4/10 runs" in printed(lambda: fly(4))


def test_bars_count_runs_and_tell_rate_and_time_left(printed: Any) -> None:
    def fly() -> None:
        with flying_campaign(["lyapunov", "[b]pd"], 1000) as notice:
            workers = [threading.Thread(target=notice, args=("lyapunov", 100)) for _ in range(10)]
            for worker in workers:
                worker.start()
            for worker in workers:
                worker.join()
            notice("[b]pd", 600)
            notice("[b]pd", 150)
            sought = Sought("worst peak [b]", 300)
            notice("[b]pd", 100, sought)
            notice("[b]pd", 50, sought)

    text = printed(fly, terminal=True)
    assert "[b]pd: worst peak [b]" in text
    assert "150/300 " in text
    assert "1000 runs of 2 laws" in text
    assert "1000/1000 runs" in text
    assert "750/1000 runs" in text
    assert "runs/s" in text
    assert "[b]pd" in text
