"""Certificates of completeness, accepted or rejected by one file that knows nothing of the rest."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.proof.checker import Rejected as Rejected, verify as verify

public(__name__, {"checker": "Rejected verify"}, called="pinsing.proof.verify(text)")
