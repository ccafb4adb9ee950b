// uPlot leaves out what is null, and takes its scale from what is not a number: one such value and nothing is drawn.
export function gaps(values: ArrayLike<number>): ArrayLike<number | null> {
  for (let i = 0; i < values.length; ++i) {
    if (Number.isNaN(values[i])) return Array.from(values, (value) => (Number.isNaN(value) ? null : value));
  }
  return values;
}
