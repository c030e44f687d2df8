"""``python -m pinsing``."""

from pinsing.cli import program

if __name__ == "__main__":
    program()
