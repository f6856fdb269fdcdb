"""What accuracy the largest plan promises in each of several test poses, and other plans beside."""

from edtk.model.task_accuracy import TaskAccuracy
from edtk.report.markdown_table import markdown_table
from edtk.report.task_table import TOOL_POINT, task_sentence, task_table

PICTURE = "tasks.png"


def in_each_task(found: TaskAccuracy, of: str = TOOL_POINT) -> str:
    """A picture, a sentence and a table of the largest plan for the main criterion.

    Args:
        found: The accuracy that this plan promises.
        of: Whose errors they are.
    """
    place = "along the path" if found.is_path else "in each test pose"
    header, rows = task_table(found)
    return (
        f"![Error to expect {place}]({PICTURE})\n\n"
        f"Largest plan. {task_sentence(found, of)}\n\n{markdown_table(header, rows)}"
    )
