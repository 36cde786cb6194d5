"""A recording while it is made: the loop hands over what there is, a thread of its own writes it down.

The thread works when the loop has done with a picture and waits for the next, so that they do not contend for
the interpreter. The loop never waits for the disk, but in virtual time, which stands meanwhile. What does not
fit into the queue is left out, counted and told. What was heard is in the file after twice `FLUSH_S` at the
latest; where the disk is full or gone the recording ends with one line and the drive goes on.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.config import Config, config_text
from host.link.clock import Clock, SystemClock
from host.link.robot import Robot
from host.link.transport import Transport
from host.nav.command import Command
from host.nav.odometry import WheelReading
from host.nav.pilot import Pilot, View
from host.nav.result import DriveLog
from host.nav.task import Task
from host.record import ros
from host.record.journal import FORMAT, lens_as_dict, task_as_dict
from host.record.mcap_writer import Told, Writer
from host.record.versions import commit, versions

QUEUE_BYTES = 64_000_000  # pictures wait in these; the rest, which is small, in a quarter more
FLUSH_S = 0.3
CLOSE_S = 20.0  # for what is still in the queue at the end
VIEW_BYTES = 200_000  # net and depths of a picture, about
SMALL_BYTES = 300  # what an entry without a picture takes, about
WAIT_S = 0.002


class Recorder:
    """Records a drive into one MCAP file; a context manager that closes it.

    Parameters
    ----------
    path
        The file, which must not exist yet.
    say
        Told of what goes wrong, in one line.

    Raises
    ------
    UsageError
        The file exists already or cannot be written.
    """

    def __init__(self, path: Path, say: Callable[[str], None] | None = None) -> None:
        self.path = path
        self._say = say or _say
        self._writer = Writer(path)
        self._clock: Clock | None = None
        self._wall_ns = 0  # wall clock less host clock
        self._patient = False  # time stands while this waits
        self._begun = False
        # Without a lock: the deque needs none, and each of the sums is written by one thread, but for what is
        # sent from others than the loop's, whose few bytes may be miscounted.
        self._queue: deque[tuple[Told, int]] = deque()
        self._given_bytes = self._written_bytes = 0
        self._work = threading.Event()
        self._closing = False
        self._ended: str | None = None  # why nothing more is written
        self._lost_frames = self._lost_others = 0
        self._frames = 0
        self._newest: Frame | None = None
        self._decision: object = None
        self._robot_event: object = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    # --- What is recorded -----------------------------------------------------------------------

    def line(self, transport: Transport, clock: Clock) -> Transport:
        """The same line, every byte of which is recorded on its way."""
        self._take_clock(clock)
        return RecordedLine(transport, self)

    def pilot(
        self, clock: Clock, lens: Lens, task: Task, config: Config, options: Mapping[str, Any]
    ) -> RecordedPilot:
        """A new pilot of which all is recorded that a replay must know.

        Parameters
        ----------
        options
            Of the command line, to be looked at by people.
        """
        self._take_clock(clock)
        self._begun = True
        begin = {
            "do": "begin",
            "format": FORMAT,
            "lens": lens_as_dict(lens),
            "task": task_as_dict(task),
            "options": {name: None if value is None else str(value) for name, value in options.items()},
            "versions": versions(),
            "commit": commit(),
            "started": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        }
        self._put("begin", (begin, config_text(config), lens, config.body))
        return RecordedPilot(self, lens, task, config)

    def frame_number(self, frame: Frame) -> int:
        """Under which number a frame is recorded; it is now, if it is a new one."""
        if frame is not self._newest:
            self._newest = frame
            self._frames += 1
            size = len(frame.encoded) if frame.encoded is not None else frame.image.nbytes
            if not self._put("frame", (self._frames - 1, frame), size):
                self._lost_frames += 1
        return self._frames - 1

    def entry(self, entry: dict[str, Any]) -> None:
        """An entry of the journal that is ready as it is."""
        self._put("entry", entry)

    def hear(self, reading: WheelReading) -> None:
        """A wheel reading that the pilot is told."""
        self._put("hear", reading)

    def made(self, number: int, view: View) -> None:
        """What the pilot made of a frame."""
        self._put("made", (number, view), VIEW_BYTES)

    def decided(self, command: Command) -> None:
        """What it decided without one."""
        self._put("decided", command)

    def drove(self, view: View, log: DriveLog, robot: Robot) -> None:
        """To be told of every frame that was driven on, last of all that is done about it."""
        latency_ms = 1e3 * (self._now_s() - view.frame.t_s)
        self._put("drove", (self.frame_number(view.frame), view, latency_ms, robot.latest), VIEW_BYTES)
        self._note_events(log, robot)
        self._work.set()

    def refused(self, frame: Frame | None, why: str, log: DriveLog, robot: Robot) -> None:
        """To be told of every frame that was not."""
        number = None if frame is None else self.frame_number(frame)
        self._put("entry", {"do": "refused", "frame": number, "t_s": self._now_s(), "why": why})
        self._note_events(log, robot)
        self._work.set()

    def ended(self, log: DriveLog, robot: Robot) -> None:
        """To be told when the drive is over."""
        self._note_events(log, robot)
        self.entry({"do": "ended", "t_s": self._now_s(), "outcome": log.outcome, "reason": log.reason})

    def event(self, level: int, name: str, text: str) -> None:
        """Something worth a line of text."""
        self._put("event", (level, name, text))

    # --- The end --------------------------------------------------------------------------------

    def close(self) -> None:
        """Write what is left and close the file; without anything in it, it goes again."""
        if self._closing:
            return
        self._closing = True
        self._work.set()
        self._thread.join(CLOSE_S)
        if self._thread.is_alive():
            self._ended = "the disk is slow"
            waiting_mb = 1e-6 * (self._given_bytes - self._written_bytes)
            self._say(f"{self.path}: the disk does not take the last {waiting_mb:.0f} MB")
        elif not self._begun:
            self._writer.discard()
        elif self._ended is None and (self._lost_frames or self._lost_others):
            self._say(
                f"{self.path}: {self._lost_frames} pictures and {self._lost_others} other entries did not "
                "get into the recording: the disk or this machine is slow"
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def summary(self) -> dict[str, Any]:
        """What became of it, for result.json; after `close`."""
        return {
            "file": str(self.path),
            "bytes": self._writer.size,
            "frames": self._writer.whole_frames,
            "lost_frames": self._lost_frames,
            "lost_entries": self._lost_others,
            "ended_early": self._ended,
        }

    # --- In the loop's thread -------------------------------------------------------------------

    def _take_clock(self, clock: Clock) -> None:
        if self._clock is None:
            self._clock = clock
            self._wall_ns = time.time_ns() - round(1e9 * clock.now_s())
            self._patient = not isinstance(clock, SystemClock)

    def _now_s(self) -> float:
        return 0.0 if self._clock is None else self._clock.now_s()

    def _note_events(self, log: DriveLog, robot: Robot) -> None:
        if log.decisions and log.decisions[-1] is not self._decision:
            self._decision = log.decisions[-1]
            stopped = log.decisions[-1].reason.startswith("stop")
            self.event(ros.WARN if stopped else ros.INFO, "drive", log.decisions[-1].reason)
        if robot.events and robot.events[-1] is not self._robot_event:
            new = []
            for event in reversed(robot.events):
                if event is self._robot_event:
                    break
                new.append(event)
            for event in reversed(new):
                self.event(ros.INFO, "link", event.text)
            self._robot_event = robot.events[-1]

    def put_bytes(self, kind: str, data: bytes) -> None:
        """Raw bytes of the line: `kind` is rx or tx. From any thread."""
        self._put(kind, data, len(data) + SMALL_BYTES)

    def _put(self, kind: str, what: Any, size: int = SMALL_BYTES) -> bool:
        """Hand over to the writer; False where there is no room."""
        now_ns = self._wall_ns + round(1e9 * self._now_s())
        room = QUEUE_BYTES if kind == "frame" else QUEUE_BYTES + QUEUE_BYTES // 4
        while self._given_bytes - self._written_bytes + size > room:
            if self._ended is not None or not self._patient or self._closing:
                self._lost_others += kind != "frame"
                return False
            self._work.set()
            time.sleep(WAIT_S)
        if self._ended is None:
            self._given_bytes += size
            self._queue.append((Told(kind, now_ns, what), size))
        return True

    # --- In the writer's thread -----------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._write_all()
            lost = {"lost_frames": self._lost_frames, "lost_entries": self._lost_others}
            self._writer.finish({"do": "end", "frames": self._frames, **lost}, self._begun)
        except OSError as error:
            self._end(error.strerror or str(error))
        except Exception as error:  # a drive is never worth less than its recording
            self._end(f"{type(error).__name__}: {error}")

    def _write_all(self) -> None:
        flushed_s = time.monotonic()
        done = False
        while not done:
            self._work.wait(FLUSH_S)
            self._work.clear()
            done = self._closing  # what came before it is in the queue
            while self._queue:
                told, size = self._queue.popleft()
                self._writer.write(told, self._wall_ns)
                self._written_bytes += size
                flushed_s = self._flush(flushed_s)
            flushed_s = self._flush(flushed_s)

    def _flush(self, flushed_s: float) -> float:
        """Bring all that is written into the file, if it is time to; when that was done last."""
        if time.monotonic() - flushed_s < FLUSH_S:
            return flushed_s
        self._writer.flush()
        return time.monotonic()

    def _end(self, why: str) -> None:
        self._ended = why
        self._queue.clear()
        self._written_bytes = self._given_bytes
        self._writer.abandon()
        self._say(f"{self.path}: the recording ends here ({why}); the drive goes on without it")


class RecordedLine:
    """A line whose bytes are recorded, both ways."""

    def __init__(self, transport: Transport, recorder: Recorder) -> None:
        self._transport, self._recorder = transport, recorder

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        self._transport.write(data)
        self._recorder.put_bytes("tx", data)

    def read(self) -> bytes:
        """What has arrived, without waiting."""
        data = self._transport.read()
        if data:
            self._recorder.put_bytes("rx", data)
        return data

    def close(self) -> None:
        """Let go of the line."""
        self._transport.close()


class RecordedPilot(Pilot):
    """A pilot whose every call is written down, before and after."""

    def __init__(self, recorder: Recorder, lens: Lens, task: Task, config: Config) -> None:
        super().__init__(lens, task, net=config.net, depth=config.depth, body=config.body, nav=config.nav)
        self._recorder = recorder

    def hear(self, reading: WheelReading) -> None:
        self._recorder.hear(reading)
        super().hear(reading)

    def restarted(self) -> None:
        self._recorder.entry({"do": "restarted"})
        super().restarted()

    def take(self, frame: Frame, now_s: float) -> View:
        number = self._recorder.frame_number(frame)
        self._recorder.entry({"do": "take", "frame": number, "now_s": now_s})
        view = super().take(frame, now_s)
        self._recorder.made(number, view)
        return view

    def decide(self, now_s: float) -> Command:
        self._recorder.entry({"do": "decide", "now_s": now_s})
        command = super().decide(now_s)
        self._recorder.decided(command)
        return command

    def react_within(self, reaction_s: float) -> None:
        self._recorder.entry({"do": "react", "reaction_s": reaction_s})
        super().react_within(reaction_s)

    def forget(self) -> None:
        self._recorder.entry({"do": "forget"})
        super().forget()


def _say(text: str) -> None:
    print(text, file=sys.stderr)
