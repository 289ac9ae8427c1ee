"""Claims that the checker derives again, and files with anything changed."""

import json
import math
from time import process_time

import numpy as np
import pytest

from starhold.certification.certificate import write
from starhold.certification.certify import Wanted, certify
from starhold.checker import check, check_file, passed
from starhold.laws.catalogue import catalogue
from tests import making
from tests.certification.by_hand import by_hand, converging, proved_by_hand
from tests.certification.edits import alone, claims_of, content_at, reasons, replaced, spots
from tests.certification.loops import certified, rotors
from tests.making import ORBITAL


@pytest.fixture(scope="module")
def proofs(tmp_path_factory):
    """What is proved of loops of every law."""
    path, found = tmp_path_factory.mktemp("proved") / "c.json", {}
    for name in ("lqr-I", "lqr-II-uneven", "pd-0", "pd-2", "sliding-1", "wheel-0"):
        write([certified(name, disturbance=1e-6)], "made", path)
        found[name] = json.loads(path.read_text(encoding="utf-8"))
    return found


def test_two_claims_of_one_kind_or_of_unknown_obligations_fail():
    assert passed(check(by_hand("pd", {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}, [converging()])))
    assert reasons(by_hand("pd", {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}, [converging(), converging()]))
    open_ = {"name": "seen", "how": "inspection", "outcome": "undecided", "evidence": {"reason": "none"}}
    claim = {**proved_by_hand("convergence", [], {}, {}), "outcome": "undecided", "obligations": [open_]}
    content = by_hand("pd", {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}, [claim])
    content["certificates"][0]["outcome"] = "undecided"
    assert "there is no obligation seen" in reasons(content)[0]


def test_no_claim_is_about_less_momentum_than_is_had_on_target(tmp_path):
    """A body that follows the orbit at rest on target has momentum; one with none is told of by nobody."""
    loop = rotors("wheel", catalogue()["wheel"].examples()[0], target=ORBITAL)
    loop = loop.with_parts(making.rotors(loop.wheels))
    whole = certify(loop)
    assert whole.claim("wheels").outcome == "proved"
    asked = certify(loop, "", Wanted(momentum=0.0)).claim("wheels")
    assert asked.outcome == "undecided"
    assert "so little momentum" in asked.obligations[0].evidence["reason"]
    # At rest on a target that is at rest a body has none.
    still = rotors("wheel", catalogue()["wheel"].examples()[0])
    still = still.with_parts(making.rotors(still.wheels))
    write([certify(still, "", Wanted(momentum=0.0))], "made", tmp_path / "s.json")
    assert passed(check_file(tmp_path / "s.json"))
    assert certify(still, "", Wanted(momentum=0.0)).claim("wheels").outcome == "proved"


# --- mutations --------------------------------------------------------------------------------------------------------

JUNK = (
    None,
    True,
    0,
    -1,
    5e-324,
    1e-104,
    1e104,
    1.7e308,
    10**400,
    math.nan,
    "x",
    "[/red]",
    "\ud800",
    [],
    {},
    [[]],
    [0.0] * 6,
)


@pytest.mark.parametrize("seed", range(3))
def test_mutations_neither_stumble_nor_pass_for_what_they_are_not(proofs, seed):
    """Anything in a file changed, taken away, doubled or put elsewhere: a verdict, and none better than before."""
    random = np.random.default_rng(seed)
    derived = [
        (name, kind) for name, made in proofs.items() for kind, claim in claims_of(made).items() if "proof" not in claim
    ]
    for name, kind in random.choice(derived, 4):
        content = alone(proofs[name], kind)
        paths = [path for path in spots(content) if "versions" not in path]
        for _ in range(12):
            path, other = (paths[k] for k in random.integers(len(paths), size=2))
            value, change = content_at(content, path), random.integers(4)
            if change == 0 and type(value) is float:
                new = math.nextafter(value, math.inf) if random.integers(2) else value * 10.0 ** random.uniform(-9.0, 9.0)
            else:
                new = content_at(content, other) if change == 1 else JUNK[random.integers(len(JUNK))]
            if change == 2:
                mutant = replaced(content, path, lambda spot, key: spot.pop(key))
            else:
                mutant = replaced(content, path, lambda spot, key, new=new: spot.__setitem__(key, new))
            begun = process_time()
            found = check(mutant)
            assert process_time() - begun < 20.0, path
            for verdict, outcomes in (("holds", ["proved"]), ("not claimed", ["refuted", "undecided", None])):
                kinds = {f.claim for f in found if f.verdict == verdict}
                were = {c["kind"] for c in content["certificates"][0]["claims"] if c["outcome"] in outcomes}
                assert kinds <= were or not passed(found) or kinds == {""}, path
