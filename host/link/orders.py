"""DRIVE, STOP and ESTOP: the latest wins, and it is repeated until telemetry shows that it arrived. No I/O.

A repeated DRIVE keeps its first deadline: repeating makes up for frames that were lost, and does not make a
setpoint any younger. On a good line telemetry is quicker and nothing is repeated.
"""

from __future__ import annotations

from host.link.protocol import Drive, EStop, Fault, Nack, State, Stop, Telemetry

REPEAT_S = 0.02
OLD_S = 0.15  # since it was given; then the next one, or the robot's dead-man, is due
ON_ITS_WAY_US = 5000  # after sending, a robot that has it may not show it: the line, and a tick of the robot


class Order:
    """One of them, on its way.

    Parameters
    ----------
    message
        What to send.
    now_s
        When it was given and first sent.
    seq
        The sequence number it was sent under.
    sent_us
        The robot's clock when it was first sent. What telemetry showed before it could arrive proves nothing:
        a robot that stood anyway shows that it stands without having heard.
    """

    def __init__(self, message: Drive | Stop | EStop, now_s: float, seq: int, sent_us: int) -> None:
        self.message = message
        self._shown_from_us = sent_us + ON_ITS_WAY_US
        self._given_s = self._sent_s = now_s
        self._seqs = [seq]
        self._open = True

    def is_due(self, now_s: float) -> bool:
        """Whether it is to be sent again."""
        self._open = self._open and now_s - self._given_s <= OLD_S
        return self._open and now_s - self._sent_s >= REPEAT_S

    def sent(self, now_s: float, seq: int) -> None:
        """It was sent again."""
        self._sent_s = now_s
        self._seqs.append(seq)

    def hear(self, message: Telemetry | Nack) -> None:
        """Learn whether the robot has got it."""
        if isinstance(message, Nack):
            arrived = message.message == self.message.ID and message.seq in self._seqs
        elif isinstance(self.message, Drive):
            arrived = message.drive_seq in self._seqs
        elif (message.mcu_time_us - self._shown_from_us) & 0xFFFF_FFFF >= 1 << 31:
            arrived = False
        elif isinstance(self.message, Stop):
            arrived = message.state not in (State.DRIVING, State.MOVING)
        else:
            arrived = message.fault in (Fault.ESTOP_FRAME, Fault.ESTOP_BUTTON)  # it replaces others
        # On a slow line a robot may begin late what was sent before a lost STOP: its latest word counts.
        self._open = (self._open or isinstance(self.message, Stop)) and not arrived
