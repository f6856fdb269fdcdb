"""Mutations of any file: of its bytes, its lines and its words, whatever it means."""

import re
from collections.abc import Callable
from random import Random

from tests.fuzz import nasty

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
BAD_BYTES = (
    b"\x00",
    b"\xff",
    b"\xfe\xff",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\x1a",
    b"\x1b[2J",
    b"\r",
)
MAGIC = (
    b"PK\x03\x04",
    b"\x1f\x8b\x08",
    b"\xfd7zXZ\x00",
    b"BZh9",
    b"\x89HDF\r\n\x1a\n",
    b"%PDF-1.4",
)
FACTORS = (-1.0, 10.0, 0.1, 1e3, 1e-3, 1e6, 1e-6, 57.29577951308232, 0.017453292519943295, 1e150)


def flip(content: bytes, rng: Random) -> bytes:
    """Another value of one byte."""
    if not content:
        return b"x"
    place = rng.randrange(len(content))
    return content[:place] + bytes([rng.randrange(256)]) + content[place + 1 :]


def flip_bits(content: bytes, rng: Random) -> bytes:
    """Some bits the other way round."""
    found = bytearray(content)
    for _ in range(rng.randrange(1, 20) if found else 0):
        found[rng.randrange(len(found))] ^= 1 << rng.randrange(8)
    return bytes(found)


def cut(content: bytes, rng: Random) -> bytes:
    """A piece is missing."""
    first, last = _slice(content, rng)
    return content[:first] + content[last:]


def insert(content: bytes, rng: Random) -> bytes:
    """Bytes that no text has, or random ones, stand somewhere."""
    place = rng.randrange(len(content) + 1)
    more = rng.choice((*BAD_BYTES, rng.randbytes(rng.randrange(1, 30))))
    return content[:place] + more + content[place:]


def duplicate(content: bytes, rng: Random) -> bytes:
    """A piece stands there twice, or many times."""
    first, last = _slice(content, rng)
    return content[:last] + content[first:last] * rng.choice((1, 1, 2, 50)) + content[last:]


def truncate(content: bytes, rng: Random) -> bytes:
    """The end is missing."""
    return content[: rng.randrange(len(content) + 1)]


def replace_all(content: bytes, rng: Random) -> bytes:
    """Something else altogether."""
    return rng.choice(
        (
            b"",
            b"\n",
            b" " * 1000,
            b"\x00" * 1000,
            rng.randbytes(500),
            b"[" * 5000,
            b"{" * 5000,
            b'{"a":' * 3000,
            b"a = " + b"[" * 5000,
            b"a." * 3000 + b"b = 1",
            b'"' + b"a" * 200_000,
            b"," * 100_000,
            b"a\n" * 50_000,
            rng.choice(MAGIC) + content,
        )
    )


def encode(content: bytes, rng: Random) -> bytes:
    """Another encoding, or other ends of lines."""
    words = content.decode("utf-8", "replace")
    unix = content.replace(b"\r\n", b"\n")
    return rng.choice(
        (
            b"\xef\xbb\xbf" + content,
            words.encode("utf-16"),
            words.encode("utf-16-le"),
            b"\xfe\xff" + words.encode("utf-16-be"),
            words.encode("utf-32"),
            words.replace("a", "ä").encode("latin-1", "replace"),
            unix.replace(b"\n", b"\r\n"),
            unix.replace(b"\n", b"\r"),
            unix.replace(b"\n", b"\n\n"),
            unix.replace(b"\n", "\u2028".encode()),
        )
    )


def replace_number(content: bytes, rng: Random) -> bytes:
    """A number is another one, or none."""
    return _replace(content, NUMBER, rng, lambda old: nasty.number(rng))


def scale_number(content: bytes, rng: Random) -> bytes:
    """A number is in another unit, or has the other sign."""
    return _replace(content, NUMBER, rng, lambda old: repr(float(old) * rng.choice(FACTORS)))


def replace_word(content: bytes, rng: Random) -> bytes:
    """A word is another text."""
    return _replace(content, WORD, rng, lambda old: nasty.text(rng))


def change_word(content: bytes, rng: Random) -> bytes:
    """A word is misspelt."""
    ways = (str.upper, str.title, lambda old: old + "s", lambda old: old[:-1], lambda old: old * 2)
    return _replace(content, WORD, rng, lambda old: rng.choice(ways)(old))


def change_lines(content: bytes, rng: Random) -> bytes:
    """A line is missing, there twice, elsewhere, or very long."""
    lines = content.split(b"\n")
    place = rng.randrange(len(lines))
    line = lines[place]
    way = rng.randrange(5)
    if way == 0:
        del lines[place]
    elif way == 1:
        lines.insert(rng.randrange(len(lines) + 1), line)
    elif way == 2:
        lines.insert(rng.randrange(len(lines)), lines.pop(place))
    elif way == 3:
        lines[place] = line * rng.choice((2, 100))
    else:
        rng.shuffle(lines)
    return b"\n".join(lines)


OF_BYTES = (flip, flip_bits, cut, insert, duplicate, truncate, replace_all)
OF_TEXT = (
    *(replace_number, replace_number, replace_number, scale_number, scale_number),
    *(replace_word, replace_word, change_word, change_lines, encode),
)


def _slice(content: bytes, rng: Random) -> tuple[int, int]:
    """Begin and end of a piece, most often a short one."""
    first = rng.randrange(len(content) + 1)
    longest = rng.choice((4, 40, len(content)))
    return first, min(len(content), first + rng.randrange(longest + 1))


def _replace(
    content: bytes, pattern: re.Pattern[str], rng: Random, other: Callable[[str], str]
) -> bytes:
    """One match of a pattern replaced by another text."""
    words = content.decode("utf-8", "surrogateescape")
    places = [match.span() for match in pattern.finditer(words)]
    if not places:
        return insert(content, rng)
    first, last = rng.choice(places)
    changed = words[:first] + other(words[first:last]) + words[last:]
    return changed.encode("utf-8", "surrogateescape")
