"""The live page's server: what it gives to whom, and a STOP that waits for nobody."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from urllib.parse import urlsplit

import aiohttp
import pytest

from host.errors import DeviceError, UsageError
from host.nav.config import BodyConfig
from host.view.page import server
from host.view.page.server import IN_FLIGHT, STOPPED, LivePage
from tests.view.watching import Listener, next_shot, seen

PATIENCE_S = 10.0


@pytest.fixture
def page() -> Iterator[LivePage]:
    with LivePage(port=0) as page:
        yield page


@pytest.fixture
def open_page(monkeypatch) -> Iterator[LivePage]:
    """One that other machines reach; here by this machine's name for itself."""
    monkeypatch.setattr(server, "_towards_others", lambda: "127.0.0.1")
    with LivePage("0.0.0.0", 0) as page:
        yield page


def begin(page: LivePage) -> Listener:
    robot = Listener()
    page.begin("a drive", [], BodyConfig(), robot, lambda t_s: t_s)  # type: ignore[arg-type]
    return robot


def begin_for_real(page: LivePage) -> None:
    page.begin("a drive", [], BodyConfig(), seen().robot, lambda t_s: t_s)


def talk(act: Callable[[aiohttp.ClientSession], Awaitable]) -> object:
    async def run() -> object:
        async with aiohttp.ClientSession() as session, asyncio.timeout(PATIENCE_S):
            return await act(session)

    return asyncio.run(run())


def origin_of(page: LivePage) -> dict[str, str]:
    return {"Origin": f"http://{urlsplit(page.url).netloc}"}


def status(page: LivePage, method: str, path: str, headers: dict[str, str], token: bool = True) -> int:
    url = urlsplit(page.url)
    address = f"http://{url.netloc}{path}{'?' + url.query if token and url.query else ''}"

    async def ask(session: aiohttp.ClientSession) -> int:
        async with session.request(method, address, headers=headers) as answer:
            await answer.read()
            return answer.status

    return talk(ask)  # type: ignore[return-value]


