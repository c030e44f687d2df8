"""What pinsing puts in place of xacro's own evaluation, parsing and files.

Runs in the xacro child process only. `Rules.enforce` leaves no path by which text of a file gets
to Python's eval: both places of xacro 2 that call it (``safe_eval`` for ``${...}`` and YAML with
units, ``substitution_args._eval`` for ``$(eval ...)``) are replaced, and ``eval`` within its
modules is taken away.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.dom import expatbuilder
from xml.dom.minicompat import NodeList
from xml.parsers import expat

import yaml

from pinsing.description.xacro_expression import FUNCTIONS, MATH, Function, Kinds, Refused, evaluate
from pinsing.description.xml_tree import LONGEST_NUMBER
from pinsing.description.yaml_tree import Loader, yaml_problem


class RefusedAt(Refused):
    """Something refused at a known place."""

    def __init__(self, problem: str, file: str | None, line: int | None = None) -> None:
        self.file, self.line = file, line
        super().__init__(problem)


class PlacedText(str):
    """A name or value of a file that knows where it stands; copies of elements keep it."""

    place: tuple[str, int]  # the file, and the line at which the element starts


class Places:
    """Where in which file the expansion is."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self.current: PlacedText | None = None

    def enter(self, what: Any) -> PlacedText | None:
        """Go to an element or a text, if it knows its place; return where the expansion was."""
        before, there = self.current, getattr(what, "tagName", what)
        if isinstance(there, PlacedText):
            self.current = there
        return before

    def follow(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a function of an element or text; a failure leaves the place where it happened."""

        def followed(what: Any, *args: Any, **options: Any) -> Any:
            before = self.enter(what)
            result = function(what, *args, **options)
            self.current = before
            return result

        return followed

    def found(self) -> tuple[str | None, int | None]:
        """Return file and line of the current place; of a tag of several lines, the right one."""
        if self.current is None:
            return None, None
        text, (file, start) = self.current, self.current.place
        lines = self.texts[file].splitlines()[start - 1 :]
        return file, start + next((i for i, line in enumerate(lines) if text in line), 0)


class Builder(expatbuilder.ExpatBuilderNS):
    """Builds a document whose elements know their place; refuses document types."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self.file = file

    def start_element_handler(self, name: str, attributes: Any) -> None:
        """Note the line at which an element starts."""
        attributes[1::2] = map(self._placed, attributes[1::2])
        super().start_element_handler(name, attributes)
        node: Any = self.curNode
        node.tagName = node.nodeName = self._placed(node.tagName)

    def _placed(self, text: str) -> PlacedText:
        placed = PlacedText(text)
        placed.place = self.file, self.getParser().CurrentLineNumber
        return placed

    def start_doctype_decl_handler(self, *_args: Any) -> None:
        """Refuse a document type."""
        raise RefusedAt(
            "document types and entities are not accepted: remove the <!DOCTYPE ...>, "
            "a robot description needs none",
            self.file,
            self.getParser().CurrentLineNumber,
        )


_LONGEST_SHOWN = 120
_WORDS: Mapping[type, str] = {
    RecursionError: "macros, includes or elements without end (nested too deeply)",
    MemoryError: "an expression needs too much memory",
}


def explain(error: BaseException, xacro: Any, places: Places) -> dict[str, Any]:
    """Turn an exception into problem, file and line."""
    file = (xacro.filestack or [None])[-1]
    problem = suffix = said = ""
    for found in causes(error):
        if isinstance(found, expat.ExpatError):
            problem = f"is not well-formed XML: {expat.ErrorString(found.code)}"
            return {"problem": problem, "file": file, "line": found.lineno}
        if isinstance(found, RefusedAt):
            return {"problem": str(found), "file": found.file, "line": found.line}
        if isinstance(found, Refused | RecursionError | MemoryError):
            problem = _WORDS.get(type(found), str(found))
        elif isinstance(found, OSError) and found.filename:
            problem = f"cannot open {found.filename}: {found.strerror}"
        said = " ".join(str(found).split()) or type(found).__name__
        suffix = " ".join(str(getattr(found, "suffix", None) or "").split()) or suffix
    problem = problem or said
    if suffix not in problem:
        cut = len(suffix) > _LONGEST_SHOWN
        problem += " " + (suffix[: _LONGEST_SHOWN - 4] + "...'" if cut else suffix)
    there, line = places.found()
    return {"problem": f"xacro: {problem}", "file": there or file, "line": line}


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and what caused it, outermost first (xacro keeps causes in ``exc``)."""
    while error is not None:
        yield error
        error = getattr(error, "exc", None) or error.__cause__


def replace_node(node: Any, by: Any, content_only: bool = False) -> None:
    """Put nodes, or what they hold, in the place of one, as xacro's function of this name does."""
    # Inserted one by one, minidom looks for each place from the first child on: half of the time.
    sources = by if isinstance(by, list) else [] if by is None else [by]
    new = sources
    if content_only:
        new = [child for source in sources for child in source.childNodes]
        for source in sources:
            source.childNodes = NodeList()
    siblings = node.parentNode.childNodes
    at = siblings.index(node)
    siblings[at : at + 1] = new
    for child in new:
        child.parentNode = node.parentNode
    for one, two in pairwise([node.previousSibling, *new, node.nextSibling]):
        if one is not None:
            one.nextSibling = two
        if two is not None:
            two.previousSibling = one
    node.nextSibling = node.previousSibling = node.parentNode = None


def _refused(name: str) -> Function:
    """Return what stands for a function that is not accepted."""

    def refuse(*_args: Any, **_options: Any) -> Any:
        raise Refused(f"the function {name!r} is not accepted")

    return Function(name, refuse)


def tokenize(text: str, sep: str = ",; ", skip_empty: Any = True) -> list[str]:
    """Split a text at any of some letters."""
    Refused.refuse_if(
        len(sep) > 100 or any(c in sep for c in "[]"), "separators of that kind are not accepted"
    )
    parts = re.split(f"[{sep}]", text_of(text))
    return [part for part in parts if part] if skip_empty else parts


def text_of(value: Any) -> str:
    """Return a value that is text; refuse any other."""
    if not isinstance(value, str):
        raise TypeError(f"expected text, found a {type(value).__name__}")
    return value


_MOST_YAML_VALUES = 200_000
_NUMBER_TAGS = frozenset({"tag:yaml.org,2002:int", "tag:yaml.org,2002:float"})


class Arguments(dict[str, str]):
    """Substitution arguments that remember which of them the file knows."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.known: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        Refused.refuse_if(
            name not in self, f"argument {name!r} has no value: give --xacro-arg {name}:=VALUE"
        )
        return super().__getitem__(name)


class _Names(dict[str, Any]):
    """Names of ``$(eval ...)``: functions, ``math``, and the arguments themselves."""

    def __missing__(self, name: str) -> Any:
        return self["arg"].call(name)


class Rules:
    """Replaces parts of xacro, the module: ``ask`` asks the parent, ``places`` says where it is."""

    def __init__(
        self, xacro: Any, ask: Callable[[str, str], dict[str, Any]], places: Places, arguments: Any
    ) -> None:
        self.xacro, self.ask, self.places, self.arguments = xacro, ask, places, arguments
        self.tables: dict[str, Any] = {}
        self.kinds = Kinds(xacro.YamlDictWrapper, xacro.YamlListWrapper, xacro.NameSpace)

    def enforce(self) -> None:
        """Put everything in its place."""
        from xacro import substitution_args

        xacro, follow = self.xacro, self.places.follow
        xacro.safe_eval, xacro.parse, xacro.load_yaml = self.safe_eval, self.parse, self.load_yaml
        xacro.glob = SimpleNamespace(glob=self.find_files)
        substitution_args._eval = self.eval_argument
        substitution_args._eval_find = self.find_package
        substitution_args._eval_env = self.variable
        substitution_args._eval_optenv = self.optional_variable
        for module in (xacro, substitution_args):
            for name in ("eval", "exec", "compile"):
                setattr(module, name, self.no_eval)
        for unit in xacro.ConstructUnits:
            Loader.add_constructor(unit.value.tag, unit.constructor)
        self.replace_symbols()
        attributes, lexed = xacro.reqd_attrs, xacro.eval_text

        def required(tag: Any, names: list[str]) -> Any:
            self.places.enter(tag)  # also for what is said of the element when this is done
            return attributes(tag, names)

        def evaluated(text: Any, symbols: Any) -> Any:
            # Most text holds nothing to evaluate, and taking it apart to see that takes time.
            plain = isinstance(text, str) and "$" not in text
            return str(text) if plain else lexed(text, symbols)

        xacro.reqd_attrs, xacro.eval_text = required, follow(evaluated)
        for name in ("eval_all", "grab_property", "process_include", "handle_macro_call"):
            setattr(xacro, name, follow(getattr(xacro, name)))
        xacro.replace_node = replace_node

    def no_eval(self, *_args: Any, **_options: Any) -> Any:
        """Stand for ``eval`` and its like within xacro."""
        raise Refused("Python's eval is out of reach")

    # Names --------------------------------------------------------------------------

    def replace_symbols(self) -> None:
        """Put our own functions behind xacro's global names, which stay the same."""
        symbols = self.xacro._global_symbols
        said = ("message", "warning", "error", "print_location")  # they print, and nothing else
        own = {name: symbols["xacro"][name] for name in said} | self.own_functions()
        known = {**MATH, **FUNCTIONS, "True": True, "False": False}
        known |= {name: Function(f"xacro.{name}", call) for name, call in own.items()}
        spaces = ("math", "python", "xacro")
        for table in (symbols, *(symbols[space] for space in spaces)):
            for name in {*table} - {*spaces}:
                dict.__setitem__(table, name, known[name] if name in known else _refused(name))
        moved = dict.fromkeys(("sorted", "range"), "python")
        moved |= dict.fromkeys(("load_yaml", "abs_filename", "dotify"), "xacro")
        for name, space in moved.items():
            symbols[name] = self.deprecated(name, space, known[name])

    def deprecated(self, name: str, space: str, function: Function) -> Function:
        """Return a function that first says what xacro would say."""

        def warned(*args: Any, **options: Any) -> Any:
            self.xacro.warning(
                f"Using {name}() directly is deprecated. Use {space}.{name}() instead."
            )
            return function.call(*args, **options)

        return Function(name, warned)

    def own_functions(self) -> dict[str, Callable[..., Any]]:
        """Return functions of the namespace ``xacro`` that are not its own."""

        def dotify(values: Any = ()) -> Any:
            if not isinstance(values, dict):
                raise TypeError("xacro.dotify takes a dict")
            return self.xacro.YamlDictWrapper(values)

        def fatal(*words: Any) -> Any:
            raise self.xacro.XacroException(" ".join(map(str, words)))

        return {
            "load_yaml": lambda filename: self.xacro.load_yaml(filename),
            "abs_filename": lambda name: self.xacro.abs_filename_spec(text_of(name)),
            "dotify": dotify,
            "arg": lambda name: self.arguments[name],
            "tokenize": tokenize,
            "fatal": fatal,
        }

    # Expressions --------------------------------------------------------------------

    def safe_eval(self, text: str, names: Any, _local: Any = None) -> Any:
        """Interpret ``${...}``."""
        return evaluate(text, names, self.kinds)

    def eval_argument(self, text: str, context: dict[str, Any]) -> str:
        """Interpret ``$(eval ...)``."""
        from xacro import substitution_args as args

        def argument(name: str) -> Any:
            return args.convert_value(self.arguments[name], "auto")

        def folder() -> str:
            return str(args._eval_dirname(context["filename"]))

        functions = {
            **FUNCTIONS,
            **MATH,
            "true": True,
            "false": False,
            "arg": Function("arg", argument),
            "dirname": Function("dirname", folder),
            "env": Function("env", self.variable),
            "optenv": Function("optenv", self.optional_variable),
            "find": Function("find", self.find_package),
        }
        try:
            return str(evaluate(text, _Names(functions), self.kinds))
        except Exception as error:  # as xacro does for ${...}: say which expression
            suffix = f"when evaluating expression '{text}'"
            raise self.xacro.XacroException(exc=error, suffix=suffix) from error

    # Files --------------------------------------------------------------------------

    def asked(self, kind: str, text: Any) -> Any:
        """Return what the parent has found; what it does not allow is refused."""
        answer = self.ask(kind, text_of(text))
        Refused.refuse_if("problem" in answer, answer.get("problem", ""))
        if "missing" in answer:
            raise OSError(answer["errno"], answer["missing"], text)
        return answer["found"]

    def read(self, filename: str) -> str:
        """Return the text of a file, by the parent's leave."""
        text: str = self.asked("read", filename)
        self.places.texts[filename] = text
        return text

    def find_files(self, pattern: str) -> list[str]:
        """Return the files that a pattern with wildcards stands for."""
        try:
            return list(self.asked("glob", pattern))
        except OSError:
            return []

    def find_package(self, name: str) -> str:
        """Return the folder of a package."""
        if (folder := self.asked("find", name)) is None:
            raise Refused(f"package {name!r} not found: give its folder with --package {name}=DIR")
        return str(folder)

    def variable(self, name: str) -> str:
        """Return an environment variable, as far as the parent shows it."""
        if (found := self.asked("env", name)) is None:
            raise Refused(f"environment variable {name!r} is not set")
        return str(found)

    def optional_variable(self, name: str, default: Any = "") -> Any:
        """Return an environment variable, or something else where it is not set."""
        found = self.asked("env", name)
        return default if found is None else found

    def parse(self, content: Any, filename: str | None = None) -> Any:
        """Return the document of a file."""
        if content is not None or filename is None:
            raise Refused("only files are parsed")
        try:
            text = self.read(filename)
        except OSError as error:  # so that optional includes work, and errors name the includer
            self.xacro.filestack.pop()
            raise self.xacro.XacroException(f"{error.strerror}: {filename}", exc=error) from error
        return Builder(filename).parseString(text)

    def load_yaml(self, filename: Any) -> Any:
        """Return the content of a YAML file, wrapped."""
        filename = self.xacro.abs_filename_spec(text_of(filename))
        if filename in self.tables:  # no expression can change what it gets
            return self.tables[filename]
        text = self.read(filename)
        self.xacro.filestack.append(filename)
        try:
            value = _Placed(text, filename).get_single_data()
        except yaml.YAMLError as error:
            problem, _, line = yaml_problem(error, text, Path(filename))
            raise RefusedAt(problem, filename, line) from None
        self.xacro.filestack.pop()
        self.xacro.all_includes.append(filename)
        self.tables[filename] = self.kinds.listed.wrap(value)
        return self.tables[filename]


class _Placed(Loader):
    """Tells the place of a value that cannot be made; refuses what its own references blow up."""

    def __init__(self, text: str, file: str) -> None:
        self._file = file
        self._values, self._held = 0, dict[int, int]()  # in all, and in each node by its id
        super().__init__(text)

    def _refuse_if(self, wrong: object, problem: str, node: yaml.Node) -> None:
        RefusedAt.refuse_if(wrong, problem, self._file, node.start_mark.line + 1)

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Compose one value, and count those that it holds, references followed."""
        before, again = self._values, self.check_event(yaml.AliasEvent)
        node = super().compose_node(parent, index)
        self._refuse_if(again and id(node) not in self._held, "this YAML holds itself", node)
        self._values += self._held[id(node)] if again else 1
        self._held[id(node)] = self._values - before
        many = f"this YAML holds more than {_MOST_YAML_VALUES} values"
        self._refuse_if(self._values > _MOST_YAML_VALUES, many, node)
        long = node.tag in _NUMBER_TAGS and len(node.value) > LONGEST_NUMBER
        too_long = f"a number of {len(node.value):,} characters is too long"
        self._refuse_if(long, too_long, node)
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Make one value."""
        try:
            return super().construct_object(node, deep)
        except (yaml.YAMLError, RefusedAt):
            raise
        except Exception as error:
            written = f"{node.value!r:.60}: " if isinstance(node, yaml.ScalarNode) else ""
            raise RefusedAt(f"{written}{error}", self._file, node.start_mark.line + 1) from None
