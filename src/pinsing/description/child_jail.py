"""Walls around a child process that handles a stranger's file: a second layer, never the only one.

Limits on processor time, memory and written files; in Python, a watch over the calls that reach
outside; on Linux (x86-64 and arm64) a seccomp filter under which the kernel opens no file, no
socket and starts no process: what was open before stays readable and writable, nothing else is.
Standard library only: child processes load this module by its folder.
"""

from __future__ import annotations

import contextlib
import os
import signal
import struct
import sys
from collections.abc import Callable, Iterable

_OPENAT = (257, 56)
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND | 0o20000000  # temporary
_MACHINES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}

_LOAD, _EQUAL, _ANY_BIT, _RETURN = 0x20, 0x15, 0x45, 0x06  # of the kernel's packet filter
_ALLOW, _ERROR_EPERM = 0x7FFF0000, 0x00050001
_SET_SECCOMP, _FILTER_MODE, _SET_NO_NEW_PRIVILEGES = 22, 2, 38

# Landlock's calls have these numbers on every machine; its rights are bits.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = range(444, 447)
_EVERYTHING, _READING = 0x1FFF, 0b1100  # of reading: files, and what is in folders

_WATCHED = (
    "open",
    "exec",
    "import",
    "os.",
    "socket.",
    "subprocess.",
    "ctypes.",
    "shutil.",
    "pty.",
    "mmap.",
    "fcntl.",
    "marshal.",
    "pickle.",
    "code.",
    "function.",
    "glob.",
    "pathlib.",
    "signal.",
    "tempfile.",
    "urllib.",
    "winreg.",
    "_winapi.",
    "gc.",
    "sys._getframe",
)


OUT_OF_TIME = [-int(s) for s in signal.Signals if s.name in ("SIGXCPU", "SIGPROF")]
"""Exit codes of a process that has used up its processor time."""


def limit_resources(seconds: int, memory: int) -> None:
    """Limit processor time [s], memory [bytes] and written files (none), where that exists."""
    # A process that has used up its time is ended by SIGXCPU.
    try:
        import resource
    except ImportError:
        return
    limits = [
        ("RLIMIT_CPU", seconds, seconds + 2),  # at the second it is SIGKILL, which says less
        ("RLIMIT_AS", memory, memory),
        ("RLIMIT_FSIZE", 0, 0),
        ("RLIMIT_CORE", 0, 0),
    ]
    for name, soft, hard in limits:
        # Some systems have the name and refuse the call; the parent's timeout remains.
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(getattr(resource, name), (soft, hard))


