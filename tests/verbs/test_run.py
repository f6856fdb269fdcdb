"""A whole study as a call, in its folder."""

import pytest
from arm import arm

from edtk.system.errors import UserError
from edtk.system.files import FolderLock
from edtk.verbs.run import run


def test_a_folder_has_one_run_at_a_time(tmp_path):
    """A second run is refused in one line, before any work, and leaves the folder as it is."""
    left = tmp_path / "plans" / ".edtk-0123456789abcdef"
    left.mkdir(parents=True)
    lock = FolderLock.try_on(tmp_path)
    with pytest.raises(UserError, match="another run is writing there"):
        run(arm(), tmp_path, workers=1)
    assert left.exists()
    lock.close()


def test_a_refused_run_leaves_nothing(tmp_path):
    """A folder that was made for a run that cannot be done is gone; what was left is swept."""
    left = tmp_path / "out" / "plans" / ".edtk-0123456789abcdef"
    nobody = arm(workspace={"height_min_mm": 1e6})
    with pytest.raises(UserError, match="no feasible pose"):
        run(nobody, tmp_path / "new" / "out", workers=1)
    assert list(tmp_path.iterdir()) == []
    left.mkdir(parents=True)
    with pytest.raises(UserError, match="no feasible pose"):
        run(nobody, tmp_path / "out", workers=1)
    assert not left.exists()


def test_a_run_replaces_nothing_that_it_reads(tmp_path):
    """A published plan that lies where the run writes is refused, before any work."""
    plan = tmp_path / "plans" / "random_m9.csv"
    plan.parent.mkdir()
    plan.write_text("q1_deg,q2_deg\n10,40\n-30,40\n")
    study = arm(published=["plans/random_m9.csv"]).replace(folder=tmp_path)
    with pytest.raises(UserError, match=r"random_m9\.csv: is read by this command and may be"):
        run(study, tmp_path, workers=1)
    assert [path.name for path in tmp_path.rglob("*")] == ["plans", "random_m9.csv"]