UPGRADE = {
    "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}  # fmt: skip


def test_the_page_is_one_file_that_asks_for_nothing_from_elsewhere(page):
    async def fetch(session: aiohttp.ClientSession) -> tuple[str, str]:
        async with session.get(page.url) as answer:
            return await answer.text(), answer.headers["Content-Security-Policy"]

    text, policy = talk(fetch)  # type: ignore[misc]
    assert "<canvas" in text and "STOP" in text and "drawCamera" in text
    assert "http://" not in text and "https://" not in text and "STYLE" not in text
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy


def test_a_strange_name_gets_neither_page_nor_pictures_nor_stop_on_loopback(page):
    robot = begin(page)
    strange = {"Host": "evil.example:8080", "Origin": "http://evil.example:8080"}
    assert status(page, "GET", "/", strange) == 403
    assert status(page, "GET", "/live", strange | UPGRADE) == 403
    assert status(page, "POST", "/stop", strange) == 403
    assert robot.halted is None


@pytest.mark.parametrize("headers", [{"Origin": "http://evil.example"}, {"Origin": "null"}, {}])
def test_another_web_page_can_neither_look_on_nor_stop_on_loopback(page, headers):
    robot = begin(page)
    assert status(page, "GET", "/live", headers | UPGRADE) == 403
    assert status(page, "POST", "/stop", headers) == 403
    assert robot.halted is None


def test_without_its_token_other_machines_get_nothing(open_page):
    robot = begin(open_page)
    headers = origin_of(open_page)
    for asked in (("GET", "/", {}), ("GET", "/live", headers | UPGRADE), ("POST", "/stop", headers)):
        assert status(open_page, *asked, token=False) == 403
    assert robot.halted is None
    assert status(open_page, "GET", "/", {}) == 200
    assert status(open_page, "POST", "/stop", headers) == 200
    assert robot.halted == STOPPED


def test_strangers_take_few_of_the_programs_files_and_not_for_long(open_page, monkeypatch):
    monkeypatch.setattr(server, "MOST_STRANGERS", 3)
    monkeypatch.setattr(server, "STRANGER_S", 0.3)
    robot, url = begin(open_page), urlsplit(open_page.url)

    def hung_up(line: socket.socket) -> bool:
        try:
            return line.recv(1) == b""
        except ConnectionResetError:
            return True

    async def look_on(session: aiohttp.ClientSession) -> None:
        address = f"http://{url.netloc}/live?{url.query}"
        async with session.ws_connect(address, headers=origin_of(open_page)) as line:
            await line.receive()
            lines = [socket.create_connection((url.hostname, url.port), PATIENCE_S) for _ in range(9)]
            try:
                late = await asyncio.gather(*(asyncio.to_thread(hung_up, one) for one in lines))
            finally:
                for one in lines:
                    one.close()
            assert all(late)
            await line.send_json({"stop": True})
            while json.loads(await line.receive_str())["kind"] != "stopped":
                pass

    talk(look_on)
    assert robot.halted == STOPPED
    assert not open_page._strangers
    assert status(open_page, "GET", "/", {}) == 200


def test_who_is_refused_is_hung_up_on(open_page):
    url = urlsplit(open_page.url)
    with socket.create_connection((url.hostname, url.port), PATIENCE_S) as line:
        line.sendall(f"GET / HTTP/1.1\r\nHost: {url.netloc}\r\n\r\n".encode())
        said = b""
        while piece := line.recv(4096):
            said += piece
    assert said.startswith(b"HTTP/1.1 403")


def test_there_is_nothing_else_and_looking_stops_nothing(page):
    robot = begin(page)
    assert status(page, "GET", "/stop", origin_of(page)) == 405
    assert status(page, "GET", "/../page.js", origin_of(page)) == 404
    assert status(page, "GET", "/page.js", origin_of(page)) == 404
    assert robot.halted is None


@pytest.mark.parametrize("by_post", [True, False])
def test_stop_reaches_the_robot_while_the_loop_is_busy(page, by_post):
    robot = begin(page)
    done = threading.Event()

    def press() -> None:
        async def act(session: aiohttp.ClientSession) -> None:
            if by_post:
                await session.post(page.url + "stop", headers=origin_of(page))
                return
            async with session.ws_connect(page.url + "live", headers=origin_of(page)) as line:
                await line.send_json({"stop": True})
                while json.loads(await line.receive_str())["kind"] != "stopped":
                    pass

        talk(act)
        done.set()

    thread = threading.Thread(target=press)
    thread.start()
    give_up_s = time.monotonic() + PATIENCE_S
    while not done.is_set() and time.monotonic() < give_up_s:
        sum(range(1000))  # hears nothing, waits for nothing
    thread.join()
    assert robot.halted == STOPPED


def test_stop_before_there_is_a_robot_holds_for_the_robot_that_comes(page):
    status(page, "POST", "/stop", origin_of(page))
    assert begin(page).halted == STOPPED


def test_a_slow_browser_gets_fewer_pictures_and_then_the_newest(page):
    begin_for_real(page)

    async def look(session: aiohttp.ClientSession) -> list[int]:
        numbers = []
        async with session.ws_connect(page.url + "live", headers=origin_of(page)) as line:
            await line.receive()
            for _ in range(IN_FLIGHT):
                seen().show(page)
                numbers.append((await next_shot(line))["number"])
            for _ in range(5):
                seen().show(page)
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(line.receive(), 0.1)
            await line.send_json({"drawn": numbers[0]})
            numbers.append((await next_shot(line))["number"])
        return numbers

    assert talk(look) == [1, 2, 7]
    assert len(page.drawn_ms) == 1


def test_what_nobody_should_say_is_passed_over(page, caplog):
    robot = begin(page)

    async def babble(session: aiohttp.ClientSession) -> str:
        async with session.ws_connect(page.url + "live", headers=origin_of(page)) as line:
            for text in (
                "",
                "[]",
                '{"stop":1}',
                '{"drawn":[]}',
                '{"drawn":99}',
                "\x00",
                '"stop"',
                "[" * 1000,
            ):
                await line.send_str(text)
            page.say("still here")
            while (said := json.loads(await line.receive_str()))["text"] == "starting":
                pass
            return said["text"]

    assert talk(babble) == "still here"
    assert robot.halted is None
    assert not caplog.records


def test_how_it_ended_is_told_also_to_those_who_come_later(page):
    page.end("goal", "goal reached, 9 cm off")

    async def look(session: aiohttp.ClientSession) -> dict:
        async with session.ws_connect(page.url + "live", headers=origin_of(page)) as line:
            return json.loads(await line.receive_str())

    assert talk(look) == {"kind": "end", "outcome": "goal", "reason": "goal reached, 9 cm off"}


def test_a_stop_that_arrives_after_the_end_does_not_hide_how_it_ended(page):
    begin(page)
    page.end("stopped", STOPPED)
    status(page, "POST", "/stop", origin_of(page))

    async def look(session: aiohttp.ClientSession) -> dict:
        async with session.ws_connect(page.url + "live", headers=origin_of(page)) as line:
            return json.loads(await line.receive_str())

    assert talk(look) == {"kind": "end", "outcome": "stopped", "reason": STOPPED}


def test_at_the_end_browsers_are_told_and_the_port_is_free_again():
    page = LivePage(port=0)
    port = urlsplit(page.url).port

    async def look(session: aiohttp.ClientSession) -> aiohttp.WSMsgType:
        async with session.ws_connect(page.url + "live", headers=origin_of(page)) as line:
            await line.receive()
            closing = asyncio.create_task(asyncio.to_thread(page.close))
            kind = (await line.receive()).type
            await closing
            return kind

    assert talk(look) is aiohttp.WSMsgType.CLOSE
    with LivePage(port=port) as again:
        assert urlsplit(again.url).port == port


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="this machine has no IPv6")
def test_all_of_this_machine_by_ipv6_means_its_ipv4_addresses_too(monkeypatch):
    monkeypatch.setattr(server, "_towards_others", lambda: "127.0.0.1")
    with LivePage("::", 0) as page:
        assert status(page, "GET", "/", {}) == 200
        assert status(page, "GET", "/", {}, token=False) == 403


