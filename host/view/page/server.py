"""The live page's server: a thread of its own, in which all that costs time is done.

The loop hands over references and goes on. Each browser says what it has drawn, and only then gets the next
picture, which is the newest: a slow one sees fewer, and none that is older. STOP goes straight from here to
the robot's line.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import json
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from host.errors import UsageError
from host.view.page.guard import Guard
from host.view.page.shot import Job, Shot

if TYPE_CHECKING:  # so that the page is there before the rest of the program is loaded
    from aiohttp import web

    from host.camera.frame import Frame
    from host.link.robot import Robot
    from host.nav.config import BodyConfig
    from host.nav.map import ObstacleMap
    from host.nav.pilot import View
    from host.nav.result import DriveLog

PORT = 8080
PORTS_TRIED = 20  # from there on, where nobody asked for one
IN_FLIGHT = 2  # pictures on their way to a browser that has not said yet that it has drawn them
REMEMBERED = 1000  # times from exposure to drawn
END_S = 2.0  # for saying good-bye to browsers
STRANGER_S = 5.0  # a caller who asked for nothing that is allowed to him is hung up on after this long
MOST_STRANGERS = 32  # at a time: each takes a file, and those the drive needs must not run out
STOPPED = "STOP pressed on the live page"
HERE = Path(__file__).parent
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src blob: data:; "
        "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class LivePage:
    """Listens as soon as it is made; a context that ends the server.

    Parameters
    ----------
    host
        Name or address of this machine to listen on.
    port
        Where; None for 8080 or the next one that is free.

    Attributes
    ----------
    url : str
        What to open in a browser.
    drawn_ms : deque of float
        From exposure until a browser said that it had drawn the picture, for the newest ones.

    Raises
    ------
    UsageError
        It cannot listen there.
    """

    def __init__(self, host: str = "127.0.0.1", port: int | None = None) -> None:
        if find_spec("aiohttp") is None:
            raise UsageError("--view: aiohttp is not installed; run 'make setup'")
        self._socket = _listen(host, port)
        address, number = self._socket.getsockname()[:2]
        self._guard = Guard.of(host, address)
        token = "" if self._guard.token is None else f"?token={self._guard.token}"
        self.url = f"http://{_shown(host, address)}:{number}/{token}"
        self.drawn_ms: deque[float] = deque(maxlen=REMEMBERED)
        self._loop = asyncio.new_event_loop()
        self._over = asyncio.Event()
        self._browsers: set[_Browser] = set()
        self._strangers: dict[asyncio.BaseProtocol, asyncio.TimerHandle] = {}
        self._note: dict[str, Any] = {"kind": "wait", "text": "starting"}
        self._shot: Shot | None = None
        self._message: tuple[int, bytes] = (0, b"")
        self._number = 0
        self._job: Job | None = None
        self._monotonic_s: Callable[[float], float] = lambda t_s: t_s
        self._stop_asked = False
        self._thread = threading.Thread(target=self._serve, name="live page", daemon=True)
        self._thread.start()

    # --- For the loop's thread ------------------------------------------------------------------

    def say(self, text: str) -> None:
        """What goes on before the first picture."""
        self._call(self._tell, {"kind": "wait", "text": text})

    def begin(
        self,
        words: str,
        goals_cm: list[tuple[float, float]],
        body: BodyConfig,
        robot: Robot,
        monotonic_s: Callable[[float], float],
    ) -> None:
        """A drive begins: what it is for; `monotonic_s` maps its clock's time to time.monotonic's."""
        self._monotonic_s = monotonic_s
        self._job = Job(words, tuple(goals_cm), body, robot)
        if self._stop_asked:
            robot.halt(STOPPED)

    def show(self, frame: Frame | None, view: View | None, obstacle_map: ObstacleMap, log: DriveLog) -> None:
        """What was made of the newest picture; `view` is None where it was not driven on."""
        done_s = time.monotonic()
        self._number += 1
        self._shot = Shot(
            self._number,
            done_s if frame is None else self._monotonic_s(frame.t_s),
            done_s,
            frame,
            view,
            log,
            obstacle_map.evidence.copy(),
            tuple(obstacle_map.movers),
            obstacle_map.half_cm,
            obstacle_map.config.cell_cm,
        )
        if self._browsers:
            self._call(self._wake)

    def end(self, outcome: str, reason: str) -> None:
        """The drive is over; the page goes on saying how it ended."""
        self._call(self._tell, {"kind": "end", "outcome": outcome, "reason": reason})

    def close(self) -> None:
        """No more server."""
        self._call(self._over.set)
        self._thread.join(END_S + 1.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self.end("stopped", str(error) or "interrupted")
        self.close()

    def _call(self, act: Callable[..., object], *arguments: object) -> None:
        with contextlib.suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(act, *arguments)

    # --- The server's thread --------------------------------------------------------------------

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._run())
        except Exception as error:  # whatever it is, the drive goes on without the page
            print(f"live page ended: {type(error).__name__}: {error}", file=sys.stderr)
        finally:
            self._socket.close()
            self._loop.close()

    async def _run(self) -> None:
        from aiohttp import web

        @web.middleware
        async def checked(request: web.Request, handler: Callable) -> web.StreamResponse:
            headers = request.headers
            host, origin, token = headers.get("Host"), headers.get("Origin"), request.query.get("token")
            objection = self._guard.objection(host, origin, token, acts=request.path != "/")
            if objection is not None:
                refusal = web.Response(status=403, text=objection + "\n", headers=HEADERS)
                refusal.force_close()
                return refusal
            if (timer := self._strangers.pop(request.protocol, None)) is not None:
                timer.cancel()
            return await handler(request)

        app = web.Application(middlewares=[checked])
        app.add_routes([
            web.get("/", self._page), web.get("/live", self._live), web.post("/stop", self._posted_stop),
        ])  # fmt: skip
        runner = web.AppRunner(app, handle_signals=False, access_log=None, shutdown_timeout=END_S / 2)
        await runner.setup()
        answer = runner.server
        assert answer is not None, "it was set up"
        listening = await self._loop.create_server(lambda: self._called(answer), sock=self._socket)
        await self._over.wait()
        listening.close()
        # At once, as those that no longer listen would take all the time one after the other.
        good_byes = (asyncio.wait_for(browser.socket.close(), END_S / 4) for browser in self._browsers)
        await asyncio.gather(*good_byes, return_exceptions=True)
        await runner.cleanup()

    def _called(self, answer: web.Server) -> asyncio.BaseProtocol:
        """Somebody connects: a stranger until he asks for something that he may have."""
        if len(self._strangers) >= MOST_STRANGERS:
            return _Engaged()
        caller = answer()
        self._strangers[caller] = self._loop.call_later(STRANGER_S, self._hang_up, caller)
        return caller

    def _hang_up(self, caller: web.RequestHandler) -> None:
        del self._strangers[caller]
        if caller.transport is not None:
            caller.transport.abort()

    async def _page(self, _: web.Request) -> web.Response:
        from aiohttp import web

        text, style, script = (
            (HERE / name).read_text("utf-8") for name in ("page.html", "page.css", "page.js")
        )
        text = text.replace("/*STYLE*/", style).replace("/*SCRIPT*/", script)
        return web.Response(text=text, content_type="text/html", headers=HEADERS)

    async def _posted_stop(self, _: web.Request) -> web.Response:
        from aiohttp import web

        self._stop()
        return web.Response(text="stopped\n", headers=HEADERS)

    async def _live(self, request: web.Request) -> web.StreamResponse:
        from aiohttp import WSMsgType, web

        socket = web.WebSocketResponse(compress=False, heartbeat=5.0, max_msg_size=1024)
        await socket.prepare(request)
        browser = _Browser(socket)
        self._browsers.add(browser)
        feeding = asyncio.create_task(self._feed(browser))
        try:
            await socket.send_json(self._note)
            async for message in socket:
                if message.type == WSMsgType.TEXT:
                    self._hear(browser, message.data)
        finally:
            self._browsers.discard(browser)
            feeding.cancel()
        return socket

    def _hear(self, browser: _Browser, text: str) -> None:
        try:
            said = json.loads(text)
            if said.get("stop") is True:
                self._stop()
            if (shot := browser.in_flight.pop(said.get("drawn"), None)) is not None:
                self.drawn_ms.append(1e3 * (time.monotonic() - shot.exposed_s))
                command_ms = 1e3 * (shot.done_s - shot.exposed_s)
                browser.note = {
                    "kind": "drawn", "ms": round(self.drawn_ms[-1], 1), "command_ms": round(command_ms, 1)
                }  # fmt: skip
                browser.news.set()
        except (ValueError, AttributeError, TypeError, RecursionError):
            pass  # nobody that is known says such things

    async def _feed(self, browser: _Browser) -> None:
        """Send the newest picture whenever there is a newer one and the browser keeps up."""
        shown = 0
        with contextlib.suppress(ConnectionError):
            while True:
                await browser.news.wait()
                browser.news.clear()
                shot, job = self._shot, self._job
                if shot is None or job is None or shot.number == shown or len(browser.in_flight) >= IN_FLIGHT:
                    continue
                shown = shot.number
                browser.in_flight[shown] = shot
                if browser.note is not None:
                    await browser.socket.send_json(browser.note)
                await browser.socket.send_bytes(self._packed(shot, job))

    def _packed(self, shot: Shot, job: Job) -> bytes:
        from host.view.page.packing import packed

        if self._message[0] != shot.number:
            self._message = shot.number, packed(shot, job)
        return self._message[1]

    def _wake(self) -> None:
        for browser in self._browsers:
            browser.news.set()

    def _tell(self, note: dict[str, Any]) -> None:
        """To all who look on, and to those who come."""
        self._note = note
        for browser in self._browsers:
            task = asyncio.ensure_future(browser.socket.send_json(note))
            browser.sending.add(task)
            task.add_done_callback(browser.sent)

    def _stop(self) -> None:
        self._stop_asked = True
        if self._job is not None:
            self._job.robot.halt(STOPPED)
        if self._note["kind"] != "end":  # STOP comes both ways, and by the second the drive may have ended
            self._tell({"kind": "stopped", "reason": STOPPED})


class _Engaged(asyncio.Protocol):
    """Hangs up at once."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        transport.abort()


