// The page's WebSocket, which reconnects when the daemon is reachable again.
import { FromDaemon } from "./protocol";

export interface Listener {
  onOpen(): void;
  onMessage(message: FromDaemon): void;
  onPoints(message: ArrayBuffer): void;
  onClosed(): void;
}

const kFirstWait = 250;
const kLongestWait = 4000;

export class Connection {
  private socket: WebSocket | null = null;
  private wait = kFirstWait;

  constructor(private readonly listener: Listener) {
    this.open();
  }

  send(message: object): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  private open(): void {
    const address = new URL("/volumes", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.wait = kFirstWait;
      this.listener.onOpen();
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (typeof event.data === "string") this.listener.onMessage(JSON.parse(event.data) as FromDaemon);
      else this.listener.onPoints(event.data);
    };
    socket.onclose = () => {
      this.listener.onClosed();
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(this.wait * 2, kLongestWait);
    };
  }
}
