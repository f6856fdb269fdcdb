"""Files are written whole or not at all, whatever happens; streams are never replaced."""

import errno
import os
import re
import stat
import threading
from pathlib import Path

import pytest
from forked import fill_disk, forked, kill_at

from edtk.system.files import (
    TEMPORARY,
    FolderLock,
    require_writable,
    sweep,
    write_files,
    write_text,
)

ROOT = Path(__file__).parents[2]
LEFT = ".edtk-0123456789abcdef"  # of a process that was killed
MOMENTS = range(1, 26)


def names(folder: Path) -> list[str]:
    """Names of all files below a folder."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_a_write_replaces_the_file_and_makes_its_folder(tmp_path: Path) -> None:
    """Folders are made as needed, and the second write is what stays."""
    path = tmp_path / "a/b/report.md"
    write_text(path, "one")
    write_text(path, "two")
    assert path.read_text() == "two"
    assert names(tmp_path) == ["a", "a/b", "a/b/report.md"]


@pytest.mark.parametrize(
    "bad",
    [
        pytest.param("/dev/full", marks=pytest.mark.unix),
        "file/x.csv",
        "folder",
        pytest.param("x" * 300, marks=pytest.mark.unix),
        pytest.param("new/sub/" + "x" * 300, marks=pytest.mark.unix),
    ],
)
def test_of_several_files_all_are_written_or_none(tmp_path: Path, bad: str) -> None:
    """Where one cannot be written the others stay as they were, and no folder is left."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("old")
    before = names(tmp_path)
    with pytest.raises(OSError, match=re.escape(repr(str(tmp_path / bad)))) as caught:
        write_files({tmp_path / "file": "new", tmp_path / "more/b": "b", tmp_path / bad: "c"})
    assert caught.value.filename == str(tmp_path / bad)
    assert (tmp_path / "file").read_text() == "old"
    assert names(tmp_path) == before


def test_an_interrupted_write_leaves_the_old_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C before the first file is replaced leaves nothing new."""
    write_text(tmp_path / "a", "old")

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_files({tmp_path / "a": "new", tmp_path / "b": "new"})
    assert names(tmp_path) == ["a"]
    assert (tmp_path / "a").read_text() == "old"


@pytest.mark.unix
def test_links_are_followed(tmp_path: Path) -> None:
    """The file that a link leads to is written, beside itself, also where it does not exist yet."""
    (tmp_path / "far").mkdir()
    (tmp_path / "near").mkdir()
    link = tmp_path / "near" / "plan.csv"
    link.symlink_to("../far/plan.csv")
    for text in ("one", "two"):
        require_writable(link)
        write_text(link, text)
        assert (tmp_path / "far" / "plan.csv").read_text() == text
    assert names(tmp_path) == ["far", "far/plan.csv", "near", "near/plan.csv"]
    assert link.is_symlink()
    loop = tmp_path / "loop"
    loop.symlink_to("loop")
    for write in (require_writable, lambda path: write_text(path, "")):
        with pytest.raises(OSError, match="loop"):
            write(loop)


@pytest.mark.unix
def test_permissions(tmp_path: Path) -> None:
    """A new file has those that the umask leaves, and a file that exists keeps its own."""
    before = os.umask(0o077)
    try:
        write_text(tmp_path / "private", "new")
        os.umask(0o022)
        write_text(tmp_path / "public", "new")
        (tmp_path / "group").write_text("old")
        (tmp_path / "group").chmod(0o660)
        write_text(tmp_path / "group", "new")
    finally:
        os.umask(before)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert modes == {"private": 0o600, "public": 0o644, "group": 0o660}


@pytest.mark.unix
def test_streams(tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    """A pipe, a device, and standard output under any name get the bytes, and stay as they are."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write_files({pipe: "piped", tmp_path / "file": "kept"})
    reader.join()
    assert read == ["piped"]
    assert (tmp_path / "file").read_text() == "kept"
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    link = tmp_path / "link"
    link.symlink_to("/dev/null")
    for path in ("/dev/null", link):
        require_writable(path)
        write_text(path, "lost")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    assert link.is_symlink()
    for path in ("-", "/dev/stdout", "/dev/fd/1"):
        require_writable(path)
        write_text(path, f"{path} ä\n")
    assert capfdbinary.readouterr().out.decode() == "- ä\n/dev/stdout ä\n/dev/fd/1 ä\n"


