from webapp.bots.page_reading import read_page

PAGE = """
<body data-page="rating">
<form action="/elsewhere"></form>
<form method="post" action="/study/3">
<input type="hidden" name="nonce" value="a&amp;b"><input type="hidden" name="events" value="">
<label><input type="radio" name="rating-x" value="1"><input type="radio" name="rating-x" value="2" checked></label>
<textarea name="answer-y"></textarea><input type="text" name="answer-z">
<input type="checkbox" name="refuse-y" value="yes">
<button name="action" value="left"><span>Left</span></button><button type="submit">Go on</button>
</form>
<input name="outside" value="1">
</body>
"""


def test_a_form_is_read_with_all_its_controls_and_nothing_from_outside() -> None:
    page = read_page("/study/3", PAGE)
    form = page.form_to("/study/3")
    assert page.kind == "rating"
    assert form is not None
    assert form.hidden == {"nonce": "a&b", "events": ""}
    assert form.choices == {"rating-x": ["1", "2"]}
    assert form.texts == ["answer-y", "answer-z"]
    assert form.boxes == {"refuse-y": "yes"}
    assert form.buttons == [("action", "left")]


def test_a_page_without_such_a_form_has_none() -> None:
    assert read_page("/done", "<body><p>Thanks").form_to("/study/3") is None
    assert read_page("/done", "<body><p>Thanks").kind == ""
