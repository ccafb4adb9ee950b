"""TOML files: scenarios and plans."""

from __future__ import annotations

import importlib
import re
import sys
from typing import Any, Dict

from .errors import BadValue, MissingPackage


def read_toml(path: str) -> Dict[str, Any]:
    """The content of a TOML file. Raises BadValue with the place of an error."""
    try:
        toml: Any = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
    except ImportError as error:
        raise MissingPackage(
            "tomli is not installed", path, "Python before 3.11 reads TOML with it: pip install tomli"
        ) from error
    try:
        with open(path, "rb") as file:
            content: Dict[str, Any] = toml.load(file)
            return content
    except OSError as error:
        raise BadValue(f"the file cannot be read: {error.strerror}", path, "give the name of a TOML file") from None
    except UnicodeDecodeError as error:
        raise BadValue(f"the file is not UTF-8: byte {error.start}", path, "save it as UTF-8") from None
    except toml.TOMLDecodeError as error:
        text = str(error)  # "Invalid value (at line 1, column 9)"
        place = re.search(r" \(at line (\d+), column (\d+)\)$", text)
        what, where = (text[: place.start()], f"{path}:{place[1]}:{place[2]}") if place else (text, path)
        raise BadValue(what, where, "correct the TOML") from None
