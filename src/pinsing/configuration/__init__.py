"""One configuration: singular values, what is lost there and why, and which ones reach a pose."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.configuration.at import State as State, at as at
    from pinsing.configuration.inverse import (
        InverseSolutions as InverseSolutions,
        inverse as inverse,
    )
    from pinsing.configuration.refine import (
        SingularConfiguration as SingularConfiguration,
        refine as refine,
        refine_many as refine_many,
    )

public(
    __name__,
    {
        "at": "State at",
        "inverse": "InverseSolutions inverse",
        "refine": "SingularConfiguration refine refine_many",
    },
)
