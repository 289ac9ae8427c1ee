"""The checker of certificates of invariant sets: it shows again what is true, and only that."""

import copy
import json

import pytest
from flint import Ordering, fmpq, fmpq_mpoly_ctx

from starhold.certification.invariant import builtin_names, certify, parse, write
from starhold.checker import check, covering, passed
from starhold.checker.cells import divides, linear, negative_multiple, signed_like
from starhold.checker.covering import Question, answer
from starhold.checker.exact import CheckError
from starhold.checker.reading import read, read_names
from tests.certification.edits import with_kinds
from tests.certification.invariants import ORIGIN, file, proved
from tests.running import starhold

# Together with all that needs the proofs of the built-in problems, which take long.

ROUND = '"x**2 + y**2"'


def content(certificate, folder):
    path = folder / "c.json"
    write(certificate, path)
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The certificates of the built-in problems."""
    return {name: content(proved(name)[1], tmp_path_factory.mktemp(name)) for name in builtin_names()}


def of(folder, x, y, theorem, V=ROUND, more=ORIGIN, name="mine"):
    """The certificate of a problem that is written as texts."""
    return content(certify(parse(file(x, y, V, theorem, more, name), "mine.toml")), folder)


def changed(given, change):
    """A copy with a change of its subject and claims."""
    given = copy.deepcopy(given)
    certificate = given["certificates"][0]
    change(certificate["subject"], certificate["claims"])
    return with_kinds(given)


def verdicts(given):
    return {f.obligation: f.verdict for f in check(given)}


def failing(given):
    return [f for f in check(given) if f.verdict == "fails"]


@pytest.mark.parametrize("name", builtin_names())
def test_examples_are_shown_again(name, made):
    found = check(made[name])
    # How large the true region is comes from elsewhere, and no claim is made of it.
    assert {f.verdict for f in found if f.obligation != "known"} == {"holds"}, [f for f in found if f.verdict != "holds"]
    told = [o["name"] for claim in made[name]["certificates"][0]["claims"] for o in claim["obligations"]]
    assert [f.obligation for f in found if f.obligation not in ("limit", "size", "known")] == told


@pytest.mark.parametrize("name", builtin_names())
def test_a_level_above_what_is_true_fails(name, made):
    for place, claim in enumerate(made[name]["certificates"][0]["claims"]):
        if "refuted_level" not in claim["numbers"]:
            continue

        def raised(subject, claims, place=place):
            numbers = claims[place]["numbers"]
            numbers["level"] = 1.01 * numbers["refuted_level"]

        assert failing(changed(made[name], raised))

        def bare(subject, claims, place=place):
            numbers = claims[place]["numbers"]
            numbers["level"] = 1.01 * numbers["refuted_level"]
            claims[place]["numbers"] = {key: numbers[key] for key in ("theorem", "level")}

        # Without the remarks the obligations alone have to give it away. An equilibrium at which V' = 0 is not looked for.
        found = check(changed(made[name], bare))
        assert not passed(found)
        assert name == "orbit" or any(f.verdict == "fails" for f in found)


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("van-der-pol", "y", "x + y + x**2*y"),
        ("van-der-pol", "x", "y"),
        ("van-der-pol", "y", "1/100 + x - y + x**2*y"),
        ("circle", "x", "-y + x*f"),
        ("saturated-axis", "v", "x + sat(-s/2)"),
        ("saturated-strip", "s", "s + sat(2*s)"),
        pytest.param(
            "switching",
            "y",
            "-2*x - 3*y if y <= 0 else y**2 - x**2 if circle <= 0 else (x**2 + y**2)*(1 + x)",
            marks=pytest.mark.slow,
        ),
        ("switching", "y", "-2*x + 3*y if y <= 0 else y**2 - x**2 if circle <= 0 else (x**2 + y**2)*(1 - x)"),
        ("spin", "q", "p*r + p**2"),
        pytest.param("dead-zone", "v", "-v - (s - sat(s)) + x", marks=pytest.mark.slow),
        ("orbit", "vy", "-w*vz - 2*f1*y + f2"),
    ],
)
def test_another_system_does_not_pass(name, key, value, made):
    assert not passed(check(changed(made[name], lambda subject, claims: subject["rates"].__setitem__(key, value))))


@pytest.mark.parametrize(
    ("name", "V"),
    [
        ("van-der-pol", "1.5*x**2 + x*y + y**2"),
        ("van-der-pol", "x**2 - y**2"),
        ("van-der-pol", "x**2 + y**2 + 1/1000"),
        ("circle", "x**2"),
        ("saturated-axis", "max(s**2, x**2/8)"),
        pytest.param("switching", "max(below if y <= 0 else above/4, 0)", marks=pytest.mark.slow),
        ("switching", "max(below if y <= 0 else above - 1, 0)"),
        ("spin", "energy + p"),
    ],
)
def test_another_function_does_not_pass(name, V, made):
    def other(subject, claims):
        subject["V"] = [V] * len(claims)

    assert not passed(check(changed(made[name], other)))


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in ("orbit", "switching") else n for n in builtin_names()]
)
def test_obligations_are_those_that_are_needed(name, made):
    for place, claim in enumerate(made[name]["certificates"][0]["claims"]):
        for k, obligation in enumerate(claim["obligations"]):
            if obligation["name"] == "switching" or "direction" in obligation["evidence"]:
                continue
            less = changed(made[name], lambda _, claims, p=place, k=k: claims[p]["obligations"].pop(k))
            assert not passed(check(less)), obligation["name"]
        more = dict(claim["obligations"][0])
        assert not passed(check(changed(made[name], lambda _, claims, p=place, m=more: claims[p]["obligations"].append(m))))


def test_what_else_a_file_may_have_wrong(made):
    changes = (
        lambda subject, claims: claims[0]["witness"]["box"].__setitem__(0, [-1.0, 1.0]),
        lambda subject, claims: claims[0]["numbers"]["size"].__setitem__(0, claims[0]["numbers"]["size"][1]),
        lambda subject, claims: claims[0]["numbers"].__setitem__("refuted_level", 1.0),
        lambda subject, claims: claims[0]["numbers"].__setitem__("level", -1.0),
        lambda subject, claims: claims[0]["numbers"].__setitem__("theorem", "unstable"),
        lambda subject, claims: claims[0]["witness"]["limit"].__setitem__("x", 0.5),
        lambda subject, claims: claims[0].__setitem__("outcome", "refuted"),
        lambda subject, claims: claims[0].__setitem__("assumptions", []),
        lambda subject, claims: subject["equilibrium"].__setitem__(0, None),
        lambda subject, claims: subject["equilibrium"].__setitem__(0, {"x": "1/7", "y": "0"}),
        lambda subject, claims: subject["variables"].append("z"),
        lambda subject, claims: subject.pop("rates"),
        lambda subject, claims: subject["rates"].__setitem__("x", "__import__('os').getcwd()"),
        lambda subject, claims: subject.__setitem__("define", {"x": "y"}),
        lambda subject, claims: claims.clear(),
    )
    for k, change in enumerate(changes):
        assert failing(changed(made["van-der-pol"], change)), k


def test_what_is_not_in_the_file_is_not_checked(made, monkeypatch):
    # Without the squares it is not shown with fifty times as many parts of the box either.
    monkeypatch.setattr(covering.Question.__init__, "__defaults__", ((), 0, 2_000))
    found = check(changed(made["circle"], lambda subject, claims: subject.pop("V")))
    assert {f.verdict for f in found} == {"not checked"}
    assert not passed(found)
    assert verdicts(changed(made["orbit"], lambda subject, claims: subject.pop("squares")))["falls"] == "not checked"


def test_jumps_have_to_be_told_and_crossed(made):
    def untold(subject, claims):
        for claim in claims:
            claim["assumptions"] = claim["assumptions"][:1]

    assert failing(changed(made["switching"], untold))

    def unlisted(subject, claims):
        for claim in claims:
            claim["obligations"] = [o for o in claim["obligations"] if o["name"] != "switching"]

    assert failing(changed(made["switching"], unlisted))


@pytest.mark.parametrize(
    ("x", "y", "theorem", "V", "more"),
    [
        ("y", "-x", "stable", ROUND, ORIGIN),
        ("y", "-x - y", "attracts", ROUND, ORIGIN),
        ("-x**3", "-y", "region", ROUND, ORIGIN),
        ("x", "-y", "unstable", '"x**2 - y**2"', ORIGIN),
        ("-x", "-y", "intersection", '["x**2 - 1", "y**2 - 1"]', ""),
        ("-x", "-y", "stable", '"x**2 + y**2 - 1"', ""),
        ("x", "y", "unstable", '"x**2 + y**2 - 1/4"', ""),
        ("-sat(x)", "-clip(y, 1/2)", "region", '"abs(x) + abs(y)"', ORIGIN),
    ],
)
def test_every_theorem(tmp_path, monkeypatch, x, y, theorem, V, more):
    given = of(tmp_path, x, y, theorem, V, more)
    found = check(given)
    if given["certificates"][0]["outcome"] != "proved":
        assert "abs" in V
        assert "holds" not in verdicts(given).values()
        return
    if theorem != "unstable":
        assert {f.verdict for f in found} == {"holds"}, [f for f in found if f.verdict != "holds"]
    assert not [f for f in found if f.verdict == "fails"], found
    if theorem == "intersection":
        # Neither shown nor found false the other way, nor with fifty times as many parts of the box.
        monkeypatch.setattr(covering.Question.__init__, "__defaults__", ((), 0, 2_000))
    # The same, told of a motion the other way.
    back = changed(given, lambda subject, claims: subject["rates"].update(x=f"-({x})", y=f"-({y})"))
    assert passed(check(back)) == (x == "y" and theorem == "stable")


@pytest.mark.parametrize(
    ("x", "y", "theorem", "V", "more", "state"),
    [
        ("-x + x**3", "-y", "region", ROUND, f"{ORIGIN}\nlevel = 1.5", {"x": 0.1, "y": 0.0}),
        ("-x", "-y", "region", ROUND, f"{ORIGIN}\nlevel = 5", {"x": 1.0, "y": 1.0}),
        ("-x", "-y", "region", '"x**2 - y**2"', ORIGIN, {"x": 1.0, "y": 0.0}),
        ("-x", "-y", "region", '"x**2 + y**2 if x <= 0 else 2*y**2 + x**2"', ORIGIN, {"x": 0.0, "y": 0.0}),
        ("-x", "-y", "unstable", ROUND, ORIGIN, {"x": 3.0, "y": 0.0}),
    ],
)
def test_refutations_are_checked_at_their_state(tmp_path, x, y, theorem, V, more, state):
    given = of(tmp_path, x, y, theorem, V, more)
    assert given["certificates"][0]["outcome"] == "refuted"
    found = check(given)
    assert passed(found)
    assert any(f.reason.startswith("refuted: ") for f in found)

    def elsewhere(subject, claims):
        claims[0]["obligations"][-1]["evidence"]["state"] = state

    assert failing(changed(given, elsewhere))


def test_a_way_on_which_v_rises_is_checked(tmp_path):
    given = of(tmp_path, "y", "-x + y/10", "stable")
    assert given["certificates"][0]["outcome"] == "refuted"
    assert passed(check(given))
    assert failing(
        changed(given, lambda s, claims: claims[0]["obligations"][-1]["evidence"].update(direction={"x": 1, "y": 0}))
    )


def test_the_command_tells_what_is_not_checked(tmp_path, made):
    def checked(given):
        (tmp_path / "c.json").write_text(json.dumps(given), encoding="utf-8")
        return starhold("check", "c.json", cwd=tmp_path)

    assert checked(made["circle"]).returncode == 0
    left = checked(changed(made["circle"], lambda subject, claims: subject.pop("V")))
    assert left.returncode == 1
    assert "2 are not checked" in left.stdout


def test_more_cells_than_can_be_looked_at_fail_in_one_line(made):
    six = [" + ".join(f"abs(x - {k + 6 * j}*y)" for k in range(6)) for j in range(2)]
    found = failing(changed(made["circle"], lambda subject, claims: subject.update(rates={"x": six[0], "y": six[1]})))
    assert {f.reason for f in found} == {"the system is too large: 4096 cells, more than 64"}


# --- what it decides with -----------------------------------------------------------------------------------------------


def test_answers_over_a_box():
    ring = fmpq_mpoly_ctx.get(("x", "y"), Ordering.degrevlex)
    x, y = ring.gens()
    box = {name: (fmpq(-1), fmpq(2)) for name in ("x", "y")}
    assert answer(Question(box, [], [[[x**2 + y**2 + fmpq(1, 100)]]]))
    assert answer(Question(box, [], [[[x**2 + y**2 - fmpq(1, 100)]]])) is False
    # It touches zero at a state that no halving meets.
    assert answer(Question({"x": box["x"]}, [], [[[(3 * x - 1) ** 2]]])) is None
    # Only where a room is not negative; either of two options; and of a goal either polynomial.
    assert answer(Question(box, [x - 1], [[[x]]]))
    assert answer(Question(box, [], [[[x + fmpq(1, 3)]], [[-x]]]))
    assert answer(Question(box, [x * (x + 2)], [[[x], [x + 2]]], 1)) is not False
    assert answer(Question(box, [1 - x - 5 * x**2 - y**2 - 2]))
    with pytest.raises(CheckError):
        answer(Question({"x": box["x"]}, [], [[[x + y]]]))


def test_polynomials():
    ring = fmpq_mpoly_ctx.get(("x", "y"), Ordering.degrevlex)
    x, y = ring.gens()
    assert divides(x - y, x**2 - y**2)
    assert not divides(x, x + y)
    assert not divides(x * 0, x)
    assert negative_multiple(x, -2 * x)
    assert not negative_multiple(x, 2 * x)
    assert not negative_multiple(x, x * 0)
    assert linear(2 * x - y + 1) is not None
    assert linear(x * y) is None
    # q = -2x and V = 4x(x - 2) have one sign where x < 2: what is left of their product.
    q, left = signed_like(-2 * x, 4 * x * (x - 2))
    assert q == -2 * x
    assert negative_multiple(left, x - 2)


@pytest.mark.parametrize(
    "text",
    [
        "x.y",
        "x**y",
        "x**-1",
        "x/y",
        "f(x)",
        "[x]",
        "x == y",
        "lambda: x",
        "x if x else y",
        "z",
        "min(x)",
        "'x'",
        "x**25",
        "1e99999*x",
        "(",
    ],
)
def test_texts_that_are_not_read(text):
    with pytest.raises(CheckError):
        read(text, read_names(["x", "y"], {}))
