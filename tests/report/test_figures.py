"""The figures exist, show something, and survive odd names, lost runs and runs at rest."""

import pickle
import re
import subprocess
import sys
from dataclasses import replace
from functools import partial
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import mathtext
from matplotlib.axis import Tick
from matplotlib.figure import Figure
from PIL import Image

from starhold.algebra.cosines import to_angles
from starhold.analysis.rigid_body import METRICS
from starhold.report.attitude_plots import KNOWN, collect, early, roll_pitch_yaw, until
from starhold.report.body import report_of
from starhold.report.figures import WORD_ROWS, plain, png, sharing_axes, word_rows
from starhold.report.plots import COLOURS, Mark, colour, recorded_plots, thin, thin_times
from starhold.report.text import number_text
from starhold.report.ticks import Ticks, as_text, label_ticks
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lane import Recording, fly, label
from starhold.studies.flight import Flight
from tests.report import flown
from tests.report.flown import draw, pixels, shows_laws
from tests.tiers import leading

NAMES = ["scalar", "attitude", "rate", "torque", "angle", "roll-pitch-yaw", "accuracy"]


def test_every_figure_is_drawn_with_every_law(tmp_path: Path) -> None:
    paths = draw(flown.flights(), tmp_path, flown.scenario())
    assert [path.name for path in paths] == [f"{name}.png" for name in NAMES]
    for path in paths:
        picture = pixels(path)
        assert 300 < picture.shape[0] < 900
        assert picture.shape[1] == 880
        assert shows_laws(picture, len(flown.flights())), path.name


def test_no_formula_is_parsed_to_label_ticks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[str] = []
    parse = mathtext.MathTextParser.parse

    def noted(parser: Any, text: str, *more: Any, **given: Any) -> Any:
        parsed.append(text)
        return parse(parser, text, *more, **given)

    monkeypatch.setattr(mathtext.MathTextParser, "parse", noted)
    draw(flown.flights(), tmp_path, flown.scenario())
    assert not parsed


def test_figures_of_one_form_share_their_axes_and_are_what_they_are_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = report_of("rigid-body").picture(flown.flights(), flown.scenario())
    # A logarithmic panel takes the axes of a linear one, one with few decades those of one with many, and the other way.
    shown: Any = picture
    log, linear = (shown[name].args[0].panels[0] for name in ("angle", "rate"))
    few = replace(log, curves=[np.clip(curve, 0.5, 20.0) for curve in log.curves])
    over_time: Any = picture["rate"]
    first, times, _, *rest = over_time.args
    for count, panels in enumerate([(log, linear), (linear, few), (few, log), (linear, linear)]):
        plot = replace(first, panels=list(panels), dashed="level" * (count % 2))
        given = plot, times, [Mark(0.5 * times[-1], "")] * (count % 2), *rest[:2], [(0.0, 0.2 * times[-1])] * (count % 2)
        picture[f"mixed {count}"] = partial(over_time.func, *given)
    alone = {name: png(make()) for name, make in picture.items()}
    made: list[Figure] = []
    begin = Figure.__init__

    def noted(figure: Figure, *given: Any, **more: Any) -> None:
        made.append(figure)
        begin(figure, *given, **more)

    monkeypatch.setattr(Figure, "__init__", noted)
    with sharing_axes():
        shared = {name: png(make()) for name, make in picture.items()}
    assert [name for name in picture if shared[name] != alone[name]] == []
    assert len(made) == 4
    assert len(picture) == 11


RANGES = [[0.25, 1.0], [1e5 + 1e-7, 1e5 + 3e-7], [2e-9, 4e12], [2e-3, 5e-3]]


