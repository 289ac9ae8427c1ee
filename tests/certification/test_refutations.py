"""What the checker takes for a refutation: a false obligation of the claim, at a state of its set; nothing that holds."""

import copy
import json
import math
from time import process_time

import numpy as np
import pytest

from starhold.certification.certificate import write
from starhold.certification.certify import Wanted, certify
from starhold.checker import check, check_file, passed
from starhold.laws import lqr, matrix_pd, pd, sliding
from starhold.laws.catalogue import catalogue
from starhold.laws.sliding import Gains as Sliding
from tests import making
from tests.certification.by_hand import by_hand, converging, proved_by_hand
from tests.certification.edits import alone, claims_of, content_at, edited, reasons, replaced, spots
from tests.certification.loops import FULL, LOPSIDED, PRINCIPAL, UNEVEN, certified, loop_of, rotors
from tests.making import ORBITAL

SKEWED = ((0.01, 0.02, 0.0), (0.02, 0.01, 0.0), (0.0, 0.0, 0.01))
CASES = {
    "rises": ("matrix-pd", matrix_pd.Gains((0.09, -0.09, 0.09), (0.01,) * 3), Wanted(), "convergence"),
    "not positive": ("matrix-pd", matrix_pd.Gains((0.09,) * 3, (0.01, 0.01, -0.01)), Wanted(), "convergence"),
    "indefinite": ("matrix-pd", matrix_pd.Gains((0.09,) * 3, SKEWED), Wanted(), "convergence"),
    "anywhere": ("lqr", lqr.design(PRINCIPAL, LOPSIDED), Wanted(rate=math.inf), "convergence"),
    "at any attitude": ("lqr", lqr.design(PRINCIPAL, LOPSIDED), Wanted(rate=1.0), "convergence"),
    "axis": ("lqr", lqr.design(PRINCIPAL, UNEVEN), Wanted(slew_angle=math.radians(120.0)), "torque-limit"),
    "norm": ("lqr", lqr.design(PRINCIPAL, UNEVEN), Wanted(slew_angle=math.radians(120.0)), "torque-limit"),
    "slow": ("pd", pd.Gains(9.0, 1.0), Wanted(), "sampling"),
    "pushed by gravity": ("sliding", Sliding((0.08,) * 3, (1e-7,) * 3), Wanted(), "sliding"),
    "pushed": ("sliding", Sliding((0.08,) * 3, (5e-3,) * 3), Wanted(disturbance=0.01), "sliding"),
    "led away": ("sliding", Sliding((0.08, -0.08, 0.08), (5e-3,) * 3), Wanted(), "sliding"),
}


@pytest.fixture(scope="module")
def refuted(tmp_path_factory):
    path, done = tmp_path_factory.mktemp("refuted") / "c.json", {}

    def make(name):
        if name not in done:
            law, gains, wanted, kind = CASES[name]
            changes = {"limit": "norm"} if name == "norm" else {"period": 1.0} if name == "slow" else {}
            craft = FULL if law == "sliding" else PRINCIPAL
            write([certify(loop_of(law, gains, craft, **changes), name, wanted)], "made", path)
            content = json.loads(path.read_text(encoding="utf-8"))
            assert claims_of(content)[kind]["outcome"] == "refuted"
            done[name] = alone(content, kind)
        return copy.deepcopy(done[name]), CASES[name][3]

    return make


@pytest.mark.parametrize("name", CASES)
def test_a_refutation_holds_as_it_is_and_nothing_else_is_told_of_it(refuted, name):
    content, kind = refuted(name)
    assert reasons(content) == []
    assert passed(check(content))
    claim = claims_of(content)[kind]
    place = next(k for k, o in enumerate(claim["obligations"]) if o["outcome"] == "refuted")
    evidence = (kind, "obligations", place, "evidence")
    told = claim["obligations"][place]["evidence"]
    for path in spots(told):
        value = told
        for key in path:
            value = value[key]
        # Where the push is larger than the reach, any state outside of the layer shows it.
        if isinstance(value, float) and value != 0.0 and (kind != "sliding" or path[0] != "state"):
            assert not passed(check(edited(content, (*evidence, *path), value * 1.01))), path
            # A state or an axis may have its mirror image.
            if path[0] not in ("state", "axis", "position"):
                assert not passed(check(edited(content, (*evidence, *path), -value))), path
    for key in told:
        assert not passed(check(edited(content, evidence, {k: v for k, v in told.items() if k != key}))), key
    assert not passed(check(edited(content, evidence, {**told, "seen": 1.0})))
    assert not passed(check(edited(content, (*evidence[:-1], "name"), "form")))
    assert not passed(check(edited(content, (*evidence[:-1], "how"), "inspection")))


