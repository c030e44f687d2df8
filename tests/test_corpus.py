"""scripts/corpus: what counts as lost when frozen answers are held against new ones."""

import copy
import importlib.util
import json
import lzma
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import python

CORPUS = Path(__file__).parent.parent / "scripts" / "corpus"
KEY = "seed 17"


@pytest.fixture(scope="module")
def entries():
    spec = importlib.util.spec_from_file_location("corpus_entries", CORPUS / "entries.py")
    module = importlib.util.module_from_spec(spec)
    before = list(sys.path)
    spec.loader.exec_module(module)
    yield module
    sys.path[:] = before


@pytest.fixture(scope="module")
def frozen(entries):
    return entries.entry(KEY, 1.0)


def sorts(entries, old) -> set[str]:
    return {s for s, _ in entries.changes(old, entries.entry(KEY, 1.0, old))}


def test_the_same_code_loses_and_gains_nothing(entries, frozen):
    assert len(frozen["families"]) == 2
    assert frozen["singular"]
    assert frozen["regular"] == 0
    assert sorts(entries, frozen) == set()


def _family_gone(old):
    elsewhere = np.random.default_rng(5).uniform(-3, 3, (2, len(old["families"][0]["points"][0])))
    old["families"].append({**old["families"][0], "text": "gone", "points": elsewhere.tolist()})


def _singular_point_gone(old):
    q = np.random.default_rng(6).uniform(-3, 3, len(old["singular"][0]["q"]))
    old["singular"].append({"q": q.tolist(), "codimension": 1})


def _bound_closer(old):
    # 5 % from below is what was proven, and the true distance allows it.
    old["bounds"]["lower"] = [x * 1.05 for x in old["bounds"]["lower"]]
    old["bounds"]["upper"] = [x * 1.2 for x in old["bounds"]["upper"]]


@pytest.mark.parametrize(
    "change",
    [
        _family_gone,
        _singular_point_gone,
        _bound_closer,
        lambda old: old["families"][0].update(codimension=2),
        lambda old: old["families"][0]["kinds"].append("other"),
        lambda old: old.update(rank=old["rank"] - 1),
        lambda old: old.update({"aspects on circles": [999, 999]}),
        lambda old: old.update(singular=[{**s, "codimension": 2} for s in old["singular"]]),
    ],
)
def test_what_was_there_and_is_not_is_a_loss(entries, frozen, change):
    old = copy.deepcopy(frozen)
    change(old)
    assert "loss" in sorts(entries, old)


def test_words_lower_are_losses_and_higher_are_gains(entries, frozen):
    new = entries.entry(KEY, 1.0, frozen)
    for k, word in enumerate(entries.WORDS):
        found = set(entries.changes({**frozen, "word": word}, new))
        at = entries.WORDS.index(new["word"])
        expected = "loss" if k > at else "gain"
        assert {s for s, _ in found} == (set() if k == at else {expected})
    less = {**new, "word": "not complete"}
    assert ("loss", f"{frozen['word']} became not complete") in entries.changes(frozen, less)


def test_a_regular_point_stated_as_singular_is_a_loss(entries, frozen):
    new = entries.entry(KEY, 1.0, frozen)
    assert "loss" in {s for s, _ in entries.changes(frozen, {**new, "regular": 1})}


@pytest.mark.slow
def test_the_command_freezes_resumes_and_compares(tmp_path):
    file = tmp_path / "corpus.json.xz"
    for words in (["make", file], ["compare", file, "--fresh"]):
        done = python(CORPUS, *words, "--only", "seed 171")
        assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "0 losses" in done.stderr
    (frozen,) = json.loads(lzma.decompress(file.read_bytes()))
    file.write_bytes(lzma.compress(json.dumps([{**frozen, "word": "not complete"}]).encode()))
    assert "became" in python(CORPUS, "compare", file, "--only", "seed 171").stdout
    assert "1 renewed" in python(CORPUS, "renew", file, "--only", "seed 171").stderr
    (again,) = json.loads(lzma.decompress(file.read_bytes()))
    assert {**again, "seconds": 0} == {**frozen, "seconds": 0}