@pytest.mark.parametrize(
    ("log", "values"), [(False, [-3e-7, 2e-6]), *((log, values) for log in (False, True) for values in RANGES)]
)
def test_ticks_say_in_plain_text_what_their_formulas_say(log: bool, values: list[float]) -> None:
    texts = list[list[str]]()
    for in_plain_text in (True, False):
        figure = Figure()
        axis = figure.subplots()
        axis.plot([0.0, 1.0], values)
        axis.set_yscale("log" if log else "linear")
        if in_plain_text:
            label_ticks(axis.yaxis, log)
        elif not log:
            axis.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4), useMathText=True)
        figure.draw_without_rendering()
        every = [*axis.get_yticklabels(), *axis.get_yticklabels(minor=True), axis.yaxis.get_offset_text()]
        texts.append([label.get_text() for label in every])
    assert texts[0] == [as_text(text) for text in texts[1]]
    assert any(texts[0])
    assert not re.search(r"[$\\^{}]", "".join(texts[0]))


@pytest.mark.parametrize(
    ("log", "values", "end"),
    [
        (False, [-3e-7, 2e-6], 3e7),
        (True, [0.3, 0.31], 1.0),
        *((log, values, 2.0) for log in (False, True) for values in RANGES),
    ],
)
@pytest.mark.usefixtures("quiet_plots")
def test_an_axis_is_drawn_as_matplotlib_draws_it(log: bool, values: list[float], end: float) -> None:
    drawn = list[Any]()
    for by_one_tick in (False, True):
        figure = Figure((8.0, 3.0))
        axes = figure.subplots(2, 1, sharex=True)
        for axis in axes:
            plain(axis)
            for one in (axis.xaxis, axis.yaxis) if by_one_tick else ():
                Ticks(one)
            axis.plot([0.0, end], values)
            axis.set_yscale("log" if log else "linear")
            label_ticks(axis.yaxis, log)
        axes[0].set_ylabel("y")
        axes[1].set_xlabel("x")
        file = BytesIO()
        figure.savefig(file, format="png")
        drawn.append((np.asarray(Image.open(file)), np.asarray(Image.open(BytesIO(png(figure))))))
    # A file also has the pixels of the library's own.
    first = drawn[0][0]
    assert all((one == first).all() for pair in drawn for one in pair)
    assert (first[..., :3] < 128).any()


def test_figures_make_no_tick_for_each_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Tick] = []
    begin = Tick.__init__

    def noted(tick: Tick, *given: Any, **more: Any) -> None:
        made.append(tick)
        begin(tick, *given, **more)

    monkeypatch.setattr(Tick, "__init__", noted)
    draw(flown.flights(), tmp_path, flown.scenario())
    # At most two, a major and a minor one, for each of the sixteen axes of four layouts.
    assert 16 <= len(made) <= 32


def test_figures_of_an_attitude_are_drawn_without_what_flies_reads_and_proves(tmp_path: Path) -> None:
    picture = report_of("rigid-body").picture(flown.flights(), flown.scenario())
    sent = tmp_path / "picture"
    sent.write_bytes(pickle.dumps(picture))
    code = f"import pickle, sys; pickle.load(open({str(sent)!r}, 'rb')); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "starhold.report.figures" in loaded
    assert not {"pydantic", "flint", "llvmlite", "scipy", "starhold.loop.step", "starhold.certification"} & {*loaded}


@pytest.mark.slow
def test_odd_names_are_shown_as_they_stand(tmp_path: Path) -> None:
    first, second = flown.flights()
    odd = [flown.renamed(first, "_$\\frac{"), flown.renamed(second, "転 " + "long " * 30)]
    assert len(draw(odd, tmp_path, flown.scenario(flown.HOSTILE))) == len(NAMES)


@pytest.mark.slow
@pytest.mark.parametrize("extra", leading([flown.lost, flown.still]))
def test_lost_and_resting_runs_are_drawn(tmp_path: Path, extra: object) -> None:
    assert callable(extra)
    assert len(draw([extra()], tmp_path, flown.scenario())) == len(NAMES)


def test_a_lost_run_does_not_flatten_the_others() -> None:
    sound = collect(flown.flights(), 2000, flown.scenario())
    mixed = collect([*flown.flights(), flown.lost()], 2000, flown.scenario())
    highest = max(float(np.abs(curve).max()) for curve in sound.rate.panels[0].curves)
    span = mixed.rate.panels[0].span
    assert span is not None
    assert max(map(abs, span)) < 10.0 * highest
    assert mixed.rate.panels[0].label == sound.rate.panels[0].label


