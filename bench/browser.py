"""Chromium without a screen, driven by its DevTools protocol: for tests and benchmarks of the live page."""

from __future__ import annotations

import asyncio
import base64
import itertools
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiohttp

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
START_S = 30.0
ANSWER_S = 20.0
KEYS = {"Space": (" ", 32), "Escape": ("Escape", 27)}


def program() -> str | None:
    """Chromium's path; None where it is not installed."""
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser of its own, gone at the end with all that it wrote."""
    path = program()
    assert path is not None, "chromium is not installed"
    with tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True) as folder:
        process = subprocess.Popen(
            [
                path, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--mute-audio",
                "--no-first-run", "--disable-extensions", "--disable-background-networking",
                "--disable-dev-shm-usage", "--remote-debugging-port=0",
                f"--user-data-dir={folder}", "about:blank",
            ],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            with asyncio.Runner() as runner:
                browser = Browser(runner, _port_of(process))
                try:
                    yield browser
                finally:
                    browser.close()
        finally:
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _port_of(process: subprocess.Popen[str]) -> int:
    assert process.stderr is not None
    give_up_s = time.monotonic() + START_S
    for line in process.stderr:
        if found := re.search(r"DevTools listening on ws://[\d.]+:(\d+)/", line):
            return int(found[1])
        assert time.monotonic() < give_up_s, "chromium does not start"
    raise AssertionError("chromium ended at once")


class Browser:
    """Opens pages, one at a time in front."""

    def __init__(self, runner: asyncio.Runner, port: int) -> None:
        self._runner, self._port = runner, port
        self._session = runner.run(_new_session())

    def open(
        self, url: str, width: int = 1280, height: int = 800, dark: bool = False, phone: bool = False
    ) -> Tab:
        """A tab with a page, in CSS pixels; a phone has two of a screen's for each, and fingers."""

        async def connect() -> aiohttp.ClientWebSocketResponse:
            async with self._session.put(f"http://127.0.0.1:{self._port}/json/new?about:blank") as answer:
                address = (await answer.json())["webSocketDebuggerUrl"]
            return await self._session.ws_connect(address, max_msg_size=0)

        tab = Tab(self._runner, self._runner.run(connect()))
        tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                 deviceScaleFactor=2 if phone else 1, mobile=phone)  # fmt: skip
        scheme = "dark" if dark else "light"
        tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        tab.call("Page.enable")
        tab.call("Page.navigate", url=url)
        return tab

    def close(self) -> None:
        """No more pages."""
        self._runner.run(self._session.close())


async def _new_session() -> aiohttp.ClientSession:
    return aiohttp.ClientSession()


class Tab:
    """One page."""

    def __init__(self, runner: asyncio.Runner, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._runner, self._socket = runner, socket
        self._numbers = itertools.count(1)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One DevTools command and its answer."""
        number = next(self._numbers)

        async def talk() -> dict[str, Any]:
            await self._socket.send_json({"id": number, "method": method, "params": parameters})
            async with asyncio.timeout(ANSWER_S):
                while True:
                    answer = await self._socket.receive_json()
                    if answer.get("id") == number:
                        assert "error" not in answer, answer["error"]
                        return answer["result"]

        return self._runner.run(talk())

    def ask(self, script: str) -> Any:
        """The value of a script, which may be a promise."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def wait_for(self, script: str, timeout_s: float = 60.0) -> Any:
        """The value of a script as soon as it is true."""
        give_up_s = time.monotonic() + timeout_s
        while not (value := self.ask(script)):
            assert time.monotonic() < give_up_s, f"not true after {timeout_s:g} s: {script}"
            time.sleep(0.02)
        return value

    def press(self, x: float, y: float) -> None:
        """The mouse, down and up."""
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press_key(self, code: str) -> None:
        """A key, down and up."""
        key, number = KEYS[code]
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code, windowsVirtualKeyCode=number)

    def screenshot(self, path: Path) -> None:
        """What is to be seen, as a PNG."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))
