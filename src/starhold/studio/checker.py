"""Scenarios are checked in a process of their own, for the files that they name may not end, or end the process."""

import hashlib
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from starhold.errors import InputError
from starhold.files import atomic_write
from starhold.studio import editing
from starhold.studio.apart import begin


class RefusedError(Exception):
    """A file is not written; `answer` is the reply."""

    def __init__(self, error: str, **details: Any) -> None:
        super().__init__(error)
        self.answer = {"error": error, **details}


class Documents:
    """Files of scenarios in a folder; `path`: the one that the studio was started with, of any name."""

    def __init__(self, path: Path | None) -> None:
        self.path = None if path is None else path.absolute()
        self.folder = Path().absolute() if self.path is None else self.path.parent
        self._lock = threading.Lock()

    def read(self) -> dict[str, Any]:
        """The file that the studio was started with, as the page knows files: name, text, and the version of it."""
        assert self.path is not None
        content = self._content(self.path)
        if content is None:
            raise RefusedError(f"{self.path}: no such file any more")
        return {"name": self.path.name, "text": _text(content), "version": _version(content)}

    def save(self, name: str, text: str, version: str) -> dict[str, Any]:
        """Write a text; `version` is that of the file as it was last seen, "" for one that is new. Refused where the file is
        another by now."""
        if not text.strip():
            raise RefusedError(f"{name}: an empty text is not saved")
        # A link stays one: what it leads to is written.
        path = self._path(name).resolve()
        try:
            content = text.encode()
        except UnicodeEncodeError:
            raise RefusedError(f"{name}: characters that no file holds") from None
        with self._lock:
            before = self._content(path)
            now = "" if before is None else _version(before)
            if now != version:
                how = "is gone" if before is None else "has changed since it was read" if version else "is there already"
                raise RefusedError(f"{path} {how}", changed=True, exists=not version, version=now)
            if before is not None and b"\r\n" in before:
                content = content.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")
            try:
                with atomic_write(path) as hidden:
                    hidden.write_bytes(content)
                    if before is not None:
                        hidden.chmod(path.stat().st_mode & 0o7777)
            except InputError as error:
                raise RefusedError(str(error)) from None
        return {"saved": str(path), "name": name, "version": _version(content)}

    def _path(self, name: str) -> Path:
        if self.path is not None and name == self.path.name:
            return self.path
        plain = name.isprintable() and Path(name).name == name and "\\" not in name and not name.startswith(".")
        if not plain or not name.endswith(".toml") or len(name) > 100:
            raise RefusedError(f"{name[:100]!r}: a name such as mine.toml, in the folder {self.folder}")
        return self.folder / name

    def _content(self, path: Path) -> bytes | None:
        try:
            return path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise RefusedError(f"{path}: {error.strerror}") from None


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise RefusedError("the file is no longer text in UTF-8; nothing of it is shown or saved") from None


def _version(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


LONGEST = 20.0
"""Seconds that a check may take."""


class Checker:
    """Checks one text at a time; its process begins with the first one, and again after one that was ended."""

    def __init__(self, longest: float = LONGEST) -> None:
        self._longest, self._lock = longest, threading.Lock()
        self._pool: ProcessPoolExecutor | None = None

    def check(self, text: str, where: str, folder: Path) -> dict[str, Any]:
        """Return the answer of `editing.check` about a text, or that its check does not end."""
        with self._lock:
            self._pool = self._pool or ProcessPoolExecutor(1, get_context("spawn"), begin)
            try:
                return self._pool.submit(_check, text, where, folder).result(self._longest)
            except TimeoutError:
                why = f"did not end within {self._longest:g} s; a file that it names may not"
            except BrokenProcessPool:
                why = "ended without an answer; a file that it names may have ended it"
            self.close()
            return {"error": f"{where}: the check {why}"}

    def close(self) -> None:
        """End the process."""
        # Without the lock, which a check that does not end holds.
        pool, self._pool = self._pool, None
        if pool is not None:
            for process in list((pool._processes or {}).values()):
                process.kill()
            pool.shutdown()


def _check(text: str, where: str, folder: Path) -> dict[str, Any]:
    try:
        return editing.check(text, where, folder)
    except Exception as error:
        return {"error": f"{where}: {type(error).__name__}: {error}"}
