"""Escapes from Python sandboxes, as expressions of a xacro file, tried in every place for one.

Run as a program it takes escapes and places as JSON and sends each through each, in one process and
without the walls that pinsing puts around it, and prints what reached outside of the interpreter,
as JSON. With the word ``plain`` it runs xacro's own evaluation instead, to show that this would
have been seen.
"""

import contextlib
import io
import itertools
import json
import sys
from typing import Any
from xml.sax.saxutils import escape as escape_xml

CALL = "system('true')"
OBJECTS = {
    "object.yaml": "a: !!python/object/apply:os.system ['true']",
    "module.yaml": "!!python/module:os",
    "unit.yaml": f"a: !degrees \"__import__('os').{CALL}\"",
}

SPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
INNER = '<xacro:include filename="inner.xacro" ns="part"/>'
PART = f'<part {SPACE}><xacro:macro name="n" params="**body"/>B</part>'
OUTSIDE = ("open", "exec", "import", "os.", "socket.", "subprocess.", "ctypes.", "code.", "gc.")


def files_of(escape: str, place: str, there: str) -> dict[str, str]:
    """Return the files of one attempt, by name; there is the expression's place, of that name."""
    wrapped = "${" + escape + "}"
    text = escape_xml(wrapped)
    value, quoted = escape_xml(wrapped, {'"': "&quot;"}), escape_xml(f"'{escape}'", {'"': "&quot;"})
    body = (
        there.replace("T", text)
        .replace('"E"', f'"{value}"')
        .replace(":=E", f":={value}")
        .replace("|E", f"|{value}")
    )
    body = body.replace('"Q"', f'"{quoted}"').replace('"U"', f'"{quoted[1:-1]}"')
    inner = f'<xacro:property name="part_value" value="{value}"/>' if place == "included" else ""
    return {
        "main.xacro": f"<robot {SPACE}>{INNER}{body}</robot>", "inner.xacro": PART.replace("B", ""),
        "part.xacro": PART.replace("B", inner), "here.yaml": "a: !radians " + json.dumps(escape),
        **OBJECTS,
    }  # fmt: skip


def attempt(xacro: Any, ask: Any, escape: str, place: str, there: str) -> str:
    """Return what came of one attempt: text, or an error after its name."""
    ask.files = {"/robot/" + name: text for name, text in files_of(escape, place, there).items()}
    try:
        document = xacro.process_file("/robot/main.xacro", mappings=ask.fresh())
        return str(document.documentElement.toxml())
    except Exception as error:
        return f"!{type(error).__name__}: {error}"


class Ask:
    """Stands for the parent process: files from memory, nothing else."""

    def __init__(self, make: Any) -> None:
        self.files: dict[str, str] = {}
        self.fresh = make

    def __call__(self, kind: str, text: str) -> dict[str, Any]:
        if kind == "find":
            return {"found": None}
        if kind == "read" and text in self.files:
            return {"found": self.files[text]}
        return {"problem": f"{text} is out of reach"} if kind == "read" else {"found": []}


def main(plain: bool) -> None:
    import xacro

    from pinsing.description.xacro_rules import Arguments, Places, Rules

    escapes, places = json.load(sys.stdin)
    ask: Any = Ask(lambda: {})
    own_eval = xacro.safe_eval
    rules = Rules(xacro, ask, Places(), {})
    ask.fresh = lambda: setattr(rules, "arguments", Arguments({})) or rules.arguments
    symbols = {n: dict(v) for n, v in xacro._global_symbols.items() if isinstance(v, dict)}
    rules.enforce()
    if plain:  # as xacro has it
        xacro.safe_eval = own_eval
        del xacro.eval, xacro.compile
        for name, space in symbols.items():
            xacro._global_symbols[name].update(space)
    attempt(xacro, ask, "1", "text", "<link>T</link>")
    seen: list[str] = []
    listening = True

    def hook(event: str, details: Any) -> None:
        if listening and event.startswith(OUTSIDE):
            seen.append(f"{event} {str(details)[:80]}")

    sys.addaudithook(hook)
    found: dict[str, Any] = {"seen": {}, "results": {}}
    with contextlib.redirect_stderr(io.StringIO()):  # what xacro prints
        for name, place in itertools.product(escapes, places):
            seen.clear()
            result = attempt(xacro, ask, escapes[name], place, places[place])
            found["results"][f"{name} | {place}"] = result[:2000]
            if seen:
                found["seen"][f"{name} | {place}"] = list(seen)
    listening = False
    print(json.dumps(found))


if __name__ == "__main__":
    main("plain" in sys.argv[1:])
