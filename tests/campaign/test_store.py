"""The store returns what was put, in any order and cut; it refuses to mix campaigns, and answers questions in SQL."""

import json

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.campaign import store as stores
from starhold.campaign.campaign import digest
from starhold.campaign.chunk import Chunk, merge
from starhold.campaign.engines import Threads
from starhold.campaign.extras import extra
from starhold.campaign.manifest import Manifest, difference, plain
from starhold.campaign.query import query
from starhold.campaign.store import Store
from starhold.errors import InputError
from tests.campaign.toy import LAWS, Toy, fly, manifest, missing
from tests.refusals import refused


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    store = Store.create(tmp_path_factory.mktemp("flown"), manifest())
    fly(store)
    return store


def test_columns_and_envelopes_are_those_of_one_chunk(flown):
    for law in LAWS:
        whole = Toy().fly(law, 0, 100)
        stored = flown.columns(list(whole.rows), law)
        for name, values in whole.rows.items():
            assert stored[name].dtype.kind == ("O" if values.dtype.kind == "U" else values.dtype.kind)
            np.testing.assert_array_equal(stored[name], values)
        counts, extremes = flown.envelopes(law)
        np.testing.assert_equal((counts, extremes), (whole.counts, whole.extremes))
        row = flown.row(law, 37)
        np.testing.assert_equal(row, {name: values[37] for name, values in whole.rows.items()})


def test_another_reader_of_parquet_finds_the_rows(flown):
    """Through pandas: numbers bit for bit, a missing number as missing."""
    whole = Toy().fly("pd", 0, 100)
    paths = sorted((flown.folder / "runs" / "pd").glob("*.parquet"))
    table = pd.concat([pd.read_parquet(path) for path in paths], ignore_index=True)
    pd.testing.assert_frame_equal(table, pd.DataFrame(whole.rows), check_exact=True, check_dtype=False)
    assert table["settling_time"].isna().any()
    form = pyarrow.parquet.ParquetFile(paths[0]).metadata.row_group(0)
    columns = [form.column(number) for number in range(form.num_columns)]
    assert {column.compression for column in columns} == {"UNCOMPRESSED"}
    assert [column.path_in_schema for column in columns if column.has_dictionary_page] == ["spacecraft.limit"]


@settings(max_examples=15)
@given(st.data())
def test_digest_does_not_depend_on_chunks_and_their_order(tmp_path_factory, data):
    runs = data.draw(st.integers(1, 24))
    found = set()
    for size in data.draw(st.lists(st.integers(3, 30), min_size=2, max_size=2)):
        store = Store.create(tmp_path_factory.mktemp("cut"), manifest(runs, size))
        for law, first, count in data.draw(st.permutations(missing(store))):
            store.put(Toy().fly(law, first, count))
        found.add(digest(store))
        # Of what is on the disk too, and of a column at a time.
        found.add(digest(Store.open(store.folder)))
    assert len(found) == 1


def changed(chunk, name):
    """The chunk with one element of a column, of the counts or of the extremes changed."""
    rows, counts, extremes = (
        {key: values.copy() for key, values in part.items()} for part in (chunk.rows, chunk.counts, chunk.extremes)
    )
    if name == "counts":
        counts["rate"][0, 0] += 1
    elif name == "extremes":
        extremes["rate.most"][1] = 10.0
    elif rows[name].dtype.kind == "f":
        spot = np.flatnonzero(np.isfinite(rows[name]))[0]
        rows[name][spot] = np.nextafter(rows[name][spot], np.inf)
    elif rows[name].dtype.kind == "U":
        rows[name][:] = np.where(rows[name] == "axis", "axes", rows[name])
    else:
        rows[name] = ~rows[name]
    return Chunk(chunk.law, chunk.first, rows, counts, extremes)


PARTS = ["initial.rate[1]", "settling_time", "failed", "spacecraft.limit", "counts", "extremes"]


@pytest.mark.parametrize("name", PARTS)
def test_digest_depends_on_everything(flown, store, name):
    for law, first, count in missing(store):
        chunk = Toy().fly(law, first, count)
        store.put(changed(chunk, name) if (law, first) == ("lyapunov", 48) else chunk)
    assert digest(store) != digest(flown)


