"""The design space of a study."""

from pathlib import Path

from edtk.study.study import load_study

STUDIES = Path(__file__).parents[2] / "studies"
POSES = "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n-90,80,10,20,30\n-60,50,10,20,30\n"


def test_excluded_poses_count_once(tmp_path: Path) -> None:
    """A sheet names a pose as often as it was visited; plans keep away from it once."""
    text = (STUDIES / "kr270_milling.toml").read_text(encoding="utf-8")
    text = text.split("published = ")[0] + text.split("published = ")[1].split("]", 1)[1]
    study = tmp_path / "study.toml"
    study.write_text(text, encoding="utf-8")
    poses = tmp_path / "poses.csv"
    counts = []
    for copies in (1, 500):
        header, first, second, _ = POSES.split("\n")
        poses.write_text("\n".join([header, *[first, second] * copies, ""]), encoding="utf-8")
        space = load_study(study, poses).space
        counts.append(sum("excluded pose" in label for label in space.workspace.labels))
    assert counts == [2, 2]
