"""Small plain files: the same numbers as pandas reads, and everything else left to pandas."""

import numpy as np
import pandas as pd
import pytest

from edtk.measure.cells import MOST_BYTES, plain_numbers


def pandas_columns(path):
    """The numbers that pandas reads from a file, by column."""
    frame = pd.read_csv(path, skipinitialspace=True, comment="#", index_col=False)
    return {name: frame[name].to_numpy(dtype=float) for name in frame}


def numbers_in_many_forms(rng, n):
    """Numbers as people and programs write them, of up to fifteen digits."""
    forms = ("%.10g", "%.3f", "%.6e", "%d", "%+.1f", "%.15g", "%.12f")
    for _ in range(n):
        value = rng.normal() * 10.0 ** rng.integers(-6, 6)
        yield rng.choice(forms) % value


def test_the_numbers_are_those_of_pandas(tmp_path):
    """Whatever the number of digits and the exponent: the same floats, bit by bit."""
    rng = np.random.default_rng(0)
    path = tmp_path / "table.csv"
    read = 0
    for _ in range(60):
        columns = [list(numbers_in_many_forms(rng, 4)) for _ in range(3)]
        lines = [
            "# a note",
            "a, b,c_deg",
            "",
            *(",".join(row) for row in zip(*columns, strict=True)),
        ]
        path.write_text(rng.choice(["\n", "\r\n"]).join(lines), newline="")
        found = plain_numbers(path.read_bytes().decode())
        if found is None:
            continue
        read += 1
        expected = pandas_columns(path)
        assert list(found) == list(expected)
        for name, values in expected.items():
            assert found[name].tobytes() == values.tobytes()
    assert read > 10


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a,b\n",
        "a,b\n1\n",
        "a,b\n1,2,3\n",
        "a,a\n1,2\n",
        "a,\n1,2\n",
        "a;b\n1;2\n",
        "a,b\n1,\n",
        "a,b\n1,x\n",
        "a,b\n1,nan\n",
        "a,b\n1,inf\n",
        "a,b\n1,True\n",
        'a,b\n"1",2\n',
        "a,b\n1,2 # a note\n",
        "a,b\n1,2 \n",
        "a\tb\n1\t2\n",
        "a,b\n-0,2\n",
        "a,b\n1,0.1234567890123456\n",
        "a,b\n1,1e-8\n",
        "a,b\n1,2\n  \n",
        "a,b\r1,2\r",
        "\ufeffa,b\n1,2\n",
        "a,\u00e4\n1,2\n",
        "a,b\n" + MOST_BYTES // 4 * "1,2\n",
    ],
)
def test_what_is_not_plain_is_left_to_pandas(text):
    """Anything that readers might understand in two ways, or that needs a message, is not read."""
    assert plain_numbers(text) is None
