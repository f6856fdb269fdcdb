"""Files of users are read to a limit, as plain text, and every failure is one line."""

import bz2
import gzip
import io
import lzma
import os
import socket
import threading
import zipfile
from pathlib import Path

import pytest

from edtk.system.errors import UserError
from edtk.system.files import CHUNK, read_text

GERMAN = "Länge\n1,5\n"


def zipped(content: bytes) -> bytes:
    """A zip archive of one file."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("plan.csv", content)
    return archive.getvalue()


def refusal(path: Path | str, **options: float) -> str:
    """The line that refuses a file."""
    with pytest.raises(UserError) as caught:
        read_text(path, **options)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path))
    return caught.value.message


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_text_is_read_whatever_its_name_says(tmp_path: Path, encoding: str) -> None:
    """A byte-order mark is left out, and a name of a compressed file means nothing."""
    path = tmp_path / "plan.csv.gz"
    path.write_bytes(GERMAN.encode(encoding))
    assert read_text(path) == GERMAN


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16_is_read_where_it_is_asked_for(tmp_path: Path, encoding: str) -> None:
    """Spreadsheets write it, with a byte-order mark."""
    path = tmp_path / "sheet.csv"
    mark = "" if encoding == "utf-16" else "\ufeff"
    path.write_bytes((mark + GERMAN).encode(encoding))
    assert read_text(path, utf_16=True) == GERMAN
    assert refusal(path) == "line 1 is no text in UTF-8"


@pytest.mark.parametrize("compress", [gzip.compress, zipped, bz2.compress, lzma.compress])
def test_a_compressed_file_is_refused(tmp_path: Path, compress: "object") -> None:
    """A few kilobytes of zeros would fill the memory; the name of the file does not matter."""
    path = tmp_path / "plan.csv"
    path.write_bytes(compress(bytes(100)))  # type: ignore[operator]
    assert "is compressed" in refusal(path)


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/full", "/dev/null"])
def test_a_device_is_refused(device: str) -> None:
    """Some devices never end."""
    if not Path(device).exists():
        pytest.skip("this system has no such device")
    assert refusal(device) == "is a device; expected a file or a pipe"


@pytest.mark.unix
def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    """An absent file, a folder, a socket, a name that no file can have, bytes that are no text."""
    assert refusal(tmp_path / "absent") == "no such file"
    assert refusal(tmp_path) == "is a folder; expected a file"
    with pytest.raises(UserError, match="File name too long"):
        read_text(tmp_path / ("x" * 300))
    (tmp_path / "plan.csv").write_bytes(b"a,b\n1,\xff\n")
    assert refusal(tmp_path / "plan.csv") == "line 2 is no text in UTF-8"
    with pytest.raises(UserError, match="null character"):
        read_text("a\0b")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "s"))
        assert "is a device" in refusal(tmp_path / "s")


def test_size_is_limited(tmp_path: Path) -> None:
    """A file of the limit is read, and one of a byte more is not, whole or as a sparse terabyte."""
    path = tmp_path / "plan.csv"
    path.write_bytes(b"x" * 1000)
    assert len(read_text(path, most_mb=0.001)) == 1000
    os.truncate(path, 1001)
    assert refusal(path, most_mb=0.001) == "is larger than 0.001 MB, the most that is read"
    os.truncate(path, 10**12)
    assert "is larger than 10 MB" in refusal(path)


@pytest.mark.unix
def test_a_pipe_is_read_to_its_end(tmp_path: Path) -> None:
    """Pieces of a pipe are put together, and a pipe without end is read to the limit."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    text = "1,2\n" * CHUNK
    for most_mb in (10.0, 1.0):
        writer = threading.Thread(target=_write_to_pipe, args=(path, text), daemon=True)
        writer.start()
        if most_mb == 10.0:
            assert read_text(path, most_mb) == text
        else:
            assert "is larger than 1 MB" in refusal(path, most_mb=most_mb)
        writer.join()


def _write_to_pipe(path: Path, text: str) -> None:
    """Write until the reader has read enough."""
    try:
        with path.open("w") as file:
            file.write(text)
    except BrokenPipeError:
        pass
