import { useSyncExternalStore } from 'react';
import { complainOf } from './notices';

// A value in the storage of the browser, shared by the tabs of this page. `read` checks the stored text, which another version of
// the page may have written. If `read` throws, the text is kept under another key, and the value is empty.
export class Saved<T> {
  private text: string | null = null;
  private value: T;
  private readonly listeners = new Set<() => void>();

  constructor(
    private readonly key: string,
    private readonly empty: T,
    private readonly read: (json: unknown) => T,
  ) {
    this.value = empty;
    addEventListener('storage', (event) => {
      if (event.key === key) this.tell();
    });
  }

  get = (): T => {
    const text = localStorage.getItem(this.key);
    if (text === this.text) return this.value;
    this.text = text;
    this.value = this.empty;
    if (text === null) return this.value;
    try {
      this.value = this.read(JSON.parse(text));
    } catch (error) {
      localStorage.setItem(`${this.key}.unreadable`, text);
      const why = error instanceof Error ? error.message : String(error);
      setTimeout(() => complainOf({ what: `the browser's storage of this page is unusable: ${why}`, where: this.key, hint: `the text is kept there as ${this.key}.unreadable` }));
    }
    return this.value;
  };

  set(to: T) {
    try {
      localStorage.setItem(this.key, JSON.stringify(to));
    } catch {
      complainOf({ what: 'the browser did not save it: its storage is full or switched off', where: this.key, hint: 'export it as a file' });
    }
    this.tell();
  }

  private tell() {
    this.listeners.forEach((listener) => listener());
  }

  listen = (listener: () => void) => {
    this.listeners.add(listener);
    return () => {
      this.listeners.delete(listener);
    };
  };
}

export const useSaved = <T>(saved: Saved<T>): T => useSyncExternalStore(saved.listen, saved.get);
