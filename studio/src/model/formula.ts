// Math channels: a small language over the channels of a recording. c1 is the first channel, c2 the second.
//
//   sum     = product { ("+" | "-") product }
//   product = sign { ("*" | "/") sign }
//   sign    = ["-"] value
//   value   = number | cN | function "(" sum {"," sum} ")" | "(" sum ")"

export interface Wave {
  values: Float64Array;
  unit: string;
}

export interface Wrong {
  problem: string;
  at: number; // place in the text, from 0
}

interface Sampled {
  waves: Wave[];
  interval_s: number;
}
// A number has no samples, and in a sum it gets the unit of the other operand.
type Value = { number: number } | Wave;
type Node = (sampled: Sampled) => Value;

interface Known {
  takes: number[]; // possible numbers of arguments
  of: (values: Float64Array[], interval_s: number) => Float64Array;
  unit: (units: string[]) => string;
  does: string;
}

export const functions: Record<string, Known> = {
  abs: { takes: [1], of: ([x]) => x.map(Math.abs), unit: ([u]) => u, does: 'the value without its sign' },
  derivative: { takes: [1], of: ([x], dt) => derivative(x, dt), unit: ([u]) => over(u, 's'), does: 'the change per second' },
  integral: { takes: [1], of: ([x], dt) => integral(x, dt), unit: ([u]) => times(u, 's'), does: 'the sum over time, 0 at the beginning' },
  difference: {
    takes: [1, 2],
    of: ([x, y]) => (y ? x.map((value, i) => value - y[i]) : x.map((value, i) => (i === 0 ? 0 : value - x[i - 1]))),
    unit: ([u, v]) => (v === undefined ? u : alike(u, v)),
    does: 'the change from one sample to the next; of two channels, the first minus the second',
  },
};

// Central differences; at the ends and beside a gap the difference on one side.
function derivative(x: Float64Array, interval_s: number): Float64Array {
  const has = (i: number) => i >= 0 && i < x.length && Number.isFinite(x[i]);
  return x.map((value, i) => {
    const from = has(i - 1) ? i - 1 : i;
    const to = has(i + 1) ? i + 1 : i;
    return !Number.isFinite(value) || from === to ? NaN : (x[to] - x[from]) / ((to - from) * interval_s);
  });
}

// The trapezoidal rule. A gap adds nothing, and is a gap in the result.
function integral(x: Float64Array, interval_s: number): Float64Array {
  let sum = 0;
  return x.map((value, i) => {
    const area = i === 0 ? 0 : ((value + x[i - 1]) / 2) * interval_s;
    if (Number.isFinite(area)) sum += area;
    return Number.isFinite(value) ? sum : NaN;
  });
}

const grouped = (unit: string) => (/[·/]/.test(unit) ? `(${unit})` : unit);
const alike = (a: string, b: string) => (a === b ? a : '');
const times = (a: string, b: string) => (a === '' ? b : b === '' ? a : a.endsWith(`/${b}`) ? a.slice(0, -b.length - 1) : `${a}·${b}`);
const over = (a: string, b: string) => (b === '' ? a : a === b ? '' : `${a === '' ? '1' : grouped(a)}/${grouped(b)}`);

const samplesOf = (value: Value, length: number) => ('number' in value ? new Float64Array(length).fill(value.number) : value.values);
const unitOf = (value: Value) => ('number' in value ? '' : value.unit);

interface Operator {
  of: (a: number, b: number) => number;
  unit: (a: Value, b: Value) => string;
}
const sameUnit = (a: Value, b: Value) => ('number' in a ? unitOf(b) : 'number' in b ? unitOf(a) : alike(a.unit, b.unit));
const operators: Record<string, Operator> = {
  '+': { of: (a, b) => a + b, unit: sameUnit },
  '-': { of: (a, b) => a - b, unit: sameUnit },
  '*': { of: (a, b) => a * b, unit: (a, b) => times(unitOf(a), unitOf(b)) },
  // A division by zero is a gap in the curve.
  '/': { of: (a, b) => (b === 0 ? NaN : a / b), unit: (a, b) => over(unitOf(a), unitOf(b)) },
};

// `at`: the place of the operator.
function binary(sign: string, left: Node, right: Node, at: number): Node {
  const { of, unit } = operators[sign];
  return (sampled) => {
    const [a, b] = [left(sampled), right(sampled)];
    if (sign === '/' && 'number' in b && b.number === 0) throw new Refusal('a division by 0 has no value', at);
    if ('number' in a && 'number' in b) return { number: of(a.number, b.number) };
    const length = sampled.waves[0]?.values.length ?? 0;
    const [x, y] = [samplesOf(a, length), samplesOf(b, length)];
    return { values: x.map((value, i) => of(value, y[i])), unit: unit(a, b) };
  };
}

interface Token {
  kind: 'number' | 'name' | 'sign' | 'end';
  text: string;
  at: number;
}

class Refusal extends Error {
  constructor(
    readonly problem: string,
    readonly at: number,
  ) {
    super(problem);
  }
}

