"""The accuracy in several test poses, as a table, a sentence and a picture."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from edtk.measure.expected_error import TaskAccuracy
from edtk.report.calibration_sections import MOST_ROWS, task_section, task_sentence, task_table
from edtk.report.comparison_sections import in_each_task
from edtk.report.draw.plans import task_errors


def accuracy(count: int, is_path: bool, known: bool = True) -> TaskAccuracy:
    """Errors that grow towards the last pose but one."""
    error = 1e-6 * np.minimum(np.arange(1.0, count + 1), 2 * count - 2 - np.arange(1.0, count + 1))
    return TaskAccuracy(
        along=0.02 * np.arange(count),
        weight=np.ones(count),
        error=error,
        band=np.stack([0.2 * error, 2 * error], axis=1),
        before=100 * error if known else None,
        is_path=is_path,
    )


def test_a_path_has_a_row_a_pose() -> None:
    """Lengths in millimetres, three digits, the worst marked."""
    header, rows = task_table(accuracy(5, is_path=True))
    assert header[1] == "along the path [mm]"
    assert rows[3] == ["4 (worst)", "60", "0.400", "0.00400", "0.0008 to 0.008"]
    assert "0.00400 mm" not in task_sentence(accuracy(5, is_path=True))
    assert "0.004 mm in the worst of them, pose 4" in task_sentence(accuracy(5, is_path=True))


def test_separate_poses_have_weights_where_they_differ() -> None:
    """A pose of weight zero is never the worst, and no length stands where there is no path."""
    found = accuracy(3, is_path=False, known=False)
    found.weight[1] = 0.0
    header, rows = task_table(found)
    assert header == ["pose", "weight", "error [mm]", "95 % of the errors [mm]"]
    assert [row[0] for row in rows] == ["1 (worst)", "2", "3"]
    assert "weighted" in task_sentence(found)


def test_very_many_poses_are_thinned_and_the_worst_stays() -> None:
    """The table says how many of them it shows."""
    found = accuracy(997, is_path=True)
    _, rows = task_table(found)
    assert len(rows) <= MOST_ROWS
    assert "996 (worst)" in [row[0] for row in rows]
    assert f"The table shows {len(rows)} of the 997 poses." in task_sentence(found)


@pytest.mark.parametrize("is_path", [True, False])
def test_pictures_show_every_pose_and_other_plans(is_path: bool) -> None:
    """The band holds the line, errors begin at zero, and the names are in the legend."""
    found = accuracy(6, is_path)
    ax = Figure().add_subplot()
    task_errors(found, "ours", {"random": found, "D": found}, ax)
    labels = ax.get_legend_handles_labels()[1]
    assert {"ours", "random", "D", "worst, pose 5", "95 % of the errors"} <= set(labels)
    assert ax.get_ylim()[0] == 0
    assert ("length" in ax.get_xlabel()) == is_path


@pytest.mark.slow
def test_sections_name_what_the_poses_are() -> None:
    """A path is one in HTML and in Markdown, and so are separate poses."""
    assert "What error to expect along the path?" in task_section(accuracy(4, is_path=True))
    assert "in each test pose" in task_section(accuracy(4, is_path=False))
    text = in_each_task(accuracy(4, is_path=True))
    assert text.startswith("![Error to expect along the path](tasks.png)")
    assert "| 3 (worst) |" in text
