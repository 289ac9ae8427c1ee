"""The page flies again: in the browser's own engine, and in node, with the bits that Python gives of the same numbers."""

import json
import subprocess
import tempfile
from collections.abc import Iterator
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from starhold.analysis.rigid_body import METRICS
from starhold.files import write_text
from starhold.report.answer import key_metrics
from starhold.report.body import Sampling
from starhold.report.page import living_data, render
from starhold.scenario.reading import Scenario, builtin_text, load, parse
from starhold.studies import compare as studies
from starhold.studies.flight import Flight
from starhold.studies.questions import UNASKED
from starhold.studies.reflight import COMPUTED, FAULTS, reflight
from tests.browser import Browser
from tests.report import flown
from tests.simulation.loops import CAUTIOUS, FUNCTIONS
from tests.tiers import leading
from tests.trace.machines import need

DESKTOP, PHONE = (1400, 900), (390, 844)


def fly(scenario: Scenario, prove: bool = False) -> list[Flight]:
    found: list[Flight] = []
    for entry in scenario.laws:
        loop = studies.build(scenario, entry)
        flight = studies.fly_law(scenario, entry, loop)
        found.append(studies.prove(scenario, entry, loop, flight) if prove else flight)
    return found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("living") / "report.html"
    scenario = parse(flown.text(), "short")
    write_text(path, render(scenario, fly(scenario, prove=True)))
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = Browser()
    yield found
    found.close()


def slide(browser: Browser, name: str, share: float) -> None:
    """Move a slider to a share of its way, as a hand does, and wait until all that follow it have landed."""
    moved = browser.ask(
        f"""(() => {{
            const slide = document.querySelector('input[aria-label="{name}, slider"]');
            slide.value = {share};
            slide.dispatchEvent(new Event("input", {{bubbles: true}}));
            return fates.map((found) => Boolean(found.flies));
        }})()"""
    )
    assert any(moved)
    landed(browser)


def landed(browser: Browser) -> None:
    browser.wait(
        "[...runners.values()].every((runner) => !runner.busy && !runner.again) && state.arrived.length === 0"
        " && fates.every((found, number) => !found.flies || state.results.has(number))"
    )


def see(browser: Browser) -> None:
    """Have all plots drawn, as if all were in sight at once."""
    browser.ask('charts.forEach((chart) => { chart.seen = true; }); document.dispatchEvent(new Event("plots-seen"))')
    landed(browser)


def ends(browser: Browser) -> list[dict[str, float]]:
    """The last values of each law's curves that the page has drawn, by plot and panel."""
    return browser.ask(
        """report.laws.map((_, number) => Object.fromEntries([...charts.values()].filter((chart) => !chart.plot.split)
            .flatMap((chart) => chart.panels.map((u, k) => [`${chart.plot.name} ${k}`,
                u.data[1 + chart.plot.panels[k].order.indexOf(number)].at(-1)]))))"""
    )


def expected(flight: Flight) -> dict[str, float]:
    run = flight.recording
    rate = 180.0 / np.pi
    found = {f"quaternion {k}": run["attitude_error"][-1, k] for k in range(4)}
    found |= {f"torque {k}": run["torque"][-1, k] for k in range(3)}
    return found | {f"rate {k}": run["rate_error"][-1, k] * rate for k in range(3)}


@pytest.mark.parametrize("size", [DESKTOP, pytest.param(PHONE, marks=pytest.mark.slow)])
def test_a_slider_flies_the_laws_again(browser: Browser, page: Path, size: tuple[int, int]) -> None:
    browser.complaints.clear()
    browser.open(page, *size)
    before = ends(browser)
    see(browser)
    slide(browser, "rate y", 0.9)
    slide(browser, "lyapunov k_rate", 0.7)
    text = browser.ask("fileText()")
    again = fly(parse(text, "the page's file"))
    drawn = ends(browser)
    assert drawn != before
    for flight, found in zip(again, drawn, strict=True):
        wanted = expected(flight)
        assert {name: found[name] for name in wanted} == wanted
    # What is ranked is what Python measures of these numbers.
    rows = browser.ask(
        '[...document.querySelectorAll("table.ranking tbody tr")].map((row) => [...row.cells].map((c) => c.textContent))'
    )
    results = {flight.name: flight.metrics for flight in again}
    ranked = METRICS.ranked(results)
    assert [row[0] for row in rows] == ranked
    metrics = key_metrics(METRICS, results)
    assert [row[2:] for row in rows] == [[METRICS.cell(name, results[law]) for name in metrics] for law in ranked]
    frames = browser.ask("views.map((view) => view.frames.at(-1))")
    assert frames == [flight.recording["attitude_error"][-1].tolist() for flight in again]
    assert browser.complaints == []


