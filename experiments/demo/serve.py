"""Serving the live axis: the address, the clock, and the way to stop."""

from __future__ import annotations

import io
import signal
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

from flexaxis.experiments.demo.front import Page
from flexaxis.experiments.demo.session import DemoSession
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.timing import RATE

FRAMES = 30  # of the 3-D picture, a second
CURVES = 5  # times a second that curves and numbers are drawn anew
BEHIND = 0.25  # s of delay that are made up for; what is more is let go
LOCAL, EVERYWHERE = "127.0.0.1", "0.0.0.0"


def serve(
    session: DemoSession,
    *,
    port: int = 8080,
    share: bool = False,
    browser: bool = True,
    speed: float = 1.0,
    exaggerate: float = 100.0,
    said: Callable[[str], None] = print,
) -> None:
    """Show a session in the browser until SIGINT or SIGTERM.

    The session holds while nobody looks.

    Parameters
    ----------
    session : DemoSession
        Shared by all viewers.
    port : int
        Where the page is; if it is taken, the next free one.
    share : bool
        Whether other computers may see it; else only this one.
    browser : bool
        Whether to open one.
    speed : float
        Simulated seconds a second.
    exaggerate : float
        Factor on the twist of the joints in the picture.
    said : callable
        Gets the lines to print.

    Raises
    ------
    FlexaxisError
        If viser or mjviser is not installed.
    """
    with _stop_signals() as stop:
        server = make_server(port, EVERYWHERE if share else LOCAL)
        address = f"http://{'localhost' if share else LOCAL}:{server.get_port()}"
        said(f"the live axis is at {address}  (Ctrl-C ends it)")
        if share:
            said(
                f"shared: whoever reaches this computer on port {server.get_port()} can watch and "
                "press the buttons; there is no password and no encryption. The page reads no "
                "files and runs no code of its viewers."
            )
        page = Page(server, session, exaggerate=exaggerate, speed=speed)
        if browser:
            webbrowser.open(address)
        try:
            _loop(page, stop)
        finally:
            with redirect_stdout(io.StringIO()):
                server.stop()


def _loop(page: Page, stop: threading.Event) -> None:
    """Advance and draw, in real time, until told to stop."""
    pace = page.pace
    before, owed, next_curves = time.monotonic(), 0.0, 0.0
    since, cpu, frames, samples = before, time.process_time(), 0, 0
    while not stop.wait(max(0.0, before + 1 / FRAMES - time.monotonic())):
        now = time.monotonic()
        elapsed, before = now - before, now
        if not page.watched:
            continue
        owed += min(elapsed, BEHIND) * pace.speed * RATE
        due, owed = int(owed), owed % 1
        page.advance(due)
        page.draw_axis()
        frames, samples = frames + 1, samples + due
        if now >= next_curves:
            next_curves = now + 1 / CURVES
            page.draw_curves()
        if now - since >= 2.0:
            pace.frames, pace.reached = frames / (now - since), samples / RATE / (now - since)
            pace.load = 100 * (time.process_time() - cpu) / (now - since)
            since, cpu, frames, samples = now, time.process_time(), 0, 0


def make_server(port: int, host: str) -> Any:
    """Return a server without a banner of its own, or say what is missing."""
    try:
        import mjviser  # noqa: F401
        import viser
    except ImportError as error:
        raise FlexaxisError(
            f"the live demo needs viser and mjviser ({error}): pip install 'flexaxis[demo]'. "
            "`flexaxis demo --record lesson.gif` needs neither"
        ) from error
    with redirect_stdout(io.StringIO()):  # it has a banner of its own
        server = viser.ViserServer(host=host, port=port, label="flexaxis", verbose=False)
    # A page could ask viser for a tunnel through its makers' server; ours stays where it is.
    server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign,misc]
    return server


@contextmanager
def _stop_signals() -> Iterator[threading.Event]:
    """Give an event that SIGINT and SIGTERM set."""
    stop = threading.Event()
    kinds = [signal.SIGINT, signal.SIGTERM]
    old = [signal.signal(kind, lambda *_: stop.set()) for kind in kinds]
    try:
        yield stop
    finally:
        for kind, handler in zip(kinds, old, strict=True):
            signal.signal(kind, handler)
