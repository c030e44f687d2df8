"""Files of arrays that may come from anybody: read within bounds, or named as damaged.

A chunk is an ``.npz`` file, readable with ``numpy.load``, whose last bytes are the SHA-256 of
all before them; it names its run and its place in it.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import stat
import tokenize
import zipfile
from pathlib import Path
from typing import cast

import numpy as np
from numpy.lib import format as npy

from pinsing.errors import Refusal
from pinsing.measures import NDArray

Record = dict[str, NDArray[np.generic]]

_DIGEST = 64  # hexadecimal digits
_MARK = b"sha256:"
_HEADERS = 4096  # bytes that names and headers of an array take at most
_KINDS = "biufSU"  # of numbers and texts; nothing that holds objects


class DamagedError(Refusal):
    """A file that does not hold what it must; the message says in which way."""


def read_bounded(path: Path, limit: int, *, follow: bool = False) -> bytes:
    """Return a regular file of at most ``limit`` bytes, without waiting; ``follow`` links or not.

    DamagedError if it is a link, a device, a pipe, or larger; OSError if it cannot be read.
    """
    DamagedError.refuse_if(not follow and path.is_symlink(), "it is a link")
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | (0 if follow else os.O_NOFOLLOW)
    handle = os.open(path, flags)
    with open(handle, "rb") as file:
        found = os.fstat(handle)
        DamagedError.refuse_if(stat.S_ISDIR(found.st_mode), "it is a folder")
        DamagedError.refuse_if(
            not stat.S_ISREG(found.st_mode), "it is no file but a device or pipe"
        )
        data = file.read(limit + 1)
    DamagedError.refuse_if(
        len(data) > limit, f"it has more than the {limit:,} bytes that it may have"
    )
    return data


def read_arrays(data: bytes, room: int) -> Record:
    """Return arrays of an ``.npz`` file of at most ``room`` bytes in all; else DamagedError."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            # in a file at most
            DamagedError.refuse_if(len(members) > 64, f"it holds {len(members)} arrays")
            DamagedError.refuse_if(
                sum(m.file_size for m in members) > room + _HEADERS * len(members),
                "its arrays are too large",
            )
            record: Record = {}
            for member in members:
                with archive.open(member) as file:  # no more than the size that was judged
                    content = file.read(member.file_size)
                record[member.filename.removesuffix(".npy")] = _array(content)
    except DamagedError:
        raise
    except (
        zipfile.BadZipFile,
        NotImplementedError,  # a way to compress that Python does not have
        RuntimeError,  # encrypted
        ValueError,
        TypeError,
        EOFError,
        OverflowError,
        OSError,
        MemoryError,
        SyntaxError,
        tokenize.TokenError,  # of a header that NumPy tries to mend
        RecursionError,
        zipfile.zlib.error,  # type: ignore[attr-defined]
        zipfile.lzma.LZMAError,  # type: ignore[attr-defined]
    ) as error:
        raise DamagedError(f"its arrays cannot be read ({type(error).__name__})") from None
    DamagedError.refuse_if(len(record) < len(members), "an array is in it twice")
    return record


def pack(record: Record, run: str, index: int) -> bytes:
    """Bytes of a chunk: an .npz file whose comment ends in the SHA-256 of all bytes before it."""
    buffer = io.BytesIO()
    arrays = {**record, "_run": np.array(run), "_chunk": np.array(index)}
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.comment = _MARK + b"0" * _DIGEST
    body = buffer.getvalue()[:-_DIGEST]
    return body + hashlib.sha256(body).hexdigest().encode()


def unpack(data: bytes, run: str, index: int, room: int) -> Record:
    """Return the record of a chunk; DamagedError if not whole, of another run, or over ``room``."""
    body, digest = data[:-_DIGEST], data[-_DIGEST:]
    DamagedError.refuse_if(
        not body.endswith(_MARK) or hashlib.sha256(body).hexdigest().encode() != digest,
        "it is not as it was written",
    )
    record = read_arrays(data, room + _HEADERS)
    owner, place = record.pop("_run", None), record.pop("_chunk", None)
    DamagedError.refuse_if(
        owner is None or owner.shape or str(owner) != run, "it belongs to another run"
    )
    DamagedError.refuse_if(
        place is None or place.shape or place.dtype.kind not in "iu" or int(place) != index,
        "it belongs to another place",
    )
    return record


def _array(content: bytes) -> NDArray[np.generic]:
    """One .npy file, whose header is believed only as far as there are bytes."""
    file = io.BytesIO(content)
    version = npy.read_magic(file)
    DamagedError.refuse_if(version not in ((1, 0), (2, 0)), "an array has an unknown format")
    reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = reader(file)
    DamagedError.refuse_if(
        dtype.kind not in _KINDS or dtype.fields is not None,
        f"an array has a content of kind {dtype.kind!r}",
    )
    size = math.prod(shape) * dtype.itemsize
    DamagedError.refuse_if(
        min(shape, default=0) < 0 or file.tell() + size != len(content) or not dtype.itemsize,
        "an array has another size than it says",
    )
    return cast("NDArray[np.generic]", npy.read_array(io.BytesIO(content), allow_pickle=False))
