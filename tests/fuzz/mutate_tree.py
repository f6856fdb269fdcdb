"""Mutations of the keys and values of a TOML or JSON file, which stays well formed."""

import json
import tomllib
from random import Random
from typing import Any

from tests.fuzz import nasty

Place = tuple[Any, Any]  # a table or a list, and the key or the index of one of its entries
MARK = "raw number "  # begins a text that is written as a number, without quotes
MOST_ENTRIES = 20_000  # of a tree that is changed once more; each change may multiply it by 100


def places(tree: Any) -> list[Place]:
    """Every entry of every table and list."""
    found: list[Place] = []
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in entries:
        found.append((tree, key))
        if isinstance(value, dict | list):
            found += places(value)
    return found


def other_value(old: Any, rng: Random) -> Any:
    """A value in place of another one: most often of the same type."""
    way = rng.random()
    is_number = isinstance(old, int | float) and not isinstance(old, bool)
    if way < 0.55:
        if is_number:
            return MARK + nasty.number(rng)
        if isinstance(old, str):
            return nasty.text(rng) if rng.random() < 0.7 else nasty.path(rng)
    if way < 0.65 and is_number:
        return -old if rng.random() < 0.5 else old * rng.choice((1e3, 1e-3, 57.29577951, 1e-9, 1e9))
    return rng.choice(
        (
            None,
            True,
            False,
            0,
            1,
            "",
            [],
            {},
            [old],
            [[old]],
            [old] * 3,
            {"q1": old},
            {"": old},
            {"k": old},
            str(old)[:10_000],
            MARK + nasty.number(rng),
            nasty.text(rng),
            _deep(rng.choice((20, 200)), rng),
        )
    )


def change(tree: Any, rng: Random) -> None:
    """Change one entry of a tree, in place."""
    every = places(tree)
    if not 0 < len(every) <= MOST_ENTRIES:
        return
    parent, key = rng.choice(every)
    value = parent[key]
    way = rng.random()
    if way < 0.5:
        parent[key] = other_value(value, rng)
    elif way < 0.65:
        del parent[key]
    elif isinstance(parent, dict) and way < 0.8:
        del parent[key]
        parent[_other_key(str(key), every, rng)] = value
    elif isinstance(parent, dict) and way < 0.9:
        parent[_other_key(str(key), every, rng)] = json.loads(json.dumps(value))
    elif isinstance(parent, list):
        _change_list(parent, rng)
    else:
        other_parent, other_key = rng.choice(every)
        parent[key] = (
            json.loads(json.dumps(other_parent.get(other_key, 1)))
            if isinstance(other_parent, dict)
            else 1
        )


def mutate_json(content: bytes, rng: Random) -> bytes:
    """A JSON file of which some entries are others."""
    tree = json.loads(content)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        change(tree, rng)
    return _unmarked(json.dumps(tree, indent=1), json.dumps).encode("utf-8", "surrogateescape")


def mutate_toml(content: bytes, rng: Random) -> bytes:
    """A TOML file of which some entries are others."""
    tree = tomllib.loads(content.decode())
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        change(tree, rng)
    lines = [f"{_text(str(key))} = {_toml(value)}" for key, value in tree.items()]
    return ("\n".join(lines) + "\n").encode("utf-8", "surrogateescape")


def _toml(value: Any) -> str:
    """A value as TOML, tables in one line; None is left to fail."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_text(str(k))} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value.removeprefix(MARK) if value.startswith(MARK) else _text(value)
    return repr(value)


def _text(words: str) -> str:
    """A text in quotes, escaped as JSON has it, which TOML reads too."""
    return json.dumps(words, ensure_ascii=False).replace("\x7f", "\\u007f")


def _unmarked(words: str, quote: Any) -> str:
    """JSON whose marked texts have become numbers."""
    for number in nasty.NUMBERS:
        words = words.replace(quote(MARK + number), number)
    return words


def _other_key(key: str, every: list[Place], rng: Random) -> str:
    """A key that is misspelt, nasty, or another one of the tree."""
    others = [str(other) for parent, other in every if isinstance(parent, dict)]
    return rng.choice((key + "s", key[:-1], key.upper(), f" {key}", nasty.text(rng), *others))


def _change_list(entries: list[Any], rng: Random) -> None:
    """Another number or order of entries."""
    way = rng.randrange(4)
    if way == 0:
        entries.append(json.loads(json.dumps(rng.choice(entries))))
    elif way == 1:
        entries.reverse()
    elif way == 2:
        entries.clear()
    else:
        entries.extend(entries * rng.choice((1, 100)))


def _deep(depth: int, rng: Random) -> Any:
    """Lists or tables inside each other."""
    found: Any = 1
    for _ in range(depth):
        found = [found] if rng.random() < 0.5 else {"a": found}
    return found
