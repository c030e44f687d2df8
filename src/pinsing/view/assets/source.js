// What computes beside the page, and the program behind it, which leads it.

// The stream of that program: what it shows, first (`start`) and later (`app.pushed`). It is opened before
// there is anything to show.
class LiveSource {
  constructor() {
    this.app = this.shown = null;
    this.closed = false;
    this.opened = new Promise((resolve, reject) => {
      const address = new URL("live", location.href);
      address.protocol = address.protocol.replace("http", "ws");
      this.socket = new WebSocket(address);
      this.socket.onclose = () => {
        this.closed = true;
        reject(new Error("the program that serves this page does not answer"));
        this.app?.gone();
      };
      this.socket.onmessage = (event) => { this.receive(JSON.parse(event.data)); resolve(); };
    });
    this.opened.catch(() => {}); // told where it is waited for
  }

  follow(app) {
    this.app = app;
    if (this.closed) app.gone();
  }

  // What is shown before anybody follows is where the page starts.
  receive(message) {
    if (this.app && this.shown) this.app.pushed(message);
    else if (message.q) this.shown = message;
  }

  async start() {
    await this.opened;
    return this.shown;
  }
}

const ASIDE = `const Engine = engineOf();
let data;
onmessage = ({ data: asked }) => {
  if (asked.data) ({ data } = asked);
  else postMessage(Engine[asked.name](data, ...asked.given));
};`;

// Long computations beside the page, so that it moves meanwhile: the engine once more, in a worker.
class Aside {
  constructor(data) {
    this.data = data;
    this.able = typeof Worker !== "undefined";
    this.worker = this.job = null;
  }

  // What Engine[name](data, ...given) returns, one question at a time; undefined where `stop` came first.
  async ask(name, ...given) {
    const here = () => wait().then(() => Engine[name](this.data, ...given));
    if (this.able && !this.worker) this.begin();
    if (!this.able) return here();
    return new Promise((resolve) => {
      this.job = { resolve, here };
      this.worker.postMessage({ name, given });
    });
  }

  // The same in place of what was asked before.
  anew(...asked) {
    this.stop();
    return this.ask(...asked);
  }

  begin() {
    const address = URL.createObjectURL(new Blob([engineOf.toString(), "\n", ASIDE], { type: "text/javascript" }));
    // Where a page may have none, or it fails, the page computes by itself.
    try { this.worker = new Worker(address); } catch { this.able = false; return; }
    URL.revokeObjectURL(address);
    this.worker.onerror = () => { this.able = false; this.answer(this.job?.here()); };
    this.worker.onmessage = ({ data }) => this.answer(data);
    this.worker.postMessage({ data: this.data });
  }

  answer(found) {
    const { job } = this;
    this.job = null;
    job?.resolve(found);
  }

  // What is being computed is wanted no more.
  stop() {
    if (!this.job) return;
    this.worker?.terminate();
    this.worker = null;
    this.answer();
  }
}
