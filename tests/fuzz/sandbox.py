"""A folder in which cases are run, and which is as before after each."""

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from stat import S_IFMT, S_ISCHR, S_ISDIR, S_ISLNK, S_ISREG

from tests.fuzz.nasty import furnish
from tests.fuzz.worlds import Files

Snapshot = dict[str, tuple[object, ...]]

OUTSIDE = "outer"  # the folder of a case is inside this one, so that `..` is watched too


@dataclass(frozen=True)
class Sandbox:
    """The valid files of a world on disk, and things with nasty names beside them.

    Attributes:
        root: Folder that belongs to the sandbox alone.
        files: The valid files.
    """

    root: Path
    files: Files

    @property
    def folder(self) -> Path:
        """Where commands are run."""
        return self.root / OUTSIDE / "folder of cases"

    def build(self) -> None:
        """Write everything, on top of nothing."""
        shutil.rmtree(self.root, ignore_errors=True)
        self.folder.mkdir(parents=True)
        furnish(self.folder)
        for name, content in self.files.items():
            self._write(name, content)

    def change(self, changed: dict[str, bytes | None]) -> None:
        """Give some files other contents."""
        for name, content in changed.items():
            if content is None:
                (self.folder / name).unlink()
            else:
                self._write(name, content)

    def restore(self, changed: dict[str, bytes | None]) -> None:
        """Give files their own contents again."""
        for name in changed:
            self._write(name, self.files[name])

    def snapshot(self) -> Snapshot:
        """Each path with what tells whether it was written to, in bytes for names of any kind."""
        found: Snapshot = {}
        folders = [os.fsencode(self.root)]
        while folders:
            with os.scandir(folders.pop()) as entries:
                for entry in entries:
                    status = entry.stat(follow_symlinks=False)
                    found[os.fsdecode(entry.path)] = _state(entry.path, status)
                    if S_ISDIR(status.st_mode):
                        folders.append(entry.path)
        return found

    def relative(self, path: str) -> str:
        """A path of a snapshot as the command sees it."""
        return os.path.relpath(path, self.folder)

    def read(self, path: str) -> bytes:
        """The content of a file of a snapshot."""
        return Path(path).read_bytes()

    def _write(self, name: str, content: bytes) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def _state(path: bytes, status: os.stat_result) -> tuple[object, ...]:
    """What changes when somebody writes to a file, replaces it, or makes it another kind."""
    mode = status.st_mode
    if S_ISREG(mode):
        return ("file", status.st_size, status.st_mtime_ns, status.st_ino)
    if S_ISLNK(mode):
        return ("link", os.readlink(path))  # noqa: PTH115
    return ("device", status.st_rdev) if S_ISCHR(mode) else ("folder", S_IFMT(mode))
