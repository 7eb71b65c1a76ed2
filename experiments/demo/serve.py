"""Start the web server of the live demo with restricted access, and simulate in real time."""

import io
import signal
import time
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from operator import itemgetter
from pathlib import Path
from threading import Event
from typing import Any

from flexaxis.experiments.demo.page import Page
from flexaxis.experiments.demo.session import DEFAULT_RACERS, MARK, DemoSession
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.text_files import read_text, toml_tables
from flexaxis.sim.timing import PERIOD, sample_index

HOST, PORT = "127.0.0.1", 8080
MAX_MESSAGE = 2**16  # largest message from a browser [bytes]; usual ones are 100 times smaller
FRAMES = 30  # number of frames of the 3-D picture per second
CURVES = 4  # number of updates of curves and numbers per second
BEHIND = 0.25  # largest delay that the simulation makes up for [s]
WARM = 8.0  # simulated time before the page is drawn [s]; the estimators settle in this time


def serve(
    estimators: Sequence[str] = (),
    *,
    lesson: Path | None = None,
    seed: int | None = None,
    port: int | None = None,
    browser: bool = True,
) -> None:
    """Show the live demo in a browser on this computer, until Ctrl-C or SIGTERM.

    The simulation pauses whenever no browser is connected.

    Parameters
    ----------
    estimators : sequence of str
        Names and options of two estimators, in the format of `--estimator` (default: the estimators
        of the lesson).
    lesson : Path, optional
        Path of a lesson file, which is a TOML file with timed actions. The actions of a lesson
        replace user clicks.
    seed : int, optional
        Random seed of the simulation (default: the seed of the lesson, or 0).
    port : int, optional
        Port of the web server (default: 8080, or the next free port).
    browser : bool
        Whether to open a browser.

    Raises
    ------
    FlexaxisError
        If viser or mjviser is missing, or if the port is invalid or in use. The error also occurs
        if the demo cannot read the lesson or cannot run one of the estimators.
    """
    plan = load_lesson(lesson) if lesson else {"act": []}
    session = DemoSession(
        estimators or plan.get("estimators", DEFAULT_RACERS),
        seed=plan.get("seed", 0) if seed is None else seed,
    )
    server = start(port)
    stopping = Event()

    def stop(*_: object) -> None:
        stopping.set()  # stops the loop even if the exception is lost in a callback of MuJoCo
        raise KeyboardInterrupt

    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, stop)
    with suppress(KeyboardInterrupt):
        address = f"http://{HOST}:{server.get_port()}"
        print(f"the live demo is at {address}  (Ctrl-C stops the server)", flush=True)
        page = Page(server, session, plan["act"])
        page.advance(sample_index(WARM, PERIOD))
        page.draw_curves()
        if browser:
            webbrowser.open(address)
        _loop(page, server, stopping)
    with redirect_stdout(io.StringIO()):
        server.stop()


def load_lesson(path: Path) -> dict[str, Any]:
    """Read a lesson file, and return its content; its ``[[act]]`` tables are sorted by time.

    A lesson file can also contain the keys ``estimators`` and ``seed``. The key ``at`` of an
    ``[[act]]`` contains a time [s], and the key ``do`` contains the name of an action in
    `flexaxis.experiments.demo.session.ACTIONS`. The optional key ``with`` of an ``[[act]]``
    contains the arguments of the action. The optional key ``say`` of an ``[[act]]`` contains a
    message that the web page shows.

    Raises
    ------
    FlexaxisError
        If the lesson file cannot be read, or if an ``[[act]]`` lacks the key ``at`` or ``do``.
    """
    lesson = toml_tables(read_text(path, FlexaxisError), source=str(path), refuse=FlexaxisError)
    acts = lesson.get("act", [])
    for act in acts:
        if not {"at", "do"} <= act.keys():
            raise FlexaxisError(f"{path}: the [[act]] {act} needs the keys `at` and `do`")
    return lesson | {"act": sorted(acts, key=itemgetter("at"))}


def start(port: int | None = None) -> Any:
    """Start a viser server that accepts connections only from web pages of the demo.

    Parameters
    ----------
    port : int, optional
        Port of the web server (default: 8080, or the next free port).

    Raises
    ------
    FlexaxisError
        If viser or mjviser is missing, or if the port is invalid or in use.
    """
    if port is not None and not 0 < port < 2**16:
        raise FlexaxisError(f"the port {port} does not exist: choose a port from 1 to 65535")
    try:
        import mjviser  # noqa: F401
        import viser
    except ImportError as error:
        raise FlexaxisError(
            f"the live demo needs viser and mjviser ({error}): run pip install -e '.[demo]' "
            "in the folder of flexaxis"
        ) from None
    with redirect_stdout(io.StringIO()), _own_pages_only():  # hides the banner that viser prints
        server = viser.ViserServer(host=HOST, port=port or PORT, verbose=False)
    # Without this line, a page could request a public tunnel through viser's share server.
    server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
    if port not in (None, server.get_port()):
        server.stop()
        raise FlexaxisError(f"the port {port} is in use: choose another port, or omit --port")
    return server


@contextmanager
def _own_pages_only() -> Iterator[None]:
    """Let new websocket servers reject connections from all web pages except the demo page.

    Without this restriction, any web page in the browser could connect to the demo. Another web
    page could even use a host name that resolves to this computer (DNS rebinding). The library
    viser does not prevent connections from other web pages.
    """
    import websockets.asyncio.server as library

    original = library.serve

    def serve(handler: Any, host: str, port: int, *, process_request: Any, **options: Any) -> Any:
        def check(connection: Any, request: Any) -> Any:
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            own = [[f"{name}:{port}"] for name in (HOST, "localhost")]
            if hosts not in own or origins not in ([], [f"http://{hosts[0]}"]):
                return connection.respond(403, "refused: this page does not belong to the demo\n")
            return process_request(connection, request)

        options["max_size"] = MAX_MESSAGE
        return original(handler, host, port, process_request=check, **options)

    library.serve = serve  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        library.serve = original  # type: ignore[misc]


def _loop(page: Page, server: Any, stopping: Event) -> None:
    """Simulate the axis and draw the web page in real time, until the event `stopping` is set."""
    before, owed, next_curves = time.monotonic(), 0.0, 0.0
    while not stopping.wait(max(0.0, before + 1 / FRAMES - time.monotonic())):
        now = time.monotonic()
        elapsed, before = now - before, now
        if not server.get_clients():
            continue
        owed += 0.0 if page.paused else min(elapsed, BEHIND) / PERIOD
        due, page.steps = int(owed) + page.steps * MARK, 0
        owed %= 1
        page.advance(due)
        # Drawing wakes viser's event loop from this thread. That can fail while a viewer connects
        # or disconnects.
        with suppress(RuntimeError):
            page.draw_axis()
            if now >= next_curves:
                next_curves = now + 1 / CURVES
                page.draw_curves()
