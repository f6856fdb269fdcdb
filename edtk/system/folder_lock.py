"""A lock on a folder, which ends with the process that holds it."""

import os
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path


@dataclass(frozen=True)
class FolderLock:
    """An attempt to lock a folder for this process alone.

    The system ends the lock when the folder is closed, also where the process is killed, so that
    no lock is ever stale. The folder gets no file for it.

    Attributes:
        held: Whether the lock is held; None where the file system knows no locks of folders.
        descriptor: Of the open folder; None where the system has no such descriptors.
    """

    held: bool | None
    descriptor: int | None

    @classmethod
    def try_on(cls, folder: Path) -> "FolderLock":
        """Try to lock a folder, without waiting.

        Raises:
            OSError: The folder cannot be opened.
        """
        # Windows has neither these locks nor descriptors of folders.
        if find_spec("fcntl") is None:
            return cls(None, None)
        fcntl = import_module("fcntl")
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
        if self.descriptor is not None:
            os.close(self.descriptor)
