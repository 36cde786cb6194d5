"""Questions at a terminal."""

from __future__ import annotations

import os

from host.doctor.person import AtTerminal, says_yes


def test_what_was_typed_before_the_question_is_no_answer_to_it(monkeypatch, capfd):
    ours, theirs = os.openpty()
    with open(theirs) as terminal, open(ours, "wb", buffering=0) as keys:
        monkeypatch.setattr("sys.stdin", terminal)
        keys.write(b"yes\nyes\n")
        typed = iter([b"No\n"])
        answer = AtTerminal().ask("Turn them?", lambda: keys.write(next(typed, b"")))
    assert answer == "no" and not says_yes(answer)
    assert "Turn them?" in capfd.readouterr().err
