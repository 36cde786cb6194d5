"""A recording read back: pictures, journal, the line's bytes, settings. A file that was never closed too.

All of the file is looked through when it is opened, so that damage is told before anything is done with it.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

import cv2
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from host.camera.frame import Frame
from host.camera.jpeg import COLOUR
from host.camera.lens import Lens
from host.config import Config, parse_config
from host.errors import InputError, UsageError
from host.record import ros
from host.record.image_file import JPEG_SIGNATURE
from host.record.journal import FORMAT, LIBRARY, Entry, lens_of

HEAD = struct.Struct("<BQ")  # of a record: what it is, how long
MESSAGE = struct.Struct("<HIQQ")  # before a message's data: channel, number, two times
NOTABLE = tuple(f'{{"do":"{what}"' for what in ("begin", "frame", "end"))  # entries that opening looks at
LONGEST_CHUNK = 1 << 30
NOT_READABLE = (
    McapError, ValueError, LookupError, ArithmeticError, TypeError, MemoryError, struct.error,
    zstandard.ZstdError,
)  # fmt: skip
REMEDY = "copy it again from where it was made"


class Said(NamedTuple):
    """One message."""

    topic: str
    t_ns: int  # wall clock
    data: bytes


class _Message(NamedTuple):
    channel: int
    number: int
    t_ns: int
    data: bytes


class SerialBytes(NamedTuple):
    """Bytes of the line, as they were sent or had arrived."""

    t_ns: int
    sent: bool  # by the host
    data: bytes


class RecordedEvent(NamedTuple):
    """A line of text."""

    t_ns: int
    level: int  # of ROS: 20 is worth knowing, 30 a warning
    source: str  # drive or link
    text: str


@dataclass(frozen=True)
class RecordedFrame:
    """A picture as it was recorded."""

    number: int  # in this recording, from 0
    seq: int  # the camera's own
    t_s: float  # when it was taken, host clock
    pixels: int  # CRC-32 of the image as it was live
    file: bytes  # JPEG or PNG

    @property
    def is_jpeg(self) -> bool:
        """As the camera gave it; else a PNG, made of what it gave."""
        return self.file.startswith(JPEG_SIGNATURE)

    def frame(self) -> Frame:
        """As the camera gave it live.

        Raises
        ------
        InputError
            The picture cannot be decoded.
        """
        image = cv2.imdecode(np.frombuffer(self.file, np.uint8), COLOUR)
        if image is None:
            raise InputError(f"picture {self.number} of the recording cannot be decoded; {REMEDY}")
        return Frame(image, self.t_s, self.seq, self.file if self.is_jpeg else None)

    def is_as_live(self, image: np.ndarray) -> bool:
        """Whether the image is to the pixel what the program saw live."""
        return zlib.crc32(image.tobytes()) == self.pixels


class Recording:
    """One file, looked through and found readable.

    Attributes
    ----------
    begin : dict
        The journal's first entry: lens, task, options, versions, when it was started.
    lens : Lens
    toml : str
        The settings in force.
    closed : bool
        It was closed as it should be; else it ends after the last chunk that is whole.
    frame_count : int
        Pictures in it.
    duration_s : float

    Raises
    ------
    InputError
        There is no such file, it is damaged or no recording of this program.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._chunks: list[tuple[int, int]] = []  # place and length in the file
        self._places: dict[int, tuple[int, int]] = {}  # of pictures: chunk, message in it
        self._held: tuple[int, list[_Message]] | None = None  # the chunk that was read last
        self._topics: dict[int, str] = {}
        self.begin: Entry = {}
        self.toml = ""
        self.closed = False
        self.entry_count = 0
        self.duration_s = 0.0
        self._messages = 0
        self._first_ns: int | None = None
        self._pending: Entry | None = None  # of the picture that comes next
        self._wall_ns: int | None = None  # wall clock less host clock
        try:
            with open(path, "rb") as file:
                self._look_through(file, os.fstat(file.fileno()).st_size)
        except FileNotFoundError:
            raise InputError(f"{path}: no such file; give a recording made with --record") from None
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}); give a recording made with --record"
            ) from None
        self._understand()

    @property
    def note(self) -> str | None:
        """What to tell a person of a file that was not closed."""
        if self.closed:
            return None
        return (
            f"{self.path}: was not closed, as after a crash or on a full disk; "
            f"it is whole up to {self.duration_s:.1f} s"
        )

    @cached_property
    def config(self) -> Config:
        """The settings in force.

        Raises
        ------
        InputError
            They are those of another version of this program.
        """
        try:
            return parse_config(self.toml, Path("settings"))
        except UsageError as error:
            raise InputError(
                f"{self.path}: recorded by a program with other settings ({error}); use that version"
            ) from None

    def host_time_s(self, t_ns: int) -> float:
        """The host clock's time, as pictures and journal have it, of a message's; without a picture 0."""
        return 0.0 if self._wall_ns is None else 1e-9 * (t_ns - self._wall_ns)

    # --- What is in it --------------------------------------------------------------------------

    def messages(self, *topics: str) -> Iterator[Said]:
        """The messages of some topics, or all of them, in the order in which they were recorded."""
        for index in range(len(self._chunks)):
            for message in self._chunk(index):
                topic = self._topics[message.channel]
                if not topics or topic in topics:
                    yield Said(topic, message.t_ns, message.data)

    def journal(self) -> Iterator[Entry]:
        """What the pilot was told and made of it; `host.record.journal` says what the entries hold."""
        for said in self.messages("/journal"):
            yield json.loads(ros.read_string(said.data))

    def frames(self) -> Iterator[RecordedFrame]:
        """The pictures, also those that were not driven on."""
        for entry in self.journal():
            if entry["do"] == "frame" and entry["frame"] in self._places:
                yield self._frame(entry)

    def frame(self, entry: Entry) -> RecordedFrame | None:
        """The picture of a journal's ``frame`` entry; None where it did not get into the recording."""
        return self._frame(entry) if entry["frame"] in self._places else None

    def serial(self) -> Iterator[SerialBytes]:
        """The line's bytes, both ways."""
        for said in self.messages("/serial/rx", "/serial/tx"):
            yield SerialBytes(said.t_ns, said.topic == "/serial/tx", ros.read_byte_array(said.data))

    def events(self) -> Iterator[RecordedEvent]:
        """What happened, in lines of text."""
        for said in self.messages("/events"):
            _, level, source, text = ros.read_log(said.data)
            yield RecordedEvent(said.t_ns, level, source, text)

    @property
    def frame_count(self) -> int:
        return len(self._places)

    def _frame(self, entry: Entry) -> RecordedFrame:
        chunk, place = self._places[entry["frame"]]
        _, _, file = ros.read_compressed_image(self._chunk(chunk)[place].data)
        return RecordedFrame(entry["frame"], entry["seq"], entry["t_s"], entry["pixels"], file)

    def _chunk(self, index: int) -> list[_Message]:
        if self._held is None or self._held[0] != index:
            place, length = self._chunks[index]
            try:
                with open(self.path, "rb") as file:
                    file.seek(place)
                    _, messages = _unpack(file.read(length))
            except (OSError, *NOT_READABLE):
                raise InputError(f"{self.path}: changed while it was read; read it again") from None
            self._held = index, messages
        return self._held[1]

    # --- At opening -----------------------------------------------------------------------------

    def _look_through(self, file: IO[bytes], size: int) -> None:
        """Find the chunks, and note what is in them; where the file was cut, up to there."""
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            what = "is empty" if size == 0 else "is no MCAP file, or its beginning is damaged"
            raise InputError(f"{self.path}: {what}; give a recording made with --record")
        at, sums, kind = len(MCAP0_MAGIC), zlib.crc32(MCAP0_MAGIC), 0
        while kind != Opcode.DATA_END and at + HEAD.size <= size:
            head = file.read(HEAD.size)
            kind, length = HEAD.unpack(head)
            if at + HEAD.size + length > size:
                break
            body = file.read(length)
            if kind == Opcode.HEADER and LIBRARY.encode() not in body:
                raise self._foreign()
            if kind == Opcode.CHUNK:
                self._take_chunk(body, at)
            elif kind == Opcode.DATA_END:
                if int.from_bytes(body[:4], "little") not in (0, sums):
                    raise self._damaged(at, "the checksum of all before it does not match")
            elif not Opcode.HEADER <= kind < Opcode.DATA_END:
                raise self._damaged(at, f"there is no record of kind {kind}")
            sums = zlib.crc32(body, zlib.crc32(head, sums))
            at += HEAD.size + length
        file.seek(max(0, size - len(MCAP0_MAGIC)))
        if kind != Opcode.DATA_END and size > at and file.read() == MCAP0_MAGIC:
            raise self._damaged(at, "a record reaches beyond the end of the file")

    def _take_chunk(self, body: bytes, at: int) -> None:
        try:
            topics, messages = _unpack(body)
            self._topics |= topics
            for place, message in enumerate(messages):
                if message.number != self._messages & 0xFFFF_FFFF:
                    raise ValueError("messages are missing before it")
                self._messages += 1
                self._first_ns = message.t_ns if self._first_ns is None else self._first_ns
                self.duration_s = 1e-9 * (message.t_ns - self._first_ns)
                self._index(message, place)
        except NOT_READABLE as error:
            raise self._damaged(at, str(error)) from None
        self._chunks.append((at + HEAD.size, len(body)))

    def _index(self, message: _Message, place: int) -> None:
        """Note what a message is; a picture belongs to the entry right before it."""
        pending, self._pending = self._pending, None
        topic = self._topics[message.channel]
        if topic == "/camera/image/compressed" and pending is not None:
            self._places[pending["frame"]] = len(self._chunks), place
            if self._wall_ns is None:
                stamp_ns, _, _ = ros.read_compressed_image(message.data)
                self._wall_ns = stamp_ns - round(1e9 * pending["t_s"])
        elif topic == "/config":
            self.toml = ros.read_string(message.data)
        elif topic == "/journal":
            self.entry_count += 1
            text = ros.read_string(message.data)
            if not text.startswith(NOTABLE):
                return
            entry = json.loads(text)
            match entry["do"]:
                case "begin":
                    self.begin = entry
                case "frame":
                    self._pending = entry
                case "end":
                    self.closed = True

    def _understand(self) -> None:
        if not self._chunks:
            raise self._empty()
        if not self.begin or not self.toml:
            raise self._empty()  # of a foreign file the head would have told
        if self.begin.get("format") != FORMAT:
            raise InputError(
                f"{self.path}: a recording of format {self.begin.get('format')}, here {FORMAT} is read; "
                "use the version of this program that made it"
            )
        try:
            self.lens: Lens = lens_of(self.begin["lens"])
        except NOT_READABLE:
            raise InputError(f"{self.path}: its lens cannot be understood; {REMEDY}") from None

    def _empty(self) -> InputError:
        return InputError(
            f"{self.path}: nothing was recorded, or it was cut off before the first second; give another one"
        )

    def _foreign(self) -> InputError:
        return InputError(f"{self.path}: is MCAP, but no recording of a drive; give one made with --record")

    def _damaged(self, at: int, why: str) -> InputError:
        return InputError(f"{self.path}: damaged at byte {at} ({why}); {REMEDY}")


def _unpack(body: bytes) -> tuple[dict[int, str], list[_Message]]:
    """(topics by channel, messages) in a chunk whose checksum is right."""
    chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    if chunk.uncompressed_size > LONGEST_CHUNK:
        raise ValueError("a chunk is too long")
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    data, at = stream.read(size), 0
    topics: dict[int, str] = {}
    messages: list[_Message] = []
    while at < size:
        kind, length = HEAD.unpack_from(data, at)
        begin, at = at + HEAD.size, at + HEAD.size + length
        if kind == Opcode.MESSAGE:
            channel, number, t_ns, _ = MESSAGE.unpack_from(data, begin)
            messages.append(_Message(channel, number, t_ns, data[begin + MESSAGE.size : at]))
        elif kind == Opcode.CHANNEL:
            one = Channel.read(ReadDataStream(BytesIO(data[begin:at])))
            topics[one.id] = one.topic
    return topics, messages
