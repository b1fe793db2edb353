"""How many connections the server lets in where the system lets it hold few."""

import resource

import pytest

from webapp import app


@pytest.mark.parametrize(
    ("soft", "hard", "let_in", "asked_for"),
    [
        (1024, 1_048_576, 1500, 3000),
        (4096, 1_048_576, 1500, None),
        (1024, resource.RLIM_INFINITY, 1500, 3000),
        (resource.RLIM_INFINITY, resource.RLIM_INFINITY, 1500, None),
        (256, 1024, 924, 1024),
        (512, 512, 412, None),
        (64, 64, 1, None),
    ],
)
def test_no_more_are_let_in_than_can_be_held(
    monkeypatch: pytest.MonkeyPatch, soft: int, hard: int, let_in: int, asked_for: int | None
) -> None:
    """Whoever is let in beyond that would have to be turned away again and again."""
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (soft, hard))
    monkeypatch.setattr(resource, "setrlimit", lambda _, wanted: asked.append(wanted))
    assert app._room_for_connections() == let_in
    assert asked == ([] if asked_for is None else [(asked_for, hard)])
