"""The accuracy to expect in each test pose in a calibration's report: a picture and a table."""

from edtk.model.task_accuracy import TaskAccuracy
from edtk.report.draw.task_errors import task_errors
from edtk.report.new_figure import new_figure
from edtk.report.page import paragraph, picture, section, table
from edtk.report.task_table import task_sentence, task_table

SIZE = (6.8, 3.6)  # of the picture [inch]


def task_section(found: TaskAccuracy) -> str:
    """What error to expect where along the path, or in which test pose."""
    figure = new_figure(*SIZE)
    label = "root mean square error" if found.total is None else "by noise alone"
    task_errors(found, label, {}, figure.add_subplot())
    figure.legend(loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    place = "along the path" if found.is_path else "in each test pose"
    caption = (
        f"Error to expect {place} after compensation, and the range in which 95 % of the errors "
        "by noise lie."
    )
    return section(
        f"What error to expect {place}?",
        paragraph(task_sentence(found)),
        picture(figure, caption),
        table(*task_table(found), full=True),
    )
