#!/usr/bin/env python
"""Run the tests of the compiled kernel under AddressSanitizer and UndefinedBehaviorSanitizer.

python scripts/fuzz/sanitize.py [--isa avx2] [-- words for pytest]

The kernel is compiled once more, into a temporary folder, and put in the place of the installed
one. What reads or writes out of bounds, shifts too far, overflows, divides by zero as an integer
or loads a bool that is none ends the run with a report. Exit code 77: it cannot be done here.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = 77
FLAGS = (
    *("-std=c++17", "-O1", "-g1", "-fPIC", "-fno-omit-frame-pointer", "-fvisibility=hidden"),
    *("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-strict-aliasing"),
    *("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"),
)
# As in CMakeLists.txt; every one of them compiles the same source for other widths.
ISA = {
    "baseline": (),
    "avx2": ("-mavx2", "-mfma"),
    "avx512": ("-mavx2", "-mfma", "-mavx512f", "-mavx512dq", "-mavx512vl", "-mavx512bw"),
}
TESTS = (
    *("tests/batch/test_batch.py", "tests/kinematics/test_refine.py"),  # the walks are of this one
    "tests/algebra/test_generic_points.py",
)
_CLEARANCE = "tests/proximity/test_clearance.py::test_the_compiled_bounds_are_those_of_numpy"

PLUGIN = '''
"""Puts the kernel that was compiled for the sanitizers in the place of the installed one."""
import importlib.util
import sys

spec = importlib.util.spec_from_file_location("pinsing._batch._kernel", {module!r})
module = importlib.util.module_from_spec(spec)
sys.modules["pinsing._batch._kernel"] = module
spec.loader.exec_module(module)


def pytest_terminal_summary(terminalreporter):
    terminalreporter.write_line("kernel: " + ", ".join(module.isa_names()))


def pytest_sessionfinish():
    from pinsing._batch import engine

    assert engine._kernel is module, "another kernel was tested"
'''


def missing() -> str | None:
    """Why it cannot be done here, in one sentence."""
    compiler = _compiler()
    if platform.system() != "Linux" or shutil.which(compiler) is None:
        return "GCC on Linux is needed"
    for name in ("libasan.so", "libubsan.so"):
        if not Path(_library(name)).is_absolute():
            return f"{compiler} has no {name}"
    try:
        import nanobind  # noqa: F401
    except ImportError:
        return "nanobind is not installed: pip install nanobind"
    return None


def _compiler() -> str:
    return os.environ.get("CXX", "g++")


def _library(name: str) -> str:
    words = [_compiler(), f"-print-file-name={name}"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def _fingerprint(batch: Path) -> str:
    """What the build writes into the kernel: a kernel without it is taken for an old one."""
    spec = importlib.util.spec_from_file_location("built_from", batch / "built_from.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return str(module.fingerprint(batch))


def build(folder: Path, isas: list[str], jobs: int) -> Path:
    """Compile the kernel; the path of the module."""
    import nanobind

    source = Path(nanobind.source_dir())
    includes = [source.parent / "ext/robin_map/include", nanobind.include_dir()]
    includes += [sysconfig.get_path("include")]
    common = [
        *FLAGS,
        *(f"-I{p}" for p in includes),
        *(f"-DPINSING_HAVE_{i.upper()}=1" for i in isas),
    ]
    batch = ROOT / "src/pinsing/_batch"
    common.append(f'-DPINSING_SOURCES="{_fingerprint(batch)}"')
    kernel = batch / "kernel.cpp"
    sources = [(kernel, isa, (*ISA[isa], f"-DPINSING_ISA={isa}")) for isa in isas]
    others = {*batch.glob("*.cpp"), source / "nb_combined.cpp"} - {kernel}
    sources += [(path, "", ()) for path in sorted(others)]

    def compile_one(item: tuple[Path, str, tuple[str, ...]]) -> str:
        path, isa, more = item
        out = folder / f"{path.stem}{isa}.o"
        subprocess.run([_compiler(), *common, *more, "-c", str(path), "-o", str(out)], check=True)
        return str(out)

    with ThreadPoolExecutor(jobs) as pool:
        objects = list(pool.map(compile_one, sources))
    module = folder / f"_kernel{sysconfig.get_config_var('EXT_SUFFIX')}"
    link = ["-shared", "-fsanitize=address,undefined", *objects, "-o", str(module), "-lpthread"]
    subprocess.run([_compiler(), *link], check=True)
    return module


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--isa", action="append", choices=ISA, help="default: avx2, on x86")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="of the compiler")
    parser.add_argument("words", nargs="*", help=f"for pytest; default: {', '.join(TESTS)}, …")
    options = parser.parse_args()
    reason = missing()
    if reason:
        print(f"not run: {reason}")
        return SKIPPED
    x86 = platform.machine() in ("x86_64", "amd64")
    isas = list(dict.fromkeys(["baseline", *(options.isa or (["avx2"] if x86 else []))]))
    with tempfile.TemporaryDirectory(prefix="pinsing-sanitize-") as name:
        folder = Path(name)
        module = build(folder, isas, options.jobs)
        (folder / "sanitized_kernel.py").write_text(PLUGIN.format(module=str(module)))
        environment = {
            **os.environ,
            # Python itself was compiled without them: they must be there before it.
            "LD_PRELOAD": f"{_library('libasan.so')} {_library('libubsan.so')}",
            # Python and other libraries keep memory on purpose until the end.
            "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0:exitcode=99",
            "UBSAN_OPTIONS": "print_stacktrace=1",
            "PYTHONPATH": f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
            "OPENBLAS_NUM_THREADS": "1",
        }
        # What a sanitizer says must be seen: pytest may not hold the stream of errors back.
        words = ["-m", "pytest", "-q", "--capture=sys", "-p", "sanitized_kernel"]
        words += ["-p", "no:xdist", "-p", "no:cacheprovider"]
        words += options.words or [*TESTS, _CLEARANCE]
        return subprocess.run([sys.executable, *words], cwd=ROOT, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main())
