"""The HTML file of a report, and what it lets a browser do."""

import re

from edtk.report.page import Page, paragraph


def test_a_page_forbids_its_browser_to_load_or_run_anything():
    """The policy stands before all that it is about; text of a file stays text."""
    html = Page("<script>a</script>", (paragraph("<img src=http://a>"),)).html()
    policy = re.search(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', html)
    assert policy is not None
    assert policy[1] == "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    assert policy.start() < html.index("<style>")
    assert "<script" not in html
    assert "<img" not in html
