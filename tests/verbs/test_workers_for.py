"""Who does the work of a verb."""

import pytest

from edtk.system.errors import ArgumentError
from edtk.verbs.inputs import workers_for


def test_processes_here_and_a_cluster_exclude_each_other():
    """A number of processes says nothing about a cluster, and was ignored beside one."""
    both = workers_for(2, "tcp://127.0.0.1:9")
    with pytest.raises(ArgumentError, match=r"workers 2: .*expected one of both"), both:
        pass
