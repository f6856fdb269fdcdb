"""Files that are either written whole or not at all."""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def require_writable(path: Path) -> None:
    """Check, before long work, that `path` can be written.

    Raises:
        OSError: The path cannot be written; the error names it.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "exists and is not a regular file", str(path))
    # Folders that are missing are made later, inside the nearest one that exists.
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise OSError(errno.EACCES, "cannot be written there", str(path))


@contextmanager
def atomic_path(path: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside `path`, and rename it when the block ends without an error.

    Raises:
        OSError: The path cannot be written; the error names it.
    """
    path = Path(path)
    require_writable(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # In the same folder, so that the renaming stays on one file system, where it is atomic.
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)  # a temporary file can be read by its owner only
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path | str, text: str) -> None:
    """Write a text file atomically, in UTF-8.

    Raises:
        OSError: The path cannot be written; the error names it.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
