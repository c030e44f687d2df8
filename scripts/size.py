"""Print how large the project is against its limits; exit code 1 where one is passed."""

from __future__ import annotations

import ast
import sys
from collections import Counter
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIMITS: dict[str, tuple[int, int]] = {
    "Python in src: statements": (34_901, 30_000),
    "Python in src: lines": (67_495, 56_000),
    "C++, JavaScript, templates, styles: lines": (10_898, 9_500),
    "modules": (137, 220),
    "packages directly under pinsing": (15, 16),
    "numbers in module constants": (492, 500),
    "names exported by pinsing": (32, 32),
    "lines of tests": (28_000, 28_000),
    "lines of text files of tests": (10_100, 10_100),
    "words of Markdown, changelog excluded": (39_999, 40_000),
    "CHANGELOG.md: lines": (150, 150),
}
"""Of each size what it may be today, to be lowered with each step, and the target."""
_OTHERS = {".cpp", ".hpp", ".js", ".mjs", ".html", ".css", ".in"}


def sizes() -> dict[str, int]:
    """Count all of it; docstrings and other strings that stand alone are no statements."""
    out = Counter(dict.fromkeys(LIMITS, 0))
    package = ROOT / "src" / "pinsing"
    for path in package.rglob("*.py"):
        tree = tree_of(path)
        out["modules"] += 1
        out["Python in src: lines"] += _text(path).count("\n")
        out["Python in src: statements"] += sum(not _stands_alone(n) for n in statements(path))
        out["numbers in module constants"] += sum(
            isinstance(n, ast.Constant) and type(n.value) in (int, float, complex)
            for s in tree.body
            if isinstance(s, ast.Assign | ast.AnnAssign) and s.value is not None
            for n in ast.walk(s.value)
        )
        if path == package / "__init__.py":
            listed = next(s for s in tree.body if "_HOMES" in ast.unparse(s).split()[:1])
            assert isinstance(listed, ast.Assign)
            homes = ast.literal_eval(listed.value).values()
            out["names exported by pinsing"] = sum(len(names.split()) for names in homes)
    out["packages directly under pinsing"] = len(list(package.glob("*/__init__.py")))
    others = [p for p in (ROOT / "src").rglob("*") if p.suffix in _OTHERS]
    out["C++, JavaScript, templates, styles: lines"] = sum(_text(p).count("\n") for p in others)
    out["lines of tests"] = sum(_text(p).count("\n") for p in (ROOT / "tests").rglob("*.py"))
    texts = [*(ROOT / "tests").rglob("*.txt"), *(ROOT / "tests").rglob("*.yaml")]
    out["lines of text files of tests"] = sum(_text(p).count("\n") for p in texts)
    folders = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    counted = [p for p in folders if p.name != "CHANGELOG.md"]
    out["words of Markdown, changelog excluded"] = sum(len(_text(p).split()) for p in counted)
    out["CHANGELOG.md: lines"] = _text(ROOT / "CHANGELOG.md").count("\n")
    return dict(out)


@cache
def tree_of(path: Path) -> ast.Module:
    """The syntax of a module, parsed once for all that ask."""
    return ast.parse(_text(path))


@cache
def statements(path: Path) -> list[ast.stmt]:
    """Its statements, nested ones too; none stands within an expression."""
    found: list[ast.AST] = [tree_of(path)]
    for node in found:
        found += [n for n in ast.iter_child_nodes(node) if not isinstance(n, ast.expr)]
    return [n for n in found if isinstance(n, ast.stmt)]


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _stands_alone(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def main() -> int:
    """Print the table; 1 where a limit is passed."""
    found = sizes()
    print(f"{'':44}{'now':>8}{'limit':>8}{'target':>8}")
    for name, (limit, target) in LIMITS.items():
        over = "  over its limit" * (found[name] > limit)
        print(f"{name:44}{found[name]:8}{limit:8}{target:8}{over}")
    return int(any(found[name] > limit for name, (limit, _) in LIMITS.items()))


if __name__ == "__main__":
    sys.exit(main())