def test_a_law_keeps_its_colour_and_many_laws_have_one() -> None:
    colours = [colour(i) for i in range(40)]
    assert colours[: len(COLOURS)] == list(COLOURS)
    assert all(re.fullmatch("#[0-9A-F]{6}", one) for one in colours)
    # No two are alike, and the first are far apart: in squares of the largest distance along a channel.
    assert len(set(colours)) == 40
    parts = np.array([[int(one[i : i + 2], 16) for i in (1, 3, 5)] for one in colours[: len(COLOURS)]])
    apart = np.linalg.norm(parts[:, None] - parts[None], axis=2) + 1e9 * np.eye(len(parts))
    assert apart.min() > 50.0


def test_a_limit_is_shown_where_it_matters() -> None:
    assert collect(flown.flights(), 2000, flown.scenario()).torque.panels[0].levels == (-0.01, 0.01)
    first = flown.flights()[0]
    far = Recording(first.recording.arrays, first.recording.attrs | {"torque_limit": 5.0})
    plot = collect(
        [type(first)(first.name, first.law, far, first.metrics, {}, first.metric_set)], 2000, flown.scenario()
    ).torque
    assert plot.panels[0].levels == ()
    assert "off the scale" in plot.dashed


def test_a_far_limit_of_wheels_does_not_flatten_them() -> None:
    scenario = load("wheels-orbital").with_({"simulation.duration": "2 s", "law.uncompensated": None})
    entry = scenario.laws[0]
    loop = build(scenario, entry)
    run = label(loop, *fly(loop, scenario.table.simulation.steps), 1)
    for name, grown in (("wheel_torque", 1e-3), ("wheel_torque", 1e3)):
        arrays = run.arrays | {name: run[name] * grown}
        flight = Flight(entry.name, entry.law.name, replace(run, arrays=arrays), {}, {}, METRICS)
        plot = next(one for one in collect([flight], 2000, scenario).further if one.name == "wheel-torque")
        assert all(bool(panel.levels) == (grown > 1.0) for panel in plot.panels)
        assert ("off the scale" in plot.dashed) == (grown < 1.0)


def test_whether_a_reading_is_new_has_no_plot() -> None:
    first = flown.flights()[0]
    columns = first.recording.columns | {
        "magnetometer_magnetic_field_is_new": ("1", "1 where it is a new one, else 0", ""),
        "own_count": ("1", "a count", ""),
    }
    zeros = np.zeros(len(first.recording["time"]))
    arrays = first.recording.arrays | {"magnetometer_magnetic_field_is_new": zeros, "own_count": zeros}
    run = replace(first.recording, arrays=arrays, columns=columns)
    names = [plot.name for plot in recorded_plots([replace(first, recording=run)], 1, KNOWN)]
    assert "own-count" in names
    assert not any("is-new" in name for name in names)


def test_words_of_marks_do_not_stand_over_one_another() -> None:
    random = np.random.default_rng(2)
    marks = [Mark(float(time), "detumble"[: random.integers(1, 9)]) for time in random.uniform(0.0, 100.0, 30)]
    rows = word_rows(marks, 100.0)
    assert 8 < len(rows) < len(marks)
    for row in range(WORD_ROWS):
        own = sorted(mark for mark in rows if rows[mark] == row)
        # A letter has about 4.6 of 507 points.
        assert all(b.time - a.time > len(a.word) * 100.0 * 4.6 / 507.0 for a, b in pairwise(own))


def test_roll_pitch_and_yaw_are_those_of_the_algebra() -> None:
    q = np.random.default_rng(3).normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    expected = [np.degrees(to_angles(tuple(row)))[::-1] for row in q]
    assert roll_pitch_yaw(q) == pytest.approx(np.array(expected), abs=1e-9)
    # A small turn about one axis is that angle alone.
    small = np.radians(0.2)
    assert roll_pitch_yaw(np.array([[np.cos(small / 2), 0.0, np.sin(small / 2), 0.0]]))[0] == pytest.approx([0.0, 0.2, 0.0])
    panels = collect(flown.flights(), 2000, flown.scenario()).roll_pitch_yaw.panels
    assert [panel.label for panel in panels] == ["roll, deg", "pitch, deg", "yaw, deg"]


