"""Processor time: what is done, however much else runs beside."""

from __future__ import annotations

import os


def processor_seconds() -> float:
    """Used by this process and by those of its children that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system