@pytest.mark.parametrize("name", CASES)
def test_a_refutation_is_of_what_was_asked(refuted, name):
    content, kind = refuted(name)
    for key, value in claims_of(content)[kind]["numbers"].items():
        if isinstance(value, float):
            # More than the set holds, or less than the torque that there is.
            for factor in (1.01, 0.99):
                changed = edited(content, (kind, "numbers", key), value * factor)
                free = (name == "at any attitude" and factor > 1.0, key == "margin" and factor * value < value)
                free = (*free, kind == "torque-limit" and key == "rate" and factor < 1.0, key == "radius" and factor > 1.0)
                assert any(free) or not passed(check(changed)), (key, factor)
        elif isinstance(value, bool):
            assert not passed(check(edited(content, (kind, "numbers", key), not value))), key
        if kind in ("convergence", "torque-limit"):
            for stiffness in (-1.0, 0.004, 1e6):
                assert not passed(check(edited(content, (kind, "witness", "stiffness"), stiffness))), stiffness


def relabelled(content, kind, place, evidence):
    """The same file with one obligation said to be refuted."""
    changed = edited(alone(content, kind), (kind, "obligations", place, "evidence"), evidence)
    claim = claims_of(changed)[kind]
    claim["obligations"][place]["outcome"] = claim["outcome"] = changed["certificates"][0]["outcome"] = "refuted"
    return changed


@pytest.fixture(scope="module")
def proofs(tmp_path_factory):
    """What is proved of loops of every law."""
    path, found = tmp_path_factory.mktemp("proved") / "c.json", {}
    for name in ("lqr-I", "lqr-II-uneven", "pd-0", "pd-2", "sliding-1", "wheel-0"):
        write([certified(name, disturbance=1e-6)], "made", path)
        found[name] = json.loads(path.read_text(encoding="utf-8"))
    return found


def test_no_proof_is_relabelled_with_the_evidence_of_a_refutation(refuted, proofs):
    """Evidence of any refutation beside any obligation of a proof, some of all."""
    random = np.random.default_rng(5)
    evidences = [
        next(o["evidence"] for o in claims_of(content)[kind]["obligations"] if o["outcome"] == "refuted")
        for content, kind in map(refuted, CASES)
    ]
    evidences += [{}, {"reason": "seen"}, {"eigenvalue": [1.0, 0.0]}, {"eigenvalue": [-1.5, 0.5]}]
    state = {"attitude": [1.0, 0.0, 0.0, 0.0], "rate": [0.0, 0.0, 0.0]}
    evidences += [{"state": state, "V": 0.0}, {"state": state, "V'": 1e-9}, {"state": state, "torque at rest": 0.0}]
    for content in proofs.values():
        for kind, claim in claims_of(content).items():
            if claim["outcome"] != "proved" or "proof" in claim:
                continue
            for place in range(len(claim["obligations"])):
                for evidence in random.choice(np.array(evidences, dtype=object), 2, replace=False):
                    assert not passed(check(relabelled(content, kind, place, evidence))), (kind, place, evidence)
                    bare = relabelled(content, kind, place, evidence)
                    bare = edited(edited(bare, (kind, "numbers"), {}), (kind, "witness"), {})
                    claims_of(bare)[kind]["obligations"] = [claims_of(bare)[kind]["obligations"][place]]
                    assert not passed(check(bare)), (kind, place, evidence)


