import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.recruitment import PARAMETERS, Ending, Recruit, RecruitmentError, Service, parse_recruit, way_back
from webapp.study.sections import Recruitment, ReturnPath

PROLIFIC = {
    "PROLIFIC_PID": "0123456789abcdef01234567",
    "STUDY_ID": "fedcba987654321001234567",
    "SESSION_ID": "session12345",
}
EXAMPLES: dict[Service, dict[str, str]] = {
    "prolific": PROLIFIC,
    "sona": {"id": "A77"},
    "label": {"label": "room-2_b.1"},
}


def recruitment(service: Service, **paths: ReturnPath) -> Recruitment:
    return Recruitment(service=service, **paths)


def test_a_link_of_prolific_names_person_study_and_session() -> None:
    assert parse_recruit(recruitment("prolific"), PROLIFIC) == Recruit("prolific", *PROLIFIC.values())


@pytest.mark.parametrize("service", ["sona", "label"])
def test_other_links_name_the_person_alone(service: Service) -> None:
    (value,) = EXAMPLES[service].values()
    assert parse_recruit(recruitment(service), EXAMPLES[service]) == Recruit(service, value, None, None)


@pytest.mark.parametrize("service", EXAMPLES)
def test_whoever_comes_without_any_of_the_parameters_came_alone(service: Service) -> None:
    assert parse_recruit(recruitment(service), {}) is None
    others = {name: value for other, query in EXAMPLES.items() if other != service for name, value in query.items()}
    assert parse_recruit(recruitment(service), {**others, "lang": "ja"}) is None


@pytest.mark.parametrize("service", EXAMPLES)
def test_other_parameters_and_blanks_around_values_change_nothing(service: Service) -> None:
    query = {name: f" {value} " for name, value in EXAMPLES[service].items()}
    plain = parse_recruit(recruitment(service), EXAMPLES[service])
    assert parse_recruit(recruitment(service), {**query, "lang": "en", "utm": "x"}) == plain


@pytest.mark.parametrize("missing", PROLIFIC)
def test_a_link_that_lacks_a_parameter_is_refused_by_its_name(missing: str) -> None:
    query = {name: value for name, value in PROLIFIC.items() if name != missing}
    with pytest.raises(RecruitmentError) as error:
        parse_recruit(recruitment("prolific"), query)
    assert (error.value.name, error.value.value) == (missing, "")


@pytest.mark.parametrize(
    ("service", "name", "value"),
    [
        ("prolific", "PROLIFIC_PID", "{{%PROLIFIC_PID%}}"),
        ("prolific", "PROLIFIC_PID", "0123456789abcdef0123456"),
        ("prolific", "PROLIFIC_PID", "0123456789ABCDEF01234567"),
        ("prolific", "PROLIFIC_PID", "0123456789abcdef01234567\n"[:24] + "8"),
        ("prolific", "STUDY_ID", "g" * 24),
        ("prolific", "SESSION_ID", "short"),
        ("prolific", "SESSION_ID", "x" * 65),
        ("sona", "id", "%SURVEY_CODE%"),
        ("sona", "id", "7 7"),
        ("sona", "id", "七"),
        ("label", "label", "a/b"),
        ("label", "label", "<script>"),
        ("label", "label", "=1+1"),
        ("label", "label", "x" * 65),
    ],
)
def test_a_value_that_cannot_be_is_refused_with_its_name_and_the_wish(service: Service, name: str, value: str) -> None:
    with pytest.raises(RecruitmentError) as error:
        parse_recruit(recruitment(service), EXAMPLES[service] | {name: value})
    (parameter,) = [parameter for parameter in PARAMETERS[service] if parameter.name == name]
    assert (error.value.name, error.value.value, error.value.wish) == (name, value[:64], parameter.wish)
    assert parameter.wish in str(error.value)


@given(value=st.text(max_size=100))
def test_no_id_holds_anything_but_letters_digits_and_three_signs(value: str) -> None:
    for service in ("sona", "label"):
        (name,) = EXAMPLES[service]
        with contextlib.suppress(RecruitmentError):
            recruit = parse_recruit(recruitment(service), {name: value})
            assert recruit is not None
            assert recruit.external_id == value.strip()
            assert all(sign.isascii() and (sign.isalnum() or sign in "._-") for sign in recruit.external_id)


def test_every_ending_has_its_own_way_back() -> None:
    endings: tuple[Ending, ...] = ("completed", "screened_out", "no_consent", "withdrawn")
    paths = {ending: ReturnPath(code=f"CODE-{ending}") for ending in endings}
    for ending in endings:
        assert way_back(recruitment("label", **paths), ending, None) == ReturnPath(code=f"CODE-{ending}")


def test_code_and_id_are_filled_into_the_link() -> None:
    path = ReturnPath(code="CODE1", link="https://example.org/done?cc={code}&who={id}")
    filled = way_back(recruitment("sona", completed=path), "completed", Recruit("sona", "A77"))
    assert filled == ReturnPath(code="CODE1", link="https://example.org/done?cc=CODE1&who=A77")


def test_a_link_that_needs_an_id_is_left_out_for_somebody_who_has_none() -> None:
    path = ReturnPath(code="CODE1", link="https://example.org/done?who={id}")
    assert way_back(recruitment("sona", withdrawn=path), "withdrawn", None) == ReturnPath(code="CODE1")


def test_a_link_that_needs_no_id_is_there_for_everybody() -> None:
    path = ReturnPath(code="CODE1", link="https://example.org/done?cc={code}")
    for recruit in (None, Recruit("label", "room-2")):
        assert way_back(recruitment("label", no_consent=path), "no_consent", recruit).link == (
            "https://example.org/done?cc=CODE1"
        )


def test_without_code_and_link_there_is_no_way_back() -> None:
    assert way_back(recruitment("label"), "completed", Recruit("label", "a")) == ReturnPath()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("code", "a b"),
        ("code", "ab"),
        ("link", "http://example.org"),
        ("link", "javascript:x"),
        ("link", "https://a b"),
    ],
)
def test_a_code_or_link_that_nobody_could_follow_is_refused(name: str, value: str) -> None:
    with pytest.raises(ValueError, match="use"):
        ReturnPath(**{name: value})
