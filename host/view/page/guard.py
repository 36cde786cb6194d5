"""Who may speak to the live page: nobody from another machine without the token, and no other web page.

A web page anywhere can send a browser to this machine's ports. The Host header tells a name that was made to
point here (DNS rebinding), the Origin header a page that does not come from here (cross-site websockets).
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from dataclasses import dataclass
from urllib.parse import urlsplit

TOKEN_BYTES = 12  # 96 bits, 16 letters in an address


@dataclass(frozen=True)
class Guard:
    """Judges requests."""

    loopback: bool  # only this machine can reach the page
    token: str | None  # that every request must carry; None: none is asked for
    names: frozenset[str]  # besides addresses, by which the page may be called

    @classmethod
    def of(cls, host: str, address: str) -> Guard:
        """For a server that was asked to listen on `host`, which is `address`."""
        if _address(address).is_loopback:
            return cls(True, None, frozenset({"localhost"}))
        own = socket.gethostname().lower()
        names = {host.lower(), own, f"{own}.local"}
        return cls(False, secrets.token_urlsafe(TOKEN_BYTES), frozenset(names))

    def objection(self, host: str | None, origin: str | None, token: str | None, acts: bool) -> str | None:
        """Why a request is refused, in a line for whoever sent it; None where it is allowed.

        Parameters
        ----------
        host, origin
            The headers.
        token
            As in the address.
        acts
            It is more than fetching the page.
        """
        if not self._knows(host):
            return "this page does not go by that name: open the address that was printed"
        if acts and origin != f"http://{host}":
            return "another web page may not do this: open the address that was printed"
        if self.token is not None and not hmac.compare_digest((token or "").encode(), self.token.encode()):
            return "the token is missing or wrong: open the whole address that was printed for this drive"
        return None

    def _knows(self, host: str | None) -> bool:
        try:
            name = urlsplit(f"//{host or ''}").hostname or ""
            address = _address(name)
        except ValueError:
            return host is not None and _name_of(host) in self.names
        return address.is_loopback or not self.loopback


def _name_of(host: str) -> str:
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    return ipaddress.ip_address(text.partition("%")[0])
