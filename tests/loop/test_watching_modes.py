"""Conditions that look beyond the measurement, against ERFA and what was recorded; monitors against counts in Python."""

import math
import re
import tomllib
from pathlib import Path
from types import SimpleNamespace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.algebra.rotation import short_turn
from starhold.laws.monitors import KINDS, Monitor, watched
from starhold.parts import sun
from starhold.scenario.reading import builtin_text, parse
from starhold.studies.compare import record
from starhold.studies.modes import epoch_of, modes_flown
from starhold.studies.verification import by_flight
from tests.making import built, flown
from tests.missions import GUARDED, HEADS, SAFE, WATCHFUL, WHEELS, cubesat, mode
from tests.refusals import refused
from tests.sky import MARCH, to_sun

FREE = GUARDED.replace('on_loss = "safe"\n', "")


def between(test, level, more="", *tables):
    """A flight over an orbit, in its first mode where a quantity is below a level, in its second one where it is above."""
    text = cubesat(*tables, FREE, duration=6000, period=2.0, rate=(0.002, -0.001, 0.0015))
    text += mode("below", f'until = {{ {test}_above = "{level}"{more} }}')
    return flown(built(parse(text + mode("above", f'back = {{ {test}_below = "{level}"{more} }}'), "m.toml")), 3000)


def check(run, values, level, grain):
    """The mode says on which side of the level the values lie, wherever they are farther from it than `grain`."""
    clear = np.abs(values - level) > grain
    assert np.array_equal((run["mode"] > 1.5)[clear], (values > level)[clear])
    assert clear.mean() > 0.95
    assert 0.02 < (run["mode"] > 1.5).mean() < 0.98


def test_a_station_sees_the_craft_at_the_elevation_of_the_iau_s_routines():
    run = between("elevation", "-20 deg", ', latitude = "52 deg", longitude = "-60 deg", height = 300')
    site, up = (
        erfa.gd2gc(1, math.radians(-60.0), math.radians(52.0), 300.0),
        erfa.s2c(math.radians(-60.0), math.radians(52.0)),
    )
    turns = erfa.gmst82(2451545.0, MARCH + run["time"] / 86400.0)
    spun = np.array([erfa.rz(-turn, np.eye(3)) for turn in turns])
    ahead = run["position"] - spun @ site
    check(run, np.arcsin(np.sum(ahead * (spun @ up), axis=1) / np.linalg.norm(ahead, axis=1)), math.radians(-20.0), 1e-4)


def test_sunlight_and_the_angle_to_the_sun_follow_the_ephemeris():
    run = between("sun_angle", "70 deg", ", axis = [0, 0, 2]", '[target]\nmode = "orbital"\n')
    q, sun = run["attitude"], to_sun(MARCH + run["time"] / 86400.0)
    down = Rotation.from_quat(q[:, [1, 2, 3, 0]]).apply([0.0, 0.0, 1.0])
    check(run, np.arccos(np.sum(down * sun, axis=1)), math.radians(70.0), 1e-3)

    run = between("sunlight", 0.5)
    along = np.sum(run["position"] * to_sun(MARCH + run["time"] / 86400.0), axis=1)
    # The edge of a cylinder is where the middle of the Sun is seen to set, to the angle by which light spreads.
    behind = np.sqrt(np.sum(run["position"] ** 2, axis=1) - along**2)
    check(run, np.where(along > 0.0, 1e4, behind - 6378137.0), 0.0, 5e3)


def test_times_come_at_the_nearest_control_instant():
    text = cubesat(FREE, period=0.5) + mode("wait", 'until = { not_before = "2026-03-05T06:30:20.3Z" }')
    text += mode("pass", "until = { not_after = 20.8 }", 'back = { after = "10 s" }')
    run = flown(built(parse(text + mode("rest"), "m.toml")), 100)
    begun = {place: run["time"][np.argmax(run["mode"] == place)] for place in (2.0, 3.0)}
    # 20.3 s is nearest to 20.5 s, 20.8 s to 21 s, up to which the next mode may begin.
    assert begun == {2.0: 20.5, 3.0: 21.0}


