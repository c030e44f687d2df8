// Long computations beside the page, so that it moves meanwhile: the engine once more, in a worker.
"use strict";

const ASIDE = `const Engine = engineOf();
let data;
onmessage = ({ data: message }) => {
  if (message.data) { data = message.data; return; }
  try { postMessage({ answer: Engine[message.name](data, ...message.given) }); }
  catch (error) { postMessage({ error: error.message }); }
};`;

class Aside {
  constructor(data) {
    this.data = data;
    this.able = typeof Worker !== "undefined";
    this.worker = null;
    this.job = null;
  }

  // What Engine[name](data, ...given) returns, one question at a time; null where `stop` came first.
  ask(name, ...given) {
    this.begin();
    if (!this.worker) return nextTask().then(() => Engine[name](this.data, ...given));
    return new Promise((resolve, reject) => {
      this.job = { resolve, reject, name, given };
      this.worker.postMessage({ name, given });
    });
  }

  begin() {
    if (this.worker || !this.able) return;
    try {
      const address = URL.createObjectURL(new Blob([engineOf.toString(), "\n", ASIDE], { type: "text/javascript" }));
      this.worker = new Worker(address);
      URL.revokeObjectURL(address);
      this.worker.postMessage({ data: this.data });
      this.worker.onmessage = ({ data: { answer, error } }) => {
        const { job } = this;
        this.job = null;
        if (error === undefined) job?.resolve(answer);
        else job?.reject(new Error(error));
      };
      // Where a page may have none, it computes by itself.
      this.worker.onerror = () => {
        const { job } = this;
        this.able = false;
        this.stop();
        if (job) job.resolve(Engine[job.name](this.data, ...job.given));
      };
    } catch {
      this.able = false;
      this.worker = null;
    }
  }

  // What is being computed is wanted no more.
  stop() {
    if (!this.job && this.able) return;
    const { job } = this;
    this.worker?.terminate();
    this.worker = this.job = null;
    if (this.able) job?.resolve(null);
  }
}
