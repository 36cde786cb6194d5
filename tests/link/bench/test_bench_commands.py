"""The bench's commands: each on a simulated robot, one on the ATmega, one through a port; all complaints."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from host.errors import DeviceError, InputError, UsageError
from host.link.bench import ber, cut, echo, flood, monitor, replay, report, soak
from host.link.bench.__main__ import main, run
from host.link.bench.ber import BerOptions
from host.link.bench.cut import CutOptions
from host.link.bench.echo import EchoOptions
from host.link.bench.flood import FloodOptions
from host.link.bench.monitor import MonitorOptions
from host.link.bench.replay import ReplayOptions
from host.link.bench.report import ReportOptions
from host.link.bench.result import Plot, Result, Series, read_result, write_result
from host.link.bench.silences import Way, ways
from host.link.bench.soak import SoakOptions, Tally, _Guard
from host.link.bench.target import open_target
from host.link.bench.verdict import Finding, Grade, Verdict
from host.link.bench.witness import Evidence
from host.sim.avr.board import ELF, LIBRARY

BENCH = [sys.executable, "-m", "host.link.bench"]


def column(result: Result, name: str) -> list:
    """Of its table."""
    return [row[result.columns.index(name)] for row in result.rows]


# --- Each command on a simulated robot ----------------------------------------------------------


def test_echo_measures_round_trips_and_an_equal_clock() -> None:
    result = echo.run(EchoOptions(count=200))
    told = {name: value for name, value, _ in result.rows}
    assert told["answered"] == 200
    assert 1.1 <= told["round trip, median"] <= 1.6  # 13 bytes there and 16 back take 1.16 ms
    assert told["round trip, longest"] < 10
    assert abs(told["robot's clock, fast"]) < 1
    assert result.verdict.text == "Healthy."


def test_drift_is_found_behind_uneven_round_trips_and_across_a_wrap_of_the_clock() -> None:
    answers = []
    for k in range(1000):
        sent_s = 0.01 * k
        there_s, back_s = 0.0006 + 0.001 * (k % 7 == 0), 0.0006 + 0.004 * (k % 5 == 0)
        mcu_s = 4294.0 + (sent_s + there_s) * (1 + 1500e-6)
        answers.append((sent_s, sent_s + there_s + back_s, int(mcu_s * 1e6) & 0xFFFF_FFFF))
    ppm, sigma = echo.drift(answers)
    assert ppm is not None and sigma is not None
    assert ppm == pytest.approx(1500, abs=5) and sigma < 2


def test_too_few_round_trips_tell_no_drift() -> None:
    assert echo.drift([(0.0, 0.1, 5)] * 10) == (None, None)


def test_flood_loses_nothing_at_full_load_both_ways_and_telemetry_keeps_its_pace() -> None:
    result = flood.run(FloodOptions(seconds=1.0))
    assert column(result, "load to the robot") == ["25 %", "50 %", "75 %", "100 %"]
    assert set(column(result, "lost there") + column(result, "lost back")) == {0}
    assert set(column(result, "unsent by robot")) == {0}
    assert column(result, "telemetry Hz") == pytest.approx([100.0] * 4, rel=0.01)
    assert column(result, "frames/s there")[-1] > 2000 and column(result, "answers/s")[-1] > 1000


def test_ber_counts_what_was_damaged_and_no_wrong_command() -> None:
    result = ber.run(BerOptions(seconds=6.0, rates="0,1e-3"))
    assert column(result, "wrong") == [0, 0]
    (none, damaged), (kept, lost) = column(result, "damaged"), column(result, "lost")
    assert none == kept == 0 and damaged > 20 and lost == damaged  # each costs itself and nothing else
    assert column(result, "age p50 ms")[0] < 20
    assert result.verdict.grade == Grade.HEALTHY and "none was obeyed wrongly" in result.verdict.text


def test_ber_would_tell_of_a_wrong_command_and_of_old_setpoints() -> None:
    good = ber.Stage(1e-4, monitor.Witness().evidence(), ber.Comparison(), [10.0] * 100, 5, 5, 0)
    assert ber.verdict([good]).grade == Grade.HEALTHY
    old = replace(good, ages_ms=[10.0] * 90 + [80.0] * 10)
    assert ber.verdict([old]).text == "Setpoints are too old at bit errors of 1 in 10,000: p99 80 ms."
    assert ber.verdict([replace(good, stops=2)]).text.startswith("The robot stopped itself 2 times")
    bad = replace(good, comparison=ber.Comparison())
    bad.comparison.wrong.append(None)  # type: ignore[arg-type]
    assert ber.verdict([bad]).grade == Grade.UNSAFE


def test_cut_brakes_and_stands_in_time_in_every_way() -> None:
    result = cut.run(CutOptions(seeds=1))
    assert len(result.rows) == len(ways()) >= 20
    told = result.details["tries"]
    assert all(0 <= ms <= 200 for one in told for ms in one["braking_ms"]), result.verdict.text
    assert all(50 <= ms <= 400 for one in told for ms in one["standing_ms"]), result.verdict.text
    assert result.verdict.grade == Grade.HEALTHY


def test_cut_notices_a_robot_that_drives_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """A way to die that is none: commands go on coming."""
    from host.link.bench.silences import _drives_on

    monkeypatch.setattr(cut, "ways", lambda: [Way("not dead at all", _drives_on)])
    result = cut.run(CutOptions(seeds=1))
    assert result.verdict.text == "Unsafe: the robot did not brake (not dead at all)."


def test_soak_holds_for_a_while_and_does_every_kind_of_thing() -> None:
    result = soak.run(SoakOptions(minutes=0.7, seed=2))
    told = dict(map(tuple, result.rows))
    assert result.verdict.grade == Grade.HEALTHY, result.verdict.text
    assert told["accepted although nobody sent it"] == 0
    assert told["frames that reached it whole"] < told["frames to the robot"]
    assert told["connected again"] > 0 and told["restarts of the robot"] > 0
    for name in ("drives", "moves and turns", "parameters written", "  move done", "  write done"):
        assert told[name] > 0, name


def test_soak_is_not_healthy_where_a_fault_stays_and_names_it() -> None:
    result = soak.run(SoakOptions(robot="sim:?battery_mv=3000", minutes=0.2))
    assert result.verdict.grade == Grade.FAULTY
    assert "could not be made ready" in result.verdict.text
    assert "BATTERY_LOW: the battery is empty: charge it" in result.verdict.text


@pytest.mark.parametrize(
    ("tally", "grade", "text"),
    [
        (Tally(), Grade.NOTE, "No request was made: give it more minutes."),
        (Tally(moves=3, outcomes=Counter({"lost, not done": 3})), Grade.FAULTY,
         "None of 3 requests was done."),
        (Tally(moves=1, kept=Counter({"MOVING": 1})), Grade.FAULTY,
         "The robot could not be made ready, once (its state stays MOVING)."),
        (Tally(moves=3, outcomes=Counter({"move done": 1})), Grade.HEALTHY,
         "Healthy. 0 frames in 1 minutes, 1"),
    ],
)  # fmt: skip
def test_soak_says_when_little_was_done(tally: Tally, grade: Grade, text: str) -> None:
    verdict = soak._verdict(SoakOptions(), tally, Evidence(), 0)
    assert verdict.grade == grade and verdict.text.startswith(text)


def test_soaks_guard_notices_a_wheel_driven_without_a_command() -> None:
    tally = Tally()
    with open_target("sim:") as target:
        guard = _Guard(target, tally)
        assert target.rolling is not None
        target.rolling.watchers.append(guard.sample)
        target.wait_s(0.5)
        assert not tally.violations
        target.rolling.board = _Stuck(target.rolling.board)  # type: ignore[assignment]
        target.wait_s(0.5)
    assert tally.violations and "was driven" in tally.violations[0]


class _Stuck:
    """A board whose motors never stop."""

    def __init__(self, board) -> None:
        self._board = board

    def __getattr__(self, name: str):
        return getattr(self._board, name)

    def duty(self, side) -> float:
        return 0.3


def test_monitor_shows_frames_in_words_and_its_capture_replays_alike(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "capture.txt"
    live = monitor.run(MonitorOptions(seconds=0.5, hide="telemetry", capture=path))
    shown = capsys.readouterr().out
    assert "Hello" in shown and "reset_cause=POWER_ON" in shown and "Telemetry" not in shown
    assert live is not None and live.verdict.text == "Healthy."
    again = replay.run(ReplayOptions(path, hide="telemetry"))
    assert again.rows == live.rows or [row[:2] for row in again.rows] == [row[:2] for row in live.rows]
    lines = [line.split(" ", 1)[1] for line in map(str.strip, capsys.readouterr().out.splitlines())]
    assert lines == [line.split(" ", 1)[1] for line in map(str.strip, shown.splitlines())]


def test_replay_tells_broken_frames_of_raw_bytes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "raw.bin"
    path.write_bytes(b"\x05noise\0\x0f\x0f\0")
    result = replay.run(ReplayOptions(path, raw="to-robot", show=True))
    assert "BROKEN (framing)" in capsys.readouterr().out
    assert result.rows[0][:2] == ["framing", 2]


def test_monitor_moves_nothing_and_says_nothing() -> None:
    with open_target("sim:") as target:
        target.wait_s(0.2)
        target.near.read()
        assert target.far.bytes_to_robot == 0
    result = monitor.run(MonitorOptions(seconds=0.3, only="nack"))
    assert result is not None and dict(row[:2] for row in result.rows)["telemetry"] > 20


def test_report_puts_results_on_one_page_with_the_worst_verdict(tmp_path: Path) -> None:
    healthy = Result("echo", "sim:", {}, ["a"], [[1]], Verdict(()))
    ill = replace(healthy, command="cut", verdict=Verdict((Finding(Grade.FAULTY, "The cable <is> broken."),)))
    for name, one in (("a.json", healthy), ("b.json", ill)):
        write_result(one, tmp_path / name)
    page = tmp_path / "page.html"
    result = report.run(ReportOptions((tmp_path / "a.json", tmp_path / "b.json"), html=page))
    assert result.verdict.text == "cut: The cable <is> broken."
    assert result.verdict.grade == Grade.FAULTY
    text = page.read_text()
    assert "The cable &lt;is&gt; broken." in text and text.count("<h2>") == 2


# --- The whole command: files, exit codes, another board, a port --------------------------------


def test_a_run_writes_json_and_a_page_that_stands_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = EchoOptions(count=60, json=tmp_path / "echo.json", html=tmp_path / "echo.html")
    assert run(echo.run, options) == 0
    assert "Healthy." in capsys.readouterr().out
    back = read_result(tmp_path / "echo.json")
    assert back.command == "echo" and back.verdict.text == "Healthy." and len(back.plots) == 2
    page = (tmp_path / "echo.html").read_text()
    assert 'name="viewport"' in page and page.count("</svg>") == 2
    assert "http://" not in page and "https://" not in page  # nothing is fetched from anywhere


@pytest.mark.parametrize(
    ("grade", "code"), [(Grade.HEALTHY, 0), (Grade.NOTE, 0), (Grade.FAULTY, 4), (Grade.UNSAFE, 5)]
)
def test_the_exit_code_is_the_grade_of_the_verdict(grade: Grade, code: int) -> None:
    result = Result("echo", "sim:", {}, ["a"], [[1]], Verdict((Finding(grade, "told"),)))
    assert run(lambda options: result, EchoOptions()) == code


def test_the_real_program_in_a_simulated_atmega_echoes() -> None:
    if not (ELF.is_file() and LIBRARY.is_file()):
        pytest.skip("run tools/setup_avr, then make avr")
    result = echo.run(EchoOptions(robot="avr:", count=60))
    told = {name: value for name, value, _ in result.rows}
    assert told["answered"] == 60 and told["round trip, median"] < 4


def test_the_bench_works_through_a_port(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    serve = [sys.executable, "-m", "host.sim.serve", "sim:", "--link", str(link)]
    with subprocess.Popen(serve, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None and server.stdout.readline()
            out = tmp_path / "echo.json"
            command = [*BENCH, "echo", "--robot", str(link), "--count", "100", "--json", str(out)]
            done = subprocess.run(command, capture_output=True, text=True, timeout=60)
            told = {name: value for name, value, _ in json.loads(out.read_text())["rows"]}
            assert told["answered"] == 100, done.stdout + done.stderr
            refused = subprocess.run(
                [*BENCH, "cut", "--robot", str(link)], capture_output=True, text=True, timeout=60
            )
            assert refused.returncode == 2 and "then add --wheels-up" in refused.stderr
        finally:
            server.terminate()


def test_help_is_the_commands_manual(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == main(["--help"]) == 0
    told = capsys.readouterr().out
    for name in ("echo", "flood", "ber", "cut", "soak", "monitor", "replay", "report"):
        assert f"host.link.bench {name}" in told


# --- Complaints ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["ecko"], "no command 'ecko'; did you mean echo?"),
        (["dance"], "no command 'dance'; the commands are echo, flood"),
        (["echo", "--robot", "simm:"], "simm: does not exist"),
        (["echo", "--count", "0"], "--count must be from 1 to 1000000, not 0"),
        (["echo", "--period-ms", "0.1"], "--period-ms must be from 1 to 10000, not 0.1"),
        (["echo", "--coutn", "5"], "did you mean --count"),
        (["flood", "--seconds", "0"], "--seconds must be from 1 to 3600, not 0"),
        (["ber", "--rates", "1e-5;1"], "write rates from 0 to 0.01, such as"),
        (["ber", "--rates", "0.5"], "write rates from 0 to 0.01, such as"),
        (["ber", "--seconds", "nan"], "--seconds must be from 1 to 3600"),
        (["ber", "--period-ms", "500"], "--period-ms must be from 5 to 100"),
        (["ber", "--speed-mm-s", "9000"], "--speed-mm-s must be within 2000"),
        (["ber", "--robot", "/dev/ttyNONE"], "put the robot on blocks, wheels free, then add --wheels-up"),
        (["cut", "--robot", "/dev/ttyNONE"], "put the robot on blocks, wheels free, then add --wheels-up"),
        (["soak", "--robot", "/dev/ttyNONE"], "put the robot on blocks, wheels free, then add --wheels-up"),
        (["cut", "--seeds", "0"], "--seeds must be from 1 to 1000, not 0"),
        (["cut", "--speed-mm-s", "10"], "--speed-mm-s must be from 50 to 1000, not 10"),
        (
            ["cut", "--only", "flood"],
            "no way to die is called so; they are: nothing is sent any more; unplugged",
        ),
        (["soak", "--minutes", "0"], "--minutes must be from 0.05 to 10000, not 0"),
        (["soak", "--faults", "drop,flop"], "no fault is called 'flop'; they are drop, flip"),
        (["monitor", "--only", "tele"], "no such message; they are broken, clear"),
        (["monitor", "--seconds", "0"], "--seconds must be above 0, not 0"),
        (["report"], "no results to report: name files written with --json"),
        (["echo", "--json", "/proc/no/where.json"], "/proc"),
    ],
)
def test_a_wrong_command_line_gets_one_line(arguments: list[str], complaint: str) -> None:
    kind = DeviceError if "simm:" in arguments else UsageError
    with pytest.raises(kind) as told:
        main(arguments)
    assert complaint in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("{", "is no JSON; name files written with --json"),
        ("[1]", "is no result of the bench"),
        ('{"format": "robot link bench 0"}', "is no result of the bench"),
        ('{"format": "robot link bench 1"}', "is no result of the bench"),
    ],
)
def test_a_file_that_is_no_result_is_said_to_be_none(tmp_path: Path, content: str, complaint: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(content)
    with pytest.raises(InputError, match=complaint):
        read_result(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_result(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("where", "value"),
    [
        (("rows",), 3), (("rows", 0), 3), (("rows", 0, 0), [1]), (("rows", 0, 0), 10**400),
        (("verdict",), []), (("verdict", "findings"), 3), (("verdict", "findings", 0), "x"),
        (("verdict", "findings", 0, "grade"), 7), (("verdict", "findings", 0, "grade"), "splendid"),
        (("verdict", "findings", 0, "text"), None), (("command",), 1), (("robot",), None), (("when",), 5),
        (("settings",), []), (("columns",), "ab"), (("columns", 0), 1), (("details",), 1),
        (("plots",), {}), (("plots", 0), 1), (("plots", 0, "kind"), "pie"), (("plots", 0, "kind"), []),
        (("plots", 0, "title"), 1), (("plots", 0, "ticks"), 3), (("plots", 0, "limit"), "x"),
        (("plots", 0, "log_x"), "x"), (("plots", 0, "more"), 1), (("plots", 0, "series"), 3),
        (("plots", 0, "series", 0, "x"), 1), (("plots", 0, "series", 0, "y"), [1, 2]),
        (("plots", 0, "series", 0, "y"), ["x"]), (("plots", 0, "series", 0, "name"), 1),
    ],
)  # fmt: skip
def test_a_damaged_result_is_said_to_be_none(
    tmp_path: Path, where: tuple[str | int, ...], value: object
) -> None:
    plot = Plot("t", "bars", "x", "y", [Series("s", [0.0], [1.5])], limit=2.0, ticks=["one"])
    verdict = Verdict((Finding(Grade.NOTE, "told"),))
    told = Result("cut", "sim:", {}, ["a"], [["x"]], verdict, [plot]).as_dict()
    inner = told
    for key in where[:-1]:
        inner = inner[key]  # type: ignore[index]
    inner[where[-1]] = value  # type: ignore[index]
    path = tmp_path / "x.json"
    path.write_text(json.dumps(told))
    with pytest.raises(InputError, match="is no result of the bench"):
        main(["report", str(path), "--html", str(tmp_path / "x.html")])


def test_a_result_and_its_page_do_not_go_into_one_file(tmp_path: Path) -> None:
    path = tmp_path / "both"
    with pytest.raises(UsageError, match=r"--json and --html are both .*both: name two files"):
        options = EchoOptions(json=path, html=tmp_path / "." / "x" / ".." / "both")
        run(lambda options: pytest.fail("measured"), options)
    assert not path.exists()


def test_results_come_back_from_json_as_they_were(tmp_path: Path) -> None:
    plot = Plot("t", "bars", "x", "y", [Series("s", [0.0], [1.5])], limit=2.0, ticks=["one"])
    verdict = Verdict((Finding(Grade.NOTE, "told"),))
    result = Result(
        "cut", "sim:", {"seeds": 1}, ["a", "b"], [["x", float("inf")]], verdict, [plot], {"k": [1]}
    )
    write_result(result, tmp_path / "r.json")
    assert read_result(tmp_path / "r.json") == replace(result, rows=[["x", None]])


def test_nobody_at_the_port_is_told_as_such(tmp_path: Path) -> None:
    import os
    import tty

    far, near = os.openpty()
    tty.setraw(near)
    try:
        with pytest.raises(DeviceError, match="no whole frame within 3 s: check that the robot has power"):
            echo.run(EchoOptions(robot=os.ttyname(near)))
    finally:
        os.close(far)
        os.close(near)
