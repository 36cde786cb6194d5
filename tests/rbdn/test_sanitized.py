"""The engine under AddressSanitizer and UBSan: 100,000 operations in any order, and odd scenes."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from compile_core import compile_core
from compile_cpp import SANITIZED
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

OPERATIONS = 100_000
A_PROGRAM = 100  # operations
TRACK, NEXT_FRAME, REFINE = 12, 13, 14  # as fuzz_core.cpp numbers them


class FuzzCore:
    """The program that runs operations; started again after it stopped at a fault."""

    def __init__(self, program: Path, scale: int, errors: Path) -> None:
        self._command = [str(program), str(scale)]
        self._errors = errors
        self._process: subprocess.Popen[str] | None = None
        self.operations_done = 0

    def assert_sound(self, program: bytes) -> None:
        """Run one program of operations; see fuzz_core.cpp."""
        if self._process is None:
            with self._errors.open("w") as errors:
                self._process = subprocess.Popen(
                    self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
                )
        assert self._process.stdin and self._process.stdout
        self._process.stdin.write(program.hex() + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            self.stop()
            raise AssertionError(self._errors.read_text()[-3000:])
        assert answer.startswith("sound "), (
            f"{answer.strip()}: echo {program.hex()} | {' '.join(self._command)}"
        )
        self.operations_done += int(answer.split()[1])

    def stop(self) -> None:
        if self._process is not None:
            self._process.communicate()
            self._process = None


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_core(Path(__file__).with_name("fuzz_core.cpp"), SANITIZED, tmp_path_factory.mktemp("fuzz"))


@pytest.fixture
def fuzz_core(program: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[FuzzCore]:
    core = FuzzCore(program, getattr(request, "param", 1), tmp_path / "errors.txt")
    yield core
    core.stop()


def test_a_hundred_thousand_operations_in_any_order_never_break_an_invariant(fuzz_core: FuzzCore):
    @settings(max_examples=OPERATIONS // A_PROGRAM, deadline=None, suppress_health_check=list(HealthCheck))
    @given(st.binary(min_size=3 + 2 * A_PROGRAM, max_size=3 + 2 * A_PROGRAM))
    def run(program: bytes) -> None:
        fuzz_core.assert_sound(program)

    run()
    assert fuzz_core.operations_done >= OPERATIONS


@pytest.mark.parametrize("fuzz_core", [3], indirect=True, ids="{}x".format)
@pytest.mark.parametrize("settings_byte", range(0, 256, 37))
def test_frames_of_random_scenes_never_break_an_invariant(fuzz_core: FuzzCore, settings_byte: int):
    frame = bytes([TRACK, 0, REFINE, 0, NEXT_FRAME, 0])
    for seed in range(10):
        fuzz_core.assert_sound(bytes([seed, 1, settings_byte]) + 12 * frame)
