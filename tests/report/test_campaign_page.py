"""The page of a campaign opens offline, says what the results say, and takes nothing from files for markup."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from starhold.campaign.results import CampaignResult, LawResult
from starhold.campaign.verdicts import judge, percent
from starhold.files import write_text
from starhold.report.campaign_page import envelopes, histograms, render
from starhold.report.campaign_units import Wording, count_text, figure, headline
from tests.browser import Browser
from tests.report import flown
from tests.report.campaign_made import ASKED, indices, law, result, spread
from tests.report.reader import Reader

SECTIONS = (
    *("Verdicts in words", "Runs", "Distributions", "Envelopes over time", "Metrics", "Runs worth flying again"),
    *("Worst cases: flown ≤ true ≤ proved", "What drives failures and metrics", "Sensitivity indices", "Dispersions flown"),
    *("Results", "How to read this page"),
)


def whole() -> CampaignResult:
    """A campaign with something in every section."""
    made = result()
    return replace(made, laws=(replace(made.laws[0], indices=indices()), *made.laws[1:]))


def page(campaign: CampaignResult) -> Reader:
    return Reader(render(flown.scenario("detumbling"), campaign))


def words(campaign: CampaignResult) -> Wording:
    return Wording.of("rigid-body", campaign)


@pytest.fixture(scope="module")
def reader() -> Reader:
    return page(whole())


def test_nothing_is_loaded() -> None:
    Reader(render(flown.scenario(), whole())).loads_nothing()


def test_the_same_results_give_the_same_bytes_whatever_the_time_took(tmp_path: Any) -> None:
    paths = [tmp_path / name for name in ("one.html", "two.html")]
    slow = replace(whole(), seconds=4711.5, flown=17)
    for path, campaign in zip(paths, (whole(), slow), strict=True):
        write_text(path, render(flown.scenario("detumbling"), campaign))
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_every_section_is_there(reader: Reader) -> None:
    for heading in SECTIONS:
        assert heading in reader.words, heading
    places = [reader.words.index(heading) for heading in SECTIONS]
    assert places == sorted(places)
    ids = {attrs.get("id") for _, attrs in reader.tags}
    drawn = [plot["name"] for key in ("histograms", "envelopes") for plot in reader.data()[key]]
    assert len(drawn) == 9
    assert set(drawn) <= ids


def test_an_empty_campaign_is_told(tmp_path: Any) -> None:
    bare = LawResult("pd", 10, 0, 0, (), (), (), None)
    found = page(replace(result(), laws=(bare,), over={}, requirements=()))
    assert "has no requirements, so nothing is judged; no run was lost." in found.text
    assert found.data()["histograms"] == found.data()["envelopes"] == []
    for heading in ("Metrics", "Distributions", "Runs worth flying again", "Sensitivity indices", "Dispersions flown"):
        assert heading not in found.words


def test_verdicts_and_metrics_stand_in_readable_units(reader: Reader) -> None:
    lyapunov, pd = result().laws
    for one in (lyapunov, pd):
        for verdict in one.verdicts:
            assert any(word.endswith(f", {verdict.worst_run}") for word in reader.words)
            assert f"{percent(verdict.observed)} / {percent(verdict.share)}" in reader.words
            assert verdict.sentence() in reader.text
    pointing = next(verdict for verdict in lyapunov.verdicts if verdict.name == "pointing")
    assert f"{figure(np.degrees(pointing.worst_margin) * 1e3)} mdeg, {pointing.worst_run}" in reader.words
    assert "pointing: final angle at most 100 mdeg" in reader.words
    error = next(spread for spread in pd.spreads if spread.metric == "final_attitude_error")
    for value in (*error.quantiles[::3], error.mean):
        assert figure(np.degrees(value) * 1e3) in reader.words
    assert count_text(error.missing) in reader.words
    # A metric that the comparison does not show keeps its SI unit.
    assert "attitude settling time" in reader.words


def test_lost_runs_and_missing_values(reader: Reader) -> None:
    pd = result().laws[1]
    assert pd.lost > 0
    assert f"runs without a value: pd {pd.lost}" in reader.words
    # The worst margin of a requirement that lost runs miss is no number.
    assert any(word.startswith("no value, ") for word in reader.words)
    assert any(word.startswith("lost, ") for word in reader.words)


def test_commands_are_there_to_be_copied(reader: Reader) -> None:
    assert "starhold rerun results/detumbling" in reader.text
    for one in result().laws:
        for item in one.again:
            assert item.command in reader.words
    questions = [word for word in reader.words if word.startswith("starhold query results/detumbling '")]
    assert len(questions) == 2
    assert result().digest in reader.words
    copied = sum(tag == "code" and attrs.get("class") == "copy" for tag, attrs in reader.tags)
    assert copied == len(questions) + 1 + sum(len(one.again) + len(one.brackets) for one in result().laws)


def test_brackets_say_when_nothing_is_proved(reader: Reader) -> None:
    assert reader.words.count("nothing is proved about it") == 2
    assert f"{figure(np.degrees(0.0912))} deg/s ≤ true ≤ {figure(np.degrees(0.11))} deg/s" in reader.words
    assert "no disturbance, exact sensors" in reader.words


def test_indices_are_told_and_so_is_why_there_are_none(reader: Reader) -> None:
    assert "No sensitivity indices: 3 runs have no value, and Sobol's estimators need all 640." in reader.words
    assert "44 ± 1" in reader.words
    assert "0.85 ± 0.02" in reader.words
    assert "3 of 40 trajectories were dropped" in reader.text


def test_only_drivers_that_stand_out_are_shown(reader: Reader) -> None:
    for one in result().laws:
        assert one.drivers is not None
    shown = [word for word in reader.words if word.startswith("rank correlation 0.")]
    noise = next(item for item in result().laws[0].drivers.metrics if item.significant)  # type: ignore[union-attr]
    assert (noise.input, noise.metric) == ("sensor.rate_noise", "final_attitude_error")
    assert f"rank correlation {noise.correlation:.2f}" in shown
    assert f"+{noise.correlation:.2f}" in reader.words
    few = page(result(names=("lyapunov",), runs=40))
    assert "too few failures to find their drivers" in few.text.lower()


def test_names_from_files_are_no_markup() -> None:
    bad = flown.HOSTILE
    first = replace(law(bad, 0, 300), indices={bad: indices()["settling_time"]})
    hostile = replace(
        first,
        spreads=tuple(replace(item, metric=bad, unit=bad) for item in first.spreads[:1]),
        envelopes=tuple(replace(item, name=bad, unit=bad, meaning=bad) for item in first.envelopes[:1]),
        verdicts=(judge(bad, np.array([1.0, -1.0]), 0.5, 0.9, {bad: np.array([1.0, 2.0])}),),
        again=tuple(replace(item, why=bad, command=bad) for item in first.again),
        brackets=tuple(replace(item, metric=bad, unit=bad, file=bad, assumption=bad) for item in first.brackets),
        drivers=replace(
            first.drivers,  # type: ignore[type-var]
            metrics=tuple(replace(item, input=bad, metric=bad, corrected=0.0) for item in first.drivers.metrics[:1]),  # type: ignore[union-attr]
            skipped=(bad,),
            remark=bad,
        ),
    )
    made = CampaignResult(
        bad, result().folder / bad, 300, bad, {bad: bad}, (hostile,), bad, 1.0, 300, (replace(ASKED[0], name=bad),)
    )
    text = render(flown.scenario("plain"), made)
    plain = render(flown.scenario("plain"), result())
    assert "<b>$x_1$" not in text
    assert text.count("<script") == plain.count("<script")
    assert text.count("</script") == plain.count("</script")
    found = Reader(text)
    assert "alert" not in "".join(found.scripts[1:])
    assert found.data()["laws"][0]["name"] == bad
    assert found.text.count(bad) > 10


def test_histograms_account_for_all_runs() -> None:
    made = result()
    for plot in histograms(made, words(made)):
        for curve in plot["curves"]:
            missing = next(
                item.missing
                for item in made.laws[curve["law"]].spreads
                if words(made).measure(item.metric).heading == plot["title"]
            )
            assert len(curve["edges"]) == len(curve["values"]) + 1
            assert sum(curve["share"]) == pytest.approx(100.0 * (1.0 - missing / made.runs), abs=1e-2)
            assert all(value is not None for value in curve["values"])
            width = np.diff(np.log10(curve["edges"]) if plot["log"] else curve["edges"])
            area = np.dot(curve["values"], width) if " per " in plot["ylabel"] or "decade" in plot["ylabel"] else None
            assert area is None or area == pytest.approx(sum(curve["share"]), rel=1e-3)


def test_histograms_of_one_value_and_of_none() -> None:
    one = result(names=("lyapunov",))
    same, none = spread("effort", np.full(50, 2.0)), spread("settling_time", np.full(50, np.nan))
    never = spread("limit_share", np.zeros(48))
    made = replace(one, laws=(replace(one.laws[0], spreads=(same, none, never)),))
    for plot, title, value in zip(histograms(made, words(made)), ("effort", "on limit"), (2.0, 0.0), strict=True):
        assert plot["title"] == title
        (curve,) = plot["curves"]
        assert 0.5 * (curve["edges"][0] + curve["edges"][1]) == pytest.approx(value)
        assert curve["values"] == [100.0]
    assert "—" in page(made).words


@pytest.mark.parametrize(("runs", "bars"), [(1, 1), (48, 6), (2500, 50), (10_000, 60)])
def test_a_histogram_has_no_more_bars_than_its_runs_can_fill(runs: int, bars: int) -> None:
    values = np.linspace(1.0, 2.0, runs)
    assert len(spread("effort", values).counts) == bars
    # All but one alike.
    most = np.where(np.arange(runs) == 0, 3.0, 0.0)
    assert spread("effort", most).counts[0] == max(runs - 1, 1)


def test_wide_ranges_are_drawn_on_logarithmic_scales() -> None:
    made = result()
    logs = {plot["title"]: plot["log"] for plot in histograms(made, words(made))}
    assert logs["final angle"]
    assert not logs["settling"]
    plots = {plot["title"]: plot for plot in envelopes(made, words(made))}
    assert all(plot["log"] for plot in plots.values())
    assert plots["attitude error"]["ylabel"] == "deg"
    assert plots["attitude error"]["curves"][0]["most"][0] == pytest.approx(180.0, rel=0.01)
    flat = replace(
        made.laws[0].envelopes[0], **{key: np.full(60, 0.3) for key in ("least", "low", "median", "high", "most")}
    )
    made = replace(made, laws=(replace(made.laws[0], envelopes=(flat,)),))
    (plot,) = envelopes(made, words(made))
    assert not plot["log"]
    lost = replace(flat, **{key: np.full(60, np.nan) for key in ("least", "low", "median", "high", "most")})
    made = replace(made, laws=(replace(made.laws[0], envelopes=(lost,)),))
    assert page(made).data()["envelopes"][0]["curves"][0]["median"] == [None] * 60


@pytest.mark.parametrize(
    ("failures", "share", "independent", "stopped", "said"),
    [
        (0, 0.99, True, False, "meets what is required: of all flights at least 99 % meet it, shown with 90 % confidence"),
        (400, 0.99, True, False, "misses what is required: more than"),
        (
            10,
            0.99,
            True,
            False,
            "leaves what is required open: whether 99 % of all flights meet it (10 of 1000 runs miss it",
        ),
        (0, 0.99, False, False, "is not judged, because runs by Sobol' points are not independent"),
        (0, 0.99, True, True, "and it holds whenever the campaign was stopped"),
    ],
)
def test_headlines_carry_what_they_rest_on(failures: int, share: float, independent: bool, stopped: bool, said: str) -> None:
    margins = np.where(np.arange(1000) < failures, -1.0, 1.0)
    verdict = judge("it", margins, share, 0.9, independent=independent, until_decided=stopped)
    one = replace(result().laws[0], verdicts=(verdict,))
    told = headline(one, "random" if independent else "sobol", words(result()))
    assert said in told
    assert ("provided that flights are independent draws from the stated dispersions" in told) == independent


def test_a_bad_condition_known_before_flight_is_named() -> None:
    hot = np.arange(4000) % 4 == 0
    margins = np.where(hot & (np.arange(4000) % 80 == 0), -1.0, 1.0)
    verdict = judge("it", margins, 0.98, 0.9, {"day": np.where(hot, "hot", "cold")})
    assert verdict.outcome == "missed"
    told = headline(replace(result().laws[0], verdicts=(verdict,)), "random", words(result()))
    assert "of flights with day = hot miss it (at most 2 % may)" in told


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.0, "0"), (np.nan, "—"), (-np.inf, "−∞"), (33641.2, "33641"), (12.3456, "12.35"), (1e-7, "1e-07"), (2e9, "2e+09")],
)
def test_numbers_are_short(value: float, shown: str) -> None:
    assert figure(value) == shown


@pytest.mark.slow
def test_small_numbers_have_powers_of_ten_and_no_letter_beside_their_unit(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(render(flown.scenario("detumbling"), whole()), encoding="utf-8")
    browser = Browser()
    try:
        browser.open(path)
        ticks = browser.ask(
            """(async () => { const box = document.createElement("div"); document.body.append(box);
                await Plotly.newPlot(box, [{x: [0, 1], y: [0, 7e-4]}], {yaxis: look().axis});
                return [...box.querySelectorAll(".ytick text")].map((one) => one.textContent); })()"""
        )
        assert len(ticks) > 2
        assert not any(letter in tick for tick in ticks for letter in "µumk")
        assert browser.complaints == []
    finally:
        browser.close()
