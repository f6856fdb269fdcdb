"""Files that are written whole or not at all, texts that are read within limits, and locks."""

import errno
import os
import re
import shutil
import stat
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from secrets import token_hex

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
OUTPUT_AND_ERRORS = (1, 2)  # file descriptors
# Of Windows: there is an object of this name already, and one of another user.
ALREADY_EXISTS, ACCESS_DENIED = 183, 5


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


@dataclass(frozen=True)
class FolderLock:
    """An attempt to lock a folder for this process alone.

    The system ends the lock when it is closed, also where the process is killed, so that no lock
    is ever stale. The folder gets no file for it. Windows has no locks of folders: there it is an
    object of the system whose name is made of the folder's, and which one may create at a time.

    Attributes:
        held: Whether the lock is held; None where the file system knows no locks of folders.
        handle: What is open: a descriptor of the folder, or of Windows' object; None if nothing is.
    """

    held: bool | None
    handle: int | None

    @classmethod
    def try_on(cls, folder: Path) -> "FolderLock":
        """Try to lock a folder, without waiting.

        Raises:
            OSError: The folder cannot be opened, where folders are.
        """
        if sys.platform == "win32":
            import ctypes

            place = os.path.normcase(os.path.realpath(folder))
            name = "Global\\edtk-" + sha256(place.encode("utf-8", "surrogatepass")).hexdigest()
            kernel = ctypes.WinDLL("kernel32", use_last_error=True)
            kernel.CreateMutexW.restype = ctypes.c_void_p
            handle = kernel.CreateMutexW(None, False, name)
            error = ctypes.get_last_error()
            if not handle:
                return cls(False if error == ACCESS_DENIED else None, None)
            return cls(error != ALREADY_EXISTS, handle)
        import fcntl

        descriptor = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return cls(False, descriptor)
        except OSError:  # some network file systems lock files alone
            return cls(None, descriptor)
        return cls(True, descriptor)

    def close(self) -> None:
        """End the lock."""
        if self.handle is None:
            return
        if sys.platform == "win32":
            import ctypes

            ctypes.WinDLL("kernel32").CloseHandle(ctypes.c_void_p(self.handle))
        else:
            os.close(self.handle)


STANDARD_OUTPUT = Path("-")
# New files are first written in a folder of such a name beside them.
TEMPORARY = re.compile(r"\.edtk-[0-9a-f]{16}")
LONE_SURROGATE = re.compile("[\ud800-\udfff]")  # a byte of a file name that is not UTF-8

Content = str | bytes


def is_standard_output(path: Path | str | None) -> bool:
    """Whether a path is `-`, or another name of the file that standard output goes to."""
    if path is None:
        return False
    return Path(path) == STANDARD_OUTPUT or _is_open_as(Path(path), OUTPUT_AND_ERRORS[:1])


def require_writable(path: Path | str) -> None:
    """Check, before long work, that a file can be written.

    Raises:
        OSError: The path cannot be written; the error names it.
    """
    path = Path(path)
    if path == STANDARD_OUTPUT:
        return
    kind = _kind(path)
    if kind is None:
        target = Path(os.path.realpath(path))
        # Folders that are missing are made later, inside the nearest one that exists.
        folder = next(parent for parent in target.parents if parent.exists())
        if folder.is_dir() and os.access(folder, os.W_OK | os.X_OK):
            return
    elif stat.S_ISDIR(kind):
        raise OSError(errno.EISDIR, "is a folder; expected a file", str(path))
    elif not (stat.S_ISREG(kind) or _is_stream(path)):
        raise OSError(errno.EINVAL, "is neither a file nor a stream", str(path))
    elif os.access(path, os.W_OK):
        folder = Path(os.path.realpath(path)).parent
        if _is_stream(path) or os.access(folder, os.W_OK | os.X_OK):
            return
    raise OSError(errno.EACCES, "cannot be written there", str(path))


def write_text(path: Path | str, text: str) -> None:
    """Write a text file in UTF-8, see `write_files`.

    Raises:
        OSError: The path cannot be written; the error names it.
    """
    write_files({path: text})


