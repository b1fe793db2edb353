"""The web application, put together from its parts, and the server that runs it."""

import logging
import os
import resource
import signal
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from flask import Flask
from flask.helpers import get_debug_flag
from waitress.server import create_server  # type: ignore[import-untyped]

from webapp.config import LOOPBACK, Config, ConfigError
from webapp.server_loop import Sockets
from webapp.stimuli.catalogue import Catalogue, current_bundle
from webapp.stimuli.program import running_program
from webapp.stimuli.publication import check_published
from webapp.storage.baton import Baton
from webapp.storage.database import Database, DatabaseError, UnavailableError, UnreachableError
from webapp.storage.instance import note_address, only_server, prepare_instance, secret_key
from webapp.storage.live import LiveNumbers
from webapp.storage.participants import has_participants
from webapp.storage.records import SYSTEM, Entry, append
from webapp.storage.scope import Scope
from webapp.storage.surroundings import shared_place
from webapp.views import arrival, ask, driving, health, participant, researcher
from webapp.views.assets import init_assets
from webapp.views.errors import init_errors
from webapp.views.logs import configure_logging, init_request_log
from webapp.views.security import cookie_name, init_security
from webapp.views.services import Bundles, Services, attach, services_of, utc_now
from webapp.views.sessions import RareSessions
from webapp.views.texts import init_texts
from webapp.views.tokens import session_key

if TYPE_CHECKING:
    from wsgiref.types import StartResponse, WSGIEnvironment

NUM_THREADS = 8
MAX_CONNECTIONS = 1500
"""A browser keeps up to six connections open after a page; beyond this many in all, nobody new is let in."""
MAX_BODY_BYTES = 64 * 1024
MAX_FORM_PARTS = 100
# What a process has open besides: the database, and what takes in connections.
_OTHER_FILES = 100
# How long an idle connection is kept.
_IDLE_S = 30
# Above the app's own limit, so that somebody who sends too much is told so on one of our pages.
_SERVER_MAX_BODY_BYTES = 6 * 1024 * 1024
# Where an answer may take long: researchers', explanations that are asked for, what waits for a lock.
_TAKE_LONGER = ("/researcher", "/ask", "/healthz")
_LOGGER = logging.getLogger(__name__)

_App = Callable[["WSGIEnvironment", "StartResponse"], Iterable[bytes]]


def create_app(config: Config, *, clock: Callable[[], datetime] = utc_now) -> Flask:
    """Put the application together, with its database brought up to date.

    Args:
        config: The settings.
        clock: Returns the time, with its zone.

    Raises:
        ConfigError: Real data are to be collected, and the study file is not ready for it.
        webapp.stimuli.catalogue.BundleError: The study was not built.
        webapp.storage.instance.InstanceError: The instance folder cannot be used.
        webapp.storage.database.DatabaseError: The database cannot be used.
    """
    app = Flask("webapp", root_path=str(_resources()), template_folder="templates", static_folder=None)
    services = _open_services(config, clock)
    attach(app, services)
    _configure_flask(app, services)
    init_request_log(app)
    init_security(app, config)
    init_texts(app)
    init_assets(app, _resources() / "static")
    init_errors(app)
    if config.database_url is not None:
        app.wsgi_app = _one_at_a_time(app.wsgi_app, services.database.baton)  # type: ignore[method-assign,assignment]
    for module in (arrival, participant, driving, ask, researcher, health):
        app.register_blueprint(module.bp)
    return app


def serve(config: Config, announce: Callable[[str], None]) -> None:
    """Run the server until it is told to stop by SIGINT or SIGTERM.

    Args:
        config: The settings.
        announce: Told the addresses, once the server listens.

    Raises:
        ConfigError: The address cannot be listened on, or as `create_app`.
        webapp.storage.instance.InstanceError: Another server runs on this instance, or as `create_app`.
    """
    refuse_debugging()
    refuse_several_for_sqlite(config)
    configure_logging(with_requests=config.access_log)
    prepare_instance(config.instance)
    with only_server(config.instance):
        app = create_app(config)
        try:
            _serve(app, config, announce)
        finally:
            services_of(app).database.close()


def _resources() -> Path:
    """Return the folder of `templates` and `static`: within the package if installed, else beside it."""
    package = Path(__file__).parent
    return package if (package / "templates").is_dir() else package.parent


def _open_services(config: Config, clock: Callable[[], datetime]) -> Services:
    bundle = check_published if config.live else current_bundle
    catalogue = Catalogue.open(bundle(config.instance, config.study))
    placeholders = catalogue.study.placeholders()
    if config.live and placeholders:
        names = ", ".join(placeholders)
        raise ConfigError(f"--live needs the study file's {names}, still placeholders; fill in and run `xar build`")
    prepare_instance(config.instance)
    is_key_new = not (config.instance / "secret_key").exists()
    secret = secret_key(config.instance)
    database = Database(config.database_path, config.database_url)
    live = LiveNumbers(database)
    try:
        database.prepare()
        if is_key_new and has_participants(database):
            _LOGGER.warning(
                "made a new secret key beside an old database: pages that are open are sent in vain, and recruiters' "
                "links lead nobody back; bring back %s from a backup",
                config.instance / "secret_key",
            )
        # The first look reads everybody; no researcher has to wait for it.
        live.overview(catalogue.study, Scope(catalogue.study.name, catalogue.version, config.mode), utc_now())
    except DatabaseError:
        database.close()
        raise
    except UnavailableError as error:
        database.close()
        reason = str(error.orig or error).strip().partition("\n")[0]
        raise UnreachableError(f"the database {database.edition.told} cannot be used now: {reason}") from error
    return Services(config, database, live, Bundles(config.instance / "bundles", catalogue), secret, clock)


