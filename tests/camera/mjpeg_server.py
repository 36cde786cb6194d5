"""A network camera on loopback that does as it is told, also badly."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from http import HTTPStatus

from pictures import jpeg

PERIOD_S = 1 / 40
BOUNDARY = b"frame"


class MjpegServer(threading.Thread):
    """Serves every caller picture after picture, `picture` of a number, until it is told otherwise.

    `fault` may be ``stalls`` (the line stays open, nothing comes), ``drops`` (it hangs up in the middle of a
    picture), ``refuses`` (it hangs up on every caller), ``repeats`` or None.
    """

    def __init__(
        self,
        *,
        lengths: bool = True,
        chunked: bool = False,
        kind: str = f"multipart/x-mixed-replace; boundary=--{BOUNDARY.decode()}",
        status: HTTPStatus = HTTPStatus.OK,
        elsewhere: str = "",
        picture: Callable[[int], bytes] = jpeg,
    ) -> None:
        super().__init__(daemon=True)
        self._lengths, self._chunked, self._kind, self._status = lengths, chunked, kind, status
        self._elsewhere = f"Location: {elsewhere}\r\n" if elsewhere else ""
        self._picture = picture
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}/video?size=small"
        self.fault: str | None = None
        self.number = 0
        self.callers = 0
        self.asked = b""
        self.burst = 1  # pictures at once
        self.sent: dict[int, float] = {}  # when
        self._done = False
        self.start()

    def close(self) -> None:
        self._done = True
        self._listener.close()
        self.join(5)

    def run(self) -> None:
        while not self._done:
            try:
                self._listener.settimeout(0.05)
                caller, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            caller.settimeout(5.0)
            self.callers += 1
            with caller, contextlib.suppress(OSError):
                self._serve(caller)

    def _serve(self, caller: socket.socket) -> None:
        if self.fault == "refuses":
            return
        self.asked = caller.recv(4096)
        transfer = "Transfer-Encoding: chunked\r\n" if self._chunked else ""
        status = f"{self._status.value} {self._status.phrase}"
        head = f"HTTP/1.1 {status}\r\nContent-Type: {self._kind}\r\n{self._elsewhere}{transfer}\r\n"
        caller.sendall(head.encode())
        if self._status != HTTPStatus.OK or "multipart" not in self._kind:
            return
        while not self._done:
            if self.fault == "stalls":
                time.sleep(PERIOD_S)
                continue
            parts = b"".join(self._part() for _ in range(self.burst))
            if self.fault == "drops":
                caller.sendall(parts[: len(parts) // 2])
                self.fault = None
                return
            caller.sendall(b"%x\r\n%b\r\n" % (len(parts), parts) if self._chunked else parts)
            time.sleep(PERIOD_S)

    def _part(self) -> bytes:
        self.number += self.fault != "repeats"
        self.sent[self.number] = time.monotonic()
        picture = self._picture(self.number)
        length = b"Content-Length: %d\r\n" % len(picture) if self._lengths else b""
        return b"--%b\r\nContent-Type: image/jpeg\r\n%b\r\n%b\r\n" % (BOUNDARY, length, picture)


@contextlib.contextmanager
def serving(**how) -> Iterator[MjpegServer]:
    """A server for as long as the block lasts."""
    server = MjpegServer(**how)
    try:
        yield server
    finally:
        server.close()
