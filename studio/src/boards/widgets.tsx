import type { ComponentType } from 'react';
import { basesOf, type Format } from '../model/bases';
import type { Widget, WidgetKind } from '../model/boards';
import { channelOf } from '../model/scope';
import { significant } from '../model/units';
import { useLiveValue } from '../live_values';
import { LiveLanes } from '../parts/live';
import { ButtonWidget } from './button';
import { useObject } from './object';
import { ScriptWidget } from './script';
import { SliderWidget } from './slider';
import { SwitchWidget } from './switch';
import { WatchWidget } from './watch';

// The content of each kind of widget. The fields of a widget are checked (model/boards.ts) before it is drawn.

export const parts: Record<WidgetKind, ComponentType<{ widget: Widget }>> = {
  value: ValueWidget,
  plot: PlotWidget,
  switch: SwitchWidget,
  slider: SliderWidget,
  button: ButtonWidget,
  script: ScriptWidget,
  watch: WatchWidget,
  note: NoteWidget,
};

function ValueWidget({ widget }: { widget: Widget }) {
  const text = String(widget.channel);
  const { value, problem } = useLiveValue(text);
  const about = useObject(text);
  const format = widget.format as Format;
  const digits = typeof value === 'number' ? basesOf(value, about?.type)[format] || significant(value) : typeof value === 'string' ? value : '–';
  return (
    <>
      <p className={format === 'decimal' ? 'figure' : 'figure mono'}>
        {typeof value === 'number' && format === 'decimal' ? significant(value) : digits}
        {about?.unit && <span className="unit">{about.unit}</span>}
      </p>
      <p className="quiet">{text.replace('/', ' ')} {about?.name}</p>
      {problem && <p className="refusal" role="status">{problem.what}</p>}
    </>
  );
}

function PlotWidget({ widget }: { widget: Widget }) {
  const channels = (widget.channels as string[]).map((text) => channelOf(text)!);
  return <LiveLanes label={widget.title || 'Plot'} channels={channels} rate_hz={200} seconds={Number(widget.seconds)} laneHeight={120} />;
}

function NoteWidget({ widget }: { widget: Widget }) {
  return <p className="written-note">{String(widget.text)}</p>;
}
