// Where frames come from: the page computes those of an arm itself; those of a mechanism come from
// the program behind it.
"use strict";

// An arm. With a program behind the page, that program may show configurations (`pushed`).
class EngineSource {
  constructor(page, handlers) {
    this.page = page;
    this.stream = page.live ? new LiveSource(handlers) : null;
  }

  compute(q) { return Engine.frameAt(this.page.engine, q); }
  // Where each joint alone would meet each family.
  marks(q) {
    const { engine, joints } = this.page;
    return joints.map((joint, j) => engine.families.flatMap((f) =>
      (f.branches.some((b) => b.equations.length > 1) ? []
        : Engine.meetings(f, q, j, joint.lower, joint.upper, joint.prismatic).map((value) => ({ value, name: f.name, text: f.text })))));
  }

  async frame(q) { return this.compute(q); }
  async pose(entry, k) { return this.compute(this.page.entries[entry].q[k]); }

  async path(entry, k, kind) {
    const { engine, entries } = this.page;
    const family = engine.families.find((f) => f.entry === entry) ?? null;
    const goal = entries[entry].q[k];
    await new Promise((resolve) => setTimeout(resolve)); // the page says first what it does
    if (kind === "along" && family === null) return [];
    const path = kind === "into" ? Engine.into(engine, entries[entry].moved, goal)
      : Engine.along(engine, family, goal);
    return Engine.framesOf(engine, path, family);
  }

  async start() {
    const { q, entry, pose } = this.stream ? await this.stream.start() : this.page.start;
    return { frame: this.compute(q), entry, pose };
  }
}

class LiveSource {
  constructor(handlers) {
    this.waiting = new Map();
    this.number = 0;
    this.opened = new Promise((resolve, reject) => {
      const scheme = location.protocol === "https:" ? "wss:" : "ws:";
      this.socket = new WebSocket(`${scheme}//${location.host}${location.pathname}live`);
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
