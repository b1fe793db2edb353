from pathlib import Path

import pytest

from webapp.config import Config, ConfigError, read_config


def test_without_any_setting_the_server_is_for_this_machine_alone_and_a_test() -> None:
    config = read_config({})
    assert config == Config(Path.cwd() / "instance")
    assert (config.host, config.port, config.mode) == ("127.0.0.1", 8000, "test")
    assert "evil.example" not in config.trusted_hosts
    assert config.trusted_hosts


def test_the_environment_is_read_and_the_command_line_comes_first() -> None:
    environment = {
        "XAR_INSTANCE": "/srv/xar",
        "XAR_STUDY": "other",
        "XAR_HOST": "0.0.0.0",  # noqa: S104
        "XAR_PORT": "80",
        "XAR_HTTPS": "Yes",
        "XAR_TRUSTED_HOSTS": "study.example.org, www.example.org",
    }
    config = read_config(environment, live=True, port=8080)
    assert config == Config(
        instance=Path("/srv/xar"),
        study="other",
        live=True,
        host="0.0.0.0",  # noqa: S104
        port=8080,
        https=True,
        trusted_hosts=("study.example.org", "www.example.org"),
    )
    assert config.mode == "live"
    assert config.database_path == Path("/srv/xar/xar.sqlite3")


def test_a_server_for_everyone_is_addressed_by_any_name_unless_told_otherwise() -> None:
    assert read_config({"XAR_HOST": "0.0.0.0"}).trusted_hosts == ()  # noqa: S104


def test_live_is_never_set_by_the_environment() -> None:
    assert read_config({"XAR_LIVE": "1"}).mode == "test"


@pytest.mark.parametrize("port", ["65536", "-1", "http", "", "8000.0", "٣"])
def test_bad_ports_are_refused(port: str) -> None:
    with pytest.raises(ConfigError, match="XAR_PORT"):
        read_config({"XAR_PORT": port})


@pytest.mark.parametrize("study", ["../elsewhere", "a/b", "/etc", "", ".."])
def test_a_study_is_a_name_and_no_path(study: str) -> None:
    with pytest.raises(ConfigError, match="XAR_STUDY"):
        read_config({"XAR_STUDY": study})


def test_all_problems_are_named_at_once() -> None:
    with pytest.raises(ConfigError) as refusal:
        read_config({"XAR_PORT": "x", "XAR_HTTPS": "perhaps", "XAR_INSTANCE": " "})
    assert len(refusal.value.problems) == 3
    assert all(name in str(refusal.value) for name in ("XAR_PORT", "XAR_HTTPS", "XAR_INSTANCE"))
