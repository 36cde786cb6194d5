"""The firmware's link.c and messages.h, callable from Python, under UBSan."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import cffi

from host.link.generate import c_name, c_type
from host.link.protocol import LAYOUTS, Decoder, Layout, LinkStatus, Message, Received, build

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware/src"
LOG_BYTES = 1 << 20


def _declarations(layout: Layout) -> str:
    members = "".join(f"{c_type(one.wire)} {one.name}; " for one in layout.fields)
    name = c_name(layout)
    return (
        f"struct {name} {{ {members}}};\n"
        f"void shim_{name}_encode(const struct {name} *message, uint8_t *payload);\n"
        f"void shim_{name}_decode(struct {name} *message, const uint8_t *payload);\n"
    )


def _wrappers(layout: Layout) -> str:
    name = c_name(layout)
    return (
        f"void shim_{name}_encode(const struct {name} *m, uint8_t *p) {{ {name}_encode(m, p); }}\n"
        f"void shim_{name}_decode(struct {name} *m, const uint8_t *p) {{ {name}_decode(m, p); }}\n"
    )


class LinkInC:
    """One link of the firmware; `fresh` starts it anew."""

    def __init__(self, build_folder: Path) -> None:
        filled = [layout for layout in LAYOUTS.values() if layout.fields]
        source = build_folder / "wrappers.c"
        source.write_text('#include "messages.h"\n' + "".join(map(_wrappers, filled)))
        library = build_folder / "liblink.so"
        flags = ["-std=gnu11", "-O1", "-g", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-shared", "-fPIC"]
        checks = ["-fsanitize=undefined", "-fno-sanitize-recover=all"]
        sources = [source, HERE / "link_shim.c", HERE / "corrupt.c", FIRMWARE / "link.c"]
        compiler = os.environ.get("CC", "cc")
        subprocess.run([compiler, *flags, *checks, f"-I{FIRMWARE}", *sources, "-o", library], check=True)
        self._ffi = cffi.FFI()
        self._ffi.cdef("""
            void shim_init(void);
            uint32_t shim_receive(const uint8_t *bytes, uint32_t size, uint8_t *log, uint32_t log_capacity);
            void shim_counters(uint8_t *payload);
            uint16_t shim_send(uint8_t id, uint8_t seq, const uint8_t *payload, uint8_t size, uint8_t *bytes);
            uint32_t corrupt_flip_bits(uint8_t *bytes, uint32_t size, uint32_t *tried);
            uint32_t corrupt_at_random(const uint8_t *pool, uint32_t frames, uint32_t stride, uint32_t count,
                                       uint64_t seed, uint32_t *untouched, uint32_t *lost);
            uint32_t link_crc32c(const uint8_t *data, uint8_t size);
        """)
        self._ffi.cdef("".join(map(_declarations, filled)))
        self._c = self._ffi.dlopen(str(library))
        self._log = self._ffi.new("uint8_t[]", LOG_BYTES)

    def fresh(self) -> None:
        """Forget everything received and sent."""
        self._c.shim_init()

    def crc32c(self, data: bytes) -> int:
        """link_crc32c()."""
        return self._c.link_crc32c(data, len(data))

    def receive(self, data: bytes) -> list[Received]:
        """Messages that link_receive_byte() handed on, read by messages.h."""
        size = self._c.shim_receive(data, len(data), self._log, LOG_BYTES)
        log, at, received = bytes(self._ffi.buffer(self._log, size)), 0, []
        while at < len(log):
            message_id, seq, length = log[at : at + 3]
            received.append(Received(seq, self._read(LAYOUTS[message_id], log[at + 3 : at + 3 + length])))
            at += 3 + length
        return received

    def counters(self) -> LinkStatus:
        """What the link counted."""
        layout = LAYOUTS[LinkStatus.ID]
        payload = self._ffi.new("uint8_t[]", layout.size)
        self._c.shim_counters(payload)
        status = self._read(layout, bytes(payload))
        assert isinstance(status, LinkStatus)
        return status

    def encode(self, message: Message, seq: int) -> bytes:
        """The frame that messages.h and link_send() make of a message."""
        layout = LAYOUTS[message.ID]
        payload = self._ffi.new("uint8_t[]", max(1, layout.size))
        if layout.fields:
            name = c_name(layout)
            values = {field.name: getattr(message, field.name) for field in layout.fields}
            getattr(self._c, f"shim_{name}_encode")(self._ffi.new(f"struct {name} *", values), payload)
        wire = self._ffi.new("uint8_t[]", 300)
        size = self._c.shim_send(layout.id, seq, payload, layout.size, wire)
        return bytes(wire[0:size])

    def flip_bits(self, frame: bytes) -> tuple[int, int]:
        """How often 1 to 3 flipped bits of `frame` were tried, and how many messages came of it."""
        tried = self._ffi.new("uint32_t *")
        accepted = self._c.corrupt_flip_bits(self._ffi.new("uint8_t[]", frame), len(frame), tried)
        return tried[0], accepted

    def corrupt(self, frames: list[bytes], count: int, seed: int) -> tuple[int, int, int]:
        """Send `count` damaged lines of two of the frames each.

        Returns
        -------
        (messages that nobody sent, lines that came whole all the same, lines from which nothing came)
        """
        stride = 1 + max(map(len, frames))
        pool = b"".join((bytes([len(frame)]) + frame).ljust(stride, b"\0") for frame in frames)
        whole, lost = self._ffi.new("uint32_t *"), self._ffi.new("uint32_t *")
        wrong = self._c.corrupt_at_random(pool, len(frames), stride, count, seed, whole, lost)
        return wrong, whole[0], lost[0]

    def _read(self, layout: Layout, payload: bytes) -> Message:
        if not layout.fields:
            return build(layout, ())
        name = c_name(layout)
        message = self._ffi.new(f"struct {name} *")
        getattr(self._c, f"shim_{name}_decode")(message, payload)
        return build(layout, tuple(getattr(message, field.name) for field in layout.fields))


def counted(decoder: Decoder) -> dict[str, int]:
    """A Python decoder's counters as the firmware would report them."""
    shared = {field.name for field in LAYOUTS[LinkStatus.ID].fields}
    return {name: value & 0xFFFF for name, value in vars(decoder.counters).items() if name in shared}
