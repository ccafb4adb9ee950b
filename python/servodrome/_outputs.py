"""Files and folders that a command is to write: checked before it runs anything, and written whole or not at all."""

from __future__ import annotations

import os

from .errors import BadValue


def check_file(path: str, option: str) -> None:
    """Raises BadValue if the file cannot be written."""
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise BadValue(f"there is no folder {folder}", option, "make it, or give another file")
    if os.path.isdir(path) or not os.access(path if os.path.exists(path) else folder, os.W_OK):
        raise BadValue(f"{path} cannot be written", option, "give another file")


def make_folder(path: str, option: str) -> None:
    """Raises BadValue if the folder cannot be made, or cannot be written."""
    try:
        os.makedirs(path, exist_ok=True)
    except OSError as error:
        raise BadValue(f"the folder {path} cannot be made: {error.strerror}", option, "give another folder") from None
    if not os.access(path, os.W_OK):
        raise BadValue(f"the folder {path} cannot be written", option, "give another folder")


def replace(temporary: str, path: str) -> None:
    """As os.replace, and after a power failure the file is the old or the new one, not an empty one."""
    file = os.open(temporary, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
    os.replace(temporary, path)