def test_digest_wants_all_runs(store):
    with pytest.raises(InputError, match="not 100 runs of pd"):
        digest(store)
    for law in LAWS:
        for first in (0, 16):
            store.put(Toy().fly(law, first, 16))
    assert len(digest(store, runs=32)) == 64
    with pytest.raises(InputError, match="not 16 runs of pd"):
        digest(store, runs=16)


def test_digest_of_groups_of_columns(flown, monkeypatch):
    """With room for one column only."""
    expected = digest(flown)
    monkeypatch.setattr(stores, "_MOST_BYTES", 1)
    assert digest(flown) == expected


finite = st.floats(allow_nan=True, width=64)


@given(st.lists(st.tuples(st.integers(0, 2**40), finite, finite), min_size=1, max_size=6), st.randoms())
def test_merge_is_the_same_for_any_order_and_grouping(numbers, random):
    parts = [({"n": np.array([n])}, {"x.least": np.array([low]), "x.most": np.array([high])}) for n, low, high in numbers]
    whole = merge(parts)
    shuffled = random.sample(parts, len(parts))
    cut = random.randint(0, len(parts))
    other = merge([merge(group) for group in (shuffled[:cut], shuffled[cut:]) if group])
    for mine, theirs in zip(whole, other, strict=True):
        assert {name: values.tobytes() for name, values in mine.items()} == {
            name: values.tobytes() for name, values in theirs.items()
        }
    assert whole[0]["n"][0] == sum(n for n, _, _ in numbers)
    lows = [low for _, low, _ in numbers if low == low]
    assert np.array_equal(whole[1]["x.least"][0], min(lows, default=np.nan), equal_nan=True)


def test_chunks_that_are_none_are_refused(store):
    rows = {"run": np.arange(3), "x": np.zeros(3)}
    for wrong in ({"x": np.zeros(3)}, rows | {"x": np.zeros(2)}, rows | {"run": np.array([0, 2, 1])}):
        with pytest.raises(ValueError, match="run"):
            Chunk("pd", 0, wrong)
    with pytest.raises(ValueError, match="end neither in"):
        Chunk("pd", 0, rows, extremes={"x": np.zeros(1)})
    with pytest.raises(ValueError, match="other names or shapes"):
        merge([({"n": np.zeros(2, int)}, {}), ({"n": np.zeros(1, int)}, {})])
    store.put(Chunk("pd", 0, rows))
    with pytest.raises(ValueError, match="stored already"):
        store.put(Chunk("pd", 0, rows))
    with pytest.raises(ValueError, match=r"not all chunks have: \['y'\]"):
        store.put(Chunk("pd", 3, {"run": np.arange(3, 6), "x": np.zeros(3), "y": np.zeros(3)}))
    with pytest.raises(ValueError, match="no part of this campaign"):
        store.put(Chunk("pd", 98, {"run": np.arange(98, 101), "x": np.zeros(3)}))
    with pytest.raises(ValueError, match="reading only"):
        Store.open(store.folder).put(Chunk("pd", 3, {"run": np.arange(3, 6), "x": np.zeros(3)}))


def test_more_runs_and_other_chunks_are_flown_on(tmp_path, flown):
    store = Store.create(tmp_path / "grown", manifest(runs=40, chunk=7))
    fly(store)
    store.finish(digest(store), {})
    grown = Store.open(store.folder).resume(manifest(runs=100, chunk=32))
    assert grown.missing("pd") == [(40, 24), (64, 32), (96, 4)]
    assert fly(grown) == digest(flown)
    # Totals of 40 runs are gone, and the manifest tells the new number.
    assert not (store.folder / "campaign.json").exists()
    assert Store.open(store.folder).manifest.runs == 100


TEXT = manifest().text
CHANGES = {
    'campaign.over."law.pd.k_rate".sigma: 0.1, was 0.05': {"sigma": 0.1},
    "spacecraft.inertia[2]: 2.5, was 2.0": {"text": TEXT.replace("2.0", "2.5")},
    'spacecraft.limit: "axis", was nothing': {"text": TEXT.replace("[campaign]", 'limit = "axis"\n[campaign]')},
    'scenario: nothing, was {"name": "toy"}': {"text": TEXT.replace('[scenario]\nname = "toy"\n', "")},
    'laws: ["pd"], was ["pd", "lyapunov"]': {"laws": ("pd",)},
    "seed: 2, was 1": {"seed": 2},
    'starhold_version: "9.9", was ': {"version": "9.9"},
    "campaign.runs: 99, was 100": {"runs": 99},
}


