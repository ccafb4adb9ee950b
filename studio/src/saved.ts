import { useSyncExternalStore } from 'react';
import { complainOf } from './notices';
import { listenToTexts, readText, writeText } from './storage';

// A value in the storage of the page (storage.ts), shared by its tabs. `read` checks the stored text, which another version of
// the page may have written. If `read` throws, the text is kept under another key, and the value is empty.
export class Saved<T> {
  private text: string | null = null;
  private value: T;

  constructor(
    private readonly key: string,
    private readonly empty: T,
    private readonly read: (json: unknown) => T,
  ) {
    this.value = empty;
  }

  get = (): T => {
    const text = readText(this.key);
    if (text === this.text) return this.value;
    this.text = text;
    this.value = this.empty;
    if (text === null) return this.value;
    try {
      this.value = this.read(JSON.parse(text));
    } catch (error) {
      const why = error instanceof Error ? error.message : String(error);
      const keep = () => {
        writeText(`${this.key}.unreadable`, text);
        complainOf({ what: `the storage of this page is unusable: ${why}`, where: this.key, hint: `the text is kept there as ${this.key}.unreadable` });
      };
      setTimeout(keep); // React forbids changes while it renders
    }
    return this.value;
  };

  set(to: T) {
    writeText(this.key, JSON.stringify(to));
  }

  listen = listenToTexts;
}

export const useSaved = <T>(saved: Saved<T>): T => useSyncExternalStore(saved.listen, saved.get);
