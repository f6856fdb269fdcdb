"""Scripts of the folder `studies` as modules."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture(scope="session")
def script():
    """A function that loads a script by its path below `studies`."""

    def load(name):
        path = STUDIES / name
        # As `python studies/NAME` has it, scripts find those that lie beside them.
        sys.path.insert(0, str(path.parent))
        try:
            spec = spec_from_file_location(f"studies_{path.stem}", path)
            module = module_from_spec(spec)
            # A dataclass looks up its module while it is made.
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
        finally:
            sys.path.remove(str(path.parent))
        return module

    return load


@pytest.fixture(scope="session")
def simulation(script):
    """Simulated arms, by a code of their own."""
    return script("simulated_arm.py")


@pytest.fixture(scope="session")
def ideal_arm(simulation):
    """A function that simulates a robot, with its tool, whose joints have ideal springs k (n,)."""

    def simulated(robot, k):
        return simulation.SimulatedArm(
            origins=np.array([joint.origin for joint in robot.chain]),
            axes=np.array([joint.axis for joint in robot.chain]),
            compliance=k,
            tool=robot.tool,
        )

    return simulated