def test_claims_grey_out_and_stay_lit(browser: Browser, page: Path) -> None:
    browser.open(page)

    def grey() -> dict[str, list[str]]:
        return browser.ask(
            """Object.fromEntries([...document.querySelectorAll(".law")].map((law) => [law.querySelector("h3").textContent,
                [...law.querySelectorAll(".claim.grey .what > b")].map((b) => b.textContent)]))"""
        )

    assert set(map(tuple, grey().values())) == {()}
    slide(browser, "lyapunov k_rate", 0.6)
    found = grey()
    assert "Converges" in found["lyapunov"]
    assert found["sliding"] == []
    assert "k_rate has changed" in browser.ask('document.querySelector(".claim.grey .now").textContent')
    browser.ask('document.getElementById("dials-reset").click()')
    assert set(map(tuple, grey().values())) == {()}
    # An inertia that the law does not know: the claim that holds for any of them stays lit.
    browser.ask('document.getElementById("known").click()')
    slide(browser, "inertia x", 0.6)
    found = grey()
    assert "Converges" in found["lyapunov"]
    assert "Uncertain inertia" not in found["lyapunov"]
    assert 'action = "none"' in browser.ask("fileText()")
    lit = browser.ask('[...document.querySelectorAll(".claim:not(.grey) .now")].map((b) => b.textContent).join()')
    assert "proved for every inertia" in lit
    browser.ask('document.getElementById("dials-reset").click()')
    # What is within a limit is within a larger one.
    slide(browser, "torque limit", 0.8)
    assert grey()["lyapunov"] == []
    slide(browser, "torque limit", 0.3)
    assert grey()["lyapunov"] == ["Within the torque limit"]


@pytest.mark.slow
def test_the_address_holds_the_sliders(browser: Browser, page: Path) -> None:
    browser.open(page)
    see(browser)
    slide(browser, "attitude yaw", 0.31)
    slide(browser, "inertia z", 0.45)
    address = browser.wait("location.hash.length > 1 && location.hash.slice(1) === hash() && location.href")
    values, drawn = browser.ask("[...moved]"), ends(browser)
    browser.open(address)
    see(browser)
    assert browser.ask("[...moved]") == values
    assert ends(browser) == drawn
    # Nonsense in an address moves nothing.
    browser.complaints.clear()
    browser.open(f"{page.as_uri()}#initial.rate=%5B1%5D&spacecraft.inertia=NaN&law.lyapunov.k_rate=-1&nothing=3&%E0%A4%A=1")
    assert browser.ask("moved.size") == 0
    assert browser.complaints == []


def test_what_no_body_has_is_said(browser: Browser, page: Path) -> None:
    browser.open(page)
    flown_before = browser.ask("state.flown")
    browser.ask(
        """(() => { const field = document.querySelector('input[aria-label="inertia x"]');
            field.value = "9"; field.dispatchEvent(new Event("change")); })()"""
    )
    said = browser.ask('document.getElementById("unsound").textContent')
    assert "spacecraft.inertia: no body has these principal moments" in said
    assert "exceeds the sum" in said
    assert browser.ask('document.getElementById("dials-copy").disabled')
    assert browser.ask("state.flown") == flown_before
    browser.ask(
        """(() => { const field = document.querySelector('input[aria-label="lyapunov k_rate"]');
            field.value = "-2"; field.dispatchEvent(new Event("change")); })()"""
    )
    assert browser.ask("""document.querySelector('[data-key="law.lyapunov.k_rate"]').className""") == "dial bad"
    why = browser.ask("""document.querySelector('[data-key="law.lyapunov.k_rate"] .why').textContent""")
    assert why == "must be above 0"
    assert not browser.ask('moved.has("law.lyapunov.k_rate")')


def test_axes_hold_a_motion_that_dies_out_and_one_that_never_is(browser: Browser, page: Path) -> None:
    browser.open(page)

    def span(log: bool, values: str) -> Any:
        return browser.ask(
            f"span({{order: [0], levels: [], log: {str(log).lower()}}}, {{lost: new Set(), plot: {{}}}}, "
            f"{{series: [{{}}], data: [[0, 1], {values}]}})"
        )

    low, high = span(True, "[60, 1e-31]")
    assert high == pytest.approx(100.0)
    assert 1e-15 < low < 1e-13
    assert span(False, "[0, 0]") == [-1, 1]


