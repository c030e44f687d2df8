// The postures of one pose: click one, watch the way to it.

class Postures {
  constructor(app, postures) {
    this.app = app;
    this.postures = postures;
    $("postures-box").hidden = !postures.length;
    $("postures-count").textContent = postures.length ? `(${postures.length})` : "";
    this.items = postures.map((posture, k) => {
      const text = make("span", "text", make("b", "", k + 1), make("span", "", posture.name));
      if (posture.way) text.append(make("span", "way", " \u25b6"));
      const title = posture.way ? "Play the way to it" : "Show it";
      const item = make("li", "", press("entry", title, () => this.choose(k), text, make("span", "more", posture.more)));
      $("postures").append(item);
      return item;
    });
  }

  // The way to it where there is one; else the posture by itself.
  choose(k) {
    const { app } = this, { q, way, name, more } = this.postures[k];
    ++app.turn;
    app.view.trail([]);
    if (!way) app.go(q);
    else {
      const frames = way.map((row) => app.compute(row));
      app.showWay(frames, (f) => (f.verdict ? f.verdict.lower : Infinity));
    }
    this.mark(k);
    app.say(`posture ${k + 1}: ${name}; ${more}`);
    if (way) app.player.resume();
  }

  mark(k) {
    this.items.forEach((item, i) => item.classList.toggle("chosen", i === k));
  }
}