def stretched(flight: Flight, rate: float, count: int = 4001) -> Flight:
    """A flight of 400 s whose errors fall at a rate (1/s)."""
    times = 0.1 * np.arange(count)
    fall = np.exp(-rate * times)
    half = 0.5 * fall
    arrays = {
        "time": times,
        "attitude_error": np.column_stack([np.cos(half), np.sin(half), 0.0 * half, 0.0 * half]),
        "rate_error": np.column_stack([fall, 0.0 * fall, 0.0 * fall]),
        "torque": np.column_stack([fall, 0.0 * fall, 0.0 * fall]),
    }
    return replace(flight, recording=Recording(arrays, flight.recording.attrs))


@pytest.mark.slow
def test_the_transient_of_a_long_run_is_drawn_by_itself(tmp_path: Path) -> None:
    first = flown.flights()[0]
    flights = [stretched(first, 0.2), stretched(first, 0.1)]
    end = early(flights)
    # The slower one is at 2 % after ln 50/0.1 s.
    assert end == pytest.approx(1.2 * np.log(50.0) / 0.1, abs=0.2)
    assert {len(one.recording["time"]) for one in until(flights, end)} == {len(np.flatnonzero(0.1 * np.arange(4001) <= end))}
    drawn = {path.stem for path in draw(flights, tmp_path, flown.scenario())}
    assert drawn == {*NAMES, "angle-transient", "torque-transient"}
    # Nothing of it where the transient is most of the run, and none where nothing comes near.
    assert early([stretched(first, 0.01)]) is None
    assert early([stretched(first, 0.02)]) is None
    assert early([stretched(first, 0.0)]) is None
    assert early([flown.lost()]) is None


def test_rounding_in_gains_reads_as_nothing() -> None:
    assert number_text([[0.5, 2.85e-20, 0.0], [2.85e-20, 0.25, 0.0], [0.0, 0.0, 0.125]]) == "diag(0.5, 0.25, 0.125)"
    assert number_text([[0.5, 1e-9], [1e-9, 0.25]]) == "[[0.5, 1e-09], [1e-09, 0.25]]"
    assert number_text((1.0, -3e-17, 1e-12)) == "[1, 0, 1e-12]"
    assert number_text(2.85e-20) == "2.85e-20"
    assert number_text([0.0, 0.0, 0.0]) == "[0, 0, 0]"


@pytest.mark.parametrize("factor", [2, 3, 8])
def test_thinning_keeps_chatter_and_smooth_values(factor: int) -> None:
    times = np.arange(1000) * 0.1
    kept = thin_times(times, factor)
    assert len(kept) == len(thin(times, factor)) == 2 * -(-1000 // factor)
    assert (np.diff(kept) >= 0.0).all()
    assert (kept[0], kept[-1]) == (times[0], times[-1])
    # A smooth curve keeps true samples at true times.
    smooth = np.exp(-0.1 * times)
    np.testing.assert_array_equal(thin(smooth, factor), np.exp(-0.1 * kept))
    chatter = np.where(np.arange(1000) % 2, 1.0, -1.0)
    thinned = thin(chatter, factor)
    assert (thinned.min(), thinned.max()) == (-1.0, 1.0)
    assert np.abs(np.diff(thinned)).mean() > 0.9
    # A single spike survives.
    spike = np.zeros(1000)
    spike[501] = 5.0
    assert thin(spike, factor).max() == 5.0
    # A run that was lost is thinned on the same grid.
    assert len(thin(smooth[:100], factor)) == 2 * -(-100 // factor)


def test_nothing_to_thin() -> None:
    values = np.arange(5.0)
    assert thin(values, 1) is values
    assert thin_times(values, 1) is values
    assert not len(thin(np.empty(0), 4))
