"""What cmocka's programs say, as PlatformIO's test cases."""

from __future__ import annotations

import re

from platformio.public import TestCase, TestRunnerBase, TestStatus

STATUS = {"OK": TestStatus.PASSED, "FAILED": TestStatus.FAILED, "ERROR": TestStatus.ERRORED}


class CustomTestRunner(TestRunnerBase):
    """Reads lines such as ``[       OK ] a_wheel_at_rest_has_no_speed``."""

    def on_testing_line_output(self, line: str) -> None:
        """One line of a program's output."""
        super().on_testing_line_output(line)
        told = re.match(r"\[ +(OK|FAILED|ERROR) +\] (\w+)$", line.strip())
        if told and told[2] not in {case.name for case in self.test_suite.cases}:  # failures are listed twice
            self.test_suite.add_case(TestCase(name=told[2], status=STATUS[told[1]]))
