"""The child process in which xacro runs: a request on stdin, an answer on stdout, both JSON.

It is started by path (see `pinsing.description.xacro`) and imports xacro, the standard library and
the sibling module ``packages.py``, nothing else of pinsing. Being a process of its own it may bend
xacro to what pinsing needs, and may be stopped when a file never ends:

- ``$(find NAME)`` is answered from the package index instead of ament_index_python;
- document types and entities are refused in every file that is parsed;
- expressions that reach for Python's internals are refused. xacro 2.1 looks for names with two
  underscores in the outermost code only, so that a lambda or a comprehension walks past it to
  any builtin;
- memory and processor time are limited, and no file can be written, where the system allows.
"""

from __future__ import annotations

import ast
import contextlib
import importlib.util
import io
import json
import os
import re
import sys
import types
from pathlib import Path
from typing import Any
from xml.parsers import expat

_INTERNALS = frozenset(
    [
        "f_back",
        "f_builtins",
        "f_code",
        "f_globals",
        "f_locals",
        "gi_code",
        "gi_frame",
        "gi_yieldfrom",
        "cr_await",
        "cr_code",
        "cr_frame",
        "ag_code",
        "ag_frame",
        "tb_frame",
        "tb_next",
        "mro",
        "format_map",
    ]
)
_DUNDER_IN_TEXT = re.compile(r"\{[^}]*__")
_QUOTED = re.compile(r"'([^'\n]+)'|\"([^\"\n]+)\"")


class Refused(Exception):
    """A problem found here, told as it is, at a place if it is known."""

    def __init__(self, problem: str, file: str | None = None, line: int | None = None) -> None:
        self.file, self.line = file, line
        super().__init__(problem)


class Arguments(dict[str, str]):
    """Substitution arguments that remember which of them the file knows."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.known: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        if name not in self:
            raise Refused(f"argument {name!r} has no value: give --xacro-arg {name}:=VALUE")
        return super().__getitem__(name)


def limit_resources(seconds: int, memory: int) -> None:
    """Limit processor time [s], memory [bytes] and written files (none), where that exists."""
    try:
        import resource
    except ImportError:
        return
    limits = [("RLIMIT_CPU", seconds), ("RLIMIT_AS", memory), ("RLIMIT_FSIZE", 0)]
    for name, limit in limits:
        # Some systems have the name and refuse the call; the parent's timeout remains.
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(getattr(resource, name), (limit, limit))


def check_expression(expression: str) -> None:
    """Refuse an expression that reaches for Python's internals, at any depth."""
    try:
        tree = ast.parse(expression.strip(), mode="eval")
    except (SyntaxError, ValueError):
        return  # xacro says it better
    for node in ast.walk(tree):
        name = (
            node.id
            if isinstance(node, ast.Name)
            else node.attr
            if isinstance(node, ast.Attribute)
            else ""
        )
        text = node.value if isinstance(node, ast.Constant) else None
        if (
            name.startswith("__")
            or name in _INTERNALS
            or (isinstance(text, str) and _DUNDER_IN_TEXT.search(text))
        ):
            raise Refused(
                f"the expression '{expression.strip()[:80]}' reaches for the internals "
                "of Python, which no robot needs"
            )


def guard(xacro: types.ModuleType, substitution: types.ModuleType, max_bytes: int) -> None:
    """Put the checks in front of xacro's evaluation and parsing."""
    safe_eval, parse, eval_argument = xacro.safe_eval, xacro.parse, substitution._eval

    def checked_eval(expression: str, *args: Any) -> Any:
        check_expression(expression)
        return safe_eval(expression, *args)

    def checked_argument(expression: str, context: Any) -> Any:
        check_expression(expression)
        return eval_argument(expression, context)

    def checked_parse(inp: Any, filename: str | None = None) -> Any:
        if inp is None and filename is not None and os.path.exists(filename):
            if not os.path.isfile(filename):
                raise Refused(f"{filename} is not a plain file")
            if os.path.getsize(filename) > max_bytes:
                raise Refused(f"{filename} is larger than {max_bytes // 2**20} MiB")
            refuse_entities(filename)
        return parse(inp, filename)

    xacro.safe_eval, xacro.parse, substitution._eval = (  # type: ignore[attr-defined]
        checked_eval,
        checked_parse,
        checked_argument,
    )


def refuse_entities(filename: str) -> None:
    """Raise if an XML file declares a document type; expat's own errors pass through."""
    parser = expat.ParserCreate()

    def doctype(*_args: object) -> None:
        raise Refused(
            "document types and entities are not accepted: remove the <!DOCTYPE ...>, "
            "a robot description needs none",
            filename,
            parser.CurrentLineNumber,
        )

    parser.StartDoctypeDeclHandler = doctype
    parser.Parse(Path(filename).read_bytes(), True)


def answer_find(index: Any) -> None:
    """Answer ``$(find NAME)`` from the package index, under the name that xacro imports."""

    def get_package_share_directory(name: str) -> str:
        folder = index.find(name)
        if folder is None:
            raise Refused(f"package {name!r} not found: give its folder with --package {name}=DIR")
        return str(folder)

    package = types.ModuleType("ament_index_python")
    module = types.ModuleType("ament_index_python.packages")
    module.get_package_share_directory = get_package_share_directory  # type: ignore[attr-defined]
    sys.modules[package.__name__], sys.modules[module.__name__] = package, module


