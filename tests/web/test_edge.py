"""The real nginx, as docs/deploying-nginx.md installs it, before the real server and before one that only counts."""

import gzip
import re
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path

import pytest
import urllib3

from tests import postgres
from tests.conftest import ROOT
from tests.web.bundles import read_study, write_bundle
from tests.web.edge import NAME, Edge, edge, read_all, request
from tests.web.edge_clients import (
    NUM_OTHERS,
    SecureBrowser,
    num_served_beside_slow_ones,
    send_forms,
    slow_ones,
)
from tests.web.reading import ask, place
from tests.web.servers import serving
from tests.web.upstreams import Upstream, upstream
from webapp.bots.browser import Site, TimeLimit
from webapp.bots.effects import Effects
from webapp.bots.plan import make_plan
from webapp.bots.surroundings import surroundings_on
from webapp.bots.walk import Walk
from webapp.config import Config
from webapp.stimuli.catalogue import Catalogue, current_bundle
from webapp.storage.database import open_database
from webapp.views.security import HEADERS

FORGED = (
    "X-Forwarded-For: 203.0.113.9",
    "X-Forwarded-Host: evil.example",
    "X-Forwarded-Proto: http",
    "X-Forwarded-Prefix: /evil",
    "X-Real-IP: 203.0.113.9",
    "Forwarded: for=203.0.113.9;host=evil.example;proto=http",
    "Proxy: http://evil.example",
)
# Configurations that the tests must find fault with.
FEW = {"worker_connections 8192": "worker_connections 64"}
UNLIMITED = {"limit_req zone=xar_consents burst=200 nodelay;": ""}
REPEATING = {"proxy_next_upstream error timeout;": "proxy_next_upstream error timeout non_idempotent;"}
USUAL_LOG = {"error.log emerg": "error.log error"}
AN_ADDRESS = re.compile(r"\d{1,3}(\.\d{1,3}){3}")


pytestmark = pytest.mark.sqlite_only(reason="one server serves the whole module; the last test has its own PostgreSQL")


