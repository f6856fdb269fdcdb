"""Whether there are measurements on a sheet."""

from pathlib import Path

from edtk.calibration.template import is_filled
from edtk.study.study import load_study
from edtk.verbs.template import template

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_6"]


def test_what_is_a_filled_sheet(tmp_path):
    """One entry fills a sheet; plans, texts and bytes are no sheets at all."""
    path = tmp_path / "file"
    table = template(STUDY, PLAN)
    for separator in (",", ";", "\t"):
        path.write_text("# day 1\n" + table.to_csv(index=False, sep=separator))
        assert is_filled(path) is False
        path.write_text(
            "# day 1\n" + table.assign(sigma_mm=0.03).to_csv(index=False, sep=separator)
        )
        assert is_filled(path) is True
    for content in (
        b"",
        b"q1_deg,repeats\n1,2\n",
        b'{"q2": 1}',
        b"dx_mmm\n1\n",
        bytes(range(256)) * 2000,
    ):
        path.write_bytes(content)
        assert is_filled(path) is None
