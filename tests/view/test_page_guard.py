"""Who is let in by the live page, and who is not."""

from __future__ import annotations

import socket

import pytest

from host.view.page.guard import Guard

HERE = Guard.of("127.0.0.1", "127.0.0.1")
ALL = Guard.of("0.0.0.0", "0.0.0.0")
TOKEN = ALL.token


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2", "::1"])
def test_on_loopback_no_token_is_asked_for(address):
    assert Guard.of(address, address).token is None


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.168.1.5", "fe80::1%eth0"])
def test_everywhere_else_a_token_is_made_that_is_another_each_time(address):
    tokens = {Guard.of(address, address).token for _ in range(5)}
    assert len(tokens) == 5
    assert all(token is not None and len(token) >= 16 for token in tokens)


@pytest.mark.parametrize("host", ["localhost:8080", "127.0.0.1:8080", "[::1]:8080", "LOCALHOST"])
def test_this_machine_may_look_on_and_stop(host):
    assert HERE.objection(host, None, None, acts=False) is None
    assert HERE.objection(host, f"http://{host}", None, acts=True) is None


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:8080",
        "192.168.1.5:8080",
        "127.0.0.1.evil.example",
        "",
        None,
        "[::1",
        "a@b",
        "localhost.",
    ],
)
def test_a_name_that_was_made_to_point_here_is_refused_even_on_loopback(host):
    said = HERE.objection(host, f"http://{host}", None, acts=True)
    assert said is not None
    assert "does not go by that name" in said


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "https://127.0.0.1:8080",
        "http://127.0.0.1:9999",
        "http://127.0.0.1",
        "null",
        "",
        None,
    ],
)
def test_another_web_page_may_not_act_even_on_loopback(origin):
    said = HERE.objection("127.0.0.1:8080", origin, None, acts=True)
    assert said is not None
    assert "another web page" in said


@pytest.mark.parametrize(
    "token",
    [None, "", "wrong", f"{TOKEN}x", f"{TOKEN}"[:-1], "é"],
    ids=["none", "empty", "wrong", "longer", "shorter", "not ASCII"],
)
@pytest.mark.parametrize("acts", [False, True])
def test_without_the_token_nobody_may_even_look_on(token, acts):
    said = ALL.objection("192.168.1.5:8080", "http://192.168.1.5:8080", token, acts)
    assert said is not None
    assert "token" in said


@pytest.mark.parametrize("host", ["192.168.1.5:8080", "127.0.0.1:8080", f"{socket.gethostname()}:8080"])
def test_with_the_token_other_machines_may_act(host):
    assert ALL.objection(host, f"http://{host}", TOKEN, acts=True) is None


def test_the_token_alone_does_not_make_a_strange_name_or_web_page_good():
    assert ALL.objection("evil.example:8080", "http://evil.example:8080", TOKEN, acts=True) is not None
    assert ALL.objection("192.168.1.5:8080", "http://evil.example", TOKEN, acts=True) is not None
