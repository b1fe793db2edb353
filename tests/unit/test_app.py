import json
import logging
import sys

from webapp.views.logs import JsonFormatter


def test_a_log_line_is_one_json_object_with_its_traceback_inside() -> None:
    try:
        dict[str, str]()["line one\nline two"]
    except KeyError:
        record = logging.LogRecord("webapp.views", logging.ERROR, __file__, 1, "%s\nfailed", ("page",), sys.exc_info())
    line = JsonFormatter().format(record)
    assert "\n" not in line
    found = json.loads(line)
    assert (found["level"], found["logger"], found["message"]) == ("ERROR", "webapp.views", "page\nfailed")
    assert "KeyError" in found["traceback"]
    assert found["time"].endswith("+00:00")
