"""Before viser: one listening socket, the door, and the list of what viewers may say."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from http.client import HTTPConnection, HTTPException
from typing import Any

from flexaxis.experiments.demo.door import Door
from flexaxis.experiments.demo.offers import Offers
from flexaxis.sim.errors import FlexaxisError

PORT, TRIED = 8080, 100
MAX_MESSAGE = 2**16  # bytes of a message of a viewer: a hundred times what the page sends
MOST_UNREAD = 2**24  # bytes that wait for a viewer who does not read: ten times the whole page
PAUSE = 0.002  # s after each, so that nobody's flood of messages fills the memory
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class Guard:
    """A socket that listens, and what stands between it and viser.

    viser has no option for any of it, so that `in_front` changes how it starts its websocket
    server; `prove` asks the running server whether that was of any use.

    Parameters
    ----------
    door : Door
    listening : socket
        Bound and listening; viser is given this one and opens none.

    Attributes
    ----------
    offers : Offers
        Empty at first: nothing is taken from a viewer.
    """

    def __init__(self, door: Door, listening: socket.socket) -> None:
        self.door, self.listening, self.offers = door, listening, Offers()
        self._stands = False
        self._connections: weakref.WeakSet[Any] = weakref.WeakSet()
        self._logger = logging.getLogger("flexaxis.demo")  # garbage on the port is no news
        self._logger.addHandler(logging.NullHandler())
        self._logger.propagate = False

    @contextmanager
    def in_front(self) -> Iterator[None]:
        """Let a websocket server that is started meanwhile be started with the guard before it."""
        import websockets.asyncio.server as library

        original = library.serve

        def serve(handler: Any, *_: Any, process_request: Any, **options: Any) -> Any:
            self._stands = True
            return original(
                lambda connection: handler(_Narrow(connection, self.offers.admitted)),
                sock=self.listening,
                process_request=self._checked(process_request),
                create_connection=self._remembered(library.ServerConnection),
                logger=self._logger,
                close_timeout=0.5,
                **(options | {"max_size": MAX_MESSAGE}),
            )

        library.serve = serve  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            library.serve = original  # type: ignore[misc]

    def prove(self) -> None:
        """Knock without a token, and from another origin.

        Raises
        ------
        FlexaxisError
            If any of it is let in: then this viser goes round the guard.
        """
        own, upgrade = f"127.0.0.1:{self.door.port}", {"Connection": "Upgrade"}
        upgrade |= {"Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
        upgrade |= {"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="}
        knocks = [
            ("/", {"Host": own}),
            ("/", upgrade | {"Host": own, "Origin": f"http://{own}"}),
            (f"/{self.door.token}/", upgrade | {"Host": own, "Origin": "http://elsewhere"}),
            (f"/{self.door.token}/", upgrade | {"Host": f"elsewhere:{self.door.port}"}),
        ]
        shut = self._stands and all(self._answer(*knock) == 403 for knock in knocks)
        if not shut:
            raise FlexaxisError(
                "the installed viser goes round the guard of the demo, so that any web page could "
                "come in: nothing is served. Install the version that flexaxis is tested with: "
                "pip install 'viser==1.1.1'"
            )

    def hang_up(self) -> None:
        """Cut all connections, also of viewers who do not read and of those not yet let in."""
        for connection in list(self._connections):
            if transport := getattr(connection, "transport", None):
                connection.loop.call_soon_threadsafe(transport.abort)

    def _answer(self, path: str, headers: dict[str, str]) -> int:
        connection = HTTPConnection("127.0.0.1", self.door.port, timeout=5)
        try:
            connection.request("GET", path, headers=headers)
            return connection.getresponse().status
        except (OSError, HTTPException):
            return 0
        finally:
            connection.close()

    def _checked(self, inner: Callable[..., Any]) -> Callable[..., Any]:
        """Return viser's answer to requests that may come in, and 403 to the others."""

        def process(connection: Any, request: Any) -> Any:
            problem = self.door.problem(
                request.path,
                hosts=request.headers.get_all("Host"),
                origins=request.headers.get_all("Origin"),
                local=connection.local_address[0],
            )
            if problem is not None:
                return connection.respond(403, f"refused: {problem}\n")
            request = replace(request, path=self.door.inside(request.path))
            response = inner(connection, request)
            for name, value in HEADERS.items() if response is not None else ():
                response.headers[name] = value
            return response

        return process

    def _remembered(self, make: Callable[..., Any]) -> Any:
        def made(*args: Any, **options: Any) -> Any:
            connection = make(*args, **options)
            connection.data_received = _answered(connection, connection.data_received)
            self._connections.add(connection)
            return connection

        return made


def _answered(connection: Any, receive: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """Return what takes in bytes, but cuts off a viewer who does not read what is answered.

    Pings are answered at once, as many as there come, and the answers wait in memory.
    """

    def received(data: bytes) -> None:
        receive(data)
        if connection.transport.get_write_buffer_size() > MOST_UNREAD:
            connection.transport.abort()

    return received


class _Narrow:
    """A connection as far as viser needs one; it hears only what was admitted."""

    def __init__(self, connection: Any, admitted: Callable[[Any], bytes | None]) -> None:
        self._connection, self._admitted = connection, admitted
        self.subprotocol = connection.subprotocol
        self.send, self.close = connection.send, connection.close

    async def recv(self) -> bytes:
        while True:
            message = self._admitted(await self._connection.recv())
            await asyncio.sleep(PAUSE)
            if message is not None:
                return message


def listen(host: str, port: int | None, said: Callable[[str], None]) -> socket.socket:
    """Return a socket that listens.

    Parameters
    ----------
    host : str
        The address to listen on.
    port : int or None
        The one that was asked for; None for 8080, or the next that is free, which is said.
    said : callable
        Gets that line.

    Raises
    ------
    FlexaxisError
        If the port that was asked for cannot be had, or none is free.
    """
    if port is not None and not 1 <= port <= 65535:
        raise FlexaxisError(f"--port {port}: give a number from 1 to 65535, such as {PORT}")
    for number in [port] if port is not None else range(PORT, PORT + TRIED):
        try:
            found = socket.create_server((host, number))
        except OSError as error:
            if port is not None:
                raise FlexaxisError(
                    f"--port {port} cannot be had ({os.strerror(error.errno or 0)}): give another "
                    "one, or leave --port out and take the next that is free"
                ) from error
            continue
        if port is None and number != PORT:
            said(f"port {PORT} is taken; the next that is free is {number}")
        return found
    raise FlexaxisError(f"no port from {PORT} to {PORT + TRIED - 1} is free: give one with --port")
