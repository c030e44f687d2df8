"""What the tests share: reproducible property tests, and small robots written on the spot."""

import compileall
import functools
import gc
import importlib
import inspect
import os
import signal
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import patch

# Each test file, and Hypothesis, is compiled with its assertions rewritten: 7 s of all, kept for
# the next run and other workers, also where the environment forbids that. Tests have its way.
_WRITES_NOTHING = sys.dont_write_bytecode
sys.dont_write_bytecode = False

import click.testing  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402
from hypothesis.internal.conjecture import providers  # noqa: E402

settings.register_profile(
    "pinsing",
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("pinsing")
settings.register_profile("quick", settings.get_profile("pinsing"), max_examples=40)
# Examples are the same whatever has been imported: numbers that stand in our own modules, which
# would be among them, take 3 s to collect.
providers._get_local_constants = lambda: providers._local_constants

# What a test reads it reads itself, and nothing of it stays on the user's disk.
os.environ["PINSING_CACHE"] = ""
# Nothing is drawn on a screen.
os.environ["MPLBACKEND"] = "agg"


def pytest_configure(config: pytest.Config) -> None:
    """The quick tier draws fewer examples, and takes what tests found before for granted."""
    quick = "not slow" in config.option.markexpr
    settings.load_profile("quick" if quick else "pinsing")
    if quick and getattr(config.option, "dist", "no") == "no":  # not what hands out tests alone
        _share("pinsing.robot.load", "load")
        _share("pinsing.families.solve", "closed_form")
        _share("pinsing.robot.mechanism", "load_mechanism")
        _share("pinsing.loops.analysis", "analyze_mechanism")
        _share("pinsing.postures.aspects", "aspects")
        for name in _CHANGES:
            setattr(pytest.MonkeyPatch, name, _alone(getattr(pytest.MonkeyPatch, name)))


_sharing = True
_CHANGES = ("setattr", "delattr", "setitem", "delitem")
_URDF = str(Path(__file__).resolve().parents[1] / "urdf")


def pytest_runtest_setup(item: pytest.Function) -> None:
    """A test that changes the program shares nothing with others, from its start on."""
    global _sharing
    _sharing = not {*_CHANGES} & {*item.function.__code__.co_names}


def _alone(change: Callable[..., None]) -> Callable[..., None]:
    """A fixture or helper that changes the program ends the sharing, for one test."""

    @functools.wraps(change)
    def changed(*args: Any, **options: Any) -> None:
        global _sharing
        _sharing = False
        change(*args, **options)

    return changed


def _kept(given: Any) -> Any:
    """An arm, a form, or what comes with pinsing by its name; no text or file of a test's own."""
    if not isinstance(given, str | Path):
        return given if type(given).__name__ in ("Arm", "ClosedForm", "Mechanism") else None
    ours = str(given).isidentifier() or os.path.dirname(os.path.abspath(given)) == _URDF
    return str(given) if ours else None


def _share(home: str, name: str) -> None:
    """Keep what a function says of a robot's name, an arm or a form, in one process of tests."""
    module, known = importlib.import_module(home), {}
    compute = getattr(module, name)
    signature = inspect.signature(compute)

    @functools.wraps(compute)
    def shared(*args: Any, **options: Any) -> Any:
        try:
            told = signature.bind(*args, **options)
            told.apply_defaults()
            if callable(told.arguments.get("progress")):
                told.arguments["progress"] = None
            given, *rest = told.arguments.values()
            key = (_kept(given), *((type(v), v) for v in rest))
            there = key in known
        except TypeError:  # a list, say
            return compute(*args, **options)
        files = any(isinstance(x, str | Path) and os.sep in str(x) for x in rest)
        if not _sharing or key[0] is None or files:
            return compute(*args, **options)
        if not there:
            known[key] = compute(*args, **options)
        return known[key]

    setattr(module, name, shared)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what asks for a browser or for Node.js: `.ci/run` runs these once more, with both."""
    for item in items:
        assert isinstance(item, pytest.Function)
        node = any("Node.js" in m.kwargs.get("reason", "") for m in item.iter_markers("skipif"))
        if node or "browser" in item.fixturenames:
            item.add_marker("outside")


def pytest_collection_finish() -> None:
    """What tests start reads compiled modules, also where the environment forbids to keep any."""
    import pinsing

    compileall.compile_dir(Path(pinsing.__file__).parent, quiet=2)
    sys.dont_write_bytecode = _WRITES_NOTHING
    # What has been collected stays to the end: no search for garbage need look through it.
    gc.collect()
    gc.freeze()


def pytest_sessionfinish() -> None:
    gc.unfreeze()


@pytest.fixture
def undrawn() -> Iterator[None]:
    """Reports whose pictures are empty: drawing takes most of the time of one."""
    empty = {"new": lambda figure, only=(): bytes(24)}
    with (
        patch("pinsing.report.arm_report.png", **empty),
        patch("pinsing.report.document.png", **empty),
    ):
        yield


# A shell that runs the tests in the background has them, and all they start, ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Syntax trees of all modules are looked through for garbage a hundredth as often: 4 s less.
gc.set_threshold(70_000)

if version("click").startswith("8.1."):  # later ones always keep standard error apart

    class _Runner(click.testing.CliRunner):
        def __init__(self, **options: Any) -> None:
            super().__init__(**{"mix_stderr": False, **options})

    click.testing.CliRunner = _Runner  # type: ignore[misc]


@pytest.fixture(autouse=True)
def _no_figure_stays() -> Iterator[None]:
    """What a test draws is its own: pyplot keeps figures, and warns of many of them."""
    yield
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium; where there is none, the tests that ask for it skip."""
    from chromium import FLAGS

    from pinsing.view.picture import find_browser

    path = find_browser()
    if path is None:
        pytest.skip("needs Chromium or Chrome")
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs Playwright for Python")
    with sync_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A tab; the test fails if the page says a word of error, or fetches from elsewhere."""
    from chromium import SIZE

    tab = browser.new_page(viewport=SIZE)
    tab.set_default_timeout(90_000)  # drawn by the processor, beside another browser
    said: list[str] = []
    tab.on("console", lambda m: said.append(m.text) if m.type in ("error", "warning") else None)
    tab.on("pageerror", lambda e: said.append(str(e)))
    asked: list[str] = []
    tab.on("request", lambda r: asked.append(r.url))
    yield tab
    tab.close()
    # Drivers of headless browsers talk about speed; that is no fault of the page.
    assert [s for s in said if "GPU stall" not in s and "GL Driver Message" not in s] == []
    assert [
        a for a in asked if not a.startswith(("http://127.0.0.1:", "file:", "data:", "blob:"))
    ] == []


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Any]:
    """Read a robot description that is given as text."""
    from pinsing.description.urdf import read_description

    def write_and_read(text: str | bytes, name: str = "arm.urdf", **options: Any) -> Any:
        file = tmp_path / name
        file.write_bytes(text.encode() if isinstance(text, str) else text)
        return read_description(file, **options)

    return write_and_read


@pytest.fixture
def refused(read: Callable[..., Any], tmp_path: Path) -> Callable[..., Any]:
    """Read one that must be refused: the error, which is one line about that file."""
    from pinsing.errors import RobotFileError

    def read_and_fail(text: str | bytes, name: str = "arm.urdf", **options: Any) -> Any:
        with pytest.raises(RobotFileError) as caught:
            read(text, name, **options)
        assert str(caught.value).startswith(str(tmp_path / name))
        assert "\n" not in str(caught.value)
        return caught.value

    return read_and_fail
