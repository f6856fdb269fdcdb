"""The check that an empty sheet overwrites nothing."""

from pathlib import Path

import pytest

from edtk.calibration.template import require_empty
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.template import template

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_6"]


def test_a_filled_sheet_is_not_overwritten(tmp_path):
    """A sheet with a single reading in it is refused; an empty one, or an empty file, is not."""
    path = tmp_path / "sheet.csv"
    require_empty(path)
    table = template(STUDY, PLAN)
    table.to_csv(path, index=False)
    require_empty(path)
    table.loc[2, "dy_mm"] = 0.1
    table.to_csv(path, index=False)
    with pytest.raises(UserError, match="has measurements in it"):
        require_empty(path)
    for text in (
        table.to_csv(sep=";"),
        "# day 1\n" + table.to_csv(),
        "q1_deg;dx_mm\n1,5;0,3\n",
        'title = "a study"\n',
    ):
        path.write_text(text)
        with pytest.raises(UserError, match=r"has measurements in it|not an empty sheet"):
            require_empty(path)
    path.write_text("")
    require_empty(path)
