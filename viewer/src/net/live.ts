// The stream, and requests back. Reconnects by itself.

export type Request =
  | { type: 'pull'; body: number; point: number[]; target: number[] }
  | { type: 'push'; body: number; point: number[]; target: number[] }
  | { type: 'release' | 'step' | 'reset' | 'hold' }
  | { type: 'pause' | 'ghost'; on: boolean }
  | { type: 'set'; setting: string; index?: number; value: number }
  | { type: 'shape'; body: number; compliance: number[]; factor: number }
  | { type: 'resume'; sequence: number }
  | { type: 'write'; tuned: boolean; moment: number; text_only: boolean }
  | { type: 'interfaces'; mechanism: number; bodies: number[] };

export interface LiveHandlers {
  opened(): void;
  message(data: string | ArrayBuffer): void;
  /** The connection is gone; `reason` is what the program said, if it did. */
  closed(reason: string): void;
}

const FIRST_WAIT = 300; // ms
const LONGEST_WAIT = 3000;

export class LiveStream {
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT;
  private stopped = false;

  constructor(
    private readonly url: string,
    private readonly handlers: LiveHandlers,
  ) {}

  start(): void {
    const socket = new WebSocket(this.url);
    this.socket = socket;
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.wait = FIRST_WAIT;
      this.handlers.opened();
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.handlers.message(event.data);
    socket.onclose = (event) => {
      this.socket = null;
      this.handlers.closed(event.reason);
      if (this.stopped) return;
      setTimeout(() => this.start(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
    };
  }

  stop(): void {
    this.stopped = true;
    this.socket?.close();
  }

  get open(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Numbers that are not finite would close the connection; such a request is a fault of the page and not sent. */
  send(request: Request): boolean {
    if (!this.open || !allFinite(request)) return false;
    this.socket?.send(JSON.stringify(request));
    return true;
  }
}

export function allFinite(value: unknown): boolean {
  if (typeof value === 'number') return Number.isFinite(value);
  if (Array.isArray(value)) return value.every(allFinite);
  if (value !== null && typeof value === 'object') return Object.values(value).every(allFinite);
  return true;
}