def test_ticks_have_their_sign_and_marks_their_room(browser: Browser, page: Path) -> None:
    browser.open(page)
    told = browser.ask("[1e-4, -2.5e-5, 123456, -0.5, 0, 12345].map((x) => short(x, 6))")
    assert told == ["1×10⁻⁴", "−2.5×10⁻⁵", "1.23456×10⁵", "−0.5", "0", "12345"]
    marks = [[time, "a mode"] for time in range(100)]
    words = browser.ask(f"placedWords({json.dumps(marks)}, (x) => 8 * x, () => 60)")
    shown = [(one["row"], one["x"]) for one in words if one["word"]]
    assert 10 < len(shown) < len(marks)
    for row in range(3):
        own = [x for other, x in shown if other == row]
        assert all(b - a >= 60 for a, b in pairwise(own))


def test_rates_are_moved_in_the_units_of_the_file() -> None:
    scenario = shortened("three-laws", "1 s", "lyapunov").with_({"initial.rate": ["2 deg/s", "0 deg/s", "-1 deg/s"]})
    for given, degrees in ((scenario, True), (scenario.with_({"initial.rate": [0.1, 0.0, 0.0]}), False)):
        data = living_data(given, fly(given), Sampling(1))
        assert not isinstance(data, str)
        dials = {dial["key"]: dial for dial in data["dials"]}
        assert dials["initial.rate"]["degrees"] is degrees
        assert dials["initial.rate"]["unit"] == "rad/s"
        assert dials["spacecraft.torque_limit"]["above"] == 0.0


# --- in node, loop by loop ---


def shortened(name: str, duration: str, *laws: str) -> Scenario:
    scenario = load(name)
    gone = {f"law.{entry.name}": None for entry in scenario.laws if laws and entry.name not in laws}
    # A page does not fly a loop that a fault changes.
    return scenario.with_(gone | {"simulation.duration": duration} | ({"fault[1]": None} if name == FUNCTIONS else {}))


LOOPS = {
    "three-laws": ("three-laws", "4 s"),
    "wheels": ("wheels-orbital", "12 s"),
    "landing": ("landing", "20 s", "fit"),
    "noise": ("three-laws-noise", "12 s", "lyapunov"),
    "every function, the time": (FUNCTIONS, "50 s"),
    "a law that reads validity": (CAUTIOUS, "15 s"),
    "matrix inertia": ("geostationary", "100 s", "pd", "matrix-pd"),
}


@pytest.mark.parametrize("name", leading(LOOPS))
def test_what_flies_in_node_is_what_python_flies(name: str) -> None:
    need("node")
    scenario = shortened(*LOOPS[name])
    made, flights = reflight(scenario), fly(scenario)
    data = json.loads(json.dumps(living_data(scenario, flights, Sampling(1))))
    for moves in moves_of(made.dials):
        again = {flight.name: flight for flight in fly(made.changed(moves))}
        jobs = []
        for number, law in data["laws"].items():
            if all(key in law["follows"] for key in moves if key.split(".")[0] != "law" or key.split(".")[1] == law["name"]):
                values = (
                    made.dials
                    | {linked: moves[leader] for linked, leader in data["linked"].items() if leader in moves}
                    | moves
                )
                limit = data["ranking"]["rows"][int(number)]["limit"]
                asked = {
                    "number": 1,
                    "values": [x for key in law["follows"] for x in np.ravel(values[key]).tolist()],
                    "plots": {},
                    "early": None,
                    "factor": 1,
                    "frames": [],
                    "limit": moves.get("spacecraft.torque_limit", limit["size"]),
                }
                jobs.append((law, asked))
        assert jobs
        for (law, _), found in zip(jobs, on_node(jobs, data["every"]), strict=True):
            flight = again[law["name"]]
            rows = [np.atleast_1d(flight.recording[column][-1]) for column, _ in law["columns"]]
            assert found["last"] == np.concatenate(rows).tobytes().hex(), (law["name"], moves)
            for metric, value in found["metrics"].items():
                wanted = flight.metrics[metric]
                near = pytest.approx(wanted, rel=1e-12, abs=0.0) if isinstance(wanted, float) else wanted
                assert value == near, (law["name"], metric)


@pytest.mark.slow
def test_a_move_takes_less_than_a_sixtieth_of_a_second() -> None:
    need("node")
    scenario = shortened("three-laws", "2000 s", "lyapunov", "sliding")
    data = living_data(scenario, fly(scenario), Sampling(27))
    assert not isinstance(data, str)
    panels = {
        "angle": [("angle", 57.3), ("norm", "rate_error", 57.3)],
        "torque": [("column", "torque", k, 1.0) for k in range(3)],
    }
    for number, law in data["laws"].items():
        values = [x for key in law["follows"] for x in np.ravel(reflight(scenario).dials[key]).tolist()]
        limit = data["ranking"]["rows"][int(number)]["limit"]
        asked = {"number": 1, "values": values, "plots": panels, "early": None, "factor": 27}
        asked |= {"frames": list(range(0, 20000, 111)), "limit": limit["size"]}
        # Each law has a worker of its own. The least of many, for a machine that does other things too.
        (found,) = on_node([(law, asked)], data["every"], repeats=40)
        assert found["ms"] < 1000.0 / 60.0, (law["name"], found["ms"])


