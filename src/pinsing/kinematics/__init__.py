"""q to J and sigma, one or millions; what one q loses and why; which q reach a pose."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.kinematics.at import State as State, at as at
    from pinsing.kinematics.inverse import (
        InverseSolutions as InverseSolutions,
        inverse as inverse,
    )
    from pinsing.kinematics.inverse_velocity import (
        InverseVelocity as InverseVelocity,
        inverse_velocity as inverse_velocity,
    )
    from pinsing.kinematics.jacobian import (
        frame_jacobian as frame_jacobian,
        frame_jacobians as frame_jacobians,
        generic_rank as generic_rank,
        regular_radius as regular_radius,
        singular_values as singular_values,
        task_jacobian as task_jacobian,
        task_jacobians as task_jacobians,
    )
    from pinsing.kinematics.refine import (
        SingularConfiguration as SingularConfiguration,
        refine as refine,
        refine_many as refine_many,
    )
    from pinsing.kinematics.tip_speed import TipSpeeds as TipSpeeds, tip_speeds as tip_speeds

public(
    __name__,
    {
        "at": "State at",
        "inverse": "InverseSolutions inverse",
        "inverse_velocity": "InverseVelocity inverse_velocity",
        "jacobian": "frame_jacobian frame_jacobians generic_rank regular_radius singular_values "
        "task_jacobian task_jacobians",
        "refine": "SingularConfiguration refine refine_many",
        "tip_speed": "TipSpeeds tip_speeds",
    },
)
