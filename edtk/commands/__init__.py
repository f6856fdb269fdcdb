"""The commands of `edtk`, one a module: each has a click command named `command`."""