def write_files(contents: Mapping[Path | str, Content] | Mapping[Path, Content]) -> None:
    """Write files whole, and either all of them or, as far as a file system can promise it, none.

    All contents are on disk before the first file is replaced by its new version. Symbolic links
    are followed. A file that exists keeps its permissions. Standard output (`-`), devices and pipes
    are written as streams, and never replaced.

    Args:
        contents: Text or bytes by path; missing folders are made.

    Raises:
        OSError: A file cannot be written; the error names it.
    """
    encoded = {Path(path): _encoded(content) for path, content in contents.items()}
    for path in encoded:
        require_writable(path)
    with ExitStack() as stack:
        places: dict[Path, Path] = {}
        written: list[tuple[Path, Path, Path]] = []
        for path in (path for path in encoded if not _is_stream(path)):
            with _naming(path):
                target = Path(os.path.realpath(path))
                if target.parent not in places:
                    places[target.parent] = stack.enter_context(_temporary_folder(target.parent))
                temporary = places[target.parent] / str(len(written))
                _write_like(temporary, target, encoded[path])
                written.append((path, temporary, target))
        for path in (path for path in encoded if _is_stream(path)):
            with _naming(path):
                _write_stream(path, encoded[path])
        for path, temporary, target in written:
            with _naming(path):
                temporary.replace(target)


def _encoded(content: Content) -> bytes:
    """The bytes of a content; what is left of a file name that is no text is shown as unknown."""
    if isinstance(content, bytes):
        return content
    return LONE_SURROGATE.sub("\ufffd", content).encode("utf-8")


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Name the file that was asked for in errors about it, and not a temporary one or nothing."""
    try:
        yield
    except OSError as error:
        shown = "standard output" if path == STANDARD_OUTPUT else str(path)
        raise OSError(error.errno, error.strerror or str(error), shown) from error


def _kind(path: Path) -> int | None:
    """The mode of the file that a path leads to; None if there is no such file.

    Raises:
        OSError: The path leads nowhere, as a link to itself.
    """
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None


def _is_stream(path: Path) -> bool:
    """Whether a path has to be written as a stream.

    Besides devices and pipes that is the file that this program's own output goes to: whatever is
    printed after a replacement of that file would be lost.
    """
    if path == STANDARD_OUTPUT:
        return True
    kind = _kind(path)
    if kind is None:
        return False
    return stat.S_ISCHR(kind) or stat.S_ISFIFO(kind) or _is_open_as(path, OUTPUT_AND_ERRORS)


def _is_open_as(path: Path, descriptors: tuple[int, ...]) -> bool:
    """Whether a path leads to the file that is open under one of these descriptors."""
    for descriptor in descriptors:
        with suppress(OSError):  # there is no such path, or that descriptor is closed
            if os.path.samestat(path.stat(), os.fstat(descriptor)):
                return True
    return False


def _write_stream(path: Path, content: bytes) -> None:
    """Write to standard output, a device or a pipe."""
    if is_standard_output(path):
        if sys.stdout is None:  # closed by who started the program
            raise OSError(errno.EBADF, "is closed")
        sys.stdout.flush()
        binary = getattr(sys.stdout, "buffer", None)
        if binary is None:  # a notebook's output takes text only
            sys.stdout.write(content.decode("utf-8", "replace"))
        else:
            binary.write(content)
        sys.stdout.flush()
        return
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_APPEND), "wb") as file:
        file.write(content)


def _write_like(temporary: Path, target: Path, content: bytes) -> None:
    """Write a file that is to replace a target, with the permissions of the target or new ones."""
    with temporary.open("xb") as file:
        kind = _kind(target)
        if kind is not None:
            temporary.chmod(stat.S_IMODE(kind))
        file.write(content)


@contextmanager
def _temporary_folder(folder: Path) -> Iterator[Path]:
    """A folder inside another one, hence on its file system, where renaming is atomic.

    It is locked as long as it is in use, and so tells it is no rest of a process that was killed.
    """
    with made_folder(folder):
        sweep(folder)
        temporary, lock = _locked_folder(folder)
        try:
            yield temporary
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
            lock.close()


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder and those above it, and remove at the end those of them that are still empty.

    Raises:
        OSError: A folder cannot be made; the error names it.
    """
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for made in missing:
            with suppress(OSError):  # it holds files
                made.rmdir()


def _locked_folder(folder: Path) -> tuple[Path, FolderLock]:
    """A new temporary folder, and the lock on it."""
    while True:
        temporary = folder / f".edtk-{token_hex(8)}"
        temporary.mkdir()
        # Another process may sweep the folder just before it is locked.
        with suppress(FileNotFoundError):
            lock = FolderLock.try_on(temporary)
            if lock.held is not False and temporary.exists():
                return temporary, lock
            lock.close()


def sweep(folder: Path) -> None:
    """Remove what processes that were killed while they wrote have left in a folder."""
    with suppress(OSError):  # it cannot be listed, or another process sweeps it too
        for path in list(folder.iterdir()):
            if TEMPORARY.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
                lock = FolderLock.try_on(path)
                if lock.held:
                    shutil.rmtree(path, ignore_errors=True)
                lock.close()
