"""SQL queries on the rows of a campaign, answered by DuckDB."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.campaign.extras import extra
from starhold.campaign.store import Store
from starhold.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame

_CLOSED = {
    "enable_external_access": False,
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "temp_directory": "",
}
"""Settings that restrict a query to the view: no files, no network, no spilling to disk."""


def query(folder: Path, sql: str, tell: Callable[[str], None] | None = None) -> DataFrame:
    """Return the result of one SELECT from `runs`, a view with a row for each stored run of each law, the campaign's columns
    and `law`. Columns that a law lacks are null in its rows, as are numbers that a run lacks. Unusable chunks are left out
    and reported to `tell`; without it they are an InputError, as is anything that DuckDB refuses."""
    store = Store.open(folder)
    duckdb, dataset = extra("duckdb"), extra("pyarrow.dataset")
    files = {law: [str(file.path) for file in store.files(law)] for law in store.manifest.laws}
    for line in store.notices:
        if tell is None:
            raise InputError("query", "", "", line)
        tell(line)
    flown = [law for law in files if files[law]]
    if not flown:
        raise InputError(str(folder), "", "no runs", "a folder with flown runs")
    with duckdb.connect(":memory:", config=_CLOSED) as connection:
        # Through Arrow, so that DuckDB needs no access to any files, which it could also write.
        for number, law in enumerate(flown):
            connection.register(f"chunks {number}", dataset.dataset(files[law], format="parquet"))
        quoted = [law.replace("'", "''") for law in flown]
        parts = [f"SELECT '{law}' AS law, * FROM \"chunks {number}\"" for number, law in enumerate(quoted)]
        connection.execute(f"CREATE VIEW runs AS {' UNION ALL BY NAME '.join(parts)}")
        connection.execute("SET lock_configuration = true")
        try:
            _check(connection, sql, duckdb)
            return connection.execute(sql).df()
        except duckdb.Error as error:
            raise InputError("query", "", "", _short(str(error))) from None


def _check(connection: Any, sql: str, duckdb: Any) -> None:
    """Raise InputError unless a text is a single SELECT."""
    kinds = [statement.type for statement in connection.extract_statements(sql)]
    if len(kinds) != 1:
        raise InputError("query", "", f"{len(kinds)} statements", "one SELECT")
    if kinds[0] not in (duckdb.StatementType.SELECT, duckdb.StatementType.EXPLAIN):
        raise InputError("query", "", f"a statement of type {kinds[0].name}", "one SELECT")


def _short(message: str) -> str:
    """Return DuckDB's message as one line, without the repeated query."""
    reason = message.partition("\n\nLINE ")[0]
    return "; ".join(line.strip() for line in reason.splitlines() if line.strip())
