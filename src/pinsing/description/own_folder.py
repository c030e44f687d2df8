"""Where pinsing's own robots lie: DH tables, the xacro, and the URDFs made of them."""

from __future__ import annotations

from pathlib import Path

from pinsing.errors import RobotFileError


def urdf_folder() -> Path:
    """Return the folder of DH tables, the xacro, and the URDFs made of them.

    Raises
    ------
    RobotFileError
        If neither the package nor the checkout around it has one.
    """
    package = Path(__file__).resolve().parents[1]
    packaged, checkout = package / "urdf", package.parents[1] / "urdf"
    for folder in (packaged, checkout):
        if folder.is_dir():
            return folder
    raise RobotFileError("no such folder: install pinsing again, it is incomplete", packaged)
