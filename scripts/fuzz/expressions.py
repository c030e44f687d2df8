"""Expressions for xacro, from a grammar: ordinary ones, and wild ones.

Python knows the value of an ordinary one as well.
"""

from __future__ import annotations

import random

_NAMES = ("n", "side", "xyz", "pi", "data.size", "data['a']['b'][0]", "data.name")
_WILD = (
    "().__class__", "''.__class__.__mro__", "open('/etc/passwd')", "__import__('os')",
    "__builtins__", "(lambda: 1)()", "(x := 3)", "[].append(1)", "'{0.__class__}'.format(1)",
    "f'{n}'", "exec('1')", "eval('1')", "getattr(n, 'real')", "type(n)", "data.__class__",
    "data.a.b", "data.nothing", "data._x", "globals()", "vars()", "dir()", "print(1)",
    "math.__dict__", "xacro.load_yaml('x')", "n.real", "n.__add__(1)", "'a' * 10**9",
    "10**10**10", "1 << 10**9", "[0] * 10**9", "range(10**12)", "list(range(10**8))",
    "sum(range(10**8))", "sorted(data)", "{}", "{1: 2}[1]", "{**data}", "[*xyz]", "...", "b'x'",
    "1j", "'%1000000000d' % 1", "'x'.join([side] * 9)", "not_there",
    "[i for i in range(9) for j in range(i)]", "{i: i for i in xyz}", "{i for i in xyz}",
    "(i for i in xyz)", "await n", "yield n", "max()", "min(1)", "int('9' * 9999)",
    "float('nan')", "round(n, 99999999)", "str(data)", "len(range(10**30))", "xyz[::-1]",
    "xyz[10**30]", "-True", "~n", "math.pow(10, 400)", "math.factorial(10**6)",
    "math.comb(10**6, 5 * 10**5)", "math.nope", "abs", "xyz.split", "xyz.split()",
    "xyz.replace('', 'x' * 999)", "[abs][0](-1)", "(abs if n else max)(1, 2)",
)  # fmt: skip
_TOKENS = (
    "(", ")", "[", "]", "{", "}", ",", ":", ".", "'", "\"", "+", "-", "*", "**", "/", "//", "%",
    "<<", ">>", "&", "|", "^", "~", "<", ">", "==", "!=", ":=", "=", "if", "else", "for", "in",
    "not", "and", "or", "lambda", "is", "None", "True", "0", "1", "9", "1e999", "0x", "1_", "n",
    "side", "data", "math", "\\", "\n", "#", ";", "@", "!", "`", "\u00e9", "\u00b2", "\u0000",
    "\u202e",
)  # fmt: skip


def ordinary(rng: random.Random) -> str:
    """An expression of numbers, texts and lists that stays small whatever it gives."""
    return rng.choice([_number, _number, _text, _truth, _list])(rng, rng.randrange(1, 6))


def wild(rng: random.Random) -> str:
    """An expression that may hold, or be, anything."""
    text = ordinary(rng) if rng.random() < 0.6 else rng.choice(_WILD)
    return changed(rng, text, rng.choice([0, 1, 1, 2, 4]))


def changed(rng: random.Random, text: str, times: int = 1) -> str:
    """An expression with something changed, put in or put around it, so many times."""
    for _ in range(times):
        way = rng.randrange(6)
        spot = rng.randrange(len(text) + 1)
        if way == 0:
            text = text[:spot] + rng.choice(_TOKENS) + text[spot:]
        elif way == 1:
            text = text[:spot] + text[spot + 1 :]
        elif way == 2:
            text = text.replace(
                rng.choice(["1", "2", "n", "side", "xyz"]), f"({rng.choice(_WILD)})", 1
            )
        elif way == 3:
            word = rng.choice(["+", "*", "**", "%", "in", "and", "if n else", "=="])
            text = f"{text} {word} {rng.choice(_WILD)}"
        elif way == 4:
            depth = rng.choice([3, 59, 70, 300, 3000])
            text = (
                rng.choice(["(", "-", "[", "not "]) * depth + text + rng.choice(["", ")" * depth])
            )
        else:
            name = rng.choice(["str", "len", "list", "sorted", "max", "sum", "dict", "int"])
            text = f"{name}({text})"
    return text