def test_a_lost_tracker_leads_to_the_safe_mode_and_a_fix_out_of_it():
    monitor = '[[law.monitor]]\nname = "tracker"\nkind = "stuck"\nreading = "attitude"\nlimit = "5 s"\n'
    text = (
        cubesat(HEADS, GUARDED, monitor)
        + mode("work")
        + mode("safe", 'until = { tracker_age_below = "0.6 s", to = "work" }')
    )
    scenario = parse(text, "m.toml")
    run = record(scenario, built(scenario))
    assert [(one.mode, one.monitor) for one in modes_flown(scenario.laws[0].law, run)] == [
        ("work", ""), ("safe", "tracker"), ("work", "")
    ]  # fmt: skip
    safe = run["time"][run["mode"] == 2.0]
    # The last attitude comes at 99 s, the next at 160 s.
    assert (safe[0], safe[-1]) == (104.0, 159.5)
    assert np.array_equal(run["mode"] == 2.0, run["tripped"] == 1.0)
    assert run["trips"][-1] == 1.0


def test_a_monitor_looks_in_its_modes_alone_and_anew_each_time():
    monitor = '[[law.monitor]]\nname = "still"\nkind = "stuck"\nreading = "attitude"\nlimit = "5 s"\nmodes = ["sun"]\n'
    text = cubesat(HEADS, GUARDED, monitor) + mode("wait", 'until = { after = "MOMENT" }')
    text += mode("sun", 'until = { after = "400 s" }') + mode("safe")
    # The outage begins at 100 s; in the mode before it counts for nothing.
    for moment, safe in (("50 s", 104.0), ("120 s", 125.0), ("158 s", math.inf)):
        scenario = parse(text.replace("MOMENT", moment), "m.toml")
        run = flown(built(scenario), 600)
        begins = [one.time for one in modes_flown(scenario.laws[0].law, run) if one.mode == "safe"]
        assert (begins or [math.inf])[0] == pytest.approx(safe, abs=1.0)
    with refused("law[1].monitor[1].modes", 'found "sum"', "did you mean sun?"):
        parse(text.replace("MOMENT", "50 s").replace('["sun"]', '["sum"]'), "m.toml")


@pytest.mark.slow
def test_a_filter_counts_as_converged_by_its_own_covariance():
    text = cubesat(HEADS, FREE) + mode("wait", 'until = { attitude_deviation_below = "0.0115 deg", dwell = "3 s" }')
    run = flown(built(parse(text + mode("work"), "m.toml")), 100)
    small = np.linalg.norm(run["mekf_attitude_deviation"], axis=1) < math.radians(0.0115)
    # Three seconds are six control periods, so seven instants.
    first = next(k for k in range(6, 100) if small[k - 6 : k + 1].all())
    assert np.argmax(run["mode"] == 2.0) == first > 12


LOST = "".join(f"[[fault]]\ntime = {20 * k}\nwheel = {k}\nlost = true\ndelay = 5\n" for k in (1, 2))


@pytest.mark.parametrize(("wheels", "begins"), [(1, 25.0), (2, 45.0)])
def test_the_safe_mode_begins_as_so_many_wheels_are_known_to_be_lost(wheels, begins):
    guarded = GUARDED.replace('"safe"', f'"safe"\nfault_action = "reallocate"\nwheels_lost = {wheels}')
    text = cubesat(WHEELS, LOST, guarded) + mode("work", 'effectors = ["wheels"]') + SAFE
    run = flown(built(parse(text.replace('torque_limit = "2 mN m"\n[orbit]', "[orbit]"), "m.toml")), 200)
    assert run["time"][np.argmax(run["mode"] == 2.0)] == begins
    assert (run["mode"][run["time"] >= begins] == 2.0).all()
    assert run["trips"][-1] == 1.0 + (wheels == 1)