def begin_work(seconds: float) -> None:
    """End this process by SIGPROF if it uses more processor time [s] until this is called again."""
    if hasattr(signal, "ITIMER_PROF"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def watch(refuse: Callable[[str], BaseException]) -> None:
    """Raise ``refuse(call)`` for any Python call that reaches outside, once all is imported."""

    def hook(event: str, _details: object) -> None:
        if event.startswith(_WATCHED):
            raise refuse(event)

    sys.addaudithook(hook)


def close_in(reading: bool = False) -> str:
    """Let the kernel open nothing more for this process; return why not, or ""."""
    # Files that are open now can be used; with ``reading`` others can be read, too. No way back.
    machine = os.uname().machine if sys.platform.startswith("linux") else "any machine"
    if machine not in _MACHINES:
        return f"no filter of system calls is known for {sys.platform} on {machine}"
    try:
        import ctypes

        call = ctypes.CDLL(None, use_errno=True).prctl
    except (ImportError, OSError, AttributeError) as error:
        return f"the kernel's filter cannot be reached ({error})"
    column = [*_MACHINES].index(machine)
    code = _filter(
        _known_calls(column, reading), _MACHINES[machine], _OPENAT[column] if reading else None
    )
    words = ctypes.create_string_buffer(code, len(code))

    class Program(ctypes.Structure):
        _fields_ = [("length", ctypes.c_ushort), ("words", ctypes.c_void_p)]

    program = Program(len(code) // 8, ctypes.addressof(words))
    call.argtypes = [ctypes.c_int] + [ctypes.c_ulong] * 4
    for option, first, second in (
        (_SET_NO_NEW_PRIVILEGES, 1, 0),
        (_SET_SECCOMP, _FILTER_MODE, ctypes.addressof(program)),
    ):
        if call(option, first, second, 0, 0) != 0:
            return f"the kernel takes no filter ({os.strerror(ctypes.get_errno())})"
    return ""


def read_only_below(folders: Iterable[str]) -> str:
    """Let the kernel open files below some folders only, for reading; return why not, or ""."""
    # Landlock (Linux 5.13 and later, where it is switched on). There is no way back.
    if not sys.platform.startswith("linux") or os.uname().machine not in _MACHINES:
        return f"no Landlock is known for {sys.platform}"
    try:
        import ctypes

        libc = ctypes.CDLL(None, use_errno=True)
    except (ImportError, OSError) as error:
        return f"Landlock cannot be reached ({error})"

    def failed(what: str) -> str:
        return f"Landlock {what} ({os.strerror(ctypes.get_errno())})"

    # What the first version of Landlock knows: it is what every later one takes as well.
    attributes = ctypes.create_string_buffer(struct.pack("=Q", _EVERYTHING), 8)
    call = libc.syscall
    call.restype = ctypes.c_long
    rules = call(_CREATE_RULESET, attributes, ctypes.c_size_t(8), ctypes.c_uint(0))
    if rules < 0:
        return failed("is not there")
    try:
        for folder in folders:
            try:
                handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            except OSError:  # not there: nothing to read in it
                continue
            try:
                rule = ctypes.create_string_buffer(struct.pack("=Qi", _READING, handle), 12)
                if call(_ADD_RULE, rules, 1, rule, ctypes.c_uint(0)) != 0:
                    return failed("takes no rule")
            finally:
                os.close(handle)
        if libc.prctl(_SET_NO_NEW_PRIVILEGES, *map(ctypes.c_ulong, (1, 0, 0, 0))) != 0:
            return failed("needs what is refused")
        if call(_RESTRICT_SELF, rules, ctypes.c_uint(0)) != 0:
            return failed("is refused")
    finally:
        os.close(rules)
    return ""


def _known_calls(column: int, reading: bool) -> list[int]:
    """Return the numbers of the system calls that are let through."""
    # Numbers of the system calls that a running interpreter needs, x86-64 and arm64.
    calls = {
        "read": (0, 63),
        "write": (1, 64),
        "close": (3, 57),
        "fstat": (5, 80),
        "lseek": (8, 62),
        "mmap": (9, 222),
        "mprotect": (10, 226),
        "munmap": (11, 215),
        "brk": (12, 214),
        "rt_sigaction": (13, 134),
        "rt_sigprocmask": (14, 135),
        "rt_sigreturn": (15, 139),
        "sched_yield": (24, 124),
        "mremap": (25, 216),
        "madvise": (28, 233),
        "getpid": (39, 172),
        "exit": (60, 93),
        "gettid": (186, 178),
        "futex": (202, 98),
        "restart_syscall": (219, 128),
        "clock_gettime": (228, 113),
        "exit_group": (231, 94),
        "getrandom": (318, 278),
        "rseq": (334, 293),
    }
    # More of them for a process that reads files: everything but opening itself, which is judged.
    more = {
        "stat": (4, 79),  # arm64 has the calls with "at" only
        "lstat": (6, 79),
        "access": (21, 48),
        "readlink": (89, 78),
        "pread64": (17, 67),
        "readv": (19, 65),
        "fcntl": (72, 25),
        "getcwd": (79, 17),
        "readlinkat": (267, 78),
        "newfstatat": (262, 79),
        "faccessat": (269, 48),
        "statx": (332, 291),
        "fadvise64": (221, 223),
        "getdents64": (217, 61),
        "sysinfo": (99, 179),
        "sched_getaffinity": (204, 123),
        "setitimer": (38, 103),
    }
    known = calls | more if reading else calls
    return sorted({numbers[column] for numbers in known.values()})


def _filter(calls: list[int], architecture: int, openat: int | None) -> bytes:
    """Return the program: the right architecture and a known call, or an error."""

    def step(code: int, value: int, yes: int = 0, no: int = 0) -> bytes:
        return struct.pack("=HBBI", code, yes, no, value)

    # A jump counts the steps that it leaves out; the last two steps are "no" and "yes".
    opening = []
    if openat is not None:  # its third argument holds the flags
        after = len(calls)
        opening = [
            step(_EQUAL, openat, 0, 3),
            step(_LOAD, 32),
            step(_ANY_BIT, _WRITING, 0, after + 2),
            step(_RETURN, _ERROR_EPERM),
        ]
    program = [
        step(_LOAD, 4),
        step(_EQUAL, architecture, 0, len(calls) + len(opening) + 1),
        step(_LOAD, 0),
        *opening,
        *(step(_EQUAL, number, len(calls) - i) for i, number in enumerate(calls)),
        step(_RETURN, _ERROR_EPERM),
        step(_RETURN, _ALLOW),
    ]
    return b"".join(program)
