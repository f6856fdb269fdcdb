"""Every value of a tree is checked, with its key."""

from edtk.system.parsing import check_leaves


def test_values_come_with_their_keys():
    """Tables are left by their keys and lists by their numbers; empty ones have no values."""
    found = []
    tree = {"a": [1, {"b": None}], "c": [], "d": {}, "e": "text"}
    check_leaves(tree, lambda value, key: found.append((key, value)))
    assert found == [("a.0", 1), ("a.1.b", None), ("e", "text")]


def test_a_list_and_a_single_value():
    """The whole may be a list, or a value without a key."""
    found = []
    check_leaves([[2]], lambda value, key: found.append((key, value)))
    check_leaves(3, lambda value, key: found.append((key, value)))
    assert found == [("0.0", 2), ("", 3)]