@pytest.mark.unix
def test_output_that_goes_to_a_file_is_not_replaced(tmp_path: Path) -> None:
    """What is printed after the file was written lands in the same file."""
    log = tmp_path / "log"

    def print_to_file() -> None:
        descriptor = os.open(log, os.O_WRONLY | os.O_CREAT)
        os.dup2(descriptor, 2)
        write_text(log, "first\n")
        os.write(2, b"second\n")

    assert forked(print_to_file) == 0
    assert log.read_text() in ("first\nsecond\n", "second\n")


@pytest.mark.unix
@pytest.mark.parametrize(
    ("path", "code"),
    [("folder", errno.EISDIR), ("file/x", errno.EACCES), ("socket", errno.EINVAL)],
)
def test_what_cannot_be_written_is_told_before_the_work(
    tmp_path: Path, path: str, code: int
) -> None:
    """The error names the path."""
    import socket

    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "socket"))
        with pytest.raises(OSError, match=path) as caught:
            require_writable(tmp_path / path)
    assert caught.value.errno == code


@pytest.mark.unix
def test_names_that_are_no_text(tmp_path: Path) -> None:
    """A file may have such a name, and a report that shows the name is written all the same."""
    path = tmp_path / os.fsdecode(b"sheet\xff.csv")
    write_text(path, f"data of {path.name}")
    assert path.read_text() == "data of sheet\ufffd.csv"


def test_leftovers_are_swept_and_living_ones_are_not(tmp_path: Path) -> None:
    """The folder of a process that was killed goes at the next write; one in use stays."""
    for number in range(3):
        folder = tmp_path / f".edtk-{number:016x}"
        folder.mkdir()
        (folder / "0").write_text("half")
    (tmp_path / ".edtk-mine").mkdir()
    (tmp_path / f"{LEFT}").write_text("a file of somebody")
    lock = FolderLock.try_on(tmp_path / f".edtk-{1:016x}")
    write_text(tmp_path / "plan.csv", "new")
    expected = [f".edtk-{1:016x}", f".edtk-{1:016x}/0", ".edtk-mine", LEFT, "plan.csv"]
    assert names(tmp_path) == sorted(expected)
    lock.close()
    sweep(tmp_path)
    assert names(tmp_path) == sorted([".edtk-mine", LEFT, "plan.csv"])
    assert TEMPORARY.fullmatch(LEFT)


@pytest.mark.unix
@pytest.mark.parametrize("moment", MOMENTS)
def test_killed_at_any_moment(tmp_path: Path, moment: int) -> None:
    """Each file is whole, the old or the new one, and the next write leaves nothing of the kill."""
    paths = [tmp_path / name for name in ("a", "b", "c", "sub/d", "sub/e")]
    write_files(dict.fromkeys(paths, "old"))

    def write() -> None:
        kill_at(moment)
        write_files(dict.fromkeys(paths, "new"))

    assert forked(write) == -9
    assert {path.read_text() for path in paths} <= {"old", "new"}
    write_files(dict.fromkeys(paths, "newer"))
    assert {path.read_text() for path in paths} == {"newer"}
    assert names(tmp_path) == ["a", "b", "c", "sub", "sub/d", "sub/e"]


@pytest.mark.unix
@pytest.mark.parametrize("left", [0, 1, 4096, 99_999])
def test_full_disk(tmp_path: Path, capfd: pytest.CaptureFixture[str], left: int) -> None:
    """The error names the file that did not fit; all files stay as they were, and nothing else."""
    write_files({tmp_path / "a": "old", tmp_path / "b": "old"})

    def write() -> None:
        fill_disk(left)
        write_files({tmp_path / "a": "", tmp_path / "b": "x" * 100_000})

    assert forked(write) == 1
    last = capfd.readouterr().err.splitlines()[-1]
    assert last.startswith("OSError: [Errno 27]")
    assert last.endswith(f"'{tmp_path / 'b'}'")
    assert names(tmp_path) == ["a", "b"]
    assert (tmp_path / "a").read_text() == "old"


# Ways to write a file of a user that this room does not know of.
OTHER_WAYS = re.compile(
    r"\.write_(text|bytes)\(|\bopen\([^)]*[\"'][wxa]b?[\"']"
    r"|savefig\((?!buffer)|to_netcdf\((?!engine)"
)


@pytest.mark.slow
@pytest.mark.parametrize("room", ["edtk", "paper_figures"])
def test_every_file_is_written_here(room: str) -> None:
    """No module of the toolkit has a way of its own to write a file."""
    for path in (ROOT / room).rglob("*.py"):
        if path.name != "files.py":
            assert not OTHER_WAYS.search(path.read_text()), path
