"""Bound what a recording may hold before memory is taken for it: a small file can claim, or unpack to, any size."""

from __future__ import annotations

import errno
import io
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.table import Misread
from firmloop.identify.regular_file import read_regular

MOST_BYTES = 256 << 20  # of a file, and of what is packed in it: 30 million numbers
MOST_TEXT = 64 << 20  # bytes of text, packed or not: it takes twenty times as long to read, and as much memory
MOST_COLUMNS = 2000
MOST_LINE = 1 << 16  # bytes of a line of text, enough for as many columns
_REMEDY = "cut it into parts, keep every tenth row, or leave out signals"
_AS_NUMBERS = "save it as .npz, .mat or .parquet, or keep every tenth row"
_PIECE, _MOST_PIECE = 512, 1 << 20  # bytes that are unpacked at a time: a member behind another may be as short
_MAT_HEADER, _MAT_COMPRESSED = 128, 15


def read_whole(path: Path) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    IdentifyError
        when it is not there, cannot be read, is no regular file (which may have no end), or is too large.
    """
    try:
        return read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        raise IdentifyError(f"{path}: there is no such file; paths are relative to the project file") from None
    except IsADirectoryError:
        raise IdentifyError(f"{path}: is a folder; give a file") from None
    except OSError as error:
        remedy = _REMEDY if error.errno == errno.EFBIG else "give a readable file"
        raise IdentifyError(f"{path}: cannot be read ({error.strerror}); {remedy}") from None


def too_large(size: int) -> str:
    """Say that so many bytes are too many."""
    return f"holds {size:,} bytes; a recording has at most {MOST_BYTES:,}"


def is_too_large(size: int) -> Misread:
    """Return the complaint that a packed recording unpacks to so many bytes."""
    return Misread("", too_large(size), _REMEDY)


def text_extent(text: bytes) -> Misread | None:
    """Complain of too much text, or of a line that is too long to be a row, before it is taken apart."""
    if len(text) > MOST_TEXT:
        return Misread("", f"has {len(text):,} bytes of text; at most {MOST_TEXT:,} are read", _AS_NUMBERS)
    ends = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n"))
    lengths = np.diff(np.concatenate([[-1], ends, [len(text)]])) - 1
    if lengths.max() <= MOST_LINE:
        return None
    k = int(np.argmax(lengths > MOST_LINE))
    wrong = f"has {lengths[k]:,} bytes; a row has at most {MOST_LINE:,} and {MOST_COLUMNS:,} columns"
    return Misread(f"line {k + 1}", wrong, "write one line per sample, and leave out signals")


def unzipped(content: bytes) -> bytes | Misread:
    """Unpack a gzip file of one or more members, as far as it may be large.

    Raises
    ------
    EOFError, zlib.error
        when it is damaged.
    """
    packed, parts, size, at = memoryview(content), [], 0, 0
    while at < len(packed) and (packed[at] or any(packed[at:])):  # zeros behind the last member are padding
        member, step = zlib.decompressobj(wbits=31), _PIECE
        while not member.eof:
            piece = packed[at : at + step]
            if not len(piece):
                raise EOFError("it ends early")
            part = member.decompress(piece, MOST_TEXT + 1 - size)
            size += len(part)
            if size > MOST_TEXT:
                return Misread("", f"unpacks to more than {MOST_TEXT:,} bytes", _AS_NUMBERS)
            parts.append(part)
            at, step = at + len(piece) - len(member.unused_data), min(2 * step, _MOST_PIECE)
    return b"".join(parts)


def npz_extent(content: bytes) -> Misread | None:
    """Complain of an archive whose arrays claim more than it holds, or more than may be held.

    Raises
    ------
    ValueError, OSError, zipfile.BadZipFile
        when it is damaged.
    """
    total = 0
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        if len(archive.infolist()) > MOST_COLUMNS:
            return _too_many(len(archive.infolist()))
        for entry in archive.infolist():
            with archive.open(entry) as stream:
                version = np.lib.format.read_magic(stream)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, kind = read(stream)
            # Python's whole numbers: a product of claims overflows any other.
            claimed = int(np.prod([int(size) for size in shape], dtype=object)) * max(1, kind.itemsize)
            total += max(claimed, entry.file_size)
            if claimed > entry.file_size and not kind.hasobject:
                wrong = f"claims {claimed:,} bytes where the archive holds {entry.file_size:,}"
                return Misread(f"column {entry.filename.removesuffix('.npy')}", wrong, "write it with numpy.savez")
    return is_too_large(total) if total > MOST_BYTES else None


def unpacked_mat(content: bytes) -> bytes | Misread:
    """Return a MATLAB file of level 5 with nothing packed in it, so that no size in it is larger than the file.

    What is no such file comes back as it is, for its reader to complain.
    """
    if len(content) < _MAT_HEADER or content[126:128] not in (b"IM", b"MI"):
        return content
    order = "<" if content[126:128] == b"IM" else ">"
    parts, size, at = [content[:_MAT_HEADER]], _MAT_HEADER, _MAT_HEADER
    while at + 8 <= len(content):
        kind, length = struct.unpack_from(f"{order}II", content, at)
        if kind == _MAT_COMPRESSED:
            packed = zlib.decompressobj()
            part = packed.decompress(content[at + 8 : at + 8 + length], MOST_BYTES + 1 - size)
        else:
            part = content[at : at + 8 + length]
        size += len(part)
        if size > MOST_BYTES:
            return Misread("", f"unpacks to more than {MOST_BYTES:,} bytes", _REMEDY)
        parts.append(part)
        at += 8 + length
    return b"".join(parts)


def check_columns(count: int) -> Misread | None:
    """Complain of more columns than anybody can name."""
    return _too_many(count) if count > MOST_COLUMNS else None


def _too_many(count: int) -> Misread:
    return Misread("", f"has {count:,} columns; a recording has at most {MOST_COLUMNS:,}", "leave out signals")