def _one_at_a_time(wsgi_app: _App, baton: Baton) -> _App:
    """Let threads that answer participants take turns, where a page is a matter of milliseconds.

    A form that comes in parts is a matter of whoever sends it; others are there by now, with waitress and with `wsgi`.
    """

    def answer(environ: "WSGIEnvironment", start_response: "StartResponse") -> Iterable[bytes]:
        if environ["PATH_INFO"].startswith(_TAKE_LONGER) or "HTTP_TRANSFER_ENCODING" in environ:
            return wsgi_app(environ, start_response)
        with baton.held():
            return wsgi_app(environ, start_response)

    return answer


def _configure_flask(app: Flask, services: Services) -> None:
    config = services.config
    app.session_interface = RareSessions()
    app.config.update(
        SECRET_KEY=session_key(services.secret),
        SESSION_COOKIE_NAME=cookie_name(config, "notice"),
        SESSION_COOKIE_SECURE=config.https,
        SESSION_COOKIE_HTTPONLY=True,
        SESSION_COOKIE_SAMESITE="Lax",
        MAX_CONTENT_LENGTH=MAX_BODY_BYTES,
        MAX_FORM_MEMORY_SIZE=MAX_BODY_BYTES,
        MAX_FORM_PARTS=MAX_FORM_PARTS,
        TRUSTED_HOSTS=list(config.trusted_hosts) or None,
    )


def _serve(app: Flask, config: Config, announce: Callable[[str], None]) -> None:
    sockets = Sockets()
    try:
        server = create_server(
            app,
            map=sockets,
            host=config.host,
            port=config.port,
            threads=NUM_THREADS,
            connection_limit=_room_for_connections(),
            channel_timeout=_IDLE_S,
            cleanup_interval=_IDLE_S // 2,
            ident=None,
            max_request_body_size=_SERVER_MAX_BODY_BYTES,
        )
    except (OSError, ValueError) as error:  # Waitress says with a ValueError that there is no such host.
        reason = error.strerror if isinstance(error, OSError) else "there is no such address"
        raise ConfigError(f"cannot listen on {config.host} port {config.port}: {reason}") from error
    signal.signal(signal.SIGTERM, _stop)
    port = next(int(opened.effective_port) for opened in sockets.values() if opened.accepting)
    tell_start(app, port, announce)
    try:
        with suppress(SystemExit, KeyboardInterrupt):
            sockets.serve()
    finally:
        server.task_dispatcher.shutdown()
        server.close()


def _room_for_connections() -> int:
    """Let the process hold as many connections as it lets in, and let in no more than the system allows it to hold."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 2 * MAX_CONNECTIONS
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    return max(1, min(MAX_CONNECTIONS, wanted - _OTHER_FILES))


def refuse_several_for_sqlite(config: Config) -> None:
    """Refuse several processes where one file may have one writer only.

    Raises:
        ConfigError: There are to be several.
    """
    if config.workers > 1 and config.database_url is None:
        raise ConfigError(
            f"WEB_CONCURRENCY or --workers is {config.workers}, and SQLite is served by one process; "
            "use 1, or PostgreSQL (DATABASE_URL)"
        )


def refuse_debugging() -> None:
    """Refuse to serve people what a programmer wants to see.

    Raises:
        ConfigError: Flask is told to debug.
    """
    if get_debug_flag():
        raise ConfigError(f"FLASK_DEBUG is {os.environ['FLASK_DEBUG']!r}; unset it where people take part")


def tell_start(app: Flask, port: int, announce: Callable[[str], None]) -> None:
    """Record that a server listens, note where for programs on this machine, and announce it.

    Args:
        app: What is served.
        port: Where it listens.
        announce: Told the addresses.
    """
    config = services_of(app).config
    host = f"[{config.host}]" if ":" in config.host else config.host
    address = f"http://{host}:{port}"
    note_address(config.instance, address)
    _record_start(services_of(app))
    announce(f"Participants: {address}/")
    announce(f"Dashboard:    {address}/researcher/")
    if not config.https and config.host not in LOOPBACK:
        announce("Without https, passwords and answers can be read on their way; see XAR_HTTPS.")
    for finding in shared_place(config.instance) if config.database_url is None else ():
        announce(f"Answers are in danger: {finding.told}; {finding.wish}.")
    announce("Live: answers are data." if config.live else "Test run: answers are marked as a test.")


def _record_start(services: Services) -> None:
    """Record which version is shown to people, and by which program: both are frozen by publishing it."""
    if services.config.live:
        current = services.bundles.current
        scope = Scope(current.study.name, current.version, services.config.mode)
        content = {"program": running_program().to_json()}
        with services.database.write() as connection:
            append(connection, Entry(services.clock(), SYSTEM, "served", scope, content=content))


def _stop(_signal: int, _frame: FrameType | None) -> NoReturn:
    """End the server's loop; answers that are being stored are finished first."""
    sys.exit(0)