const token = /\s*(?:(\d+(?:\.\d*)?(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?)|([a-z_]\w*)|([-+*/(),\u2212]))/iy;

function tokensOf(text: string): Token[] {
  const tokens: Token[] = [];
  token.lastIndex = 0;
  for (let at = 0; text.slice(at).trim() !== ''; at = token.lastIndex) {
    token.lastIndex = at;
    const found = token.exec(text);
    const begin = at + text.slice(at).search(/\S/);
    if (!found) throw new Refusal(`"${text[begin]}" has no meaning here`, begin);
    const [, number, name, sign] = found;
    tokens.push({ kind: number !== undefined ? 'number' : name !== undefined ? 'name' : 'sign', text: number ?? name ?? sign.replace('\u2212', '-'), at: begin });
  }
  return [...tokens, { kind: 'end', text: '', at: text.length }];
}

const deepest = 100; // nested parentheses

class Parser {
  private next = 0;
  private depth = 0;

  constructor(
    private readonly tokens: Token[],
    private readonly channels: number,
  ) {}

  whole(): Node {
    const node = this.sum();
    this.noDecimalComma();
    const { kind, text, at } = this.tokens[this.next];
    if (kind !== 'end') throw new Refusal(text === ')' ? '")" without "("' : `an operator is missing before "${text}"`, at);
    return node;
  }

  private take(text: string): boolean {
    if (this.tokens[this.next].kind !== 'sign' || this.tokens[this.next].text !== text) return false;
    ++this.next;
    return true;
  }

  private chain(signs: string[], part: () => Node): Node {
    let node = part();
    for (;;) {
      const { at } = this.tokens[this.next];
      const sign = signs.find((each) => this.take(each));
      if (sign === undefined) return node;
      node = binary(sign, node, part(), at);
    }
  }

  private sum = (): Node => this.chain(['+', '-'], this.product);
  private product = (): Node => this.chain(['*', '/'], this.sign);
  private sign = (): Node => {
    let negative = false;
    const { at } = this.tokens[this.next];
    while (this.take('-')) negative = !negative;
    const node = this.value();
    return negative ? binary('-', () => ({ number: 0 }), node, at) : node;
  };

  private value(): Node {
    const { kind, text, at } = this.tokens[this.next];
    if (++this.depth > deepest) throw new Refusal(`more than ${deepest} nested parentheses`, at);
    ++this.next;
    const node = kind === 'number' ? this.number(text) : kind === 'name' ? this.named(text, at) : this.inner(text, kind, at);
    --this.depth;
    return node;
  }

  private number(text: string): Node {
    const number = Number(text);
    return () => ({ number });
  }

  private inner(text: string, kind: Token['kind'], at: number): Node {
    if (kind === 'end') throw new Refusal('a channel or a number is missing at the end', at);
    if (text !== '(') throw new Refusal(`a channel or a number is missing before "${text}"`, at);
    const node = this.sum();
    this.close(at);
    return node;
  }

  // "1,5" is a number in many countries.
  private noDecimalComma() {
    const [before, comma, after] = [-1, 0, 1].map((k) => this.tokens.at(this.next + k));
    if (comma?.text !== ',' || before?.kind !== 'number' || after?.kind !== 'number' || after.at !== comma.at + 1) return;
    throw new Refusal(`the decimal separator is a point: ${before.text}.${after.text}`, before.at);
  }

  private close(at: number) {
    this.noDecimalComma();
    if (!this.take(')')) throw new Refusal('")" is missing for this "("', at);
  }

  private named(text: string, at: number): Node {
    const channel = /^c(\d+)$/i.exec(text)?.[1];
    if (channel !== undefined) {
      const number = Number(channel);
      if (number < 1 || number > this.channels) throw new Refusal(`there is no channel ${text}: the recording has c1 to c${this.channels}`, at);
      return ({ waves }) => waves[number - 1];
    }
    const known = Object.hasOwn(functions, text) ? functions[text] : undefined;
    if (!known) throw new Refusal(`"${text}" is no channel and no function: use c1 to c${this.channels}, ${Object.keys(functions).join(', ')}`, at);
    const open = this.tokens[this.next].at;
    if (!this.take('(')) throw new Refusal(`${text} needs "(" and ")" around its channel`, at);
    const parts = [this.sum()];
    while (this.take(',')) parts.push(this.sum());
    this.close(open);
    if (!known.takes.includes(parts.length)) throw new Refusal(`${text} takes ${known.takes.join(' or ')}, not ${parts.length} channels`, at);
    return (sampled) => {
      const values = parts.map((part) => part(sampled));
      const length = sampled.waves[0]?.values.length ?? 0;
      return { values: known.of(values.map((value) => samplesOf(value, length)), sampled.interval_s), unit: known.unit(values.map(unitOf)) };
    };
  }
}

// The wave that `text` describes, for recordings with this number of channels; or the error in the text.
export function formulaOf(text: string, channels: number): ((sampled: Sampled) => Wave) | Wrong {
  try {
    const node = new Parser(tokensOf(text), channels).whole();
    // Constants are known without samples: this finds a division by 0.
    node({ waves: Array.from({ length: channels }, () => ({ values: new Float64Array(), unit: '' })), interval_s: 1 });
    return (sampled) => {
      const value = node(sampled);
      return 'number' in value ? { values: samplesOf(value, sampled.waves[0]?.values.length ?? 0), unit: '' } : value;
    };
  } catch (error) {
    if (error instanceof Refusal) return { problem: error.problem, at: error.at };
    throw error;
  }
}

// The math channels of the address: "name=formula;name=formula".
export interface MathChannel {
  name: string;
  formula: string;
}
export const mathsOf = (text: string | null): MathChannel[] =>
  (text ?? '').split(';').flatMap((each) => {
    const cut = each.indexOf('=');
    return cut < 1 ? [] : [{ name: each.slice(0, cut), formula: each.slice(cut + 1) }];
  });
export const textOfMaths = (maths: MathChannel[]) => maths.map(({ name, formula }) => `${name}=${formula}`).join(';');

// The reason why a math channel cannot have this name; undefined: it can.
export function nameProblem(name: string, taken: string[]): string | undefined {
  if (name.trim() === '') return 'Enter a name.';
  if (/[=;,]/.test(name)) return 'A name must not contain "=", ";" or ",".';
  return taken.includes(name.trim()) ? 'This name is taken.' : undefined;
}
