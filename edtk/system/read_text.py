"""The text of a file that a person names: the one way in which edtk reads such files."""

import errno
import os
import stat
from pathlib import Path

from edtk.system.errors import UserError

MOST_MB = 10.0  # of a file that people write; tables and certificates may be larger
CHUNK = 1 << 20  # bytes that are read at once from a pipe, whose size nobody knows
BYTE_ORDER_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
# First bytes of compressed files. They are refused: a few kilobytes can stand for gigabytes.
COMPRESSED = {
    b"\x1f\x8b": "gzip",
    b"PK\x03\x04": "zip",
    b"\xfd7zXZ\x00": "xz",
    b"BZh": "bzip2",
    b"\x28\xb5\x2f\xfd": "zstd",
}


def read_text(path: Path | str, most_mb: float = MOST_MB, utf_16: bool = False) -> str:
    """Read a text file, see `read_bytes` and `decode`.

    Args:
        path: A regular file or a pipe.
        most_mb: Limit on its size [MB].
        utf_16: Whether a byte-order mark of UTF-16 is understood, too.

    Raises:
        UserError: The file cannot be read, is too large, or is no text; names the file.
    """
    return decode(read_bytes(path, most_mb), path, utf_16)


def read_bytes(path: Path | str, most_mb: float = MOST_MB) -> bytes:
    """Read a regular file or a pipe, up to a size.

    Devices are refused: some never end, and would be read to the end of the memory.

    Args:
        path: The file.
        most_mb: Limit on its size [MB].

    Raises:
        UserError: There is no such file, it is no regular file and no pipe, or it is too large.
    """
    most = int(most_mb * 1e6)
    if "\0" in str(path):
        raise UserError("has a null character in its name", where=str(path).replace("\0", "\\0"))
    try:
        kind = Path(path).stat().st_mode
        if stat.S_ISDIR(kind):
            raise UserError("is a folder; expected a file", where=path)
        if not (stat.S_ISREG(kind) or stat.S_ISFIFO(kind)):
            raise UserError("is a device; expected a file or a pipe", where=path)
        with Path(path).open("rb") as file:
            content = _read(file.fileno(), most)
    except FileNotFoundError:
        raise UserError("no such file", where=path) from None
    except OSError as error:
        raise UserError(error.strerror or os.strerror(errno.EIO), where=path) from error
    if len(content) > most:
        raise UserError(f"is larger than {most_mb:g} MB, the most that is read", where=path)
    return content


def decode(content: bytes, path: Path | str, utf_16: bool = False) -> str:
    """The text of a file in UTF-8, with or without a byte-order mark.

    Args:
        content: The bytes of the file.
        path: The file, for messages.
        utf_16: Whether a byte-order mark of UTF-16 is understood, too.

    Raises:
        UserError: The content is compressed, or is no text in UTF-8.
    """
    for first, name in COMPRESSED.items():
        if content.startswith(first):
            raise UserError(f"is compressed ({name}); expected plain text", where=path)
    encoding = BYTE_ORDER_MARKS.get(content[:2], "utf-8-sig") if utf_16 else "utf-8-sig"
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        row = content.count(b"\n", 0, error.start) + 1
        name = "UTF-16" if encoding == "utf-16" else "UTF-8"
        raise UserError(f"line {row} is no text in {name}", where=path) from error


def _read(descriptor: int, most: int) -> bytes:
    """All bytes of an open file, or one more than `most` of them."""
    parts = []
    left = most + 1
    while left > 0:
        part = os.read(descriptor, min(CHUNK, left))
        if not part:
            break
        parts.append(part)
        left -= len(part)
    return b"".join(parts)
