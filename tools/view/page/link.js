// The WebSocket: token first, acknowledgements, and again and again when it is gone.
import { decode } from './protocol.js';

const kAgain_ms = 500;
const kAlive_ms = 1000;

export class Link {
  /** @param on { document(json), frame(frame), mesh(mesh), trouble(text, final) } */
  constructor(on) {
    this.on = on;
    this.newest = 0;
    this.told = 0;
    this.toldAt = 0;
    this.token = new URLSearchParams(location.hash.slice(1)).get('k') ?? '';
    this.open();
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/live`, 'rtbus-view-1');
    this.socket.binaryType = 'arraybuffer';
    this.newest = this.told = 0;
    this.socket.onopen = () => this.socket.send(JSON.stringify({ token: this.token }));
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onclose = (event) => {
      const final = event.code >= 4400;
      const why = event.reason || 'rtbus view does not answer; waiting for it';
      this.on.trouble(why, final);
      if (!final) setTimeout(() => this.open(), kAgain_ms);
    };
  }

  receive(data) {
    if (typeof data === 'string') return this.on.document(JSON.parse(data));
    const message = decode(data);
    if (message.kind === 'mesh') return this.on.mesh(message);
    this.newest = message.number;
    this.on.frame(message);
  }

  /** From requestAnimationFrame only: a hidden page acknowledges nothing, and is sent nothing. */
  acknowledge(now_ms) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    if (this.newest === this.told && now_ms < this.toldAt + kAlive_ms) return;
    this.told = this.newest;
    this.toldAt = now_ms;
    this.socket.send(JSON.stringify({ ack: this.newest }));
  }

  /** What a recording does next. */
  play(play) { if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ play })); }

  /** The one way of an order to the session. @returns false: not sent. */
  order(order) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ order }));
    return true;
  }
}
