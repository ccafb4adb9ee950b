"""A recording of values of axes."""

from __future__ import annotations

import csv
import math
import os
from array import array
from types import TracebackType
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Mapping, Optional, Type, Union

from ._backend import TICKS_PER_SECOND, Recorder, Samples
from ._numpy import numpy, optional
from .errors import UnknownName
from .signals import Signal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    _Floats = NDArray[np.float64]
    _Ints = NDArray[np.int64]

Path = Union[str, "os.PathLike[str]"]


class Recording(Mapping[str, "_Floats"]):
    """Values of axes at a fixed rate: `recording["v"]` is a numpy array, `recording.time` their times.

    It records until stop(), or to the end of its `with` block, or until the line is closed. A value is the state after its
    tick; NaN: the axis had no power. Before it is stopped, the values so far can be read.
    """

    signals: Dict[str, Signal]
    """What is recorded, by the names of the columns."""

    def __init__(self, recorder: Recorder, signals: Mapping[str, Signal], stride: int) -> None:
        self._recorder = recorder
        self._stride = stride
        self.signals = dict(signals)

    @property
    def rate(self) -> float:
        """Samples in a second of line time."""
        return TICKS_PER_SECOND / self._stride

    def stop(self) -> "Recording":
        """Ends the recording; its values stay. Once more does nothing."""
        self._recorder.close()
        return self

    def __enter__(self) -> "Recording":
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.stop()

    # ---- With numpy ----

    @property
    def time(self) -> "_Floats":
        """Line time of each sample, in seconds."""
        np = numpy("Recording.time")
        samples = self._recorder.samples()
        result: _Floats = (samples.first_tick + np.arange(samples.rows) * samples.stride) / TICKS_PER_SECOND
        return result

    @property
    def ticks(self) -> "_Ints":
        """The tick of each sample."""
        np = numpy("Recording.ticks")
        samples = self._recorder.samples()
        result: _Ints = samples.first_tick + np.arange(samples.rows, dtype="int64") * samples.stride
        return result

    def numpy(self) -> "_Floats":
        """All values: a row for each sample, a column for each signal."""
        np = numpy("Recording.numpy()")
        samples = self._recorder.samples()
        flat: _Floats = np.frombuffer(samples.values, dtype=np.float64)
        return flat.reshape(samples.rows, samples.columns).copy()  # the caller may change it

    def __getitem__(self, name: str) -> "_Floats":
        """The values of a column. Raises UnknownName."""
        np = numpy("Recording")
        column = self._column(name)
        samples = self._recorder.samples()
        result: _Floats = np.array(samples.values[column :: samples.columns], dtype=np.float64)
        return result

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __len__(self) -> int:
        """The number of columns; `samples` is that of the rows."""
        return len(self.signals)

    # ---- Without it ----

    @property
    def samples(self) -> int:
        """The number of samples so far."""
        return self._recorder.samples().rows

    @property
    def is_full(self) -> bool:
        """True if it ended before stop(), because the program in real time had no more memory for it."""
        return self._recorder.samples().full

    def columns(self) -> "Dict[str, array[float]]":
        """The values of each column, and "time_s", as arrays of the standard library."""
        samples = self._recorder.samples()
        columns = {"time_s": array("d", _times(samples))}
        for place, name in enumerate(self.signals):
            columns[name] = samples.values[place :: samples.columns]
        return columns

    def to_csv(self, path: Path) -> None:
        """Writes a table: "time_s" and a column for each signal. An empty field: the axis had no power."""
        samples = self._recorder.samples()
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["time_s", *self.signals])
            width = samples.columns
            for row, time in enumerate(_times(samples)):
                values = samples.values[row * width : (row + 1) * width]
                writer.writerow([time, *("" if math.isnan(value) else value for value in values)])

    # ---- With pandas ----

    def to_pandas(self) -> Any:
        """A DataFrame with a column for each signal; the index is the line time in seconds. Raises MissingPackage."""
        pandas = optional("pandas", "Recording.to_pandas()")
        index = pandas.Index(self.time, name="time_s")
        return pandas.DataFrame(self.numpy(), index=index, columns=list(self.signals))

    def to_parquet(self, path: Path) -> None:
        """Writes a Parquet file with the columns of to_pandas(); needs pandas and pyarrow. Raises MissingPackage."""
        pandas = optional("pandas", "Recording.to_parquet()")
        optional("pyarrow", "Recording.to_parquet()")
        frame = pandas.DataFrame({"time_s": self.time, **dict(self.items())})
        frame.to_parquet(path, index=False)

    def _column(self, name: str) -> int:
        for place, known in enumerate(self.signals):
            if known == name:
                return place
        raise UnknownName(f'there is no column "{name}"', "recording", f"the columns are {', '.join(self.signals)}")

    def __repr__(self) -> str:
        return f"<recording of {', '.join(self.signals)} at {self.rate:g} Hz>"


def _times(samples: Samples) -> List[float]:
    return [(samples.first_tick + row * samples.stride) / TICKS_PER_SECOND for row in range(samples.rows)]
