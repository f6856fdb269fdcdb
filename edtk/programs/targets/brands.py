"""The readers of existing robot programs, by the names of their files."""

from pathlib import PurePath

from edtk.programs.targets.brand import Brand
from edtk.programs.targets.fanuc_ls_targets import FanucTargets
from edtk.programs.targets.krl_targets import KrlTargets
from edtk.programs.targets.rapid_targets import RapidTargets
from edtk.programs.targets.urscript_targets import UrTargets

BRANDS: tuple[Brand, ...] = (KrlTargets(), RapidTargets(), UrTargets(), FanucTargets())


def brand_of(name: str) -> Brand | None:
    """The reader of files of such a name; None of a table of poses."""
    suffix = PurePath(name).suffix.lower()
    return next((brand for brand in BRANDS if suffix in brand.suffixes), None)
