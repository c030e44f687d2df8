"""Print what pinsing needs, one requirement a line, so that it can be installed beside the build.

python scripts/requirements.py [EXTRA]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

try:
    import tomllib
except ImportError:  # Python 3.10: pip has a copy
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

_OWN = re.compile(r"pinsing\[([\w, -]+)\]")


def requirements(project: dict[str, Any], extra: str = "") -> list[str]:
    """Requirements of the project and of one of its extras, those of extras it names included."""
    needed = list(project["dependencies"])
    left, seen = [extra] if extra else [], set()
    while left:
        name = left.pop()
        if name in seen:
            continue
        seen.add(name)
        for requirement in project["optional-dependencies"][name]:
            own = _OWN.fullmatch(requirement.replace(" ", ""))
            if own:
                left += own[1].split(",")
            else:
                needed.append(requirement)
    return needed


if __name__ == "__main__":
    text = (Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8")
    print("\n".join(requirements(tomllib.loads(text)["project"], *sys.argv[1:2])))
