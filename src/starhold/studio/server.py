"""The studio's server, which answers only on this machine, and only requests with the token of its start."""

import json
import secrets
import socket
import webbrowser
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send

from starhold.errors import InputError
from starhold.scenario.reading import builtin_names, builtin_text
from starhold.studio import editing
from starhold.studio.checker import Checker, Documents, RefusedError
from starhold.studio.jobs import Jobs
from starhold.studio.worker import KINDS, RERUN

HOST = "127.0.0.1"
MOST_TEXT = 2**23
"""The largest size of a request in bytes."""
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "worker-src blob:; frame-ancestors 'self'"
)


class Guard:
    """Accepts only requests that name this machine as host and have the token: in the address of the first request, in a
    cookie of all others. Pages from other sites have neither."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope, receive)
        answer: Response | None = None
        cookie, receives = cookie_name(scope["server"][1]), receive
        if _host(request) not in (HOST, "localhost"):
            answer = PlainTextResponse("this studio answers only on this machine", 403)
        elif _equal(request.query_params.get("token", ""), self._token):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(cookie, self._token, httponly=True, samesite="strict")
        elif not _equal(request.cookies.get(cookie, ""), self._token):
            answer = PlainTextResponse("open the address that `starhold studio` printed: it holds the token", 403)
        elif request.method != "GET" and not request.headers.get("content-type", "").startswith("application/json"):
            answer = PlainTextResponse("JSON is required", 415)
        elif (body := await _body(receive)) is None:
            answer = PlainTextResponse("too long", 413)
        else:
            receives = _given(body, receive)

        async def guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = {"content-security-policy": POLICY, "referrer-policy": "no-referrer", "cache-control": "no-store"}
                headers["x-content-type-options"] = "nosniff"
                message["headers"] = [*message["headers"], *((k.encode(), v.encode()) for k, v in headers.items())]
            await send(message)

        await (answer or self._app)(scope, receives, guarded)


def cookie_name(port: int) -> str:
    """Return the name of the cookie of the studio on a port; browsers share cookies among all ports of a machine."""
    return f"starhold-studio-{port}"


def _host(request: Request) -> str:
    """Return the host that a request names; "" where it names none."""
    try:
        return request.url.hostname or ""
    except ValueError:
        return ""


async def _body(receive: Receive) -> bytes | None:
    """Return the whole body of a request, chunked or not; None if it is too long."""
    body = b""
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > MOST_TEXT:
            return None
        if message["type"] != "http.request" or not message.get("more_body", False):
            return body


def _given(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that first gives a body already read and then the remaining messages."""
    left = [{"type": "http.request", "body": body, "more_body": False}]

    async def again() -> Any:
        return left.pop() if left else await receive()

    return again


def _equal(given: str, token: str) -> bool:
    return secrets.compare_digest(given.encode(), token.encode())


