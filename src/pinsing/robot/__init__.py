"""Robots: from a file, a name or a model to an Arm, and its nominal geometry."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.robot.arm import Arm as Arm
    from pinsing.robot.load import load as load
    from pinsing.robot.mechanism import (
        Mechanism as Mechanism,
        load_mechanism as load_mechanism,
    )
    from pinsing.robot.nominal import Nominal as Nominal, nominal as nominal

public(
    __name__,
    {
        "arm": "Arm",
        "load": "load",
        "mechanism": "Mechanism load_mechanism",
        "nominal": "Nominal nominal",
    },
    called="pinsing.load(robot)",
)
