"""Mutations of a CSV file: of its rows, its columns, and the way in which it is written."""

from random import Random

from tests.fuzz import nasty

Rows = list[list[str]]

HEADERS = (
    *("dx_mm", "dy_mm", "x_mm", "x0_mm", "z0_mm", "drx_deg", "sigma_mm", "marker_x_mm", "repeats"),
    *("Fx_N", "Fz_N", "Tz_Nm", "q1_deg", "q1_rad", "q2_mm", "Unnamed: 1", "q2_deg.1", "index", "k"),
    *("joint:q1_deg", "joint:rail_mm", "", " ", "#", "=q1_deg", "note", "1", "nan"),
)


def drop_column(rows: Rows, rng: Random) -> Rows:
    """A column is missing."""
    column = _column(rows, rng)
    return [row[:column] + row[column + 1 :] for row in rows]


def copy_column(rows: Rows, rng: Random) -> Rows:
    """A column is there twice."""
    column = _column(rows, rng)
    return [[*row, row[column] if column < len(row) else ""] for row in rows]


def swap_columns(rows: Rows, rng: Random) -> Rows:
    """Two columns have each other's header."""
    first = _column(rows, rng)
    second = _column(rows, rng)
    header = rows[0][:]
    header[first], header[second] = header[second], header[first]
    return [header, *rows[1:]]


def rename_column(rows: Rows, rng: Random) -> Rows:
    """A column has another header."""
    header = rows[0][:]
    other = rng.choice((*HEADERS, *rows[0])) if rng.random() < 0.7 else nasty.text(rng)
    header[_column(rows, rng)] = other
    return [header, *rows[1:]]


def add_column(rows: Rows, rng: Random) -> Rows:
    """There is one more column."""
    cells = [nasty.number(rng) if rng.random() < 0.3 else "1" for _ in rows[1:]]
    header = rng.choice(HEADERS)
    return [[*row, cell] for row, cell in zip(rows, [header, *cells], strict=True)]


def fill_column(rows: Rows, rng: Random) -> Rows:
    """All cells of a column are the same nasty value."""
    column = _column(rows, rng)
    value = nasty.number(rng) if rng.random() < 0.8 else nasty.text(rng)
    return [rows[0], *([*row[:column], value, *row[column + 1 :]] for row in rows[1:])]


def fill_cell(rows: Rows, rng: Random) -> Rows:
    """A cell is a nasty value."""
    found = [row[:] for row in rows]
    row = rng.choice(found)
    if row:
        nasty_value = nasty.number(rng) if rng.random() < 0.7 else nasty.text(rng)
        row[rng.randrange(len(row))] = nasty_value
    return found


def change_rows(rows: Rows, rng: Random) -> Rows:
    """Rows are missing, there twice, in another order, or there are very many."""
    header, *body = rows
    if not body:
        return [header]
    place = rng.randrange(len(body))
    return rng.choice(
        (
            [header],
            body,
            [header, *body[:place], *body[place + 1 :]],
            [header, body[place]],
            [header, *body, body[place]],
            [header, *body[::-1]],
            [header, *body, header],
            [header, header, *body],
            [header, *(body * 300)],
            [header, *([body[place]] * 50)],
        )
    )


def change_width(rows: Rows, rng: Random) -> Rows:
    """A row has more cells than the header, or fewer."""
    found = [row[:] for row in rows]
    row = rng.choice(found)
    if row and rng.random() < 0.5:
        row.pop()
    else:
        row.extend(["7"] * rng.choice((1, 1, 1000)))
    return found


def add_empty_rows(rows: Rows, rng: Random) -> Rows:
    """Rows without content, as a spreadsheet leaves them behind."""
    empty = rng.choice(([""], [""] * len(rows[0]), [" "], ["#"], ["-"]))
    place = rng.choice((0, 1, len(rows)))
    return [*rows[:place], *([empty] * rng.choice((1, 3, 200))), *rows[place:]]


OF_TABLES = (
    *(drop_column, copy_column, swap_columns, rename_column, rename_column, add_column),
    *(fill_column, fill_cell, fill_cell, change_rows, change_width, add_empty_rows),
)


def mutate_table(content: bytes, rng: Random) -> bytes:
    """A CSV file with some of these mutations, perhaps written as another program writes it."""
    rows = [line.split(",") for line in content.decode("utf-8", "replace").splitlines()]
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        if not rows or not rows[0]:
            rows = [[""], *rows[1:]]  # there is a header, even if it is empty
        rows = rng.choice(OF_TABLES)(rows, rng)
    return _written(rows, rng)


def _written(rows: Rows, rng: Random) -> bytes:
    """The file as a program of some country writes it."""
    way = rng.random()
    if way < 0.7:
        return _joined(rows, ",").encode("utf-8", "surrogatepass")
    if way < 0.8:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    quoted = [[f'"{cell}"' for cell in row] for row in rows] if way > 0.95 else rows
    words = _joined(quoted, rng.choice((";", ";", "\t", ", ", "|", " ")))
    encoding = rng.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"))
    ending = rng.choice(("\n", "\r\n", "\r"))
    return words.replace("\n", ending).encode(encoding, "replace")


def _joined(rows: Rows, separator: str) -> str:
    return "".join(separator.join(row) + "\n" for row in rows)


def _column(rows: Rows, rng: Random) -> int:
    """Index of a column; rows without cells get one."""
    if not rows[0]:
        rows[0].append("")
    return rng.randrange(len(rows[0]))