@pytest.fixture(scope="module")
def instance(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("edge") / "instance"
    write_bundle(folder, read_study())
    return folder


@pytest.fixture(scope="module")
def site(instance: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Edge]:
    """The real server behind nginx."""
    with ExitStack() as stack:
        server = stack.enter_context(serving(instance, XAR_HTTPS="yes", XAR_TRUSTED_HOSTS=NAME))
        yield stack.enter_context(edge(tmp_path_factory.mktemp("nginx") / "site", server.port))


@pytest.fixture
def counted(tmp_path: Path) -> Iterator[tuple[Edge, Upstream]]:
    """A server that counts, behind nginx."""
    with upstream() as server, edge(tmp_path / "nginx", server.port) as found:
        yield found, server


def test_a_bot_takes_part_to_the_end_over_tls_with_cookies_of_this_host_alone(site: Edge, instance: Path) -> None:
    catalogue = Catalogue.open(current_bundle(instance, "sakai2021"))
    with open_database(place(instance), make=False) as database:
        around = surroundings_on(
            Site("127.0.0.1", site.https_port, NAME), database, Config(instance), catalogue, Effects()
        )
        (plan,) = make_plan({"attentive": 1}, 1, ("en",), 0)
        walk = Walk(plan, around, TimeLimit(60, threading.Event()))
        walk.browser = SecureBrowser(site)
        assert walk.arrive()
        assert walk.go_on() == "completed"
        walk.browser.close()
    assert "__Host-participant" in walk.browser.cookies
    assert all(name.startswith("__Host-") for name in walk.browser.cookies)
    assert walk.participant is not None
    assert ask(instance, "SELECT mode, completed_at IS NOT NULL FROM participants") == [("bot", 1)]


def test_a_personal_link_leads_to_https(site: Edge) -> None:
    """Typed into another device, it must not travel in the clear."""
    browser = SecureBrowser(site)
    nonce = re.search(r'name="nonce" value="(\w+)"', browser.get("/").text)
    assert nonce is not None
    browser.post("/consent", {"agree": "yes", "nonce": nonce[1]})
    page = browser.get("/another-device").text
    browser.close()
    assert f"https://{NAME}/resume/" in page
    assert "http://" not in page


@pytest.mark.parametrize("path", ["/", "/nowhere", "/study", "/healthz", "/researcher/sign-in", "/static/0/none.css"])
def test_every_answer_says_once_that_this_site_is_https_alone_and_no_version(site: Edge, path: str) -> None:
    head = site.ask(request(path)).partition("\r\n\r\n")[0]
    assert head.count("Strict-Transport-Security: max-age=31536000; includeSubDomains") == 1
    assert re.findall(r"(?i)^server: (.*)\r$", head + "\r\n", re.MULTILINE) == ["nginx"]
    for name, value in HEADERS.items():
        assert head.count(f"\r\n{name}: {value}") == 1, name


def test_without_tls_there_is_a_way_to_https_alone_and_under_the_own_name(site: Edge) -> None:
    pool = urllib3.HTTPConnectionPool("127.0.0.1", site.http_port)
    answer = pool.request("GET", "/?lang=ja", headers={"Host": NAME}, redirect=False)
    assert (answer.status, answer.headers["Location"]) == (301, f"https://{NAME}/?lang=ja")
    assert pool.request("GET", "/", headers={"Host": "evil.example"}, redirect=False).status == 421
    pool.close()


def test_another_name_is_not_served_by_handshake_or_by_header(site: Edge) -> None:
    with pytest.raises(OSError, match=r"(?i)unrecognized"):
        site.connect("evil.example")
    assert site.ask(request("/", host="evil.example")).startswith("HTTP/1.1 421 ")
    assert site.ask(request("/", host=f"{NAME}\r\nHost: evil.example")).startswith("HTTP/1.1 400 ")


def test_forged_headers_change_nothing_in_what_is_answered(site: Edge) -> None:
    plain, forged = (_without_chance(site.ask(request("/", *headers))) for headers in ((), FORGED))
    assert forged == plain
    assert "evil" not in forged
    assert "evil" not in site.ask(request("/?lang=en", *FORGED))


def test_the_program_is_told_its_own_name_https_and_nobodys_address(counted: tuple[Edge, Upstream]) -> None:
    found, server = counted
    found.ask(request("/", *FORGED))
    ((_, _, headers),) = server.seen
    assert headers["host"] == NAME
    assert headers["x-forwarded-proto"] == "https"
    assert not {line.partition(":")[0].lower() for line in FORGED} - {"x-forwarded-proto"} & set(headers)
    assert not AN_ADDRESS.search(str(headers))


@pytest.mark.parametrize(
    ("length", "begun"),
    [("Content-Length: 104857600", b""), ("Transfer-Encoding: chunked", b"10001\r\n" + 65537 * b"x" + b"\r\n1")],
)
def test_a_hundred_megabytes_are_refused_before_they_have_been_sent(
    counted: tuple[Edge, Upstream], length: str, begun: bytes
) -> None:
    found, server = counted
    with found.connect() as connection:
        connection.sendall(request("/consent", length, method="POST") + begun)
        assert connection.recv(12) == b"HTTP/1.1 413"
    assert server.seen == []


def test_two_hundred_slow_connections_hold_up_nobody(counted: tuple[Edge, Upstream], tmp_path: Path) -> None:
    found, _ = counted
    assert num_served_beside_slow_ones(found) == NUM_OTHERS
    # Control: where nginx has room for few connections, others are not served.
    with upstream() as server, edge(tmp_path / "narrow", server.port, other=FEW) as narrow:
        assert num_served_beside_slow_ones(narrow) < NUM_OTHERS


def test_one_address_cannot_open_a_thousand_sessions_but_a_whole_school_can_begin(
    counted: tuple[Edge, Upstream], tmp_path: Path
) -> None:
    found, server = counted
    begun_at = time.monotonic()
    statuses = send_forms(found, "/consent", 1000)
    most = 201 + int(time.monotonic() - begun_at) + 1
    assert set(statuses) == {200, 429}
    assert 200 <= statuses[200] <= most
    assert len(server.seen) == statuses[200]
    refused = found.ask(request("/consent", method="POST", body=b"agree=yes"))
    assert refused.startswith("HTTP/1.1 429 ")
    assert "\r\nRetry-After: 30\r\n" in refused
    # Whoever has begun is not stopped by it, at whatever page.
    assert found.ask(request("/study/3", method="POST", body=b"x=1")).startswith("HTTP/1.1 200 ")
    # Control: without the limit all of them arrive.
    with upstream() as all_of_them, edge(tmp_path / "open", all_of_them.port, other=UNLIMITED) as unlimited:
        assert send_forms(unlimited, "/consent", 300) == {200: 300}


def test_passwords_cannot_be_guessed_by_the_hundred(counted: tuple[Edge, Upstream]) -> None:
    found, _ = counted
    statuses = send_forms(found, "/researcher/sign-in", 100)
    assert 20 <= statuses[200] <= 25
    assert statuses[429] == 100 - statuses[200]


def test_a_form_is_never_sent_twice_and_a_page_may_be_asked_for_twice(tmp_path: Path) -> None:
    assert _times_sent(tmp_path / "ours") == {"GET": 2, "POST": 1}
    # Control: nginx can be told to repeat forms, and this test would see it.
    assert _times_sent(tmp_path / "repeating", REPEATING) == {"GET": 2, "POST": 2}


def test_styles_are_kept_for_good_and_arrive_packed_under_an_address_of_their_content(site: Edge) -> None:
    found = re.search(r'href="(/static/[0-9a-f]{12}/css/base\.css)"', site.ask(request("/")))
    assert found is not None
    head, _, body = site.ask(request(found[1], "Accept-Encoding: gzip")).partition("\r\n\r\n")
    assert "\r\nCache-Control: public, max-age=31536000, immutable" in head
    assert "\r\nContent-Encoding: gzip" in head
    assert gzip.decompress(body.encode("latin-1")) == (ROOT / "static/css/base.css").read_bytes()
    other = found[1].replace(found[1].split("/")[2], 12 * "0")
    assert "immutable" not in site.ask(request(other))


def test_what_is_logged_names_no_address_no_link_and_no_browser(tmp_path: Path) -> None:
    with upstream() as server, edge(tmp_path / "ours", server.port) as found:
        server.is_silent = True
        lines = _cause_trouble(found)
    assert '"part":"/resume","status":"502"' in lines
    assert "TOKEN" not in lines
    assert "NAMED" not in lines
    assert not AN_ADDRESS.search(lines)
    # Control: an error log of the usual level names the address.
    with upstream() as server, edge(tmp_path / "usual", server.port, other=USUAL_LOG) as usual:
        server.is_silent = True
        assert AN_ADDRESS.search(_cause_trouble(usual))


def test_while_the_server_is_away_people_are_told_that_nothing_is_lost(counted: tuple[Edge, Upstream]) -> None:
    found, server = counted
    server.is_silent = True
    answer = found.ask(request("/study/3"))
    assert answer.startswith("HTTP/1.1 502 ")
    assert "\r\nRetry-After: 5\r\n" in answer
    assert "Answers that you have given are stored." in answer
    server.is_silent = False
    assert found.ask(request("/study/3")).startswith("HTTP/1.1 200 ")


def test_slow_connections_never_reach_the_workers_who_would_wait_for_them(
    tmp_path: Path, postgres_server: postgres.Server
) -> None:
    """gunicorn's threads read what they are sent: without nginx, 200 slow connections are the end of it."""
    write_bundle(tmp_path / "instance", read_study())
    given = {"DATABASE_URL": postgres_server.url(postgres_server.make())}
    with serving(tmp_path / "instance", "--workers", "2", XAR_TRUSTED_HOSTS=NAME, XAR_HTTPS="yes", **given) as server:
        with edge(tmp_path / "nginx", server.port) as found:
            assert num_served_beside_slow_ones(found) == NUM_OTHERS
        # Control: the same without nginx.
        with slow_ones(lambda: socket.create_connection(("127.0.0.1", server.port), timeout=1)):
            connection = urllib3.HTTPConnectionPool("127.0.0.1", server.port, timeout=1, retries=False)
            with pytest.raises(urllib3.exceptions.HTTPError):
                connection.request("GET", "/", headers={"Host": NAME})
            connection.close()


def _times_sent(folder: Path, other: Mapping[str, str] | None = None) -> Mapping[str, int]:
    """Count how often two servers that give no answer are asked for one request of each method."""
    times: Counter[str] = Counter()
    for method in ("GET", "POST"):
        with (
            upstream() as one,
            upstream() as two,
            edge(folder / method, one.port, two.port, other=other or {}) as found,
        ):
            one.is_silent = two.is_silent = True
            assert found.ask(request("/", method=method, body=b"a=b")).startswith("HTTP/1.1 502 ")
            times.update(seen[0] for server in (one, two) for seen in server.seen)
    return times


def _cause_trouble(found: Edge) -> str:
    """Do what nginx has something to say about, and return what was logged."""
    found.ask(request("/resume/TOKEN?id=NAMED", "User-Agent: NAMED", "Referer: NAMED"))
    found.ask(request("/", "X-Long: " + 9000 * "x"))
    found.ask(request("/consent", method="POST", body=65537 * b"x"))
    found.ask(b"GET / NAMED\x00\r\n\r\n")
    with socket.create_connection(("127.0.0.1", found.https_port)) as connection:
        connection.sendall(b"\x16\x03\x01\x00\x05wrong")
        read_all(connection)
    ends_at = time.monotonic() + 5
    while '"status":"502"' not in found.logged() and time.monotonic() < ends_at:
        time.sleep(0.02)
    return found.logged()


def _without_chance(answer: str) -> str:
    """Leave out what differs from answer to answer."""
    return re.sub(r"\r\nDate: [^\r]*|[0-9a-f]{32}", "", answer)
