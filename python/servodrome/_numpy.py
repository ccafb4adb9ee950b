"""numpy and pandas are optional: they are imported at first use."""

from __future__ import annotations

import importlib
from typing import Any

from .errors import MissingPackage


def optional(name: str, used_for: str) -> Any:
    """The package, imported. Raises MissingPackage."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingPackage(f"the package {name} is not installed", used_for, f"pip install {name}") from error


def numpy(used_for: str) -> Any:
    """numpy. Raises MissingPackage."""
    return optional("numpy", used_for)
