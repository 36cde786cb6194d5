"""The live page in a real browser: what it draws, and STOP by button and by key."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from bench.browser import Browser, chromium, program
from bench.page import WAYS, stop_while_busy
from host.link.protocol import Fault
from host.nav.config import BodyConfig
from host.view.page.server import STOPPED, LivePage
from tests.view.watching import Listener

pytestmark = pytest.mark.skipif(
    program() is None, reason="chromium is not installed: tools/setup, or `apt-get install chromium`"
)
ROOT = Path(__file__).resolve().parents[2]
STOP_S = 0.15
TRIES = 4  # a busy machine may delay one, but a STOP that waits for the loop is late in each
PATIENCE_S = 120.0  # on a busy machine


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@dataclass
class Drive:
    """A simulated drive that shows its page."""

    process: subprocess.Popen[str]
    url: str
    folder: Path

    def result(self) -> dict:
        _, said = self.process.communicate(timeout=PATIENCE_S)
        assert "Traceback" not in said
        return json.loads((self.folder / "out.json").read_text())


@pytest.fixture
def drive(tmp_path) -> Iterator[Drive]:
    process = subprocess.Popen(
        [
            sys.executable, str(ROOT / "host/nav_loop.py"), "--camera", "sim:room?seed=1", "--view",
            "--view-port", "0", "--max-time", "20", "--max-wall", str(PATIENCE_S), "--json", "out.json",
        ],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        found = re.fullmatch(r"live page: (http://127\.0\.0\.1:\d+/)\n", process.stderr.readline())
        assert found
        yield Drive(process, found[1], tmp_path)
    finally:
        process.kill()
        process.wait()


def test_a_drive_is_to_be_seen_on_desk_and_phone_and_a_key_stops_it(browser, drive, tmp_path):
    tab = browser.open(drive.url, dark=True)
    tab.wait_for("window.live?.shots >= 20", PATIENCE_S)
    assert tab.ask("live.polygons") > 3
    assert tab.ask("live.labels") > 0
    assert tab.ask("live.cells") > 100
    assert tab.ask("took.ms > took.command_ms && took.command_ms > 0")
    tab.wait_for("document.getElementById('stages').children.length === 7")
    assert tab.ask("document.documentElement.scrollHeight <= innerHeight")  # a desk shows all at once

    tab.screenshot(tmp_path / "page.png")
    shown = cv2.imread(str(tmp_path / "page.png"))
    assert shown.shape == (800, 1280, 3)
    assert shown[3, 3].max() < 60  # dark, as was asked for
    x, y, width, height = tab.ask("(b => [b.x, b.y, b.width, b.height])($('camera').getBoundingClientRect())")
    camera = shown[round(y) : round(y + height), round(x) : round(x + width)]
    assert len(np.unique(camera.reshape(-1, 3), axis=0)) > 1000  # a picture, and not one colour

    tab.call("Emulation.setDeviceMetricsOverride", width=360, height=740, deviceScaleFactor=2, mobile=True)
    tab.wait_for("innerWidth === 360")
    assert tab.ask("document.documentElement.scrollWidth") <= 360
    assert tab.ask("$('stop').getBoundingClientRect().width") > 300
    wide = tab.ask("[...document.querySelectorAll('section, header, #reason')].map(e => e.scrollWidth)")
    assert max(wide) <= 360

    tab.press_key("Escape")
    result = drive.result()
    assert drive.process.returncode == 5
    assert (result["outcome"], result["reason"]) == ("stopped", "STOP pressed on the live page")
    tab.wait_for("live.phase() === 'end'")
    assert tab.ask("$('reason').textContent") == "ended: STOP pressed on the live page"
    assert tab.ask("$('stop').disabled")


@pytest.fixture(scope="module")
def port() -> Iterator[str]:
    """Of a robot that lives in real time, whatever happens here."""
    command = [sys.executable, "-m", "host.sim.serve", "sim:", "--world", "sim:room?seed=1"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("how", WAYS)
def test_stop_takes_the_motors_power_while_the_loop_is_busy(browser, port, how):
    for _ in range(TRIES):
        told = stop_while_busy(browser, port, how)
        assert any(report.duty_left_permille > 0 for _, report in told)  # it drove until then
        late = [report for t_s, report in told if t_s > STOP_S]
        assert late[-1].fault == Fault.ESTOP_FRAME
        if all(report.duty_left_permille == report.duty_right_permille == 0 for report in late):
            return
    pytest.fail(f"in none of {TRIES} tries the motors were off within {STOP_S} s")


@pytest.mark.parametrize("heard", [True, False])
def test_a_stop_that_nobody_heard_is_told_and_sent_when_the_line_is_back_soon(browser, heard):
    with LivePage(port=0) as page:
        port = int(page.url.split(":")[2].strip("/"))
        tab = browser.open(page.url)
        tab.wait_for("window.live?.phase() === 'wait' && socket.readyState === 1")
    tab.wait_for("live.phase() === 'gone'")
    assert not tab.ask("$('stop').disabled")
    tab.press_key("Space")
    assert "press the button on the robot" in tab.ask("$('reason').textContent")
    tab.ask(f"pressedAt += {10_000 if heard else -10_000}; 0")  # however long a busy machine takes
    robot = Listener()
    with LivePage(port=port) as page:
        page.begin("a drive", [], BodyConfig(), robot, lambda t_s: t_s)  # type: ignore[arg-type]
        tab.wait_for("socket.readyState === 1")
        if heard:
            tab.wait_for("live.phase() === 'stopped'")
        time.sleep(0.2)
        assert robot.halted == (STOPPED if heard else None)
