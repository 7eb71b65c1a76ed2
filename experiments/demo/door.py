"""Who may come in: the address asked for, the page that asks, and the token in the path."""

from __future__ import annotations

import hmac
import secrets
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field

LOCAL = frozenset({"127.0.0.1", "localhost"})
HTTP = 80  # the port that an address need not name


@dataclass(frozen=True)
class Door:
    """Rules by which a request is let in or refused, the same for the page and its websocket.

    Host and Origin are compared with our own address, so that neither a page of another origin nor
    a name that someone else points at this computer (DNS rebinding) gets in; the token keeps out
    whoever was not given the address. It stands in the path because the page makes the address of
    its websocket from that, and because cookies are shared by all ports of a computer.

    Attributes
    ----------
    port : int
        Where we listen.
    names : frozenset of str
        What this computer is called, in lower case; the address that a connection came in by is
        accepted as well.
    token : str
        A secret of 256 bits.
    """

    port: int
    names: frozenset[str] = LOCAL
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)

    def problem(
        self, path: str, *, hosts: Sequence[str], origins: Sequence[str], local: str = "127.0.0.1"
    ) -> str | None:
        """Return why a request is refused, or None.

        Parameters
        ----------
        path : str
            As in the request line.
        hosts, origins : sequence of str
            Values of all headers of that name.
        local : str
            Our own end of the connection.
        """
        own = {f"{name}:{self.port}" for name in {*self.names, local}}
        if self.port == HTTP:
            own |= {*self.names, local}
        if len(hosts) != 1 or hosts[0].lower() not in own:
            return "this is not the address of the demo"
        # A browser sends the origin with every websocket; only other programs leave it out.
        if list(origins) not in ([], [f"http://{hosts[0]}"]):
            return "a page of another origin may not come in"
        given = path.partition("?")[0].split("/")[1:2]
        sent = "".join(given).encode(errors="surrogateescape")  # bytes that are no letters, too
        if not hmac.compare_digest(sent, self.token.encode()):
            return "open the whole address that `flexaxis demo` printed"
        return None

    def inside(self, path: str) -> str:
        """Return the path of an admitted request without the token."""
        return "/" + path.removeprefix(f"/{self.token}").removeprefix("/")

    def address(self, name: str) -> str:
        """Return the whole address under a name of this computer."""
        return f"http://{name}:{self.port}/{self.token}/"


def own_names() -> frozenset[str]:
    """Return what this computer is called in its network, in lower case."""
    name = socket.gethostname().lower()
    short = name.partition(".")[0]
    return LOCAL | {name, short, f"{short}.local", socket.getfqdn().lower()}
