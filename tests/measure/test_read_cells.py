"""Tables as people and their spreadsheets write them."""

from pathlib import Path

import numpy as np
import pytest

from edtk.measure.cells import PoseFileError, read_cells
from edtk.measure.pose_table import PoseTable
from edtk.system.errors import Note

PATH = Path("table.csv")
SEMICOLONS = "semicolons between columns"
COMMAS = f"{SEMICOLONS}, decimal commas"


@pytest.mark.parametrize(
    ("text", "assumed"),
    [
        ("a;b\n1,5;2\n3;-4,25e1\n", COMMAS),
        ("a;b\r\n1,5;2\r\n3;-42,5\r\n", COMMAS),
        ("sep=;\na;b\n1,5;2\n3;-42,5\n", COMMAS),
        ("a;b # x, y\n1.5;2 # z, 1\n3;-42.5\n", SEMICOLONS),
        ("a\tb\n1,5\t2\n3\t-42,5\n", "tabs between columns, decimal commas"),
        ("a;b;;\n1,5;2;;\n3;-42,5;;\n;;;\n", "2 empty columns at the end left out, 1 empty row at"),
        ("a,b\n1.5,2\n3,-42.5\n,\n,\n", "2 empty rows at the end left out"),
    ],
)
def test_what_a_spreadsheet_writes(text, assumed):
    """Other separators, decimal commas, empty rows and columns are read; a note tells which."""
    with pytest.warns(Note, match=f"^table.csv: read with .*{assumed}"):
        cells = read_cells(text, PATH)
    assert list(cells) == ["a", "b"]
    np.testing.assert_array_equal(np.array([cells["a"], cells["b"]]).T, [[1.5, 2], [3, -42.5]])


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-8", "utf-8-sig"])
def test_encodings(tmp_path, encoding):
    """A mark at the beginning of the file tells UTF-16, which some spreadsheets write."""
    path = tmp_path / "table.csv"
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    path.write_bytes(f"{mark}ä,b\n1,2\n".encode(encoding))
    assert PoseTable.read(path, "table").numbers("ä").tolist() == [1.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is no CSV table"),
        (",,\n1,2,3\n", "is no CSV table"),
        ("a,,b\n1,2,3\n", "column 2 has no name"),
        ("a,b,\n1,2,3\n", "column 3 has no name"),
        ("a,b,a\n1,2,3\n", "column 'a' is there twice"),
        ('a,"b\n1,2\n', "the header has a quote that is not closed"),
        ('a,b\n1,2\n3,"4\n5,6\n', "row 2: a quote is not closed"),
        ("a,b\n1,2\n3\n", "row 2: 1 cells; expected 2"),
        ("a,b\n1,2,3\n4,5\n", "row 1: 3 cells; expected 2"),
        ("a,b\n1,2\n\n# x\n3,4,5\n", "row 2: 3 cells; expected 2"),
        ("a,b\n1,2\n3,\0\n", "line 3: has a null character"),
        ("a;b\n1,5;2\n3;1.234\n", "row 2, column b: '1.234' has a point"),
        ("a;b\n1.234,5;2\n", "row 1, column a: '1.234,5' has a point"),
    ],
)
def test_what_is_no_table(text, message):
    """One line says what is wrong, and in which row or column."""
    with pytest.raises(PoseFileError, match=f"^table.csv: {message}"):
        read_cells(text, PATH)


@pytest.mark.parametrize(
    "cell",
    ["9" * 400, f"-{'9' * 400}", "9" * 5000, "1e400", "0x10", "1_000", '"1,234"', "1j", "TRUE x"],
)
@pytest.mark.parametrize("others", ["", "1,2\n"])
def test_cells_that_are_no_finite_numbers(cell, others):
    """Row and column are named, whatever else the column holds."""
    table = PoseTable(PATH, read_cells(f"a,b\n{others}{cell},3\n", PATH))
    row = 2 if others else 1
    with pytest.raises(PoseFileError, match=f"^table.csv: row {row}, column a: .* finite number"):
        table.numbers("a")


@pytest.mark.parametrize("cell", ["#N/A", "#REF!", "#DIV/0!", "#VALUE!", "#NAME?", "#NUM!"])
@pytest.mark.parametrize("row", ["{},2", "1,{}", '"{}",2', " {},2"])
def test_a_formula_that_failed_is_no_comment(cell: str, row: str) -> None:
    """Its row would be gone without a word; comments may say anything else."""
    with pytest.raises(PoseFileError, match=r"line 3.*is an error of a spreadsheet"):
        read_cells(f"a,b\n3,4\n{row.format(cell)}\n5,6\n", PATH)
    assert len(read_cells("a,b # 1\n3,4 # N/A\n# note: #N/A means none\n5,6\n", PATH)["a"]) == 2
