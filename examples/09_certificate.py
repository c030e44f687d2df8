"""A certificate, checked; and one that was changed by a single number, refused."""

import subprocess
import sys
from pathlib import Path

from pinsing.proof import checker

file = Path(sys.argv[1] if len(sys.argv) > 1 else "puma560.cert.json")
pinsing = [sys.executable, "-m", "pinsing"]
subprocess.run([*pinsing, "families", "puma560", "-o", file], check=True)

# The checker needs python-flint alone, and nothing of pinsing: run it as a program of its own.
said = subprocess.run([sys.executable, checker.__file__, file], capture_output=True, text=True)
print("as it was:", said.stdout.strip()[:60])

forged = file.with_name("forged.cert.json")
forged.write_text(file.read_text().replace("2159/5000", "2159/5001"))
said = subprocess.run([sys.executable, checker.__file__, forged], capture_output=True, text=True)
print("forged:", (said.stdout + said.stderr).strip()[:60], "exit code", said.returncode)
