"""The command line, within the process of the test."""

from click.testing import CliRunner, Result

from pinsing.cli.app import command


def run(*words: object) -> Result:
    """Run `pinsing WORDS`."""
    return CliRunner().invoke(command, [*map(str, words)], prog_name="pinsing")
