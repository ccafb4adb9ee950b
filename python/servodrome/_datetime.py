"""datetime.datetime and datetime.date in virtual time: now(), utcnow() and today() tell the time of the replaced clock.

Their instances are those of the original classes, so they fit wherever a library compares types.
"""

from __future__ import annotations

import datetime
from typing import Any, Callable, List, Tuple

_Pairs = List[Tuple[Any, Any]]


class _Replacement(type):
    """The class of the replacements: isinstance() and issubclass() answer for the original class."""

    _original: Any

    def __instancecheck__(cls, instance: Any) -> bool:
        return isinstance(instance, cls._original) if "_original" in vars(cls) else super().__instancecheck__(instance)

    def __subclasscheck__(cls, subclass: Any) -> bool:
        return issubclass(subclass, cls._original) if "_original" in vars(cls) else super().__subclasscheck__(subclass)


def replacements(seconds: Callable[[], float]) -> _Pairs:
    """The original classes and what replaces them; `seconds` is time.time()."""
    real_date, real_datetime = datetime.date, datetime.datetime

    class date(real_date, metaclass=_Replacement):  # type: ignore[valid-type, misc]  # noqa: N801
        _original = real_date

        def __new__(cls, *arguments: Any, **keywords: Any) -> Any:
            return real_date.__new__(real_date if cls is date else cls, *arguments, **keywords)

        @classmethod
        def today(cls) -> Any:
            return cls.fromtimestamp(seconds())

    class datetime_(real_datetime, metaclass=_Replacement):  # type: ignore[valid-type, misc]  # noqa: N801
        _original = real_datetime

        def __new__(cls, *arguments: Any, **keywords: Any) -> Any:
            return real_datetime.__new__(real_datetime if cls is datetime_ else cls, *arguments, **keywords)

        @classmethod
        def now(cls, tz: Any = None) -> Any:
            return cls.fromtimestamp(seconds(), tz)

        @classmethod
        def utcnow(cls) -> Any:
            return cls.fromtimestamp(seconds(), datetime.timezone.utc).replace(tzinfo=None)

        @classmethod
        def today(cls) -> Any:
            return cls.fromtimestamp(seconds())

    datetime_.__name__ = datetime_.__qualname__ = "datetime"
    for one in (date, datetime_):
        one.__module__ = "datetime"
    return [(real_date, date), (real_datetime, datetime_)]