@pytest.mark.parametrize("told", list(CHANGES))
def test_another_campaign_is_not_resumed(flown, told):
    with refused(f"{flown.folder}: {told}"):
        Store.open(flown.folder).resume(manifest(**CHANGES[told]))
    assert Store.open(flown.folder).manifest == flown.manifest


def test_comments_and_the_number_of_runs_change_nothing(flown):
    same = manifest(text="# Longer.\n" + TEXT.replace("runs = 1", "runs   = 1_000"))
    assert same.difference(flown.manifest) is None
    assert same.fingerprint() == flown.manifest.fingerprint()


def test_designs_of_a_fixed_size_are_not_extended(tmp_path):
    store = Store.create(tmp_path / "campaign", manifest(extensible=False))
    with pytest.raises(InputError, match="runs: 200, was 100"):
        store.resume(manifest(runs=200, extensible=False))


def test_a_text_that_is_no_toml_is_compared_by_lines():
    one, two = manifest(text="a\nb\nc"), manifest(text="a\nB\nc")
    assert two.difference(one) == 'line[2]: "B", was "b"'


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@given(json_values, json_values)
def test_a_difference_is_found_where_and_only_where_there_is_one(one, two):
    same = json.dumps(one, sort_keys=True) == json.dumps(two, sort_keys=True)
    assert (difference(one, two, "key") is None) == same
    assert difference(one, one, "key") is None


def test_long_values_are_shown_where_they_differ():
    told = difference("x" * 100 + "1", "x" * 100 + "2", "key")
    assert told == 'key: ...xxxxxxxxxx1", was ...xxxxxxxxxx2"'


def test_numbers_that_json_lacks_become_words():
    given = {"low": -np.inf, "values": np.array([1.0, np.nan]), "count": np.int64(3), "pair": (True, None)}
    assert plain(given) == {"low": "-inf", "values": [1.0, "nan"], "count": 3, "pair": [True, None]}


def test_manifest_survives_its_file():
    before = manifest(settings={"over": {"x": {"low": -np.inf}}}, columns={"pd": ("run",)})
    after = Manifest.from_json(before.to_json(), "manifest.json")
    assert after.difference(before) is None
    assert (after.columns, after.runs, after.chunk) == (before.columns, before.runs, before.chunk)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"scenario": 1}', b"\xff", None])
def test_what_is_no_campaign_is_told(tmp_path, content):
    if content is not None:
        (tmp_path / "manifest.json").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match="found no manifest"):
        Store.open(tmp_path)


@pytest.mark.parametrize("value", [None, 0, -1, 7.5, "many", [], ["pd"], {}, {"pd": 3}, True, 1e400, "gone"])
def test_a_manifest_changed_by_hand_is_told(store, value):
    path = store.folder / "manifest.json"
    text = path.read_text()
    written = json.loads(text)
    for key in written:
        changed = {name: item for name, item in written.items() if name != key}
        if value != "gone":
            changed[key] = value
        path.write_text(json.dumps(changed))
        same = json.dumps(changed, sort_keys=True) == json.dumps(written, sort_keys=True)
        if same or (key == "folder" and value == "many"):
            assert Store.open(store.folder).manifest.folder == changed["folder"]
            continue
        with pytest.raises(InputError, match=r"changed by hand|no manifest"):
            Store.open(store.folder)
    path.write_text(text.replace("0.05", "0.06"))
    with pytest.raises(InputError, match="changed by hand"):
        Store.open(store.folder)


