"""A network camera: an MJPEG stream over HTTP, one JPEG after the other in a reply that never ends."""

from __future__ import annotations

import http.client
import re
import select
import socket
import time
from urllib.parse import urljoin, urlsplit

from host.camera.live import Shot
from host.errors import DeviceError, UsageError

CONNECT_S = 3.0
SILENCE_S = 1.0  # of the stream, after which it is opened anew
MOVES = 5  # from one address to another before its stream is given up
LARGEST_PART = 16_000_000
READ_BYTES = 1 << 16
STREAM_TYPE = "multipart/x-mixed-replace"
LENGTH = re.compile(rb"content-length:\s*(\d+)", re.IGNORECASE)
HEAD_END = b"\r\n\r\n"


class MjpegStream:
    """An open stream; a ``host.camera.live.Capture``. Pictures have the times of their arrival.

    Raises
    ------
    UsageError
        The address is none.
    DeviceError
        Nobody answers there, or with something else than a stream.
    """

    def __init__(self, url: str) -> None:
        at = url
        for _ in range(1 + MOVES):
            moved = self._open(at)
            if moved is None:
                break
            at = moved
        else:
            raise DeviceError(f"camera {url}: leads from one address to the next; give the last, {at}")
        self._bytes = bytearray()

    def _open(self, at: str) -> str | None:
        """Begin the stream of an address; else where that leads."""
        self._connection = _connection(at)
        try:
            parts = urlsplit(at)
            self._connection.connect()
            self._socket: socket.socket = self._connection.sock  # it forgets it when the reply has begun
            self._connection.request("GET", (parts.path or "/") + (f"?{parts.query}" if parts.query else ""))
            self._reply = self._connection.getresponse()
            moved = self._reply.getheader("Location") if 300 <= self._reply.status < 400 else None
            if moved is None:
                self._boundary = _boundary(at, self._reply)
                self._socket.settimeout(SILENCE_S)
                return None
            self._connection.close()
            return urljoin(at, moved)
        except (OSError, ValueError, http.client.HTTPException) as error:  # ValueError: leads nowhere
            self._connection.close()
            raise DeviceError(
                f"camera {at}: does not answer ({error or type(error).__name__}); is it on, and is the "
                f"address right?"
            ) from None
        except DeviceError:
            self._connection.close()
            raise

    def read(self) -> Shot | None:
        """The newest picture that has arrived, waited for; None where the stream ended or fell silent."""
        newest, count = None, 0
        try:
            while newest is None or self._more_waits():
                data = self._reply.read1(READ_BYTES)
                if not data:
                    return None
                self._bytes += data
                while (part := self._next_part()) is not None:
                    newest, count = part, count + 1
                if len(self._bytes) > LARGEST_PART:
                    return None
        except (OSError, ValueError, http.client.HTTPException):  # ValueError: read from after closing
            if newest is None:
                return None
        return None if newest is None else Shot(newest, time.monotonic(), count - 1)

    def release(self) -> None:
        """Hang up."""
        self._reply.close()
        self._connection.close()

    def _more_waits(self) -> bool:
        return bool(select.select([self._socket], [], [], 0)[0])

    def _next_part(self) -> bytes | None:
        """Take the next whole part off the bytes."""
        head_end = self._bytes.find(HEAD_END)
        if head_end < 0:
            return None
        begin = head_end + len(HEAD_END)
        lengths = LENGTH.findall(self._bytes, 0, head_end)
        if lengths:
            end = begin + int(lengths[-1])
            if end > len(self._bytes):
                return None
        else:
            end = self._bytes.find(self._boundary, begin)
            if end < 0:
                return None
        part = bytes(self._bytes[begin:end])
        del self._bytes[:end]
        return part.rstrip(b"\r\n")


def _connection(url: str) -> http.client.HTTPConnection:
    kinds = {"http": http.client.HTTPConnection, "https": http.client.HTTPSConnection}
    try:
        parts = urlsplit(url)
        if parts.scheme in kinds and parts.hostname:
            return kinds[parts.scheme](parts.hostname, parts.port, timeout=CONNECT_S)
    except ValueError:  # of brackets or of the port
        pass
    raise UsageError(f"camera {url}: is no address; write it as http://192.168.1.20:8080/video")


def _boundary(url: str, reply: http.client.HTTPResponse) -> bytes:
    """What stands between two parts, from the head of the reply."""
    if reply.status != http.client.OK:
        raise DeviceError(
            f"camera {url}: answers {reply.status} {reply.reason}; open the address in a browser to see why"
        )
    kind = reply.headers.get_content_type()
    if kind != STREAM_TYPE:
        single = "a single picture" if kind.startswith("image/") else f"{kind}, no MJPEG stream"
        raise DeviceError(f"camera {url}: gives {single}; look up the address of its MJPEG stream")
    name = reply.headers.get_param("boundary")
    return b"--" + str(name or "").strip('"').removeprefix("--").encode("latin-1", "replace")