class _Browser:
    """One that has the page open."""

    def __init__(self, socket: web.WebSocketResponse) -> None:
        self.socket = socket
        self.news = asyncio.Event()
        self.news.set()
        self.in_flight: dict[int, Shot] = {}  # by number
        self.note: dict[str, Any] | None = None  # how long the last picture took that it has drawn
        self.sending: set[asyncio.Future] = set()

    def sent(self, task: asyncio.Future) -> None:
        """A short message is gone, or the browser is."""
        self.sending.discard(task)
        if not task.cancelled():
            task.exception()


def _listen(host: str, port: int | None) -> socket.socket:
    wanted = [*range(PORT, PORT + PORTS_TRIED), 0] if port is None else [port]
    try:
        family, _, _, _, (address, *_) = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError):
        raise UsageError(f"--view-host {host}: no such host; give an address of this machine") from None
    for number in wanted:
        try:
            # All of this machine means its IPv4 addresses too, which are the ones that get printed.
            both = address == "::" and socket.has_dualstack_ipv6()
            return socket.create_server((str(address), number), family=family, dualstack_ipv6=both)
        except OverflowError:
            raise UsageError(f"--view-port {number}: give 0 to 65535") from None
        except OSError as error:
            if error.errno == errno.EADDRINUSE and number != wanted[-1]:
                continue
            raise UsageError(_why_not(host, number, error)) from None
    raise AssertionError("the last port is any that is free")


def _why_not(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"--view-port {port}: another program listens there; leave it out and a free one is taken"
    if error.errno == errno.EACCES:
        return f"--view-port {port}: reserved for the system; give one from 1024 on, or leave it out"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"--view-host {host}: not an address of this machine; try 0.0.0.0 for all that it has"
    return f"--view-host {host}, --view-port {port}: cannot listen there ({error.strerror})"


def _shown(host: str, address: str) -> str:
    """What to write in the address for others."""
    if address in ("0.0.0.0", "::"):
        return _towards_others()
    return f"[{address}]" if ":" in address else address if host == address else host


def _towards_others() -> str:
    """This machine's address in its network, else its name."""
    with contextlib.suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # sends nothing; an address for documentation, nobody has it
        return probe.getsockname()[0]
    return socket.gethostname()
