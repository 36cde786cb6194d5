"""The simplest host there is: sends messages one after the other, and says HELLO so that they count."""

from __future__ import annotations

from host.errors import DeviceError
from host.link.bench.target import Target
from host.link.protocol import PROTOCOL_VERSION, SCHEMA_HASH, HelloRequest, Message, encode

ANSWER_S = 3.0  # opening the port may reset the board, whose bootloader then waits up to 2 s
ASK_AGAIN_S = 0.1
STEP_S = 0.0002


class Caller:
    """Sends on a target's line; what comes back is seen by the line's taps."""

    def __init__(self, target: Target) -> None:
        self._target = target
        self._seq = 0

    def send(self, message: Message) -> int:
        """Send a message; how many bytes that took."""
        frame = b"\0" + encode(message, self._seq)
        self._seq = (self._seq + 1) & 0xFF
        self._target.near.write(frame)
        return len(frame)

    def begin(self) -> None:
        """Start a new sequence of messages: ask until the robot has answered, and a little longer.

        Raises
        ------
        DeviceError
            Nobody answers.
        """
        target, heard = self._target, self._target.near.to_host.counters
        give_up_s = target.clock.now_s() + ANSWER_S
        asked_s = float("-inf")
        frames = heard.frames
        while heard.frames == frames:
            now_s = target.clock.now_s()
            if now_s >= give_up_s:
                raise DeviceError(
                    f"{target.uri}: no whole frame within {ANSWER_S:g} s: check that the robot has power, "
                    "that this is its port, and that its firmware is flashed"
                )
            if now_s - asked_s >= ASK_AGAIN_S:
                self.send(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
                asked_s = now_s
            target.wait_s(STEP_S)
            target.near.read()
        self.send(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
        until_s = target.clock.now_s() + 2 * ASK_AGAIN_S
        while target.clock.now_s() < until_s:
            target.wait_s(STEP_S)
            target.near.read()
