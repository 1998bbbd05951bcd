"""The server of the page: on this machine only, for who has the token, for one tab at a time."""

import asyncio
import hmac
import json
import secrets
import socket
import webbrowser
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from selfmotion.basics import ProblemError, RenderError, SelfmotionError
from selfmotion.shell.view.page_session import PageSession

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket

HOST = "127.0.0.1"
# How a connection is ended: without the token, and where another tab has the page.
REFUSED, TAKEN = 4403, 4409
# The port that addresses without one have.
_HTTP = 80
# Messages of the page are short [bytes].
_LONGEST = 65_536
# Files of plans are smaller [bytes].
_LARGEST = 2**28


def check_server() -> None:
    """Raise RenderError where the packages of the server are missing."""
    try:
        import starlette
        import tomlkit
        import uvicorn
        import websockets
    except ImportError as error:
        raise RenderError(
            f"the page needs the package {error.name}: pip install 'selfmotion[view]'"
        ) from None
    del starlette, tomlkit, uvicorn, websockets


def serve(
    session: PageSession,
    *,
    port: int = 0,
    opens: bool = True,
    told: Callable[[str], None] = print,
) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    session : PageSession
    port : int
        0 for a free one.
    opens : bool
        Whether the browser is opened.
    told : callable
        Called with the address, which holds the token.

    Raises
    ------
    RenderError
        Packages are missing, or the port is taken.
    """
    import uvicorn

    bound = listening(port)
    token = secrets.token_urlsafe(24)
    number = bound.getsockname()[1]
    address = f"http://{HOST}:{number}/?token={token}"
    server = uvicorn.Server(configuration(application(session, token, number)))
    told(address)
    if opens:
        webbrowser.open(address)
    try:
        server.run(sockets=[bound])
    except KeyboardInterrupt:
        # The way in which this ends.
        pass
    finally:
        bound.close()
        session.close()


def listening(port: int) -> socket.socket:
    """Return a socket at a port of this machine alone; RenderError where it is taken."""
    bound = socket.socket()
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
    except OSError as error:
        bound.close()
        raise RenderError(
            f"port {port} is taken ({error.strerror}); give another --port, or none for a free one"
        ) from None
    return bound


def configuration(app: "Starlette") -> Any:
    """Return how the application is served: without a log, since addresses hold the token."""
    import uvicorn

    return uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        server_header=False,
        ws="websockets-sansio",
        ws_max_size=_LONGEST,
        # To compress a message takes longer than to hand it to this machine's browser.
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=1,
    )


def application(session: PageSession, token: str, port: int) -> "Starlette":
    """Return the application: the page, its connection, exported files, and plans beside it."""
    from starlette.applications import Starlette
    from starlette.routing import Route, WebSocketRoute

    answers = _Answers(session, token, port)
    routes = [
        Route("/", answers.page),
        Route("/export", answers.export),
        Route("/beside", answers.beside, methods=["POST"]),
        WebSocketRoute("/live", answers.live),
    ]
    return Starlette(routes=routes)


class _Answers:
    """What the server answers to who has the token, on this machine.

    Parameters
    ----------
    session : PageSession
    token : str
    port : int
        At which it is served.
    """

    def __init__(self, session: PageSession, token: str, port: int) -> None:
        self._session, self._token, self._port = session, token, port
        # Another name for this machine is one that a foreign page may have given it.
        names = (HOST, "localhost")
        # Browsers leave out the port of HTTP.
        self._hosts = {f"{name}:{port}" for name in names} | set(names if port == _HTTP else ())

    def _refusal(self, request: "Request | WebSocket") -> str:
        """Return why a request is refused; "" for none."""
        if request.headers.get("host") not in self._hosts:
            return f"this page is served as {HOST}:{self._port} only"
        origin = request.headers.get("origin")
        if origin is not None and origin.removeprefix("http://") not in self._hosts:
            return "another page asks for this one"
        given = request.query_params.get("token", "")
        if not hmac.compare_digest(given.encode(), self._token.encode()):
            return "the token is missing or wrong; open the address that `selfmotion view` printed"
        return ""

    async def page(self, request: "Request") -> "Response":
        """Answer with the page."""
        from starlette.responses import HTMLResponse

        if why := self._refusal(request):
            return _refused(why)
        return HTMLResponse(self._session.html, headers=_HEADERS)

    async def export(self, request: "Request") -> "Response":
        """Answer with the motion as a file."""
        from starlette.responses import PlainTextResponse, Response

        if why := self._refusal(request):
            return _refused(why)
        suffix = request.query_params.get("as", "")
        try:
            mass = _mass(request.query_params.get("mass", ""))
            data = await asyncio.to_thread(self._session.export, suffix, mass)
        except SelfmotionError as error:
            return PlainTextResponse(f"{error}\n", status_code=409, headers=_HEADERS)
        # Headers are Latin-1: other letters of the name are told as those of an address are.
        name = quote(f"{self._session.file.stem}{suffix}", safe="", errors="replace")
        headers = {**_HEADERS, "Content-Disposition": f"attachment; filename*=UTF-8''{name}"}
        return Response(data, media_type="application/octet-stream", headers=headers)

    async def beside(self, request: "Request") -> "Response":
        """Take the file of a plan that is shown beside the own one; an empty one for none."""
        from starlette.responses import PlainTextResponse

        if why := self._refusal(request):
            return _refused(why)
        name, data = request.query_params.get("name", "plan"), bytearray()
        async for part in request.stream():
            data += part
            if len(data) > _LARGEST:
                return PlainTextResponse(f"{name}: is too large for a plan\n", status_code=413)
        try:
            await asyncio.to_thread(self._session.show_beside, name, bytes(data))
        except SelfmotionError as error:
            return PlainTextResponse(f"{error}\n", status_code=409, headers=_HEADERS)
        return PlainTextResponse("", headers=_HEADERS)

    async def live(self, connection: "WebSocket") -> None:
        """Hear and tell, as long as the page is open."""
        await connection.accept()
        if why := self._refusal(connection):
            await connection.close(REFUSED, why[:100])
            return
        outgoing: asyncio.Queue[bytes] = asyncio.Queue()
        loop = asyncio.get_running_loop()

        def send(data: bytes) -> None:
            loop.call_soon_threadsafe(outgoing.put_nowait, data)

        if not await asyncio.to_thread(self._session.attach, send):
            await connection.close(TAKEN, "another tab has this page")
            return
        try:
            await _both(connection, self._session, outgoing)
        finally:
            self._session.detach()


def _mass(given: str) -> float | None:
    """Return a mass that the page has typed [kg]; None where it is empty."""
    try:
        return float(given) if given else None
    except ValueError:
        raise ProblemError(f"mass: is {given!r}, expected a number of kg") from None


def _refused(why: str) -> "Response":
    from starlette.responses import PlainTextResponse

    return PlainTextResponse(f"refused: {why}\n", status_code=403)


_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


async def _both(
    connection: "WebSocket", session: PageSession, outgoing: "asyncio.Queue[bytes]"
) -> None:
    """Hear and tell at the same time, until the page is closed."""
    hearing = asyncio.create_task(_hear(connection, session))
    telling = asyncio.create_task(_say(connection, outgoing))
    done, others = await asyncio.wait({hearing, telling}, return_when=asyncio.FIRST_COMPLETED)
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)
    for task in done:
        task.result()


async def _hear(connection: "WebSocket", session: PageSession) -> None:
    from starlette.websockets import WebSocketDisconnect

    while True:
        try:
            text = await connection.receive_text()
        except (WebSocketDisconnect, KeyError):
            # A page that sends bytes is none of ours.
            return
        try:
            asked = json.loads(text)
            answer = await asyncio.to_thread(session.answer, asked)
        except (ValueError, RecursionError) as error:
            answer = {"error": f"the page sent what is no JSON: {error}"}
        except SelfmotionError as error:
            answer = {"error": str(error)}
        if answer is not None:
            await connection.send_text(json.dumps(answer, allow_nan=False))


async def _say(connection: "WebSocket", outgoing: "asyncio.Queue[bytes]") -> None:
    while True:
        data = await outgoing.get()
        # Of several that wait the last one says all.
        while not outgoing.empty():
            data = outgoing.get_nowait()
        await connection.send_bytes(data)
