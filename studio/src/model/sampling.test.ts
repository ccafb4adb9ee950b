import { describe, expect, test } from 'vitest';
import type { BusView, Channel } from '../api/types';
import { ratesOf, sampledText } from './sampling';
import { rates } from './scope';

const bus = (type: BusView['type'], axis: string, sampling_hz?: number): BusView => ({ name: type, type, disturbance: null, axes: { [axis]: {} }, links: [], ...(sampling_hz ? { sampling_hz } : {}) });

describe('how drives on buses are sampled', () => {
  test('the rates end with the greatest one of the buses', () => {
    const buses = [bus('can', 'a', 1000), bus('ethercat', 'b', 500), bus('rs485', 'c', 100)];
    expect(ratesOf(['a', 'c'], buses)).toEqual([100, 500, 1000]);
    expect(ratesOf(['b'], buses)).toEqual([100, 500]);
    expect(ratesOf(['c'], buses)).toEqual([100]);
  });
  test('a virtual line has all rates', () => {
    expect(ratesOf(['a'], undefined)).toEqual(rates);
    expect(ratesOf(['a'], [bus('can', 'a')])).toEqual(rates);
  });
  test('the text has the way, the real rate, the missing samples and the reason', () => {
    const channel: Channel = { axis: 'a', object: '6064:00', name: 'x', unit: '' };
    expect(sampledText(channel)).toBeNull();
    const sampled = { by: 'read as an object', due_hz: 100, rate_hz: 97.6, samples: 90, missed: 3, limit: { what: 'the object is not mapped', where: 'a', hint: 'map it' } };
    expect(sampledText({ ...channel, sampled })).toBe('read as an object at 98 Hz, 3 samples missed. Not faster, because the object is not mapped: map it');
    expect(sampledText({ ...channel, sampled: { by: 'TPDO 1, when a value changes' } })).toBe('TPDO 1, when a value changes');
  });
});
