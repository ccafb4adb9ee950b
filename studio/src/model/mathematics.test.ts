import { parquetMetadata, parquetReadObjects } from 'hyparquet';
import { describe, expect, test } from 'vitest';
import type { Recording } from '../api/types';
import { appliedOf, layoutOf, readLayouts, withLayout } from './layouts';
import { withMaths } from './mathematics';
import { parquetOf } from './parquet';
import type { Samples } from './scope';

const channels = [{ axis: 'x', signal: 'velocity_rpm', name: 'velocity_rpm', unit: 'rpm' }, { axis: 'y', object: '6064:00', name: 'Position actual value', unit: '' }];
const recording: Recording = { id: 3, name: 'with "quotes"', note: 'größer', state: 'done', rate_hz: 4000, trigger_tick: 1004, first_tick: 1000, samples: 3, channels };
const samples: Samples = { recording, x: Float64Array.of(-0.25, 0, 0.25), interval_ms: 0.25, values: [Float64Array.of(1, 2, 4), Float64Array.of(7, NaN, 9)] };

describe('math channels of a recording', () => {
  test('are further channels with a unit', () => {
    const { recording: more, values } = withMaths(samples, [{ name: 'slope', formula: 'derivative(c1)' }]);
    expect(more.channels.map(({ axis, name, unit }) => [axis, name, unit])).toEqual([['x', 'velocity_rpm', 'rpm'], ['y', 'Position actual value', ''], ['', 'slope', 'rpm/s']]);
    expect([...values[2]]).toEqual([4000, 6000, 8000]);
  });
  test('that do not fit are left out', () => {
    expect(withMaths(samples, [{ name: 'a', formula: 'c3' }, { name: 'b', formula: 'c1 +' }])).toBe(samples);
  });
});

test('a Parquet file has the samples, with gaps as null', async () => {
  const file = await parquetOf(withMaths(samples, [{ name: 'twice', formula: '2 * c1' }]));
  expect(await parquetReadObjects({ file })).toEqual([
    { tick: 1000n, time_s: 0.0625, 'x velocity_rpm [rpm]': 1, 'y 6064:00 Position actual value': 7, 'twice [rpm]': 2 },
    { tick: 1004n, time_s: 0.06275, 'x velocity_rpm [rpm]': 2, 'y 6064:00 Position actual value': null, 'twice [rpm]': 4 },
    { tick: 1008n, time_s: 0.063, 'x velocity_rpm [rpm]': 4, 'y 6064:00 Position actual value': 9, 'twice [rpm]': 8 },
  ]);
  const { key_value_metadata } = parquetMetadata(file);
  expect(key_value_metadata).toContainEqual({ key: 'servodrome.note', value: 'größer' });
});

describe('layouts', () => {
  test('keep the settings and not the recording, and apply exactly them', () => {
    const layout = layoutOf('speed', new URLSearchParams('ch=x/velocity_rpm&rate=4000&rec=7&a=1&math=m=c1'));
    expect(layout.query).toEqual({ ch: 'x/velocity_rpm', rate: '4000', math: 'm=c1' });
    expect(appliedOf(layout)).toMatchObject({ ch: 'x/velocity_rpm', plot: null, trigger: null });
    expect(appliedOf(layout)).not.toHaveProperty('rec');
  });
  test('replace one of the same name', () => {
    const [a, b] = [{ name: 'b', query: { ch: '1' } }, { name: 'a', query: {} }];
    expect(withLayout(withLayout([a], b), { name: 'b', query: { ch: '2' } })).toEqual([b, { name: 'b', query: { ch: '2' } }]);
  });
  test('are refused if they are none', () => {
    for (const bad of [{}, [{}], [null], [{ name: 'a', query: { ch: 1 } }]]) expect(() => readLayouts(bad)).toThrow();
    expect(readLayouts([{ name: 'a', query: {} }])).toEqual([{ name: 'a', query: {} }]);
  });
});
