"""The web application: one page, a way in, and a WebSocket."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Final

import structlog
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from service.ground.access import MAX_TOKEN_LETTERS, Access
from service.ground.browser import BadMessageError, Browser, BrowserStalledError
from service.ground.guard import Guard
from service.ground.hub import Hub
from service.ground.page_files import PageFile, load_page

log = structlog.get_logger()

CLOSE_NO_TOKEN: Final = 4401
CLOSE_STALLED: Final = 4408
CLOSE_BAD_MESSAGE: Final = 4400
CLOSE_FULL: Final = 4429

_WRONG_TOKEN_S = 1.0
"""Wait before a wrong token is answered: guessing takes ages."""

_MAX_LOGIN_BYTES = MAX_TOKEN_LETTERS * 2 + 100


class GroundApp:
    """The handlers of the routes.

    Args:
        hub: where browsers get their news.
        access: who may look.
        port: part of the cookie's name, since a browser does not tell ports apart.
        secure: the page is served over TLS.
    """

    def __init__(self, hub: Hub, access: Access, port: int, *, secure: bool = False) -> None:
        self._hub = hub
        self._access = access
        self._cookie_name = f"uavdepth_ground_{port}"
        self._secure = secure
        self._page = load_page()
        self.asgi = Starlette(
            routes=[
                *(Route(path, self._file, methods=["GET"]) for path in self._page),
                Route("/session", self._tell_session, methods=["GET"]),
                Route("/login", self._log_in, methods=["POST"]),
                WebSocketRoute("/live", self._live),
            ],
            middleware=[Middleware(Guard, access=access)],
            lifespan=self._run_hub,
        )

    @asynccontextmanager
    async def _run_hub(self, _app: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(self._hub.run())
        yield
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task

    async def _file(self, request: Request) -> Response:
        file: PageFile = self._page[request.url.path]
        headers = {"ETag": file.etag, "Cache-Control": "no-cache"}
        if request.headers.get("if-none-match") == file.etag:
            return Response(status_code=304, headers=headers)
        return Response(file.data, media_type=file.media_type, headers=headers)

    async def _tell_session(self, request: Request) -> Response:
        """204 if the browser may look, 401 if it has to tell the token first."""
        return Response(
            status_code=204 if self._is_known(request) else 401, headers={"Cache-Control": "no-store"}
        )

    async def _log_in(self, request: Request) -> Response:
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > _MAX_LOGIN_BYTES:
                return PlainTextResponse("too long for a token", 413)
        try:
            token = json.loads(body)["token"]
        except (ValueError, TypeError, KeyError, RecursionError):
            return PlainTextResponse('{"token": "..."} is needed', 400)
        if not isinstance(token, str) or not self._access.knows_token(token):
            await asyncio.sleep(_WRONG_TOKEN_S)
            return PlainTextResponse("this is not the token", 403)
        response = Response(status_code=204, headers={"Cache-Control": "no-store"})
        if self._access.needs_token:
            response.set_cookie(
                self._cookie_name,
                self._access.cookie,
                max_age=7 * 86_400,
                httponly=True,
                samesite="strict",
                secure=self._secure,
            )
        return response

    async def _live(self, websocket: WebSocket) -> None:
        """One browser, from its coming to its going."""
        await websocket.accept()
        if not self._is_known(websocket):
            await websocket.close(CLOSE_NO_TOKEN, "token needed")
            return
        if self._hub.is_full:
            await websocket.close(CLOSE_FULL, "too many browsers")
            return
        browser = Browser(self._hub, websocket.send_bytes)
        self._hub.add(browser)
        try:
            code, words = await _converse(websocket, browser)
        finally:
            await self._hub.remove(browser)
        if code is not None:
            log.info("browser let go", why=words)
            with suppress(WebSocketDisconnect, RuntimeError):
                await websocket.close(code, words[:100])

    def _is_known(self, connection: HTTPConnection) -> bool:
        return self._access.knows_cookie(connection.cookies.get(self._cookie_name))


async def _converse(websocket: WebSocket, browser: Browser) -> tuple[int | None, str]:
    """Speak with one browser until one side ends it; the close code to send, None if the browser went."""

    async def hear() -> None:
        while True:
            await browser.hear(await websocket.receive_text())

    tasks = {asyncio.create_task(hear()), asyncio.create_task(browser.feed())}
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        results = await asyncio.gather(*tasks, return_exceptions=True)
    errors = [error for error in results if isinstance(error, Exception)]
    for error in errors:
        if isinstance(error, BrowserStalledError):
            return CLOSE_STALLED, str(error)
        if isinstance(error, (BadMessageError, KeyError)):
            return CLOSE_BAD_MESSAGE, str(error)
        if not isinstance(error, (WebSocketDisconnect, RuntimeError, OSError)):
            raise error
    return None, ""