def moves_of(dials: dict[str, Any]) -> list[dict[str, Any]]:
    """Sets of values: start and gains; inertia that the laws know; inertia that they do not, and another limit."""
    gains = {key: value * 0.7 for key, value in dials.items() if key.startswith("law.") and isinstance(value, float)}
    stretched = tuple(np.asarray(dials["spacecraft.inertia"]) * 1.07)
    inertia = tuple(tuple(row) for row in stretched) if np.ndim(stretched[0]) else stretched
    found = [
        {"initial.rate": (0.011, -0.02, 0.005), "initial.attitude": (0.9, 0.3, -0.2, 0.1)} | gains,
        {"spacecraft.inertia": inertia},
        {"fault[1].inertia": inertia},
    ]
    if "spacecraft.torque_limit" in dials:
        found[-1]["spacecraft.torque_limit"] = dials["spacecraft.torque_limit"] * 0.8
    return found


def on_node(jobs: list[tuple[Any, Any]], every: int, repeats: int = 1) -> list[Any]:
    """The worker's program for each law, in node; with the least processor time (ms) of so many answers."""
    worker = (resources.files("starhold.report") / "assets" / "flight.js").read_text(encoding="utf-8")
    script = ["const answers = [];"]
    for law, asked in jobs:
        programs = "".join(
            f"const {name} = (() => {{\n{law[name]['text']}\nreturn {law[name]['name']};\n}})();\n"
            for name in ("fly", "derive", "note")
        )
        told = {key: value for key, value in law.items() if key not in ("fly", "derive", "note")} | {"every": every}
        script.append(
            f"answers.push((() => {{\nconst law = {json.dumps(told)};\n{programs}{worker}\n"
            f"const asked = {json.dumps(asked)};\nlet found, ms = Infinity;\nfor (let k = 0; k < {repeats}; k++) {{\n"
            "const begun = process.cpuUsage();\nfound = answer(asked);\nconst used = process.cpuUsage(begun);\n"
            "ms = Math.min(ms, (used.user + used.system) / 1000);\n}"
            "\nreturn { ms, metrics: found.metrics, last: Buffer.from(found.last.buffer).toString('hex') };\n})());"
        )
    script.append("process.stdout.write(JSON.stringify(answers));")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "run.js")
        file.write_text("\n".join(script), encoding="utf-8")
        done = subprocess.run(["node", str(file)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


# --- what follows, and what does not ---


def test_what_a_law_computes_by_other_means_is_held() -> None:
    scenario = shortened("three-laws", "1 s")
    laws = {law.name: law for law in reflight(scenario).laws}
    assert "spacecraft.inertia" in laws["sliding"].follows
    assert laws["sliding"].unfollowed == {}
    weights = ("law.mpc.q_attitude", "law.mpc.q_rate", "law.mpc.r")
    assert laws["mpc"].unfollowed == {"spacecraft.inertia": COMPUTED} | dict.fromkeys(weights, UNASKED)
    assert "initial.rate" in laws["mpc"].follows
    assert "torque_limit" in laws["mpc"].reads
    assert "torque_limit" not in laws["sliding"].reads


def test_designed_gains_are_held_as_numbers() -> None:
    text = builtin_text("three-laws").split("[[law]]")[0].replace("duration = 2000.0", "duration = 1.0")
    scenario = parse(f'{text}[[law]]\ntype = "lyapunov"\nform = "bandwidth"\nbandwidth = 0.05\n', "designed")
    made = reflight(scenario)
    (entry,) = scenario.laws
    assert made.dials["law.lyapunov.k_rate"] == entry.gains.k_rate
    assert made.scenario.laws[0].gains == entry.gains
    assert made.scenario.laws[0].form is None
    # Another inertia leaves them.
    other = made.changed({"spacecraft.inertia": (2.5, 3.0, 4.0)})
    assert other.laws[0].gains == entry.gains


def test_a_scenario_with_faults_stays_on_the_ground() -> None:
    scenario = shortened("three-laws", "5 s", "lyapunov").with_(
        {"fault": [{"time": 2.0, "inertia": [2.0, 3.1, 4.0], "action": "none"}]}
    )
    made = reflight(scenario)
    assert made.laws == ()
    assert made.grounded == {"lyapunov": FAULTS}
    assert living_data(scenario, fly(scenario), Sampling(1)) == FAULTS
    assert f"Nothing here can be flown again with sliders: {FAULTS}." in render(scenario, fly(scenario))
