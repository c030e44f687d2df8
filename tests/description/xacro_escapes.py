"""Escapes from Python sandboxes, as expressions of a xacro file, and every place for one.

Run as a program it sends each escape through each place, in one process and without the walls that
pinsing puts around it, and prints what reached outside of the interpreter, as JSON. With the word
``plain`` it runs xacro's own evaluation instead, to show that this would have been seen.
"""

import contextlib
import io
import itertools
import json
import sys
from typing import Any
from xml.sax.saxutils import escape as escape_xml

CALL = "system('true')"
GLOBALS = (
    "python.vars(python.type(python.vars(python.type(xacro.abs_filename))['__globals__']))['__get__']"
    "(python.vars(python.type(xacro.abs_filename))['__globals__'], xacro.abs_filename)"
)

ESCAPES = {
    # The walk from any object to all classes, and from there to a module.
    "class": "().__class__.__base__.__subclasses__()",
    "class of text": "''.__class__.__mro__[1].__subclasses__()",
    "class in a lambda": "(lambda: ().__class__.__bases__[0].__subclasses__())()",
    "class in a comprehension": "[x.__class__.__base__.__subclasses__() for x in [()]]",
    "class by a condition": "[c for c in 1 .__class__.__mro__ if c.__subclasses__()][0]",
    "init globals": "[c for c in ().__class__.__base__.__subclasses__()][0].__init__.__globals__",
    "subscripted class": "list['x'].__origin__.__base__",
    "reduce": "(1).__reduce_ex__(2)[0].__globals__",
    "getattribute": "object.__getattribute__((), '__class__')",
    # From the functions that xacro exposes.
    "globals by vars": f"{GLOBALS}['os'].{CALL}",
    "type": "python.type(1)",
    "type of three": "python.type('X', (), dict(a=1))",
    "vars": "python.vars(xacro.load_yaml)",
    "function globals": f"xacro.abs_filename.__globals__['os'].{CALL}",
    "function subscript": f"xacro.abs_filename['__globals__']['os'].{CALL}",
    "function code": "xacro.load_yaml.__code__.co_code",
    "function closure": "xacro.warning.__closure__[0].cell_contents.__globals__",
    "namespace class": "math.__class__.__init__.__globals__['os']",
    "namespace key": "xacro['__builtins__']",
    "namespace parent": "math.parent.root",
    "namespace method": "math._resolve_.__globals__",
    "namespace update": "math.update(pi=3)",
    "namespace key of builtins": "python['__import__']('os')",
    "block of a macro": "part['**body'].ownerDocument",
    "builtins key": "__builtins__['__import__']('os')",
    "subclass hook": "python.issubclass(1, 2)",
    "slice object": "python.slice(1).__class__",
    "math loader": "math.__loader__.load_module('os')",
    "math spec": "math['__spec__'].loader",
    # Builtins by name.
    "import": f"__import__('os').{CALL}",
    "open": "open('mark', 'w').write('x')", "eval": "eval('1+1')", "exec": "exec('import os')",
    "compile": "compile('1', 'x', 'eval')", "getattr": "getattr((), '__cl' + 'ass__')",
    "globals": "globals()", "locals": "locals()", "breakpoint": "breakpoint()", "help": "help()",
    "input": "input('x')", "fullwidth letters": "ｅｖａｌ('1')",
    "italic letters": "𝘰𝘱𝘦𝘯('mark', 'w')", "fullwidth underscores": "()._＿class_＿",
    "ligature": "__ｉmport__('os')",
    # Templates that read attributes.
    "format": r"'\x7b0.__class__\x7d'.format(1)",
    "format map": r"'\x7ba.__class__\x7d'.format_map(dict(a=1))",
    "format of text": r"str.format('\x7b0.__class__\x7d', 1)",
    "format by map": r"list(map('\x7b0.__class__\x7d'.format, [1]))",
    "f-string": "f'\x7b().__class__\x7d'",
    "translate": "'a'.translate(dict(a=1).__class__)",
    # Frames, coroutines, tracebacks.
    "generator frame": "(x for x in [1]).gi_frame.f_back.f_globals",
    "generator code": "(x for x in [1]).gi_code.co_consts",
    "frame of itself": "[g.gi_frame.f_back.f_back for g in [(g for _ in [1])]][0]",
    "coroutine": "(lambda: (yield))().cr_frame",
    "async": "[x async for x in [1]]",
    "await": "await 1",
    "traceback": "python.Exception().__traceback__.tb_frame",
    # Syntax.
    "lambda": "(lambda x: x)(1)",
    "lambda default": "(lambda x=().__class__: x)()",
    "walrus": "(x := ().__class__)",
    "walrus in a comprehension": "[y := ().__class__ for x in [1]]",
    "starred": f"[*[__import__('os').{CALL}]]",
    "star arguments": "print(*[().__class__])",
    "double star": r"dict(**python.vars(xacro))",
    "attribute target": "[0 for math.pi in [4]]",
    "subscript target": "[0 for xacro['x'] in [4]]",
    "statement": "import os",
    "semicolon": "1; import os",
    "newline": "1\nimport os",
    "decorator": "@eval",
    "matrix product": "[1] @ [2]",
    "ellipsis": "... .__class__",
    "bytes": "b'\x00'.fromhex",
    # Functions that take functions.
    "map": "list(map(eval, ['1']))",
    "map of a method": "list(map(''.__class__, [1]))",
    "map of text": "list(map('upper', ['a']))",
    "filter": "python.filter(open, ['mark'])",
    "sorted key": "python.sorted(['mark'], key=open)",
    "min key": "min(['mark', 'b'], key=__import__)",
    "max of a class": "max([1], key=().__class__)",
    "attrgetter": "operator.attrgetter('__class__')(1)",
    "reduce of functools": "functools.reduce(getattr, ['__class__'], 1)",
    "isinstance": "python.isinstance(1, ().__class__)",
    "dotted class": "xacro.dotify(dict(a=1)).__class__",
    "dotted init": "xacro.dotify(dict(a=1)).__init__.__globals__",
    "dotted method": "xacro.dotify(dict(a=1)).get.__self__",
    "dotted wrap": "xacro.dotify(dict(a=1)).__getattr__.__globals__",
    "list wrap": "xacro.tokenize('a b').wrap.__globals__",
    "dotify of all": "xacro.dotify(xacro).arg",
    # Files by the functions of xacro.
    "yaml object": "xacro.load_yaml('object.yaml')",
    "yaml module": "xacro.load_yaml('module.yaml')",
    "yaml unit": "xacro.load_yaml('unit.yaml')",
    "yaml outside": "xacro.load_yaml('/etc/passwd')",
    "yaml descriptor": "xacro.load_yaml(0)",
    "tokenize": "xacro.tokenize('a', ']|(a+)+[')",
    "message file": "xacro.message('x', file=1) + xacro.abs_filename(1)",
}  # fmt: skip

