"""A law that asks for it is told whether its estimate is valid; claims about such a law say that they assume that it is."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.structure import flatten
from starhold.loop.kernels import make_step
from starhold.scenario.building import build
from starhold.simulation.stepper import Stepper
from tests.making import flown
from tests.simulation.loops import CAUTIOUS

FOLDER = Path(CAUTIOUS).parent
TEXT = tomllib.loads(Path(CAUTIOUS).read_text())
MODES = {"type": "modes", "mode": [{"name": "early", "until": {"after": 4.0}}, {"name": "late"}]}


def made(**more):
    return sh.scenario(TEXT | more, folder=FOLDER)


def in_modes():
    law = TEXT["law"][0]
    return made(law=[MODES | {"mode": [mode | law for mode in MODES["mode"]]}])


def without_estimator():
    return made(part=[])


@pytest.mark.parametrize("scenario", [made, in_modes], ids=["alone", "in modes"])
def test_a_law_only_damps_while_its_estimate_is_not_valid(scenario):
    loop = build(scenario(), scenario().laws[0])
    run = flown(loop, 60)
    valid = run["mekf_is_valid"]
    # Through the outage of 4 s to 12 s, from where the deviation exceeds what counts as valid.
    assert valid.tolist() == [1.0] * 12 + [0.0] * 12 + [1.0] * 37
    damping = -0.2 * run["mekf_rate"]
    assert np.array_equal(run["command"][12:24], damping[12:24])
    turned = np.abs(run["command"] - damping).max(axis=1)
    assert (turned[valid > 0.5] > 1e-4).all()
    flight = Stepper(loop)
    assert [flight.step().measurement.is_valid for _ in range(59)] == valid[1:60].tolist()
    assert np.array_equal(flight.dataset()["command"][:59], run["command"][:59])


def test_without_an_estimator_it_is_always_valid():
    loop = build(without_estimator(), without_estimator().laws[0])
    pd = made(part=[], law=[{"type": "pd"} | {k: x for k, x in TEXT["law"][0].items() if k != "file"}])
    command, expected = (flown(one, 40)["command"] for one in (loop, build(pd, pd.laws[0])))
    assert np.array_equal(command, expected)
    assert Stepper(loop).step().measurement.is_valid == 1.0


def test_it_has_no_number_in_a_loop_whose_law_does_not_ask():
    pd = made(law=[{"type": "lyapunov", "k_rate": 0.2, "k_attitude": 0.03}])
    loop = build(pd, pd.laws[0])
    seen = make_step(loop.composition()).measure(loop.carry(), 0, (1, 0), loop.craft, loop.setup())
    assert flatten((seen.is_valid,)) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            'READS = ("is_valid",)',
            "",
            r"nothing gives, in `stiffness = .*; allowed: .*is_valid where its file says READS = ",
        ),
        ("is_valid", "is_sure", "no is_sure, which cautious needs; allowed: a sensor that measures is_sure"),
    ],
)
def test_a_law_that_asks_for_nothing_or_for_what_is_not_there_is_refused(old, new, told, tmp_path):
    text = (FOLDER / "cautious.py").read_text()
    (tmp_path / "cautious.py").write_text(text.replace(old, new))
    with pytest.raises(sh.InputError, match=told) as error:
        sh.simulate(sh.scenario(TEXT, folder=tmp_path))
    assert "\n" not in str(error.value)


ESTIMATOR = """
from typing import Annotated, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.vector import Vector
from starhold.parts.contract import Card, NoMemory, NoParams as Params

CARD = Card(title="Rate", summary="w", sources=("a test",), assumptions=())
ROLE = "estimator"
NEEDS = ("rate",)


class Estimate(NamedTuple):
    rate: Annotated[Vector, Quantity("rad/s", "rate", "axis")]


def estimate(readings, memory, params, craft, period):
    return Estimate(readings.rate), memory


def examples():
    return [Params()]
"""


def test_an_estimator_that_does_not_say_is_refused_for_such_a_law(tmp_path):
    (tmp_path / "rates.py").write_text(ESTIMATOR)
    (tmp_path / "cautious.py").write_text((FOLDER / "cautious.py").read_text())
    with pytest.raises(
        sh.InputError, match="law cautious: found no is_valid, which it needs; allowed: an estimator that gives"
    ):
        sh.simulate(sh.scenario(TEXT | {"part": [TEXT["part"][0], {"file": "rates.py"}]}, folder=tmp_path))


def test_claims_assume_a_valid_estimate_and_a_flight_without_one_leaves_them():
    (certificate,) = sh.certify(made())
    assert certificate.outcome == "proved"
    assert certificate.claim("pointing") is not None
    assert all("valid-estimate" in claim.assumptions for claim in certificate.claims)
    assert all("without:estimator mekf" in claim.assumptions for claim in certificate.claims)
    (flight,) = sh.compare(made())
    begun = [one.time for one in flight.departures[0]["convergence"] if one.how == "the estimate is not valid"]
    assert begun == [6.0]


def test_a_law_that_fails_with_a_valid_estimate_is_not_proved(tmp_path):
    text = (FOLDER / "cautious.py").read_text()
    (tmp_path / "cautious.py").write_text(text.replace("gains.k_attitude, 0.0)", "0.0, gains.k_attitude)"))
    (certificate,) = sh.certify(sh.scenario(TEXT, folder=tmp_path))
    claim = certificate.claim("convergence")
    assert claim.outcome == "undecided"
    assert "valid-estimate" in claim.assumptions
