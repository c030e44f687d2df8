// Keeps a moving picture smooth: where it cannot be drawn in time (graphics without a card), it is drawn
// with fewer points while it moves, and with all of them once it rests.

const PACE = { slow: 60, stuck: 250, rest: 300, coarse: 0.4, looks: 3 }; // ms between pictures, ms, points a side, pictures

class Pace {
  constructor(viewer) {
    this.viewer = viewer;
    this.last = 0;
    this.watching = this.coarse = this.slow = false;
    const capture = viewer.capture_image.bind(viewer);
    viewer.capture_image = (...size) => { this.full(); return capture(...size); };
  }

  // Something has moved.
  moved() {
    this.last = performance.now();
    if (this.watching || document.hidden) return;
    this.watching = true;
    if (this.slow) this.ratio(PACE.coarse); // it was the last time
    let before = null, late = 0;
    const look = (at) => {
      if (performance.now() - this.last > PACE.rest) { this.watching = false; this.full(); return; }
      const gap = at - (before ?? at);
      late = gap > PACE.slow ? late + 1 : 0;
      before = at;
      if (!this.coarse && (gap > PACE.stuck || late >= PACE.looks)) {
        this.slow = true;
        this.ratio(PACE.coarse);
      }
      requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  }

  ratio(part) {
    this.coarse = part < 1;
    this.viewer.renderer.setPixelRatio(part * window.devicePixelRatio);
    this.viewer.set_dirty();
  }

  full() { if (this.coarse) this.ratio(1); }
}
