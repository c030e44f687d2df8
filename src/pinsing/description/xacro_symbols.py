"""The global names of xacro, with functions of our own behind them.

Runs in the xacro child process only.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from pinsing.description.xacro_values import FUNCTIONS, MATH, Function, Refused


class Symbols:
    """Replaces what is behind xacro's global names.

    Parameters
    ----------
    xacro : module
        The package.
    arguments : Mapping of str to str
        Values of ``xacro.arg``.
    """

    def __init__(self, xacro: Any, arguments: Mapping[str, str]) -> None:
        self.xacro, self.arguments = xacro, arguments

    def replace(self) -> None:
        """Put our own functions behind the global names, which stay the same."""
        symbols, spaces = self.xacro._global_symbols, {}
        spaces["math"] = dict(MATH)
        spaces["python"] = {**FUNCTIONS, "True": True, "False": False}
        spaces["xacro"] = self.own_functions()
        for space, known in spaces.items():
            for name in list(symbols[space]):
                dict.__setitem__(symbols[space], name, self.refusal(name, known))
        deprecated = {"sorted": "python", "range": "python"}
        deprecated |= dict.fromkeys(("load_yaml", "abs_filename", "dotify"), "xacro")
        for name in list(symbols):
            if name in spaces:
                continue
            if name in deprecated:
                symbols[name] = self.deprecated(name, deprecated[name], spaces)
            else:
                known = spaces["python"] if name in spaces["python"] else spaces["math"]
                symbols[name] = self.refusal(name, known)

    def refusal(self, name: str, known: Mapping[str, Any]) -> Any:
        """Return what a name stands for; a function that refuses, where we have none."""
        if name in known:  # False is known, too
            return known[name]

        def refuse(*_args: Any, **_options: Any) -> Any:
            raise Refused(f"the function {name!r} is not accepted")

        return Function(name, refuse)

    def deprecated(self, name: str, space: str, spaces: Mapping[str, Any]) -> Function:
        """Return a function that first says what xacro would say."""
        function = spaces[space][name]

        def warned(*args: Any, **options: Any) -> Any:
            self.xacro.warning(
                f"Using {name}() directly is deprecated. Use {space}.{name}() instead."
            )
            return function.call(*args, **options)

        return Function(name, warned)

    def own_functions(self) -> dict[str, Function]:
        """Return the functions of the namespace ``xacro``."""
        functions: dict[str, Callable[..., Any]] = {
            "load_yaml": lambda filename: self.xacro.load_yaml(filename),
            "abs_filename": lambda name: self.xacro.abs_filename_spec(text_of(name)),
            "dotify": self.dotify,
            "arg": lambda name: self.arguments[name],
            "tokenize": tokenize,
            "fatal": self.fatal,
            **{name: self.message(name) for name in ("message", "warning", "error")},
            "print_location": self.message("print_location"),
        }
        return {name: Function(f"xacro.{name}", call) for name, call in functions.items()}

    def dotify(self, values: Any = ()) -> Any:
        """Wrap a dict, so that a dot reaches its keys."""
        if not isinstance(values, dict):
            raise TypeError("xacro.dotify takes a dict")
        return self.xacro.YamlDictWrapper(values)

    def fatal(self, *words: Any) -> Any:
        """End with a message of the file's making."""
        raise self.xacro.XacroException(" ".join(map(str, words)))

    def message(self, name: str) -> Callable[..., str]:
        """Return a function that prints, as xacro does, and gives empty text."""
        write = getattr(self.xacro, name)

        def said(*words: Any, print_location: Any = None, **looks: Any) -> str:
            if set(looks) - {"color", "alt_text", "file"}:
                raise TypeError(f"xacro.{name} got an unexpected keyword argument")
            write(*words)
            if name in ("warning", "error") if print_location is None else print_location:
                self.xacro.print_location()
            return ""

        return said


def tokenize(text: str, sep: str = ",; ", skip_empty: Any = True) -> list[str]:
    """Split a text at any of some letters."""
    if len(sep) > 100 or any(c in sep for c in "[]"):
        raise Refused("separators of that kind are not accepted")
    parts = re.split(f"[{sep}]", text_of(text))
    return [part for part in parts if part] if skip_empty else parts


def text_of(value: Any) -> str:
    """Return a value that is text; refuse any other."""
    if not isinstance(value, str):
        raise TypeError(f"expected text, found a {type(value).__name__}")
    return value
