"""The studio's server: on this machine alone, for whoever has the token that it was started with."""

from __future__ import annotations

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
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from starhold.errors import InputError
from starhold.files import atomic_write
from starhold.scenario.reading import builtin_names, builtin_text
from starhold.studio import editing
from starhold.studio.jobs import Jobs
from starhold.studio.worker import KINDS

HOST = "127.0.0.1"
COOKIE = "starhold-studio"
MOST_TEXT = 2**23
"""Bytes that a request may have."""
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "worker-src blob:; frame-ancestors 'self'"
)
ASSETS = {
    name: kind
    for kind, names in {
        "text/css": ("studio.css", "codemirror.css", "show-hint.css"),
        "text/javascript": ("studio.js", "codemirror.js", "toml.js", "show-hint.js"),
    }.items()
    for name in names
}


class Guard:
    """Lets through what names this machine as its host and has the token, in the address of the first request and in a
    cookie of all others. A page of elsewhere has neither."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope, receive)
        answer: Response | None = None
        if (request.url.hostname or "") not in (HOST, "localhost"):
            answer = PlainTextResponse("this studio answers on this machine alone", 403)
        elif _equal(request.query_params.get("token", ""), self._token):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(COOKIE, self._token, httponly=True, samesite="strict")
        elif not _equal(request.cookies.get(COOKIE, ""), self._token):
            answer = PlainTextResponse("open the address that `starhold studio` printed: it holds the token", 403)
        elif request.method != "GET" and not request.headers.get("content-type", "").startswith("application/json"):
            answer = PlainTextResponse("JSON is wanted", 415)
        elif int(request.headers.get("content-length", "0") or 0) > MOST_TEXT:
            answer = PlainTextResponse("too long", 413)

        async def guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                own = {"content-security-policy": POLICY, "referrer-policy": "no-referrer", "cache-control": "no-store"}
                own["x-content-type-options"] = "nosniff"
                message["headers"] = [*message["headers"], *((k.encode(), v.encode()) for k, v in own.items())]
            await send(message)

        await (answer or self._app)(scope, receive, guarded)


def _equal(given: str, token: str) -> bool:
    return secrets.compare_digest(given.encode(), token.encode())


class Studio:
    """One studio: the file that it edits, if any, and the jobs."""

    def __init__(self, path: Path | None, text: str) -> None:
        self.path, self.text, self.jobs = path, text, Jobs()
        self.where = "scenario" if path is None else path.name
        self.folder = Path() if path is None else path.parent

    def app(self, token: str) -> Starlette:
        """Make the application."""
        routes = [
            Route("/", self._page),
            Route("/assets/{name}", self._asset),
            Route("/begin", self._begin),
            Route("/builtin/{name}", self._builtin),
            Route("/check", self._check, methods=["POST"]),
            Route("/save", self._save, methods=["POST"]),
            Route("/jobs", self._all),
            Route("/jobs", self._start, methods=["POST"]),
            Route("/jobs/{number:int}/stop", self._stop, methods=["POST"]),
            Route("/results/{number:int}/{name}", self._result),
        ]
        return Starlette(routes=routes, middleware=[Middleware(Guard, token=token)])

    async def _page(self, request: Request) -> Response:
        return HTMLResponse(_text("studio.html"))

    async def _asset(self, request: Request) -> Response:
        name = request.path_params["name"]
        return Response(_text(name), media_type=ASSETS[name]) if name in ASSETS else PlainTextResponse("no such file", 404)

    async def _begin(self, request: Request) -> Response:
        words, choices = await run_in_threadpool(editing.words), await run_in_threadpool(editing.choices)
        file = None if self.path is None else str(self.path)
        return JSONResponse({"text": self.text, "file": file, "words": words, "kinds": list(KINDS), **choices})

    async def _builtin(self, request: Request) -> Response:
        name = request.path_params["name"]
        return (
            PlainTextResponse(builtin_text(name)) if name in builtin_names() else PlainTextResponse("no such scenario", 404)
        )

    async def _check(self, request: Request) -> Response:
        asked = await _asked(request, "text")
        return JSONResponse(await run_in_threadpool(editing.check, asked["text"], self.where, self.folder))

    async def _save(self, request: Request) -> Response:
        asked = await _asked(request, "text")
        if self.path is None:
            return JSONResponse({"error": "no file: start the studio with the name of one"}, 409)
        try:
            with atomic_write(self.path) as hidden:
                hidden.write_text(asked["text"], encoding="utf-8")
        except OSError as error:
            return JSONResponse({"error": f"{self.path}: {error.strerror}"}, 409)
        return JSONResponse({"saved": str(self.path)})

    async def _all(self, request: Request) -> Response:
        return JSONResponse(self.jobs.all())

    async def _start(self, request: Request) -> Response:
        asked = await _asked(request, "text", "kind")
        if asked["kind"] not in KINDS:
            return JSONResponse({"error": f"no such thing: {asked['kind']}; one of {', '.join(KINDS)}"}, 422)
        found = await run_in_threadpool(editing.check, asked["text"], self.where, self.folder)
        if "error" in found:
            return JSONResponse(found, 422)
        try:
            job = self.jobs.start(asked["kind"], found["name"], asked["text"], self.where, self.folder)
        except ValueError as error:
            return JSONResponse({"error": str(error)}, 409)
        return JSONResponse(job.told(), 201)

    async def _stop(self, request: Request) -> Response:
        self.jobs.stop(request.path_params["number"])
        return JSONResponse({})

    async def _result(self, request: Request) -> Response:
        job, name = self.jobs.get(request.path_params["number"]), request.path_params["name"]
        path = None if job is None else job.folder / name
        # A name of the folder itself, and nothing beyond it.
        if path is None or Path(name).name != name or not path.is_file():
            return PlainTextResponse("no such file", 404)
        return FileResponse(path)


async def _asked(request: Request, *names: str) -> dict[str, str]:
    """Read the strings of these names in a request."""
    try:
        given: Any = await request.json()
    except ValueError:
        given = None
    if not isinstance(given, dict) or not all(isinstance(given.get(name), str) for name in names):
        return dict.fromkeys(names, "")
    return {name: given[name] for name in names}


def _text(name: str) -> str:
    return (resources.files("starhold.studio") / "assets" / name).read_text(encoding="utf-8")


def serve(path: Path | None, text: str, port: int, told: Callable[[str], None], browse: bool) -> None:
    """Serve a studio until it is interrupted. told: hears the address with its token. InputError where the port is taken."""
    import uvicorn

    token, studio = secrets.token_urlsafe(24), Studio(path, text)
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
    except OSError as error:
        listener.close()
        raise InputError(
            "studio", "--port", f"{port}: {error.strerror}", "another port, or 0 for any that is free"
        ) from None
    # Who reads the address and asks at once waits for the server to begin.
    listener.listen()
    address = f"http://{HOST}:{listener.getsockname()[1]}/?token={token}"
    told(address)
    if browse:
        webbrowser.open(address)
    config = uvicorn.Config(studio.app(token), log_level="error", lifespan="off")
    try:
        uvicorn.Server(config).run(sockets=[listener])
    finally:
        studio.jobs.close()
        listener.close()
