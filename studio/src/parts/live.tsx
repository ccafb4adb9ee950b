import { useEffect, useMemo, useState } from 'react';
import type { Channel, ChannelRequest, Problem } from '../api/types';
import { labelOf } from '../model/scope';
import { LiveBuffer } from '../model/live_buffer';
import { redraw_ms } from '../rates';
import { stream } from '../store';
import { Trouble } from './controls';
import { Lanes, type LanesProps } from './lanes';

interface Live {
  channels: Channel[];
  x: Float64Array;
  values: Float64Array[];
  problem?: Problem;
}

const nothing: Live = { channels: [], x: new Float64Array(), values: [] };

// The last seconds of some channels.
export function useLive(channels: ChannelRequest[], rate_hz: number, seconds: number, running = true): Live {
  const [live, setLive] = useState<Live>(nothing);
  const asked = JSON.stringify(channels);
  useEffect(() => {
    const requests = JSON.parse(asked) as ChannelRequest[];
    if (!running || requests.length === 0) return;
    let answered: Channel[] = [];
    let buffer = new LiveBuffer(requests.length, rate_hz, seconds);
    let due = false;
    const timer = setInterval(() => {
      if (!due || document.hidden) return;
      due = false;
      setLive({ channels: answered, ...buffer.view() });
    }, redraw_ms);
    const end = stream.subscribe({
      channels: requests,
      rate_hz,
      accepted: (answer) => {
        answered = answer.channels;
        buffer = new LiveBuffer(requests.length, answer.rate_hz, seconds);
      },
      refused: (problem) => setLive({ ...nothing, problem }),
      frame: (frame) => {
        buffer.append(frame);
        due = true;
      },
    });
    return () => {
      clearInterval(timer);
      end();
    };
  }, [asked, rate_hz, seconds, running]);
  return live;
}

export function LiveLanes({ channels, rate_hz, seconds, running = true, ...props }: {
  channels: ChannelRequest[];
  rate_hz: number;
  seconds: number;
  running?: boolean;
} & Omit<LanesProps, 'x' | 'curves' | 'range' | 'onRange' | 'unit'>) {
  const live = useLive(channels, rate_hz, seconds, running);
  const range = useMemo<[number, number]>(() => [-seconds, 0], [seconds]);
  const several = new Set(live.channels.map(({ axis }) => axis)).size > 1;
  const curves = live.channels.map((channel, i) => ({ name: several ? labelOf(channel) : channel.name, unit: channel.unit, tone: i, values: live.values[i] }));
  return (
    <>
      <Trouble problem={live.problem} />
      <Lanes {...props} x={live.x} curves={curves} range={range} unit="s" />
    </>
  );
}
