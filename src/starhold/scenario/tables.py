"""The base of all tables of a scenario file, and how they refuse."""

from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError


class Table(BaseModel):
    """A table that refuses keys it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Flag: TypeAlias = Annotated[bool, Field(strict=True)]
"""true or false, and no word or number in their place."""


def refuse(reason: str) -> PydanticCustomError:
    """An error whose text says what is allowed."""
    return PydanticCustomError("quantity", "{reason}", {"reason": reason})


def at_key(key: str, reason: str, value: Any) -> PydanticCustomError:
    """An error about one key of a table that is read."""
    return PydanticCustomError("quantity_at", "{reason}", {"reason": reason, "key": key, "found": value})


def told_at(key: str, given: str, allowed: str) -> PydanticCustomError:
    """An error about one key of a table that is read, whose value is described already."""
    return PydanticCustomError("told_at", "{reason}", {"reason": allowed, "key": key, "found": given})


LONGEST_NAME = 100
_RESULTS = (".json", ".html", ".nc", ".png", ".csv")


def check_name(name: str) -> str:
    """The name; an error where it could lead elsewhere, or be markup or a file of results."""
    sound = bool(name) and all(c.isalnum() or c in "-_. " for c in name) and name == name.strip(" .")
    if not sound or len(name) > LONGEST_NAME or name.lower().endswith(_RESULTS):
        allowed = "letters, digits and, between them, '-', '_', '.' and spaces"
        raise refuse(f"{allowed}; at most {LONGEST_NAME}, and not the name of a file of results")
    return name


Name: TypeAlias = Annotated[str, AfterValidator(check_name)]
"""The name of a scenario or a law: it names folders, and stands in tables and pages."""