def test_a_folder_with_a_campaign_is_not_written_over(store):
    fly(store)
    (store.folder / "mine.txt").touch()
    store.finish(digest(store), {"share": np.nan})
    with pytest.raises(InputError, match=r"a campaign already there \(manifest.json\)"):
        Store.create(store.folder, manifest())
    (store.folder / "manifest.json").unlink()
    (store.folder / "campaign.json").unlink()
    # Chunks without a manifest are no empty folder: they would be taken for new ones.
    with pytest.raises(InputError, match=r"a campaign already there \(runs\)"):
        Store.create(store.folder, manifest())
    again = Store.create(store.folder, manifest(), force=True)
    assert again.missing("pd")[0] == (0, 16)
    assert sorted(path.name for path in store.folder.iterdir()) == ["manifest.json", "mine.txt"]


def test_unknown_names_are_told(flown):
    with pytest.raises(InputError, match='found column "x"; allowed: run, initial'):
        flown.columns(["x"], "pd")
    with pytest.raises(InputError, match='found law "sliding"; allowed: pd, lyapunov'):
        flown.columns(["run"], "sliding")
    with pytest.raises(InputError, match="found no run 100 of pd; allowed: 0 to 99"):
        flown.row("pd", 100)


def test_a_package_that_is_not_there_is_told():
    with pytest.raises(InputError, match=r"campaigns: need unheardof: pip install 'starhold\[campaign\]'"):
        extra("unheardof")


# Questions in SQL


def test_answers_are_those_of_pandas(flown):
    table = pd.concat([pd.DataFrame(Toy().fly(law, 0, 100).rows).assign(law=law) for law in LAWS], ignore_index=True)
    found = query(flown.folder, "select * from runs order by law desc, run")
    columns = list(found.columns)
    assert set(columns) == set(table.columns)
    pd.testing.assert_frame_equal(found, table[columns], check_exact=True, check_dtype=False)
    asked = 'count(*) as n, count(settling_time) as settled, max("initial.rate[1]") as most, sum(failed::int) as failed'
    sql = f"select law, {asked}, avg(settling_time) as mean from runs group by law order by law"
    found = query(flown.folder, sql).set_index("law")
    groups = table.groupby("law")
    expected = {
        "n": groups.size(),
        "settled": groups["settling_time"].count(),
        "most": groups["initial.rate[1]"].max(),
        "failed": groups["failed"].sum(),
        "mean": groups["settling_time"].mean(),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(found[name].to_numpy(float), values.to_numpy(float), rtol=1e-14 if name == "mean" else 0)


REFUSED = {
    "selec 1": 'query: Parser Error: syntax error at or near "selec"',
    "select nothing from runs": 'query: Binder Error: Referenced column "nothing" not found',
    "select 1; select 2": "query: found 2 statements; allowed: one SELECT",
    "": "query: found 0 statements; allowed: one SELECT",
    "create table t as select 1": "query: found a statement of type CREATE; allowed: one SELECT",
    "copy runs to '{folder}/out.csv'": "query: found a statement of type COPY",
    "select * from read_csv('{folder}/manifest.json')": "query: Permission Error: Cannot access file",
    "select * from '{folder}/manifest.json'": "query: Permission Error: Cannot access file",
    "select * from glob('/*')": "query: Permission Error",
    "attach '{folder}/stolen.db'": "query: found a statement of type ATTACH",
    "select * from read_text('/etc/passwd')": "query: Permission Error",
    "select * from store": "query: Catalog Error: Table with name store does not exist",
}


@pytest.mark.parametrize("sql", list(REFUSED))
def test_a_question_reaches_nothing_but_the_runs(flown, sql):
    before = sorted(flown.folder.rglob("*"))
    with refused(start=REFUSED[sql]):
        query(flown.folder, sql.format(folder=flown.folder))
    assert sorted(flown.folder.rglob("*")) == before


def test_questions_leave_out_what_is_unusable_and_say_so(store):
    with pytest.raises(InputError, match="found no runs"):
        query(store.folder, "select 1 from runs")
    fly(store, Threads(1))
    spoiled = next((store.folder / "runs" / "pd").glob("000000032-*"))
    spoiled.write_bytes(spoiled.read_bytes()[:-1])
    with pytest.raises(InputError, match=r"000000032-.*--resume flies them again"):
        query(store.folder, "select count(*) from runs")
    told = []
    assert query(store.folder, "select count(*) from runs", told.append).iloc[0, 0] == 184
    assert len(told) == 1