OBJECTS = {
    "object.yaml": "a: !!python/object/apply:os.system ['true']",
    "module.yaml": "!!python/module:os",
    "unit.yaml": f"a: !degrees \"__import__('os').{CALL}\"",
}

# E is the expression as an attribute's value, T as text of an element; Q is its text alone within
# single quotes, U without.
PLACES = {
    "attribute": '<link name="E"/>',
    "text": "<link>T</link>",
    "property": '<xacro:property name="v" value="E"/><link name="${v}"/>',
    "property at once": '<xacro:property name="v" value="E" lazy_eval="false"/><link/>',
    "property of the parent": '<xacro:macro name="m"><xacro:property name="v" value="E" '
    'scope="parent"/></xacro:macro><xacro:m/>',
    "property default": '<xacro:property name="v" default="E"/><link name="${v}"/>',
    "property name": '<xacro:property name="E" value="1"/>',
    "property removal": '<xacro:property name="v" remove="E"/>',
    "lazy": '<xacro:property name="v" value="1" lazy_eval="E"/>',
    "shadowed function": '<xacro:property name="len" value="E"/><link name="${len}"/>',
    "condition": '<xacro:if value="E"/>',
    "unless": '<xacro:unless value="E"/>',
    "parameter": '<xacro:macro name="m" params="eval">${eval}</xacro:macro><xacro:m eval="E"/>',
    "default": '<xacro:macro name="m" params="p:=E">${p}</xacro:macro><xacro:m/>',
    "forwarded default": '<xacro:macro name="m" params="p:=^|E">${p}</xacro:macro><xacro:m/>',
    "block": '<xacro:macro name="m" params="*b"><xacro:insert_block name="b"/></xacro:macro>'
    '<xacro:m><link name="E"/></xacro:m>',
    "include": '<xacro:include filename="E"/>',
    "include namespace": '<xacro:include filename="part.xacro" ns="E"/>',
    "included": '<xacro:include filename="part.xacro"/><link name="${part_value}"/>',
    "argument default": '<xacro:arg name="x" default="E"/>',
    "argument of eval": '<xacro:property name="x" value="Q"/><link name="$(eval ${x})"/>',
    "argument in an expression": '<xacro:arg name="x" default="U"/><link name="${$(arg x)}"/>',
    "element": '<xacro:element xacro:name="E"/>',
    "added attribute": '<link><xacro:attribute name="a" value="E"/></link>',
    "call": '<xacro:call macro="E"/>',
    "comment": "<!-- xacro:eval-comments --><!-- T -->",
    "yaml": "<link name=\"${xacro.load_yaml('here.yaml').a}\"/>",
}

SPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
INNER = '<xacro:include filename="inner.xacro" ns="part"/>'
PART = f'<part {SPACE}><xacro:macro name="n" params="**body"/>B</part>'
OUTSIDE = ("open", "exec", "import", "os.", "socket.", "subprocess.", "ctypes.", "code.", "gc.")


def files_of(escape: str, place: str) -> dict[str, str]:
    """Return the files of one attempt, by name."""
    wrapped = "${" + escape + "}"
    text = escape_xml(wrapped)
    value, quoted = escape_xml(wrapped, {'"': "&quot;"}), escape_xml(f"'{escape}'", {'"': "&quot;"})
    body = PLACES[place].replace("T", text) if "T" in PLACES[place] else PLACES[place]
    body = body.replace('"E"', f'"{value}"').replace(":=E", f":={value}").replace("|E", f"|{value}")
    body = body.replace('"Q"', f'"{quoted}"').replace('"U"', f'"{quoted[1:-1]}"')
    inner = f'<xacro:property name="part_value" value="{value}"/>' if place == "included" else ""
    return {
        "main.xacro": f"<robot {SPACE}>{INNER}{body}</robot>", "inner.xacro": PART.replace("B", ""),
        "part.xacro": PART.replace("B", inner), "here.yaml": "a: !radians " + json.dumps(escape),
        **OBJECTS,
    }  # fmt: skip


def attempt(xacro: Any, ask: Any, escape: str, place: str) -> str:
    """Return what came of one attempt: text, or an error after its name."""
    ask.files = {"/robot/" + name: text for name, text in files_of(escape, place).items()}
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
    attempt(xacro, ask, "1", "text")
    seen: list[str] = []
    listening = True

    def hook(event: str, details: Any) -> None:
        if listening and event.startswith(OUTSIDE):
            seen.append(f"{event} {str(details)[:80]}")

    sys.addaudithook(hook)
    found: dict[str, Any] = {"seen": {}, "results": {}}
    with contextlib.redirect_stderr(io.StringIO()):  # what xacro prints
        for name, place in itertools.product(ESCAPES, PLACES):
            seen.clear()
            result = attempt(xacro, ask, ESCAPES[name], place)
            found["results"][f"{name} | {place}"] = result[:2000]
            if seen:
                found["seen"][f"{name} | {place}"] = list(seen)
    listening = False
    print(json.dumps(found))


if __name__ == "__main__":
    main("plain" in sys.argv[1:])