def causes(error: BaseException) -> list[BaseException]:
    """Return an error and what caused it, outermost first (xacro keeps causes in ``exc``)."""
    errors: list[BaseException] = []
    current: BaseException | None = error
    while current is not None and current not in errors:
        errors.append(current)
        current = getattr(current, "exc", None) or current.__cause__
    return errors


def explain(error: BaseException, xacro: types.ModuleType) -> dict[str, Any]:
    """Turn an exception into problem, file and line."""
    errors = causes(error)
    files = list(
        dict.fromkeys(f for f in [macro_file(xacro), (xacro.filestack or [None])[-1]] if f)
    )
    problem, line = "", None
    for found in errors:
        if isinstance(found, expat.ExpatError):
            problem = f"is not well-formed XML: {expat.ErrorString(found.code)}"
            return {"problem": problem, "file": files[-1] if files else None, "line": found.lineno}
        if isinstance(found, Refused) and found.file:
            return {"problem": str(found), "file": found.file, "line": found.line}
        if isinstance(found, Refused):
            problem = str(found)
        elif isinstance(found, RecursionError):
            problem = "macros, includes or elements without end (nested too deeply)"
        elif isinstance(found, MemoryError):
            problem = "an expression needs too much memory"
        elif isinstance(found, OSError) and found.filename:
            problem = f"cannot open {found.filename}: {found.strerror}"
    suffixes = [str(getattr(e, "suffix", None) or "") for e in errors]
    expressions = [suffix for suffix in suffixes if suffix]
    if not problem:
        problem = " ".join(str(errors[-1]).split()) or type(errors[-1]).__name__
        if expressions:
            problem += " " + " ".join(expressions[-1].split())
    file, line = locate(files, needles(" ".join([str(e) for e in errors] + [problem]), error))
    return {"problem": f"xacro: {problem}", "file": file, "line": line}


def macro_file(xacro: types.ModuleType) -> str | None:
    """Return the file that defines the innermost macro being expanded."""
    stack = xacro.macrostack or []
    return stack[-1].history[-1][-1] if stack and stack[-1].history else None


def needles(message: str, error: BaseException) -> list[str]:
    """Return what to look for in the source to find the line that a message speaks of."""
    found = ["${" + m for m in re.findall(r"evaluating expression '([^\n]*?)'(?:\s|$)", message)]
    names = re.findall(r"unknown macro name: xacro:(\S+)", message)
    names += [macro.body.getAttribute("name") for macro in getattr(error, "macros", [])]
    found += [f"<xacro:{name}{end}" for name in names for end in " />"]
    found += [
        f"$({command} {name})" for name in _texts(message) for command in ("arg", "find", "env")
    ]
    found += [os.path.basename(m) for m in re.findall(r"cannot open (\S+):", message)]
    return [n for n in found + _texts(message) if n]


def _texts(message: str) -> list[str]:
    return [a or b for a, b in _QUOTED.findall(message)]


def locate(files: list[str], wanted: list[str]) -> tuple[str | None, int | None]:
    """Return file and line of the first wanted text that stands on one line only.

    xacro keeps no line numbers; a text that occurs twice gives the file alone.
    """
    for needle in wanted:
        for file in files:
            try:
                lines = Path(file).read_text(encoding="utf-8", errors="replace").splitlines()
            except OSError:
                continue
            hits = [i for i, line in enumerate(lines, 1) if needle in line]
            if len(hits) == 1:
                return file, hits[0]
    return (files[-1] if files else None), None


def expand(request: dict[str, Any]) -> dict[str, Any]:
    """Run xacro on the request's file."""
    spec = importlib.util.spec_from_file_location("_pinsing_packages", request["packages_module"])
    assert spec is not None
    assert spec.loader is not None
    packages = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(packages)
    index = packages.PackageIndex(Path(request["path"]), request["packages"])
    try:
        import xacro
        from xacro import substitution_args
    except ImportError as error:
        return {"problem": f"xacro cannot be imported ({error}): pip install xacro"}
    answer_find(index)
    guard(xacro, substitution_args, request["max_bytes"])
    arguments = Arguments(request["arguments"])
    noise = io.StringIO()
    try:
        with contextlib.redirect_stderr(noise), contextlib.redirect_stdout(noise):
            document = xacro.process_file(request["path"], mappings=arguments)
            text = document.toprettyxml(indent="  ")
    except Exception as error:  # an expression may raise anything
        return explain(error, xacro)
    unknown = sorted(set(request["arguments"]) - arguments.known)
    warnings = [w[9:] for w in noise.getvalue().splitlines() if w.startswith("warning: ")]
    return {
        "xml": text,
        "unknown": unknown,
        "known": sorted(arguments.known),
        "folders": [str(folder) for folder in index.used()],
        "warnings": warnings,
    }


def main() -> None:
    """Answer one request."""
    request = json.loads(sys.stdin.buffer.read())
    sys.path[:] = request["sys_path"]
    limit_resources(request["seconds"], request["memory"])
    answer = expand(request)
    sys.stdout.buffer.write(json.dumps(answer).encode())


if __name__ == "__main__":
    main()
