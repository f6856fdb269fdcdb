"""Files are written whole or not at all."""

from pathlib import Path

import pytest

from edtk.system.atomic_file import atomic_path, write_text


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    """An error in the middle of writing keeps the file as it was, and removes the temporary one."""
    path = tmp_path / "results.csv"
    write_text(path, "old")

    def interrupted() -> None:
        with atomic_path(path) as temporary:
            temporary.write_text("half of the n")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["results.csv"]


def test_a_write_replaces_the_file_and_makes_its_folder(tmp_path: Path) -> None:
    """Folders are made as needed, and the second write is what stays."""
    path = tmp_path / "a/b/report.md"
    write_text(path, "one")
    write_text(path, "two")
    assert path.read_text() == "two"
