"""Public packages: names are imported when first used, and a wrong name says which is right."""

from __future__ import annotations

import difflib
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any


class Package(ModuleType):
    """A package that shows its public names and no others.

    Its attribute is the function, not the module of the same name, whatever was imported before.
    """

    _homes: Mapping[str, str] = {}
    _packages: Sequence[str] = ()
    _advice: Mapping[str, str] = {}
    _called = ""

    def __getattr__(self, name: str) -> Any:
        if name in self._homes:
            value = getattr(importlib.import_module(self._homes[name]), name)
        elif name in self._packages:
            value = importlib.import_module(f"{self.__name__}.{name}")
        else:
            raise AttributeError(self._refusal(name))
        self.__dict__[name] = value
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        # The import system binds every module of a package in it.
        if not (name in self._homes and isinstance(value, ModuleType)):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        own = (n for n in self.__dict__ if n.startswith("__") and n.endswith("__"))
        return sorted({*own, *self.__all__, *self._packages})

    def __call__(self, *_: object, **__: object) -> None:
        hint = self._called or ", ".join(f"{self.__name__}.{n}" for n in self.__all__[:4])
        raise TypeError(f"{self.__name__} is a module, not a function: use {hint}")

    def advice(self, name: str) -> str:
        """Return what to use for a name that is advised on, or the function of that name."""
        if name in self._packages:
            return str(getattr(importlib.import_module(f"{self.__name__}.{name}"), "_called", ""))
        function = f"{self.__name__}.{name}" if name in self.__all__ else ""
        return function or self._advice.get(name, "")

    def _refusal(self, name: str) -> str:
        """Say what to use instead of a name that is not there."""
        refusal = f"module {self.__name__!r} has no attribute {name!r}"
        # Python asks for dunders, and for a module before it imports it.
        if name.startswith("_") or importlib.util.find_spec(f"{self.__name__}.{name}"):
            return refusal
        if name in self._advice:
            return f"{refusal}: use {self._advice[name]}"
        places: dict[str, str] = {}
        for package in self._packages:
            module = importlib.import_module(f"{self.__name__}.{package}")
            places = dict.fromkeys(module.__all__, module.__name__) | places
        places |= dict.fromkeys(self.__all__, self.__name__)
        close = [name] if name in places else difflib.get_close_matches(name, places, 1, 0.7)
        return f"{refusal}: use {places[close[0]]}.{close[0]}" if close else refusal


def advised(name: str) -> str:
    """Return what the outermost package says to use for a name that it has not, or nothing."""
    outermost = sys.modules[__name__.partition(".")[0]]
    return outermost.advice(name) if isinstance(outermost, Package) else ""


def public(
    package: str,
    homes: Mapping[str, str],
    *,
    packages: Sequence[str] = (),
    advice: Mapping[str, str] | None = None,
    called: str = "",
) -> None:
    """Make a package import its names when they are first used.

    ``homes``: the names, separated by spaces, that each module holds, in the package or elsewhere
    if there is a dot in it. ``packages``: public ones within it. ``advice``: what to use instead of
    names that people guess. ``called``: the same where the package is called like a function.
    """
    module = sys.modules[package]
    found = {
        name: home if "." in home else f"{package}.{home}"
        for home, names in homes.items()
        for name in names.split()
    }
    module.__class__ = Package
    module.__dict__.setdefault("__all__", sorted(found))
    module.__dict__.update(_homes=found, _packages=packages, _advice=advice or {}, _called=called)


_GUESSES = {
    "jacobian": "J",
    "singular_values": "sigma",
    "is_singular": "singular",
    "limits": "lower and upper",
    "count": "lower and upper",
    "joint_names": "joints",
    "tool": "tip",
    **dict.fromkeys(("dof", "nq", "nv"), "n"),
    **dict.fromkeys(("equations", "keys", "names"), "families"),
}
_ELSEWHERE = {
    "plot": "the functions of pinsing.plot",
    "save": "to_json()",
    "show": "pinsing.Viewer",
    **{name: f"form[{name!r}]" for name in ("wrist", "elbow", "shoulder", "F1", "F2", "F3")},
}


class Advised:
    """Mixin of classes that say what to use where they are asked for what they have not."""

    if not TYPE_CHECKING:  # which would take every name for an attribute

        def __getattr__(self, name: str) -> Any:
            kind = type(self)
            refusal = f"{kind.__name__} has no attribute {name!r}"
            if not name.startswith("_"):
                hint = _hint(kind, name)
                refusal += f": use {hint}" if hint else ""
            raise AttributeError(refusal)


def _hint(kind: Any, name: str) -> str:
    """Say what stands for an attribute that a class has not; empty for no idea."""
    import dataclasses  # `import pinsing` takes no time

    known = [n for n in dir(kind) if not n.startswith("_")]
    known += [f.name for f in dataclasses.fields(kind)]
    guess = _GUESSES.get(name, "")
    if guess.partition(" ")[0] in known:
        return guess
    close = difflib.get_close_matches(name, known, 3, 0.7)
    return _ELSEWHERE.get(name) or advised(name) or " or ".join(close)