def test_v_may_rise_far_away_where_it_proves_a_set_of_its_own():
    """The law's own V has a cubic term, which is nothing against the level set near the target."""
    gains = {"k_rate": [0.5, 0.6, 0.7], "k_attitude": [0.01, 0.02, 0.03]}
    inertia = [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]]
    state = {"attitude": [1.0, 0.0, 0.0, 0.0], "rate": [-1e3, 1e3, 1e3]}
    claim = converging()
    claim["obligations"] = [{"name": "descent", "how": "exact inequality", "outcome": "refuted", "evidence": {}}]
    claim["outcome"], claim["witness"] = "refuted", {}
    content = by_hand("matrix-pd", gains, [claim], inertia=inertia)
    content["certificates"][0]["outcome"] = "refuted"
    # V' = -w.Dw - w.K^-1 (w x Jw), by which V' is told.
    w, K, J = np.array(state["rate"]), np.diag(gains["k_attitude"]), np.diag([2.0, 3.0, 4.0])
    slope = float(-w @ np.linalg.solve(K, np.diag(gains["k_rate"]) @ w) - w @ np.linalg.solve(K, np.cross(w, J @ w)))
    assert slope > 0.0
    claim["obligations"][0]["evidence"] = {"state": state, "V'": slope}
    for numbers, holds in (
        ({"rate_everywhere": None, "everything": True}, True),
        ({"rate_everywhere": 2e3, "everything": False}, True),
        ({"rate_everywhere": 1e3, "everything": False}, False),
        ({"rate_everywhere": 2e3, "everything": True}, False),
        ({}, False),
    ):
        claim["numbers"] = numbers
        assert passed(check(content)) == holds, numbers


# --- what is told beside ----------------------------------------------------------------------------------------------


def test_two_claims_of_one_kind_or_of_unknown_obligations_fail():
    assert passed(check(by_hand("pd", {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}, [converging()])))
    assert reasons(by_hand("pd", {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}, [converging(), converging()]))
    open_ = {"name": "seen", "how": "inspection", "outcome": "undecided", "evidence": {"reason": "none"}}
    claim = {**proved_by_hand("convergence", [], {}, {}), "outcome": "undecided", "obligations": [open_]}
    content = by_hand("pd", {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}, [claim])
    content["certificates"][0]["outcome"] = "undecided"
    assert "there is no obligation seen" in reasons(content)[0]


def test_a_torque_is_pushed_by_what_there_is(refuted):
    """A bound of the modelled torque may be larger than that; nearer than the orbit nothing pulls."""
    content, _ = refuted("pushed by gravity")
    subject = content["certificates"][0]["subject"]
    place = claims_of(content)["sliding"]["obligations"][1]["evidence"]["position"]
    near = edited(content, ("sliding", "obligations", 1, "evidence", "position"), [0.5 * x for x in place])
    assert not passed(check(near))
    roomy = edited(content, ("", "modelled_torque"), [2.0 * x for x in subject["modelled_torque"]])
    assert not passed(check(roomy))
    assert not passed(check(edited(content, ("", "gravity_gradient"), False)))


def test_no_surface_is_overpowered_by_a_bound_alone(tmp_path):
    loop = loop_of("sliding", sliding.Gains((0.08,) * 3, (5e-3,) * 3), FULL)
    modelled = certify(loop).claim("sliding").numbers["torque"][0]
    between = certify(loop, "", Wanted(disturbance=5e-3 - 0.4 * modelled))
    write([between], "made", tmp_path / "c.json")
    assert passed(check_file(tmp_path / "c.json")), [f for f in check_file(tmp_path / "c.json") if f.verdict == "fails"]


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
def test_mutations_neither_stumble_nor_pass_for_what_they_are_not(refuted, proofs, seed):
    """Anything in a file changed, taken away, doubled or put elsewhere: a verdict, and none better than before."""
    random = np.random.default_rng(seed)
    names = random.choice(list(CASES), 2, replace=False)
    pool = [refuted(name)[0] for name in names]
    for name in random.choice(list(proofs), 2, replace=False):
        derived = [kind for kind, claim in claims_of(proofs[name]).items() if "proof" not in claim]
        pool += [alone(proofs[name], random.choice(derived))] if derived else []
    for content in pool:
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
