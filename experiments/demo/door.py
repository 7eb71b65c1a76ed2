"""Before viser: one socket of this computer, the token, and the check of what viewers may say."""

from __future__ import annotations

import asyncio
import io
import logging
import os
import socket
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import replace
from typing import Any

from flexaxis.experiments.demo.input_check import InputCheck
from flexaxis.experiments.demo.token import LOCAL, Token
from flexaxis.sim.errors import FlexaxisError

PORT, TRIED = 8080, 100
MOST_VIEWERS = 200  # connections at a time, those included that have not said yet what they want
MAX_MESSAGE = 2**16  # bytes of a message of a viewer: a hundred times what the page sends
MOST_UNREAD = 2**24  # bytes that wait for a viewer who does not read: ten times the whole page
PAUSE = 0.002  # s after each, so that nobody's flood of messages fills the memory
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class DemoServer:
    """A viser behind the token.

    viser has no option for any of it, so that how it starts its websocket server is changed while
    it does; pyproject.toml bounds it to versions of which the tests know that this holds.

    Parameters
    ----------
    port : int, optional
        The one that was asked for; by default 8080, or the next that is free.
    warned : callable, optional
        Gets a line where it is not 8080.

    Attributes
    ----------
    token : Token
    check : InputCheck
        Empty at first: nothing is taken from a viewer.
    viser : viser.ViserServer

    Raises
    ------
    FlexaxisError
        If viser or mjviser is not installed, the port cannot be had, or the token would be passed.
    """

    def __init__(
        self, port: int | None = None, warned: Callable[[str], None] = lambda _: None
    ) -> None:
        viser = _viser()
        self._listening = listen(port, warned)
        self.token, self.check = Token(self._listening.getsockname()[1]), InputCheck()
        self._connections: weakref.WeakSet[Any] = weakref.WeakSet()
        self._logger = logging.getLogger("flexaxis.demo")  # garbage on the port is no news
        self._logger.addHandler(logging.NullHandler())
        self._logger.propagate = False
        self._stands = False
        # It prints a banner of its own.
        with redirect_stdout(io.StringIO()), self._in_front():
            self.viser = viser.ViserServer(
                host=LOCAL[0], port=self.token.port, label="flexaxis", verbose=False
            )
        _let_threads_draw(self.viser)
        # A page could ask viser for a tunnel through its makers' server; ours stays where it is.
        self.viser.request_share_url = lambda verbose=True: None
        if not self._stands:
            self.stop()
            raise FlexaxisError(
                "the installed viser starts its server in a way that the demo does not know, so "
                "that any web page could come in: nothing is served. Install what pyproject.toml "
                "asks for: pip install -e '.[demo]' in the folder of flexaxis"
            )

    def stop(self) -> None:
        """Cut all connections, also of viewers who do not read, and end."""
        for connection in list(self._connections):
            if transport := getattr(connection, "transport", None):
                connection.loop.call_soon_threadsafe(transport.abort)
        with redirect_stdout(io.StringIO()):
            self.viser.stop()
        self._listening.close()

    @contextmanager
    def _in_front(self) -> Iterator[None]:
        """Let a websocket server that is started meanwhile listen where we do, behind the token."""
        import websockets.asyncio.server as library

        original = library.serve

        def serve(handler: Any, *_: Any, process_request: Any, **options: Any) -> Any:
            self._stands = True
            return original(
                lambda connection: handler(_Narrow(connection, self.check.admitted)),
                sock=self._listening,
                process_request=self._checked(process_request),
                create_connection=self._counted(library.ServerConnection),
                logger=self._logger,
                close_timeout=0.5,
                **(options | {"max_size": MAX_MESSAGE}),
            )

        library.serve = serve  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            library.serve = original  # type: ignore[misc]

    def _checked(self, inner: Callable[..., Any]) -> Callable[..., Any]:
        """Return viser's answer to requests that may come in, and 403 to the others."""

        def process(connection: Any, request: Any) -> Any:
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            problem = self.token.problem(request.path, hosts=hosts, origins=origins)
            if problem is not None:
                return connection.respond(403, f"refused: {problem}\n")
            response = inner(connection, replace(request, path=self.token.inside(request.path)))
            for name, value in HEADERS.items() if response is not None else ():
                response.headers[name] = value
            return response

        return process

    def _counted(self, make: Callable[..., Any]) -> Any:
        """Return what makes a connection: no more than MOST_VIEWERS, and none that does not read.

        Pings are answered at once, as many as there come, and the answers wait in memory.
        """

        def made(*args: Any, **options: Any) -> Any:
            connection = make(*args, **options)
            begin, receive = connection.connection_made, connection.data_received
            there = [c for c in self._connections if not _closed(c)]

            def begun(transport: Any) -> None:
                begin(transport)
                if len(there) >= MOST_VIEWERS:
                    transport.abort()

            def received(data: bytes) -> None:
                receive(data)
                if connection.transport.get_write_buffer_size() > MOST_UNREAD:
                    connection.transport.abort()

            connection.connection_made, connection.data_received = begun, received
            self._connections.add(connection)
            return connection

        return made


def _closed(connection: Any) -> bool:
    transport = getattr(connection, "transport", None)
    return transport is not None and transport.is_closing()


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


class _Waking(asyncio.Event):
    """An event that any thread may set, once its loop is running."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._home = loop

    def set(self) -> None:
        with suppress(RuntimeError):  # a loop that is closed has nobody to wake
            self._home.call_soon_threadsafe(super().set)


def _let_threads_draw(server: Any) -> None:
    """Mend what viser does for each message: it sets asyncio's event out of our thread.

    That fails now and then while viewers come and go ("deque mutated during iteration").
    """
    buffer = server._websock_server._broadcast_buffer
    buffer.message_event = _Waking(buffer.event_loop)


def _viser() -> Any:
    try:
        import mjviser  # noqa: F401
        import viser
    except ImportError as error:
        raise FlexaxisError(
            f"the live demo needs viser and mjviser ({error}): pip install -e '.[demo]' "
            "in the folder of flexaxis. "
            "`flexaxis demo --record lesson.gif` needs neither"
        ) from None  # wrong use, and no failure of the machine
    return viser


def listen(port: int | None, said: Callable[[str], None]) -> socket.socket:
    """Return a socket that listens on this computer.

    Parameters
    ----------
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
            found = socket.create_server((LOCAL[0], number))
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
