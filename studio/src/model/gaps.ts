// Replaces NaN by null. uPlot draws a gap for null, but a single NaN makes its scale invalid, and it draws nothing.
export function gaps(values: ArrayLike<number>): ArrayLike<number | null> {
  for (let i = 0; i < values.length; ++i) {
    if (Number.isNaN(values[i])) return Array.from(values, (value) => (Number.isNaN(value) ? null : value));
  }
  return values;
}
