"""Run the oracle: python scripts/oracle."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from oracle.run import main

if __name__ == "__main__":
    sys.exit(main())
