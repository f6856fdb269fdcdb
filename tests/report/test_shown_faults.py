"""What a plan shows of faults, in lines that a person reads."""

from dataclasses import replace

import numpy as np
from readings import STUDY

from edtk.design.detection import Detection, Separation
from edtk.report.views.plan import shown_faults

Q = np.deg2rad([0, 10, -20, 30, 40, 50])
DRIFT = Detection("drift", 0.05, "mm", 0.5, Q, 0.75)
PLAY = Detection("backlash", 0.01, "deg", 0.875, None, 0.875, "q4")
NEVER = Detection("load_size", 10.0, "%", 0.01, None, 0.01)
POSE = "0.00, 10.00, -20.00, 30.00, 40.00, 50.00"


def lines(*detections, separations=()):
    return shown_faults(STUDY.robot, detections, separations)


def test_chances_of_being_noticed():
    """With the experiment that helps, where one does; and what no measurement shows."""
    assert lines(DRIFT, PLAY, NEVER) == [
        f"drift 0.05 mm: noticed with 50 %, with one more experiment 75 %, at {POSE}",
        "backlash of q4 0.01 deg: noticed with 88 %",
        "load_size 10 %: never noticed, compliances take it up",
    ]


def test_chances_of_being_told_apart():
    """With repetitions and the experiment that help, where they are needed."""
    both = Separation((DRIFT, PLAY), 0.625, Q, 0.75, 4)
    words = "drift 0.05 mm or backlash of q4 0.01 deg: told apart with"
    expected = {
        both: f"{words} 62 %; 90 % if each experiment is measured 4 times; "
        f"75 % with one more experiment, at {POSE}",
        replace(both, times=None, better=None): f"{words} 62 %",
        replace(both, right=0.95): f"{words} 95 %",
    }
    assert lines(separations=list(expected)) == list(expected.values())