class Studio:
    """One studio: the folder whose scenarios it edits, and its jobs. `name`: the name of the initial text where no file is
    given; `run`: the files that the user allows to be run as Python."""

    def __init__(self, path: Path | None, name: str, text: str) -> None:
        self.name, self.text, self.jobs, self.checker = name, text, Jobs(), Checker()
        self.documents = Documents(path)
        self.where, self.folder = name, self.documents.folder
        self.run: set[str] = set()

    def app(self, token: str) -> Starlette:
        """Return the web application."""
        routes = [
            Route("/", self._page),
            Mount("/assets", StaticFiles(packages=[("starhold.studio", "assets")])),
            Route("/begin", self._begin),
            Route("/builtin/{name}", self._builtin),
            Route("/check", self._check, methods=["POST"]),
            Route("/file", self._file),
            Route("/save", self._save, methods=["POST"]),
            Route("/run", self._run, methods=["POST"]),
            Route("/jobs", self._all),
            Route("/jobs", self._start, methods=["POST"]),
            Route("/jobs/{number:int}/stop", self._stop, methods=["POST"]),
            Route("/jobs/{number:int}/again", self._again, methods=["POST"]),
            Route("/results/{number:int}/{name}", self._result),
        ]
        return Starlette(routes=routes, middleware=[Middleware(Guard, token=token)])

    async def _page(self, request: Request) -> Response:
        page = resources.files("starhold.studio") / "assets" / "studio.html"
        return HTMLResponse(page.read_text(encoding="utf-8"))

    async def _begin(self, request: Request) -> Response:
        words, choices = await run_in_threadpool(editing.words), await run_in_threadpool(editing.choices)
        opened = None if self.documents.path is None else self.documents.path.name
        begun = {"name": self.name, "text": self.text, "version": ""}
        page = {"own": opened, "folder": str(self.folder), "words": words, "kinds": list(KINDS), **choices}
        return await _answered(lambda: (begun if opened is None else self.documents.read()) | page)

    async def _builtin(self, request: Request) -> Response:
        name = request.path_params["name"]
        return (
            PlainTextResponse(builtin_text(name)) if name in builtin_names() else PlainTextResponse("no such scenario", 404)
        )

    async def _check(self, request: Request) -> Response:
        given = await _strings(request, "text")
        return _malformed() if given is None else JSONResponse(await self._checked(given["text"]))

    async def _checked(self, text: str) -> dict[str, Any]:
        """Return the result of checking a text, or the files that it would run and that the user has not yet allowed."""
        files = [file for file in editing.files_run(text) if file not in self.run]
        return {"asks": files} if files else await run_in_threadpool(self.checker.check, text, self.where, self.folder)

    async def _run(self, request: Request) -> Response:
        given = await _json(request)
        files = given.get("files") if isinstance(given, dict) else None
        if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
            return _malformed()
        self.run |= set(files)
        return JSONResponse({})

    async def _file(self, request: Request) -> Response:
        if self.documents.path is None:
            return JSONResponse({"error": "the studio was started without a file"}, 404)
        return await _answered(self.documents.read)

    async def _save(self, request: Request) -> Response:
        given = await _strings(request, "text", "name", "version")
        return _malformed() if given is None else await _answered(lambda: self.documents.save(**given))

    async def _all(self, request: Request) -> Response:
        return JSONResponse(self.jobs.all())

    async def _start(self, request: Request) -> Response:
        given = await _strings(request, "text", "kind")
        if given is None:
            return _malformed()
        if given["kind"] not in KINDS:
            return JSONResponse({"error": f"no such thing: {given['kind']}; one of {', '.join(KINDS)}"}, 422)
        checked = await self._checked(given["text"])
        if "name" not in checked:
            return JSONResponse(checked, 422)
        return self._begun(given["kind"], checked["name"], given["text"], self.where, self.folder, checked["laws"])

    async def _again(self, request: Request) -> Response:
        """Start a job that flies one run of a campaign of this studio again."""
        given, job = await _strings(request, "law", "run"), self.jobs.get(request.path_params["number"])
        if given is None or job is None or job.kind != "campaign":
            return _malformed()
        law, run = given["law"], given["run"]
        if not run.isdecimal() or law not in job.laws:
            return _malformed()
        return self._begun(RERUN, f"{law}, run {run}", "", str(job.folder), self.folder, (law, run))

    def _begun(self, *job: Any) -> Response:
        """Start a job, unless the largest number of jobs is running."""
        try:
            return JSONResponse(self.jobs.start(*job).status(), 201)
        except ValueError as error:
            return JSONResponse({"error": str(error)}, 409)

    async def _stop(self, request: Request) -> Response:
        self.jobs.stop(request.path_params["number"])
        return JSONResponse({})

    async def _result(self, request: Request) -> Response:
        job, name = self.jobs.get(request.path_params["number"]), request.path_params["name"]
        # Only a name in the folder itself, nothing outside it.
        path = None if job is None else next((path for path in job.folder.iterdir() if path.name == name), None)
        if path is None or not path.is_file():
            return PlainTextResponse("no such file", 404)
        return FileResponse(path)


def _malformed() -> Response:
    return JSONResponse({"error": "a request with missing or wrong fields"}, 422)


async def _answered(work: Callable[[], dict[str, Any]]) -> Response:
    """Answer with the outcome of work on files."""
    try:
        return JSONResponse(await run_in_threadpool(work))
    except RefusedError as refused:
        return JSONResponse(refused.answer, 409)


async def _json(request: Request) -> Any:
    """Return the JSON of a request; None where it is not JSON, or contains invalid text."""
    try:
        given = json.loads(await request.body())
        json.dumps(given, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        return None
    return given


async def _strings(request: Request, *names: str) -> dict[str, str] | None:
    """Return the strings of these names in a request; None where one is missing."""
    given = await _json(request)
    if not isinstance(given, dict) or not all(isinstance(given.get(name), str) for name in names):
        return None
    return {name: given[name] for name in names}


def serve(path: Path | None, name: str, text: str, port: int, announce: Callable[[str], None], browse: bool) -> None:
    """Serve a studio until it is interrupted. announce: called with the address and its token. InputError where the port
    is taken."""
    import uvicorn

    token, studio = secrets.token_urlsafe(24), Studio(path, name, text)
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
    except OSError as error:
        listener.close()
        raise InputError(
            "studio", "--port", f"{port}: {error.strerror}", "another port, or 0 for any that is free"
        ) from None
    # A client that connects right after reading the address waits until the server starts.
    listener.listen()
    address = f"http://{HOST}:{listener.getsockname()[1]}/?token={token}"
    announce(address)
    if browse:
        webbrowser.open(address)
    config = uvicorn.Config(studio.app(token), log_level="error", lifespan="off")
    try:
        uvicorn.Server(config).run(sockets=[listener])
    finally:
        studio.checker.close()
        studio.jobs.close()
        listener.close()
