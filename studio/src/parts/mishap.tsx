import { Component, type ReactNode } from 'react';

// An error boundary: an error in one page replaces only that page; the stop button, the clock and other pages work.
export class Mishap extends Component<{ children: ReactNode }, { error: Error | null }> {
  override state: { error: Error | null } = { error: null };

  static getDerivedStateFromError(error: unknown) {
    return { error: error instanceof Error ? error : new Error(String(error)) };
  }

  override render() {
    const { error } = this.state;
    if (!error) return this.props.children;
    return (
      <section className="panel" aria-label="This part of the page has failed">
        <p className="trouble" role="alert">
          <strong>This part of the page has failed</strong> · {error.message}
          <span className="hint">The drives are not affected. STOP and the other pages still work.</span>
        </p>
        <button type="button" className="button" onClick={() => this.setState({ error: null })}>Try again</button>
      </section>
    );
  }
}
