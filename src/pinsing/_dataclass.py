"""``dataclass`` of the standard library, but cheap to define.

That one writes up to seven methods of each class as text, and compiles them when the class is
defined: 0.7 ms a class, a seventh of the time of a short command, which makes objects of a third
of its classes. Here methods are compiled when they are first asked for, and those that print and
freeze are plain functions. Fields, defaults and what a class does are those of the standard
library; type checkers see nothing else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

__all__ = ["dataclass"]

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:
    import builtins
    import dataclasses
    import sys
    from reprlib import recursive_repr

    _PARAMS = "__dataclass_params__"

    def dataclass(cls=None, /, *, frozen=False, eq=True, repr=True):
        """Make a class a dataclass; ``frozen``, ``eq`` and ``repr`` as in the standard library."""
        if cls is None:
            return lambda cls: _made(cls, frozen, eq, repr)
        return _made(cls, frozen, eq, repr)

    def _made(cls, frozen, eq, repr):
        if not cls.__doc__:  # else the standard library looks for a signature to put there
            cls.__doc__ = cls.__name__
        own = {name for name, value in vars(cls).items() if (name, value) != ("__hash__", None)}
        _with_fields(cls, frozen)
        methods = {"__init__": _Late(cls, "__init__", _init_of_frozen if frozen else _init)}
        if repr:
            methods["__repr__"] = _repr
        if eq:
            methods["__eq__"] = _Late(cls, "__eq__", _eq)
            methods["__hash__"] = _Late(cls, "__hash__", _hash) if frozen else None
        if frozen:
            methods["__setattr__"], methods["__delattr__"] = _freezers(cls)
        for name, method in methods.items():
            if name not in own:
                setattr(cls, name, method)
        return cls

    def _with_fields(cls, frozen):
        """Have the standard library find the fields; what derives from the class is told of it."""
        above = [vars(c)[_PARAMS] for c in cls.__mro__[1:] if _PARAMS in vars(c)]
        were = [params.frozen for params in above]
        if frozen and not all(were):
            raise TypeError("cannot inherit frozen dataclass from a non-frozen one")
        if not frozen and any(were):
            raise TypeError("cannot inherit non-frozen dataclass from a frozen one")
        for params in above:  # else it would write what freezes, or refuse
            params.frozen = False
        try:
            dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
        finally:
            for params in (*above, vars(cls)[_PARAMS]):
                params.frozen = frozen

    class _Unset:
        def __repr__(self):  # in a signature, as the standard library has it
            return "<factory>"

    _UNSET = _Unset()

    class _Late:
        """A method until someone asks for it: then it is compiled, and takes this place."""

        def __init__(self, owner, name, lines):
            self.owner, self.name, self.lines = owner, name, lines

        def __get__(self, instance, owner=None):
            method = _compiled(self.owner, self.name, self.lines)
            setattr(self.owner, self.name, method)
            return method if instance is None else method.__get__(instance, owner)

    def _compiled(cls, name, lines):
        beside = {}  # what the method sees besides the names of its module
        body = "\n  ".join(lines(cls, beside))
        text = f"def outer({', '.join(beside)}):\n {body}\n return {name}"
        made = {}
        exec(text, vars(sys.modules.get(cls.__module__, builtins)), made)
        method = made["outer"](**beside)
        method.__qualname__ = f"{cls.__qualname__}.{name}"
        method.__module__ = cls.__module__
        if name == "__init__":
            types = {f.name: f.type for f in dataclasses.fields(cls) if f.init}
            method.__annotations__ = {**types, "return": None}
        return method

    def _init(cls, scope, put="self.{0} = {1}"):
        """Lines of ``__init__``; defaults go into its scope."""
        plain, by_name, body = [], [], []
        scope["unset"] = _UNSET
        for f in dataclasses.fields(cls):
            name, default, value = f.name, "", f.name
            if f.default is not dataclasses.MISSING:
                scope[f"default_{name}"], default = f.default, f"=default_{name}"
            elif f.default_factory is not dataclasses.MISSING:
                scope[f"make_{name}"], default = f.default_factory, "=unset"
                value = f"make_{name}()" + f" if {name} is unset else {name}" * f.init
            if f.init:
                (by_name if f.kw_only else plain).append(name + default)
            if f.init or value != name:
                body.append(put.format(name, value))
        words = ["self", *plain, *["*"][: len(by_name)], *by_name]
        if hasattr(cls, "__post_init__"):
            body.append("self.__post_init__()")
        return [f"def __init__({', '.join(words)}):", *body, "return"]

    def _init_of_frozen(cls, scope):
        scope["put"] = object.__setattr__
        return _init(cls, scope, "put(self, {0!r}, {1})")

    def _eq(cls, scope):
        names = [f.name for f in dataclasses.fields(cls) if f.compare]
        same = f"{_tuple('self', names)} == {_tuple('other', names)}"
        unlike = "if other.__class__ is not self.__class__: return NotImplemented"
        return ["def __eq__(self, other):", unlike, f"return {same}"]

    def _hash(cls, scope):
        hashed = [f for f in dataclasses.fields(cls) if (f.compare if f.hash is None else f.hash)]
        return ["def __hash__(self):", f"return hash({_tuple('self', [f.name for f in hashed])})"]

    def _tuple(of, names):
        return f"({''.join(f'{of}.{name}, ' for name in names)})"

    @recursive_repr()
    def _repr(self):
        shown = [f.name for f in dataclasses.fields(self) if f.repr]
        values = ", ".join(f"{name}={getattr(self, name)!r}" for name in shown)
        return f"{self.__class__.__qualname__}({values})"

    def _freezers(cls):
        def refused(self, name):
            return type(self) is cls or name in cls.__dataclass_fields__

        def __setattr__(self, name, value):
            if refused(self, name):
                raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
            super(cls, self).__setattr__(name, value)

        def __delattr__(self, name):
            if refused(self, name):
                raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
            super(cls, self).__delattr__(name)

        return __setattr__, __delattr__
