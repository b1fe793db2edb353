import pytest

from webapp.bots.browser import Site
from webapp.bots.errors import BotError
from webapp.bots.server import is_of_this_machine, site_of


@pytest.mark.parametrize(
    ("address", "site"),
    [
        ("http://127.0.0.1:8000", Site("127.0.0.1", 8000, "127.0.0.1:8000")),
        ("http://0.0.0.0:8000", Site("127.0.0.1", 8000, "127.0.0.1:8000")),
        ("http://localhost:81/", Site("localhost", 81, "localhost:81")),
    ],
)
def test_a_server_of_this_machine_is_reached_under_its_own_address(address: str, site: Site) -> None:
    assert site_of(address, ()) == site


def test_behind_a_proxy_the_server_is_asked_for_by_the_name_that_it_listens_to() -> None:
    site = site_of("http://127.0.0.1:8000", ("study.example.org",))
    assert (site.host, site.name) == ("127.0.0.1", "study.example.org:8000")


@pytest.mark.parametrize("address", ["http://192.0.2.1:8000", "http://no.such.host.invalid:8000", "nonsense"])
def test_a_server_of_another_machine_is_refused(address: str) -> None:
    with pytest.raises(BotError, match="is not on this machine"):
        site_of(address, ())


def test_only_addresses_that_could_be_listened_on_are_of_this_machine() -> None:
    assert is_of_this_machine("127.0.0.1")
    assert not is_of_this_machine("192.0.2.1")
    assert not is_of_this_machine("")