def test_the_end_waits_no_longer_for_many_that_do_not_listen_than_for_one():
    page = LivePage(port=0)
    url = urlsplit(page.url)
    asked = {"Host": url.netloc, **origin_of(page), **UPGRADE}
    head = "".join(f"{name}: {value}\r\n" for name, value in asked.items())
    lines = [socket.create_connection((url.hostname, url.port)) for _ in range(12)]
    try:
        for line in lines:
            line.sendall(f"GET /live HTTP/1.1\r\n{head}\r\n".encode())
        give_up_s = time.monotonic() + PATIENCE_S
        while len(page._browsers) < len(lines) and time.monotonic() < give_up_s:
            time.sleep(0.01)
        assert len(page._browsers) == len(lines)
        page.close()
        assert not page._thread.is_alive()
    finally:
        for line in lines:
            line.close()


def test_where_the_usual_port_is_taken_it_is_the_next_one_that_is_free(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as other:
        monkeypatch.setattr(server, "PORT", other.getsockname()[1])
        with LivePage() as page:
            assert urlsplit(page.url).port != server.PORT


@pytest.mark.parametrize(
    ("host", "port", "said"),
    [
        ("nowhere.invalid", 0, "--view-host nowhere.invalid: no such host"),
        ("192.0.2.7", 0, "--view-host 192.0.2.7: not an address of this machine"),
        ("127.0.0.1", 70000, "--view-port 70000: give 0 to 65535"),
        ("127.0.0.1", -1, "--view-port -1: give 0 to 65535"),
    ],
)
def test_an_address_that_cannot_be_listened_on_is_told_in_one_line(host, port, said):
    with pytest.raises(UsageError, match=said):
        LivePage(host, port)


def test_a_port_that_was_asked_for_and_is_taken_is_told_in_one_line():
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(
            UsageError, match=f"--view-port {port}: another program listens there; leave it out"
        ):
            LivePage(port=port)


def test_where_aiohttp_is_missing_one_line_says_what_to_do(monkeypatch):
    monkeypatch.setattr(server, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match="aiohttp is not installed; run 'make setup'"):
        LivePage(port=0)


def test_a_server_that_fails_does_not_end_the_drive(monkeypatch, capsys):
    def fail(self):
        raise OSError("no more files")

    monkeypatch.setattr(LivePage, "_run", fail)
    with LivePage(port=0) as page:
        begin_for_real(page)
        page._thread.join(PATIENCE_S)
        seen().show(page)
        page.end("goal", "there")
    assert capsys.readouterr().err == "live page ended: OSError: no more files\n"


def test_what_breaks_a_drive_is_told_to_those_who_look_on():
    async def look(session: aiohttp.ClientSession, page: LivePage) -> str:
        async with session.ws_connect(page.url + "live", headers=origin_of(page)) as line:
            await line.receive()
            await asyncio.to_thread(page.__exit__, DeviceError, DeviceError("the camera is gone"), None)
            return json.loads(await line.receive_str())["reason"]

    page = LivePage(port=0)
    assert talk(lambda session: look(session, page)) == "the camera is gone"
