"""`impactd serve`: the daemon behind uvicorn, until a signal ends it.

On SIGTERM, SIGINT or SIGHUP the valve is made safe first; only then are connections closed.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import sys
from collections.abc import Callable

import anyio
import structlog
import uvicorn
from starlette.datastructures import State

from impactd.abort_door import AbortDoor
from impactd.api.app import create_app
from impactd.api.arrivals import ACCEPT_BATCH, ACCEPT_QUEUE, Arrivals
from impactd.api.connection import connection_class
from impactd.api.connection_limit import (
    Connections,
    descriptor_limit,
    most_connections,
    raise_descriptor_limit,
)
from impactd.api.failed_logins import FailedLogins
from impactd.api.token_memory import TokenMemory
from impactd.daemon import Daemon
from impactd.end_signals import EndSignals
from impactd.repeat_limit import RepeatLimit
from impactd.settings.settings import Settings

_GRACE_S = 3
# An answer changes threads four times, and each time waits so long for one that computes.
_SWITCH_INTERVAL_S = 0.0005


class AddressTakenError(Exception):
    """Nobody can listen at the address."""

    def __init__(self, host: str, port: int, reason: str) -> None:
        self.host = host
        self.port = port
        self.reason = reason
        super().__init__(
            f"Cannot listen on {host} port {port}: {reason}; give another --host or --port."
        )


class Server(uvicorn.Server):
    """Uvicorn that stops the rig before the web.

    The caller stops the daemon in the end. ``state`` is the application's: arrivals, tokens, failed
    logins. ``announce`` is told the address once it listens.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        daemon: Daemon,
        state: State,
        announce: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(config)
        self._daemon = daemon
        self._arrivals: Arrivals = state.arrivals
        self._tokens: TokenMemory = state.token_memory
        self._failed_logins: FailedLogins = state.failed_logins
        self._announce = announce
        self.url = ""

    def run(self, sockets: list[socket.socket] | None = None) -> None:
        """Serve until the end; the abort socket opens before and closes after the rest."""
        port = sockets[0].getsockname()[1] if sockets else self.config.port
        with AbortDoor(self._daemon.service, self._arrivals, port):
            super().run(sockets)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Bind, then announce the address."""
        await super().startup(sockets)
        if self.started:
            # asyncio accepts as many in one round as it lets the kernel keep; the kernel may have
            # more, so that a crowd at the port does not make the next client wait a second.
            for one in sockets or []:
                one.listen(ACCEPT_QUEUE)
            self._arrivals.serve_on(asyncio.get_running_loop())
            self._tokens.start()
            self.url = _url(self.servers[0].sockets[0].getsockname())
            await anyio.to_thread.run_sync(self._daemon.announce, self.url)
            structlog.get_logger("impactd").info("listening", url=self.url)
            if self._announce is not None:
                self._announce(self.url)

    async def on_tick(self, counter: int) -> bool:
        """Log failed logins now and then; ten ticks are a second."""
        if counter % 10 == 0:
            self._failed_logins.summarize()
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Make the valve safe, then close connections."""
        self._daemon.bus.close()  # event streams would never end by themselves
        self._tokens.stop()
        await anyio.to_thread.run_sync(self._daemon.service.stop)
        await super().shutdown(sockets)
        self._arrivals.serve_on(None)


def make_server(daemon: Daemon, announce: Callable[[str], None] | None = None) -> Server:
    """Return a server for a daemon, not yet started.

    Host and port are those of the daemon's settings. ``announce`` is told the address once it
    listens. ``run()`` serves until a signal; ``url`` is known once ``started``.
    """
    server = daemon.settings.server
    app = create_app(daemon)
    config = uvicorn.Config(
        app,
        host=server.host,
        port=server.port,
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        date_header=True,
        ws="none",
        loop="asyncio",  # `Arrivals.settle` counts its rounds
        http=connection_class(
            app.state.arrivals, Connections(most_connections(descriptor_limit()))
        ),
        backlog=ACCEPT_BATCH,
        timeout_graceful_shutdown=_GRACE_S,
    )
    return Server(config, daemon, app.state, announce)


def serve(
    settings: Settings, announce: Callable[[str], None] | None = None, *, own_options: str = ""
) -> None:
    """Run the daemon until SIGTERM, SIGINT or SIGHUP.

    ``announce`` is told the address once it listens; ``own_options`` are in commands of its hints.

    Raises
    ------
    AddressTakenError
        If nobody can listen at the address.
    DataLockedError
        If another daemon serves the data directory.
    """
    configure_log()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    raise_descriptor_limit()
    # Before any device is touched. uvicorn raises its signals again once it is done: they end here,
    # because ending on request is a success.
    signals = EndSignals()
    signals.catch()
    daemon = Daemon(settings, own_options=own_options)
    try:
        listener = listen(settings.server.host, settings.server.port)
        daemon.start()
        server = make_server(daemon, announce)
        signals.pass_on(server.handle_exit)
        server.run(sockets=[listener])
    finally:
        daemon.stop()


def listen(host: str, port: int) -> socket.socket:
    """Return a bound socket, before any hardware is touched; port 0 takes a free one.

    Raises AddressTakenError if nobody can listen there.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        # The protocol is named because asyncio switches Nagle's algorithm off only where it reads
        # IPPROTO_TCP; with it on, each answer waits 40 ms for the client's delayed acknowledgement.
        listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    except OSError as error:
        raise AddressTakenError(host, port, error.strerror or str(error)) from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise AddressTakenError(host, port, error.strerror or str(error)) from error
    return listener


def configure_log() -> None:
    """Log one line per event to stderr: for a person on a terminal, logfmt for the journal."""
    terminal = sys.stderr.isatty()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            *([] if terminal else [structlog.processors.format_exc_info]),
            structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)
            if terminal
            else structlog.processors.LogfmtRenderer(key_order=["timestamp", "level", "event"]),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.WriteLoggerFactory(sys.stderr),
    )
    logging.basicConfig(
        level=logging.WARNING, stream=sys.stderr, format="%(levelname)s %(message)s"
    )
    for handler in logging.getLogger().handlers:
        handler.addFilter(RepeatLimit())


def _url(address: tuple[object, ...]) -> str:
    host, port = str(address[0]), address[1]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
