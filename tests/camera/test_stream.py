"""An MJPEG stream over HTTP, from a server on this machine: as it should be, stalled, broken off, none."""

from __future__ import annotations

import itertools
import time
from http import HTTPStatus

import pytest
from mjpeg_server import serving
from pictures import jpeg

from host.camera import live, stream
from host.camera.lens import Lens
from host.camera.source import open_camera
from host.camera.stream import MjpegStream
from host.errors import DeviceError, UsageError

LENS = Lens(160, 120, 180, 180, 80, 60)


@pytest.mark.parametrize(
    "how", [{}, {"lengths": False}, {"chunked": True}], ids=["with lengths", "without", "in chunks"]
)
def test_pictures_come_as_they_were_sent_newest_first_and_with_their_jpeg(how):
    with serving(**how) as server:
        camera = open_camera(server.url, LENS)
        frames = [camera.read(1.0) for _ in range(12)]
        camera.close()
        numbers = []
        for frame in frames:
            assert frame is not None
            numbers += [number for number in list(server.sent) if jpeg(number) == frame.encoded]
            assert frame.t_s - server.sent[numbers[-1]] < 0.5
        assert len(numbers) == len(frames)  # whole pictures, every one of them that was sent
        assert numbers == sorted(set(numbers))
        assert server.asked.startswith(b"GET /video?size=small HTTP/1.1")


def test_of_pictures_that_piled_up_only_the_newest_is_looked_at():
    with serving() as server:
        server.burst = 5
        capture = MjpegStream(server.url)
        shots = [capture.read() for _ in range(6)]
        capture.release()
        last = 0
        for shot in shots[1:]:
            assert shot is not None
            (number,) = [number for number in list(server.sent) if jpeg(number) == shot.picture]
            if last:
                assert number - last == shot.skipped + 1
            last = number
        assert max(shot.skipped for shot in shots if shot) >= 4


@pytest.mark.parametrize("fault", ["stalls", "drops", "repeats"])
def test_a_stream_that_breaks_off_is_noticed_and_taken_up_again(fault: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(stream, "SILENCE_S", 0.4)
    monkeypatch.setattr(live, "RESTART_S", 0.4)
    told: list[str] = []
    with serving() as server:
        camera = open_camera(server.url, LENS, tell=told.append)
        before = camera.read(1.0)
        assert before is not None
        server.fault = fault
        failed, after, until_s = "", None, time.monotonic() + 5
        while after is None and time.monotonic() < until_s:
            try:
                frame = camera.read(0.2)
                after = frame if failed else None
            except DeviceError as error:
                failed = str(error)
                server.fault = None if "no frame" not in failed else server.fault
        camera.close()
        assert after is not None and after.seq > before.seq
        assert server.url in failed
        assert ("the same pictures" if fault == "repeats" else "stopped delivering") in failed
        if fault != "repeats":
            assert server.callers == 2
            assert told == [f"camera {server.url}: delivers again"]


def test_a_server_that_is_gone_is_tried_again_and_the_reason_told(monkeypatch: pytest.MonkeyPatch):
    with serving() as server:
        camera = open_camera(server.url, LENS)
        server.fault = "drops"
        time.sleep(0.1)
        server.fault = "refuses"
        said = set()
        for _ in itertools.takewhile(lambda _: server.callers < 3, range(100)):
            with pytest.raises(DeviceError) as told:
                while True:
                    camera.read(0.05)
            said.add(str(told.value))
            time.sleep(0.05)
        camera.close()
    assert any("does not answer" in text and "is it on, and is the address right?" in text for text in said)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"status": HTTPStatus.NOT_FOUND}, "answers 404 Not Found; open the address in a browser"),
        ({"status": HTTPStatus.UNAUTHORIZED}, "answers 401 Unauthorized"),
        ({"status": HTTPStatus.FOUND}, "answers 302 Found"),  # and does not say where
        ({"kind": "text/html"}, "gives text/html, no MJPEG stream; look up the address"),
        ({"kind": "image/jpeg"}, "gives a single picture; look up the address of its MJPEG stream"),
    ],
)
def test_what_is_no_stream_is_told(how, words: str):
    with serving(**how) as server, pytest.raises(DeviceError) as told:
        open_camera(server.url)
    assert str(told.value).startswith(f"camera {server.url}: ") and words in str(told.value)


def test_a_stream_that_has_moved_is_found_and_one_that_moves_for_ever_is_given_up():
    with serving() as server, serving(status=HTTPStatus.FOUND, elsewhere=server.url) as old:
        camera = open_camera(old.url)
        assert camera.read(5.0) is not None
        camera.close()
    with serving(status=HTTPStatus.FOUND, elsewhere="/on?on") as server, pytest.raises(DeviceError) as told:
        open_camera(server.url)
    said = "leads from one address to the next; give the last, "
    last = server.url.replace("/video?size=small", "/on?on")
    assert str(told.value) == f"camera {server.url}: {said}{last}"
    for nowhere in ("http://[1/", "/vid\u00e9o"):
        with (
            serving(status=HTTPStatus.FOUND, elsewhere=nowhere) as server,
            pytest.raises(DeviceError) as told,
        ):
            open_camera(server.url)
        assert "does not answer (" in str(told.value) and "is the address right?" in str(told.value)


def test_a_lens_of_another_size_is_refused():
    with serving() as server, pytest.raises(DeviceError, match="160x120 px, the lens is for 640x480"):
        open_camera(server.url, Lens(640, 480, 600, 600, 320, 240))


@pytest.mark.parametrize(
    ("url", "kind", "words"),
    [
        ("http://127.0.0.1:1/", DeviceError, "does not answer .*Connection refused.*is it on"),
        ("http://no.such.host.invalid/", DeviceError, "does not answer"),
        ("http://", UsageError, "is no address; write it as http://"),
        ("http://[::1/", UsageError, "is no address; write it as http://"),
        ("http://here:port/", UsageError, "is no address; write it as http://"),
    ],
)
def test_an_address_where_nobody_answers_is_told(url: str, kind, words: str):
    with pytest.raises(kind, match=words) as told:
        open_camera(url)
    assert "\n" not in str(told.value)