def counted(kind, values, estimates, limit, times):
    """When a monitor of these values, half a second apart, is tripped."""
    beyond, stood, found = 0, 0, []
    for k, value in enumerate(values):
        new = k == 0 or value != values[k - 1]
        elapsed, before = 0.5 * (stood + 1), values[k - 1] if k else value
        stood = 0 if new else stood + 1
        if kind == "stuck":
            found.append(0.5 * stood >= limit)
            continue
        wrong = {
            "range": abs(value) > limit, "rate": k > 0 and abs(value - before) > limit * elapsed,
            "residual": abs(value - estimates[k]) > limit,
        }[kind]  # fmt: skip
        beyond = (beyond + 1 if wrong else 0) if new or kind == "range" else beyond
        found.append(beyond >= times)
    return found


def test_the_mission_of_the_page_about_modes_works_over_its_station_and_ends_in_its_safe_mode():
    page = (Path(__file__).parents[2] / "docs" / "modes.md").read_text(encoding="utf-8")
    story = tomllib.loads(re.findall(r"^```toml\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)[-1])
    scenario = sh.scenario(tomllib.loads(builtin_text("cubesat-mission")) | story)
    entry, run = scenario.laws[0], record(scenario, built(scenario))
    begun = modes_flown(entry.law, run, epoch_of(scenario, entry.law))
    assert [one.mode for one in begun] == ["detumble", "nadir", "pass", "nadir", "pass", "safe"]
    # Three and a half hours, and ten seconds until the loss is known.
    assert (begun[-1].time, begun[-1].utc) == (12610.0, "2026-03-20T15:30:10.000")
    assert begun[2].utc > "2026-03-20T13:30:00"
    assert by_flight(scenario, entry, run)["requirement[1]"].verdict == "met"
    assert (run["trips"][-1], run["tripped"].max()) == (1.0, 0.0)


SIZES = {"number": 1, "vector": 3, "attitude": 4}
SHAPES = [(kind, shape) for kind in KINDS for shape in SIZES if (kind, shape) != ("range", "attitude")]
"""An attitude has no size."""


@pytest.mark.parametrize(("kind", "shape"), SHAPES)
def test_a_monitor_trips_where_counting_says(kind, shape):
    rng = np.random.default_rng(5)
    values = np.repeat(rng.uniform(-1.0, 1.0, 300), rng.integers(1, 4, 300))
    values[400:420] = values[400]
    estimates = values + rng.uniform(-1.0, 1.0, len(values))
    formed = {
        "number": lambda x: x,
        "vector": lambda x: (0.0, x, 0.0),
        "attitude": lambda x: short_turn((0.5 * x, 0.0, 0.0)),
    }[shape]
    limit, times = (3.0, 1) if kind == "stuck" else (0.6, 2)
    monitor = Monitor("one", kind, "value", "1", SIZES[shape])
    guard, found = monitor.at_start, []
    for value, estimate in zip(values, estimates, strict=True):
        sight = SimpleNamespace(
            readings=(SimpleNamespace(other=1.0), SimpleNamespace(value=formed(value))),
            estimate=SimpleNamespace(value=formed(estimate)),
        )
        now = SimpleNamespace(
            sight=sight, measurement=SimpleNamespace(period=0.5), later=lambda periods, time: time - 0.25 <= 0.5 * periods
        )
        truth, guard = watched(monitor, guard, now, limit, float(times))
        found.append(truth)
    assert found == counted(kind, values, estimates, limit, times)
    assert 3 < sum(found) < len(found) - 3


def test_conditions_and_slews_see_the_sun_of_the_file():
    """That which parts see, by almanac or precise, as it is held against ERFA in test_ephemeris."""
    epoch, seen = (2026.0, 3.0, 5.0, 6.0, 30.0, 0.0), []
    for place, given in enumerate(("", 'ephemeris = "precise"\n')):
        found = parse(WATCHFUL.replace("[orbit]\n", f"[orbit]\n{given}"), "here")
        numbers = built(found).carry().memory.watch.sky.sun
        assert numbers == found.laws[0].slews[1].sun == sun.prepared(epoch, place)
        seen.append(np.array(sun.sun(0.0, numbers).direction))
    assert 1e-5 < np.linalg.norm(seen[0] - seen[1]) < 1e-3
