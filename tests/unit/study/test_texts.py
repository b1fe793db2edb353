import pytest

from webapp.study.problems import StudyError
from webapp.study.texts import MissingTextError, Texts, Wanted, check_texts, parse_texts

TEXT = """\
[page]
step = "Step {number} of {total}"
facts = ["One.", "Two."]
braces = "A {Brace} and {} and { } stay."

[items]
general = "All in all?"

[items.likeliness]
1 = "Could you?"
2 = "Did you?"

[scales.likeliness]
low = "no"
high = "yes"

[scales.general]
low = "bad"
high = "good"
"""


@pytest.fixture
def texts() -> Texts:
    return parse_texts(TEXT, "en", "en.toml")


def test_parameters_are_filled_in(texts: Texts) -> None:
    assert texts("page.step", number=3, total=11) == "Step 3 of 11"


def test_a_parameter_may_hold_braces_and_is_not_filled_in_again(texts: Texts) -> None:
    assert texts("page.step", number="{total}", total=11) == "Step {total} of 11"


def test_braces_around_anything_else_stay(texts: Texts) -> None:
    assert texts("page.braces") == "A {Brace} and {} and { } stay."


def test_a_missing_parameter_is_named(texts: Texts) -> None:
    with pytest.raises(MissingTextError, match=r"'page\.step' needs the parameter 'total'"):
        texts("page.step", number=3)


@pytest.mark.parametrize("key", ["page.nothing", "page", "page.facts", ""])
def test_a_text_that_is_not_there_is_named(texts: Texts, key: str) -> None:
    with pytest.raises(MissingTextError, match=f"'{key}' in language 'en'"):
        texts(key)


def test_a_list_of_texts_keeps_its_order(texts: Texts) -> None:
    assert texts.list("page.facts") == ("One.", "Two.")
    with pytest.raises(MissingTextError, match=r"'page\.step'"):
        texts.list("page.step")


def test_an_item_may_be_worded_for_one_experiment_or_for_all(texts: Texts) -> None:
    assert texts.item("likeliness", "2").legend == "Did you?"
    assert texts.item("general", "2").legend == texts.item("general", "1").legend == "All in all?"
    assert (texts.item("general", "1").low, texts.item("likeliness", "1").high) == ("bad", "yes")
    with pytest.raises(MissingTextError, match=r"items\.likeliness"):
        texts.item("likeliness", "3")


@pytest.mark.parametrize("value", ["3", "true", '""', '"  "', "[]", '["a", 3]', '["a", ""]', "1979-05-27"])
def test_what_is_no_text_is_refused_with_its_line(value: str) -> None:
    with pytest.raises(StudyError, match=r"en\.toml, line 3: page\.facts: is .*; write a text or a list of texts"):
        parse_texts(TEXT.replace('["One.", "Two."]', value), "en", "en.toml")


def test_a_file_that_is_not_toml_is_refused() -> None:
    with pytest.raises(StudyError, match=r"en\.toml, at its end: not a TOML file"):
        parse_texts("title = ", "en", "en.toml")


def test_what_pages_need_is_compared_with_what_a_language_has(texts: Texts) -> None:
    required = {key: Wanted() for key in texts.entries if not key.startswith("page")}
    required |= {
        "page.step": Wanted(frozenset({"number"})),
        "page.facts": Wanted(),
        "page.title": Wanted(),
    }
    assert check_texts(texts, required, "en.toml") == (
        "en.toml: page.step: names the parameter {total}; it may use {number}",
        "en.toml: page.facts: is ['One.', 'Two.']; write one text",
        "en.toml: page.title: is missing",
    )


def test_a_parameter_may_be_left_out_and_stands_in_lists_too() -> None:
    texts = Texts("en", {"a": "Plain.", "b": ("One {x}.", "Two {y}.")})
    assert check_texts(texts, {"a": Wanted(frozenset({"x"})), "b": Wanted(frozenset({"x"}), is_list=True)}, "f") == (
        "f: b: names the parameter {y}; it may use {x}",
    )
