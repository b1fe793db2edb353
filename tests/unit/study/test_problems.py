import pytest

from webapp.study.problems import find_line

TEXT = """\
name = "a"
"quoted key" = 1

[learning]
seeds.first = 3  # a dotted key

[[experiments]]
id = "1"
kinds = [
    "full",
]

[experiments.question]
questioner = "x"

[[experiments.items]]
id = "one"

[[experiments.items]]
id = "two"

[[experiments]]
id = "2"

[[experiments.items]]
id = "three"
"""


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("name",), 1),
        (("quoted key",), 2),
        (("learning",), 4),
        (("learning", "seeds", "first"), 5),
        (("experiments",), 7),
        (("experiments", 0), 7),
        (("experiments", 0, "kinds", 0), 9),
        (("experiments", 0, "question", "questioner"), 14),
        (("experiments", 0, "items", 0, "id"), 17),
        (("experiments", 0, "items", 1, "id"), 20),
        (("experiments", 1, "id"), 23),
        (("experiments", 1, "items", 0, "id"), 26),
        (("experiments", 1, "missing"), 22),
        (("learning", "missing"), 4),
        (("missing",), None),
        ((), None),
    ],
)
def test_the_line_of_a_setting_is_found_or_else_that_of_its_table(
    path: tuple[str | int, ...], line: int | None
) -> None:
    assert find_line(TEXT, path) == line
