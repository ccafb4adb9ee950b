import { describe, expect, it } from 'vitest';
import { textOf } from './parameters';
import { bitsOf, changesOf, moved, type Mapped, type Pdos } from './pdos';

const word: Mapped = { object: '6040:00', name: 'Controlword', bits: 16 };
const target: Mapped = { object: '607A:00', name: 'Target position', bits: 32 };
const gap: Mapped = { object: '0000:00', name: 'padding', bits: 8 };
const pdos = (objects: Mapped[], enabled = true): Pdos => ({
  bus: 'can',
  pdos: [{ index: '0x1600', direction: 'receive', number: 1, fixed: false, most: 8, objects, enabled, can_id: 0x201 }],
  mappable: { receive: [], transmit: [] },
});

describe('PDOs', () => {
  it('sends what has changed, and nothing else', () => {
    expect(changesOf(pdos([word]), pdos([word]))).toBeNull();
    expect(changesOf(pdos([word]), pdos([word, target]))).toEqual({ pdos: [{ index: '0x1600', objects: ['6040:00', '607A:00'] }] });
    expect(changesOf(pdos([word]), pdos([word], false))).toEqual({ pdos: [{ index: '0x1600', enabled: false }] });
    expect(changesOf({ ...pdos([word]), receive: ['0x1600'] }, { ...pdos([word]), receive: [] })).toEqual({ receive: [] });
  });
  it('says how long padding is', () => {
    expect(changesOf(pdos([word]), pdos([word, gap]))).toEqual({ pdos: [{ index: '0x1600', objects: ['6040:00', '0000:00/8'] }] });
    expect(bitsOf([word, target, gap])).toBe(56);
  });
  it('moves within the list', () => {
    expect(moved([1, 2, 3], 0, 1)).toEqual([2, 1, 3]);
    expect(moved([1, 2, 3], 0, -1)).toEqual([1, 2, 3]);
    expect(moved([1, 2, 3], 2, 1)).toEqual([1, 2, 3]);
  });
});

describe('parameters', () => {
  it('are written as a file has them', () => {
    const differences = [
      { object: '6081:00', name: 'Profile velocity', unit: 'vel', type: 'u32', left: '10', right: '20' },
      { object: '6082:00', name: 'End velocity', unit: 'vel', type: 'u32', left: null, right: '0' },
    ];
    expect(textOf('ismc', differences)).toBe('# servodrome parameters 1\nproduct: ismc\n6081:00 u32 10\nend\n');
  });
});
