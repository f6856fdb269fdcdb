"""`python -m edtk` is the command `edtk`."""

from edtk.cli import main

if __name__ == "__main__":
    main()
