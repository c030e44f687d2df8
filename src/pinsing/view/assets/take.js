// What goes out of the page and comes into it: poses as text and links, pictures, trajectory files.

const trimmed = (q) => q.map((v) => Number(v.toFixed(9)));

const { NUMBER, HUGE } = Engine;

// What the address asks for: #q=0.1,0.2,... and #picture; `problem` says why its q is none.
function asked() {
  const parts = location.hash.slice(1).split("&"), found = parts.find((part) => part.startsWith("q="));
  const picture = parts.includes("picture"), texts = found?.slice(2).replace(/%2c/gi, ",").split(",");
  if (!texts) return { q: null, picture, problem: "" };
  const wrong = texts.findIndex((t) => !NUMBER.test(t)), far = texts.findIndex((t) => Math.abs(Number(t)) > HUGE);
  const shown = (k) => (texts[k].length > 24 ? `${texts[k].slice(0, 24)}\u2026` : texts[k]);
  const problem = wrong >= 0 ? `value ${wrong + 1} of the address is not a number: ${shown(wrong) || "nothing"}`
    : far >= 0 ? `value ${far + 1} of the address is too large: ${shown(far)} (radians and metres, up to 1e6)` : "";
  return { q: problem ? null : texts.map(Number), picture, problem };
}

class Take {
  // `app` gives the pose (`poseTexts()`), joints of a file (`fileJoints()`) and takes one in (`follow`).
  constructor(app) {
    this.app = app;
    $("copy").addEventListener("click", () => this.copy($("copy-as").value));
    $("save-picture").addEventListener("click", () => this.picture());
    $("open-path").addEventListener("click", () => $("path-file").click());
    $("path-file").addEventListener("change", () => { this.read($("path-file").files[0]); $("path-file").value = ""; });
    this.offer();
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => { event.preventDefault(); this.read(event.dataTransfer.files[0]); });
  }

  // What to type for files that a page without a program behind it does not read.
  get others() { return this.app.page.mechanism ? "" : " For other files type: pinsing check ROBOT FILE -o page.html"; }

  // Which files the page takes.
  offer() {
    $("path-units").hidden = !this.app.reads;
    $("drop-note").textContent = this.app.reads ? "Or drop its file onto the page: whatever `pinsing check` reads (CSV, NPY, YAML of ROS or MoveIt, .ls, .script)."
      : `Or drop a CSV file onto the page, in radians and metres, with the names ${this.app.fileJoints().map(({ name }) => name).join(", ")} in its first line.${this.others}`;
  }

  text(kind) {
    const { flag, python, link, json } = this.app.poseTexts();
    return { flag: `--q=${trimmed(flag).join(",")}`, python, link: `${location.href.split("#")[0]}#q=${trimmed(link).join(",")}`,
             json: JSON.stringify(json) }[kind];
  }

  async copy(kind) {
    const text = this.text(kind);
    try {
      await navigator.clipboard.writeText(text);
      $("copied").textContent = `copied: ${text}`;
    } catch {
      $("copied").textContent = text; // no right to the clipboard: here it is, to be marked by hand
    }
    if (kind !== "link") return;
    try { history.replaceState(null, "", text); } catch { /* a frame without an address of its own */ }
  }

  picture() {
    const download = `${this.app.page.robot.name.replace(/[^\w.-]+/g, "_") || "robot"}.png`;
    make("a", { href: this.app.view.still(true).toDataURL(), download }).click();
  }

  // A trajectory file, ready to be played: read by the program behind the page, as the command line reads it; by
  // the page alone in one plain format.
  async read(file) {
    if (!file) return;
    const { app } = this;
    try {
      if (app.reads) {
        app.say(`reading ${file.name}\u2026`);
        const asked = new URLSearchParams({ name: file.name, units: $("path-units").value });
        const answer = await fetch(`trajectory?${asked}`, { method: "POST", body: file });
        if (!answer.ok) throw new Error(answer.status === 400 ? "the file is larger than 32 MB" : `refused (${answer.status})`);
        const way = await answer.json();
        app.say(way.error ?? "");
        if (!way.error) app.trajectory(way);
        return;
      }
      await app.follow(file.name, Engine.parseTrajectory(await file.text(), app.fileJoints()));
    } catch (error) {
      app.say(`${file.name}: ${error.message}${app.reads ? "" : `.${this.others}`}`);
    }
  }
}
