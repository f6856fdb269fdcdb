"""XML of strangers: elements and attributes, or one line."""

import pytest

from edtk.system import parsing as module
from edtk.system.errors import UserError
from edtk.system.parsing import parse_xml

BOMB = '<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;">]><a>&c;</a>'


def refusal(text):
    with pytest.raises(UserError) as caught:
        parse_xml(text, "file.xml")
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert message.startswith("file.xml: ")
    return message


def test_elements_and_attributes_are_read_in_order():
    """Tags, attributes and lines come back; prefixes stay, declared or not, and text goes."""
    root = parse_xml('<a x="1">text\n<b/><c:d y="&lt;2"><b/></c:d></a>')
    assert (root.tag, root.attributes) == ("a", {"x": "1"})
    assert [child.tag for child in root.children] == ["b", "c:d"]
    assert root.first("c:d").attributes == {"y": "<2"}
    assert root.first("b").line == 2
    assert root.first("e") is None
    assert [element.tag for element in root.everything()] == ["a", "b", "c:d", "b"]


@pytest.mark.parametrize("text", [BOMB, '<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>'])
def test_a_document_type_is_refused(text):
    """No entity is ever read, neither one that grows nor one that names a file."""
    assert "has a DOCTYPE (at line 1)" in refusal(text)


@pytest.mark.parametrize(
    "text", ["", "hello", "<a>", "<a></b>", "<a/><b/>", '<a x=">', "<a>&b;</a>"]
)
def test_text_that_is_no_xml_is_one_line_with_the_place(text):
    """Whatever is wrong, the message says in which line."""
    assert "not valid XML: " in refusal(text)
    assert "at line 1" in refusal(text)


def test_half_a_character_is_one_line():
    """A lone surrogate cannot be written in UTF-8."""
    assert "no text in UTF-8" in refusal("<a x='\ud800'/>")


def test_depth_and_number_are_bounded(monkeypatch):
    """A file that is nested too deeply, or has too many elements, is refused while it is read."""
    assert "nested more than 100 deep" in refusal("<a>" * 200)
    monkeypatch.setattr(module, "MOST_ELEMENTS", 10)
    assert "has more than 10 elements" in refusal("<a>" + 20 * "<b/>" + "</a>")
