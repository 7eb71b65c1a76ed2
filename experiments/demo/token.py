"""Who may come in: who asks for our own address, from our own page, with the token in its path."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field

LOCAL = ("127.0.0.1", "localhost")
HTTP = 80  # the port that an address need not name


@dataclass(frozen=True)
class Token:
    """Rules by which a request is let in or refused, the same for the page and its websocket.

    Host and Origin are compared with our own address, so that neither a page of another origin nor
    a name that someone else points at this computer (DNS rebinding) gets in; the token keeps out
    whoever was not given the address. It stands in the path because the page makes the address of
    its websocket from that, and because cookies are shared by all ports of a computer.

    Attributes
    ----------
    port : int
        Where we listen, on this computer only.
    secret : str
        Of 256 bits.
    """

    port: int
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)

    def problem(self, path: str, *, hosts: Sequence[str], origins: Sequence[str]) -> str | None:
        """Return why a request is refused, or None.

        Parameters
        ----------
        path : str
            As in the request line.
        hosts, origins : sequence of str
            Values of all headers of that name.
        """
        own = {f"{name}:{self.port}" for name in LOCAL}
        own |= set(LOCAL) if self.port == HTTP else set()
        if len(hosts) != 1 or hosts[0].lower() not in own:
            return "this is not the address of the demo"
        # A browser sends the origin with every websocket; only other programs leave it out.
        if list(origins) not in ([], [f"http://{hosts[0]}"]):
            return "a page of another origin may not come in"
        given = path.partition("?")[0].split("/")[1:2]
        sent = "".join(given).encode(errors="surrogateescape")  # bytes that are no letters, too
        if not hmac.compare_digest(sent, self.secret.encode()):
            return "open the whole address that `flexaxis demo` printed"
        return None

    def inside(self, path: str) -> str:
        """Return the path of an admitted request without the token."""
        return "/" + path.removeprefix(f"/{self.secret}").removeprefix("/")

    @property
    def address(self) -> str:
        """The whole address."""
        return f"http://{LOCAL[0]}:{self.port}/{self.secret}/"
