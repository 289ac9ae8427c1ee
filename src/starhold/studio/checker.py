"""Checks scenarios in a separate process, because the files that they name may hang or end the process."""

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
    """Raised where a file is not read or written; `answer` is the reply to the page."""

    def __init__(self, error: str, **details: Any) -> None:
        super().__init__(error)
        self.answer = {"error": error, **details}


class Documents:
    """The scenario files in a folder; `path`: the file with which the studio was started, of any name."""

    def __init__(self, path: Path | None) -> None:
        self.path = None if path is None else path.absolute()
        self.folder = Path().absolute() if self.path is None else self.path.parent
        self._lock = threading.Lock()

    def read(self) -> dict[str, Any]:
        """Return the file with which the studio was started, for the page: its name, text, and version."""
        assert self.path is not None
        content = self._content(self.path)
        if content is None:
            raise RefusedError(f"{self.path}: no such file any more")
        return {"name": self.path.name, "text": _text(content), "version": _version(content)}

    def save(self, name: str, text: str, version: str) -> dict[str, Any]:
        """Write a text and return the new version. version: that of the file when it was last read, "" for a new file.
        Refused where the file has changed since."""
        if not text.strip():
            raise RefusedError(f"{name}: an empty text is not saved")
        # A symbolic link is kept: its target is written.
        path = self._path(name).resolve()
        try:
            content = text.encode()
        except UnicodeEncodeError:
            raise RefusedError(f"{name}: characters that cannot be written to a file") from None
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
        raise RefusedError("the file is no longer UTF-8 text; it is neither shown nor saved") from None


def _version(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


LONGEST = 20.0
"""The longest time (s) of a check."""


class Checker:
    """Checks one text at a time, in a process that starts with the first text and again after it has ended."""

    def __init__(self, longest: float = LONGEST) -> None:
        self._longest, self._lock = longest, threading.Lock()
        self._pool: ProcessPoolExecutor | None = None

    def check(self, text: str, where: str, folder: Path) -> dict[str, Any]:
        """Return the answer of `editing.check` about a text, or an error if the check does not end."""
        with self._lock:
            self._pool = self._pool or ProcessPoolExecutor(1, get_context("spawn"), begin)
            try:
                return self._pool.submit(_check, text, where, folder).result(self._longest)
            except TimeoutError:
                why = f"did not end within {self._longest:g} s; a file that the scenario names may hang"
            except BrokenProcessPool:
                why = "ended without an answer; a file that the scenario names may have ended it"
            self.close()
            return {"error": f"{where}: the check {why}"}

    def close(self) -> None:
        """End the process."""
        # Without the lock, which a hanging check holds.
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
