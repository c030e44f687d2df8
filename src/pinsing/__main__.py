"""``python -m pinsing``."""

from pinsing.cli import main

if __name__ == "__main__":
    main()
