"""Serving the live axis: the address, the clock, and the way to stop."""

from __future__ import annotations

import os
import signal
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from flexaxis.experiments.demo.door import DemoServer
from flexaxis.experiments.demo.page import Page
from flexaxis.experiments.demo.session import DemoSession
from flexaxis.sim.timing import PERIOD, sample_index

FRAMES = 30  # of the 3-D picture, a second
CURVES = 4  # times a second that curves and numbers are drawn anew
BEHIND = 0.25  # s of delay that are made up for; what is more is let go
WARM = 8.0  # s of the axis before anybody looks: estimators have settled, and curves are there
FAREWELL = 0.2  # s that the last words have to reach the pages
PATIENCE = 0.6  # s that an end may take by itself; with FAREWELL, for Ctrl-C is to take a second


def serve(
    session: DemoSession,
    *,
    port: int | None = None,
    browser: bool = True,
    speed: float = 1.0,
    exaggerate: float = 100.0,
    play: Callable[[DemoSession], Callable[[int], None]] | None = None,
    said: Callable[[str], None] = print,
    warned: Callable[[str], None] = lambda _: None,
) -> None:
    """Show a session in the browser until SIGINT or SIGTERM.

    The session holds while nobody looks.

    Parameters
    ----------
    session : DemoSession
        Shared by all viewers.
    port : int, optional
        Where the page is, or nowhere; if none is given 8080, or the next that is free.
    browser : bool
        Whether to open one.
    speed : float
        Simulated seconds a second.
    exaggerate : float
        Factor on the twist of the joints in the picture.
    play : callable, optional
        Gives, for the session, what is to be called instead of its `advance`.
    said, warned : callable
        Get the lines to print: the address first; and what was not as asked for.

    Raises
    ------
    FlexaxisError
        As from `DemoServer`.
    """
    failed: list[BaseException] = []

    def run() -> None:
        """Go on until told to stop: in a thread, for a compiler takes seconds for a loop."""
        try:
            session.prepare()
            if play is None:
                page.advance(sample_index(WARM, PERIOD))
            else:
                page.play(play)
            page.draw_curves()
            _loop(page, stop)
        except BaseException as error:
            failed.append(error)
            stop.set()

    with _signals() as stop:
        server = DemoServer(port, warned)
        said(f"the live axis is at {server.token.address}  (Ctrl-C ends it)")
        page = Page(server, session, exaggerate=exaggerate, speed=speed)
        if browser:
            webbrowser.open(server.token.address)
        worker = threading.Thread(target=run, daemon=True)
        worker.start()
        stop.wait()
        worker.join(PATIENCE)
        page.end()
        time.sleep(FAREWELL)
        server.stop()
    if failed:
        raise failed[0]
    if worker.is_alive():  # nothing is lost: what is compiled is written whole or not
        os._exit(0)


def _loop(page: Page, stop: threading.Event) -> None:
    """Advance and draw, in real time, until told to stop."""
    pace = page.pace
    before, owed, next_curves = time.monotonic(), 0.0, 0.0
    while not stop.wait(max(0.0, before + 1 / FRAMES - time.monotonic())):
        now = time.monotonic()
        elapsed, before = now - before, now
        if not page.watched:
            continue
        owed += 0.0 if pace.paused else min(elapsed, BEHIND) * pace.speed / PERIOD
        due, owed = int(owed) + page.stepped(), owed % 1
        if due:
            page.advance(due)
            page.draw_axis()
        pace.count(due)
        if now >= next_curves:
            next_curves = now + 1 / CURVES
            page.draw_curves()


@contextmanager
def _signals() -> Iterator[threading.Event]:
    """Give an event that SIGINT and SIGTERM set."""
    stop = threading.Event()
    old = [(k, signal.signal(k, lambda *_: stop.set())) for k in (signal.SIGINT, signal.SIGTERM)]
    try:
        yield stop
    finally:
        for kind, handler in old:
            signal.signal(kind, handler)
