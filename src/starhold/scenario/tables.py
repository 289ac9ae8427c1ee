"""What all tables of a scenario file share."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError


class Table(BaseModel):
    """A table that refuses keys it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def refuse(reason: str) -> PydanticCustomError:
    """An error whose text says what is allowed."""
    return PydanticCustomError("quantity", "{reason}", {"reason": reason})


def at_key(key: str, reason: str, found: Any) -> PydanticCustomError:
    """The same about one key of a table that is read."""
    return PydanticCustomError("quantity_at", "{reason}", {"reason": reason, "key": key, "found": found})
