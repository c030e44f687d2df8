"""The command line: reads words, calls functions, prints. Heavy imports wait in the commands."""

from pinsing.cli.app import main

__all__ = ["main"]
