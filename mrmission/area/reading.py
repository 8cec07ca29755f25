"""A file's bytes to text to a JSON document, with one clear line where that fails."""

from __future__ import annotations

import codecs
import json
from pathlib import Path
from typing import Any

from mrmission.area import formats
from mrmission.errors import InputError

MAX_FILE_BYTES = 256 * 1024 * 1024
"""Larger files are refused: no lake outline needs them, and parsing takes ten times the memory."""

MAX_INTEGER_DIGITS = 300
"""Longer integers cannot be a float; Python itself refuses to parse some of them."""

_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32-le"),  # before UTF-16: its mark begins with the same two bytes
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


def read_bytes(path: Path) -> bytes:
    """Return the file's bytes.

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, is empty, or is too large.
    """
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise InputError("is a directory, not a file; name the GeoJSON file in it")
        if size > MAX_FILE_BYTES:
            raise InputError(
                f"the file has {size / 1e6:,.0f} MB, the limit is {MAX_FILE_BYTES / 1e6:,.0f} MB; "
                "simplify the outline or cut the lake out of the data set"
            )
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError("no such file; check the name") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot be read: {reason}") from None
    if not data:
        raise InputError("the file is empty (0 bytes); save it again")
    return data


def decode(data: bytes) -> tuple[str, list[str]]:
    """Return the text of `data`, and notes about its encoding.

    UTF-8, UTF-16 and UTF-32 are told by their byte order mark or by where their NULs are; anything
    else that is not UTF-8 is read as Latin-1, with a note (only names can be affected).

    Raises
    ------
    InputError
        When the bytes are no text.
    """
    if not data.strip(b"\0"):
        raise InputError(
            f"not a JSON file: all {len(data)} bytes are NUL (a full disk or a broken copy?); "
            "get the file again"
        )
    for mark, encoding in _BYTE_ORDER_MARKS:
        if data.startswith(mark):
            try:
                return data[len(mark) :].decode(encoding), []
            except UnicodeDecodeError:
                raise InputError(
                    f"the file begins like {encoding.upper()} text but is not; save it as UTF-8"
                ) from None
    guess = json.detect_encoding(data)
    if guess not in ("utf-8", "utf-8-sig"):
        try:
            return data.decode(guess), []
        except UnicodeDecodeError:
            raise InputError("the file is not UTF-8 text; save it as UTF-8 GeoJSON") from None
    try:
        return data.decode("utf-8"), []
    except UnicodeDecodeError as error:
        if b"\0" in data:
            raise InputError(
                f"the file is not text (byte {error.start} is no UTF-8 and there are NULs); "
                "export the lake as GeoJSON"
            ) from None
        note = f"the file is not UTF-8 (byte {error.start}); read it as Latin-1 (names only)"
        return data.decode("latin-1"), [note]


def parse(text: str) -> tuple[Any, list[str]]:
    """Return the JSON document in `text`, and notes about keys given twice.

    NaN and Infinity are let through (Python and others write them): the check of coordinates names
    the position. Integers of absurd length become infinite, for the same reason.

    Raises
    ------
    InputError
        When it is not one JSON document.
    """
    repeated: dict[str, None] = {}

    def collect(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        members = dict(pairs)
        if len(members) < len(pairs):
            seen: set[str] = set()
            for key, _ in pairs:
                if key in seen:
                    repeated[key] = None
                seen.add(key)
        return members

    def integer(digits: str) -> float:
        return int(digits) if len(digits) <= MAX_INTEGER_DIGITS else float("inf")

    try:
        document = json.loads(text, object_pairs_hook=collect, parse_int=integer)
    except RecursionError:
        raise InputError(
            "JSON is nested too deeply; a GeoJSON outline needs less than ten levels"
        ) from None
    except MemoryError:
        raise InputError("the file is too large for the memory; simplify the outline") from None
    except json.JSONDecodeError as error:
        raise InputError(_syntax_message(text, error)) from None
    notes = [
        f"duplicate key {formats.quoted(key)}; used the last one" for key in list(repeated)[:3]
    ]
    return document, notes


def _syntax_message(text: str, error: json.JSONDecodeError) -> str:
    """Say where the text stops being JSON, and what it looks like there."""
    rest = text[error.pos :].lstrip()
    if text.startswith("\x1e"):
        return (
            "this looks like a GeoJSON text sequence (RFC 8142): more than one JSON document; "
            "make one FeatureCollection of it (ogr2ogr lake.geojson FILE)"
        )
    if error.msg.startswith("Extra data") and rest[:1] in "{[":
        return (
            f"more than one JSON document (the second at line {error.lineno}): this looks like "
            "line-delimited GeoJSON; make one FeatureCollection of it (ogr2ogr lake.geojson FILE)"
        )
    place = f"not valid JSON at line {error.lineno} column {error.colno}"
    before = text[: error.pos].rstrip()
    if (rest[:1] in ("]", "}") and before.endswith(",")) or "trailing comma" in error.msg:
        return f"{place}: trailing comma; remove it"
    if rest.startswith(("//", "/*", "#")):
        return f"{place}: comments are not allowed in JSON; remove it"
    if not rest:
        return f"{place}: the file ends in the middle (cut off?); get it again"
    return f"{place}: {error.msg[:1].lower()}{error.msg[1:]} near {formats.quoted(rest[:20])}"


def read_document(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the JSON object in the file, and notes; other formats are named and refused.

    Raises
    ------
    InputError
        When the file is unreadable, of another format, or not a JSON object.
    """
    data = read_bytes(path)
    formats.refuse_binary(data, path)
    text, notes = decode(data)
    formats.refuse_text(text)
    document, more = parse(text)
    if not isinstance(document, dict):
        raise InputError(
            f"not GeoJSON: the top level is {formats.json_type(document)}; "
            "it must be an object such as a Feature or a Polygon"
        )
    formats.refuse_document(document)
    return document, notes + more
