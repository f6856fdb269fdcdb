"""`edtk.verify`: the claims of a certificate, recomputed."""

import json
from pathlib import Path
from typing import Any

from edtk.certificate.verification import Verification
from edtk.certificate.verify_certificate import verify_certificate
from edtk.system.errors import UserError


def verify(certificate: Path | str | dict[str, Any]) -> Verification:
    """Recompute every claim of a certificate from its poses and multipliers alone.

    The check shares no code with the search: it has a kinematics, an information matrix and bounds
    of its own, and draws the candidates anew.

    Args:
        certificate: The file that `edtk.plan`, `edtk.relax` or `edtk.run` wrote, or its content.

    Returns:
        Each claim with the stated and the recomputed number; `.valid` if all hold.

    Raises:
        UserError: The file cannot be read, or is no certificate.

    Example:
        >>> import edtk
        >>> edtk.verify("plan.json").valid  # doctest: +SKIP
        True
    """
    if isinstance(certificate, dict):
        where = "certificate"
        content: Any = certificate
    else:
        where = str(certificate)
        content = _read(Path(certificate))
    if not isinstance(content, dict) or "proof" not in content:
        raise UserError(f"{where}: not a certificate; expected a file written by --certificate")
    try:
        return verify_certificate(content)
    except KeyError as error:
        raise UserError(f"{where}: not a certificate: the key {error} is missing") from error
    except (TypeError, ValueError, OverflowError) as error:
        raise UserError(f"{where}: not a certificate: {' '.join(str(error).split())}") from error


def _read(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
        UserError: The file is missing, or is no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: not valid JSON: {error}") from error