def _number(rng: random.Random, depth: int) -> str:
    if depth <= 0 or rng.random() < 0.15:
        return rng.choice(["0", "1", "2", "7", "0.5", "1e-3", "0x1f", "1_000", "n", "pi", "True"])
    one = _number(rng, depth - 1)
    two = _number(rng, depth - 1)
    return rng.choice(
        [
            f"{one} + {two}", f"({one}) - ({two})", f"({one}) * ({two})", f"({one}) / ({two})",
            f"({one}) // ({two})", f"({one}) % ({two})", f"-({one})", f"abs({one})",
            f"({one}) ** {rng.choice(['0', '1', '2', '-1', '0.5'])}", f"min({one}, {two})",
            f"max({one}, {two})", f"int({one})", f"float({one})", f"math.sin({one})",
            f"radians({one})", f"sqrt({one})", f"atan2({one}, {two})", f"math.floor({one})",
            f"({one} if {two} else 3)", f"len({_list(rng, depth - 1)})",
            f"sum({_list(rng, depth - 1)})", f"({one} or {two})", f"round({one})",
            f"{rng.choice(_NAMES[4:6])}", f"len({_text(rng, depth - 1)})", f"({one} & {two})",
            f"({one} | {two})", f"({one} ^ {two})", f"~({one})",
            f"(int({one}) % 9 << int(abs({two})) % 9)", f"{_list(rng, depth - 1)}[{two}]",
        ]
    )  # fmt: skip


def _text(rng: random.Random, depth: int) -> str:
    if depth <= 0 or rng.random() < 0.2:
        return rng.choice(["''", "'a'", "side", "xyz", "'0.5'", "data.name", '"it\'s"', "'é'"])
    one = _text(rng, depth - 1)
    return rng.choice(
        [
            f"{one} + {_text(rng, depth - 1)}", f"str({_number(rng, depth - 1)})", f"({one})[0]",
            f"({one})[{_number(rng, 1)}:]", f"({one})[::-1]", f"({one}) * 3", f"({one}).upper()",
            f"({one} if {_truth(rng, depth - 1)} else 'b')", f"({one}).split()[0]",
            f"({one}).replace('a', 'b')", f"str({_list(rng, depth - 1)})", f"({one}).strip()",
        ]
    )  # fmt: skip


def _truth(rng: random.Random, depth: int) -> str:
    one, two = _number(rng, depth - 1), _number(rng, depth - 1)
    return rng.choice(
        [
            f"{one} < {two}", f"{one} <= {two} != 4", f"({one}) == ({two})", f"not ({one})",
            f"({one}) in {_list(rng, depth - 1)}", f"({_text(rng, depth - 1)}) in xyz",
            f"({one}) is None", f"({_truth(rng, 0) if depth > 0 else 'n'}) and ({one})",
            f"{_text(rng, depth - 1)} == side", f"bool({one})",
        ]
    )  # fmt: skip


def _list(rng: random.Random, depth: int) -> str:
    if depth <= 0 or rng.random() < 0.2:
        return rng.choice(["[]", "[1, 2, 3]", "(1, 2)", "[n]", "xyz.split()", "[0.5, 'a']"])
    one, two = _number(rng, depth - 1), _number(rng, depth - 1)
    return rng.choice(
        [
            f"[{one}, {two}]", f"[{one}] + [{two}]", f"[{one}] * 3",
            f"list(range(int({one}) % 9))", f"[i * 2 for i in {_list(rng, depth - 1)}]",
            f"[i for i in [{one}, {two}] if i]", f"sorted([{one}, {two}])",
            f"{_list(rng, depth - 1)}[1:]", f"({one}, {two})",
        ]
    )  # fmt: skip
