"""`python -m edtk` is the command `edtk`."""

import os
import sys

# Python searches the current folder first: whatever anybody has put there would be loaded.
_HOME = os.path.dirname(os.path.dirname(__file__))  # noqa: PTH120
if not sys.flags.safe_path and os.path.realpath(sys.path[0]) != os.path.realpath(_HOME):
    del sys.path[0]

from edtk.cli import main  # noqa: E402

if __name__ == "__main__":
    main()
