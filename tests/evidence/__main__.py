"""Write docs/evidence.md from the results: `python -m tests.evidence`."""

from tests.evidence.page import PATH, render
from tests.evidence.results import read_results

PATH.write_text(render(read_results()), encoding="utf-8")
