// Where frames come from: baked into the page, or computed by the program behind it.
"use strict";

class BakedSource {
  constructor(page) { this.page = page; }
  async pose(entry, k) { return this.page.frames[entry].poses[k]; }
  async path(entry, k, kind) { return this.page.frames[entry][kind][k]; }
  async start() { return this.page.start; }
}

class LiveSource {
  constructor(handlers) {
    this.waiting = new Map();
    this.number = 0;
    this.opened = new Promise((resolve, reject) => {
      const scheme = location.protocol === "https:" ? "wss:" : "ws:";
      this.socket = new WebSocket(`${scheme}//${location.host}/live`);
      this.socket.onopen = resolve;
      this.socket.onerror = reject;
      this.socket.onclose = () => handlers.gone();
      this.socket.onmessage = (event) => this.receive(JSON.parse(event.data), handlers);
    });
  }

  receive(message, handlers) {
    if (message.id === undefined) { handlers.pushed(message); return; }
    const { resolve, reject } = this.waiting.get(message.id);
    this.waiting.delete(message.id);
    if (message.error !== undefined) reject(new Error(message.error));
    else resolve(message.answer);
  }

  async ask(request) {
    await this.opened;
    const id = ++this.number;
    return new Promise((resolve, reject) => {
      if (this.socket.readyState !== WebSocket.OPEN) return; // gone() has told the user
      this.waiting.set(id, { resolve, reject });
      this.socket.send(JSON.stringify({ id, ...request }));
    });
  }

  pose(entry, k) { return this.ask({ want: "pose", entry, pose: k }); }
  path(entry, k, kind) { return this.ask({ want: "path", entry, pose: k, kind }); }
  frame(q) { return this.ask({ want: "frame", q }); }
  start() { return this.ask({ want: "start" }); }

  // Of a mechanism: from a closed configuration to other inputs, and what surrounds it.
  drive(q, inputs) { return this.ask({ want: "frame", q, inputs }); }
  around(q) { return this.ask({ want: "around", q }); }
}
