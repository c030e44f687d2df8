// The meshcat view: applies a frame to the scene that Python drew.
"use strict";

class SceneView {
  constructor(element, settings) {
    this.element = element;
    this.settings = settings;
    this.options = { mode: settings.mode, translation: true, rotation: true,
                     axis: true, visual: settings.shapes, bone: !settings.shapes, floor: true };
    const V = this.viewer = new MeshCat.Viewer(element);
    const fullSize = V.set_3d_pane_size.bind(V);
    V.set_3d_pane_size = () => fullSize(element.clientWidth || 1, element.clientHeight || 1);
    new ResizeObserver(() => V.set_3d_pane_size()).observe(element);
    V.set_property(["Background"], "top_color", [1, 1, 1]);
    V.set_property(["Background"], "bottom_color", [0.89, 0.92, 0.95]);
    V.scene_tree.find(["Background"]).on_update();
    V.set_property(["Grid"], "visible", false);
    V.set_property(["Axes"], "visible", false);
    V.camera.fov = 36;
    V.camera.near = 0.01 * settings.reach;
    V.camera.far = 100 * settings.reach;
    this.touched = false;
    V.controls.addEventListener("start", () => { this.touched = true; });
    this.label = document.getElementById("label-lost");
    const render = V.render.bind(V);
    V.render = () => { render(); this.placeLabel(); };
  }

  // Commands as meshcat's own page takes them, each after its length.
  load(bytes) {
    const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let at = 0; at < bytes.byteLength;) {
      const length = data.getUint32(at, true);
      this.viewer.handle_command_bytearray(bytes.subarray(at + 4, at + 4 + length));
      at += 4 + length;
    }
    this.lights();
  }

  // Meshcat's lights fade ten metres away and stand at 1.5 m: move them out with large robots.
  lights() {
    const far = Math.max(1, this.settings.reach);
    for (const [name, x] of [["PointLightNegativeX", 1.5], ["PointLightPositiveX", -1.5]]) {
      const light = this.viewer.scene_tree.find(["Lights", name, "<object>"]).object;
      light.position.set(x * far, x * far, 2 * far);
      light.distance = 0;
    }
  }

  node(path) { return this.viewer.scene_tree.find(["pinsing", ...path.split("/")]).object; }

  place(path, position, turn, scale) {
    const o = this.node(path);
    if (position) o.position.set(...position);
    if (turn) o.quaternion.set(...turn);
    if (scale) o.scale.set(...scale);
  }

  show(frame) {
    this.frame = frame;
    const s = this.options;
    frame.links.forEach((p, i) => this.place(`arm/${i + 1}`, p.slice(0, 3), p.slice(3)));
    this.place("tip", frame.tip);
    for (let j = 0; j <= frame.links.length; j++) {
      const dressed = !this.settings.bare.includes(j);
      this.node(`arm/${j}/visual`).visible = s.visual;
      this.node(`arm/${j}/bone`).visible = s.bone || (s.visual && !dressed);
      if (j === 0) continue;
      const hot = frame.hot.includes(this.settings.jointOf[j - 1]);
      this.node(`arm/${j}/axis`).visible = s.axis && !hot;
      this.node(`arm/${j}/hot`).visible = s.axis && hot;
    }
    this.lostAt = null;
    for (const kind of ["translation", "rotation"]) {
      const e = frame.ellipsoids[s.mode][kind];
      const seen = s[kind] && e.drawn[0] > 0;
      this.node(`ellipsoid/${kind}`).visible = seen;
      if (seen) this.place(`ellipsoid/${kind}`, frame.tip, e.turn, e.drawn);
      const lost = s[kind] && e.flat !== null;
      this.node(`lost/${kind}`).visible = lost;
      if (lost) this.place(`lost/${kind}`, frame.tip, e.flat);
      if (lost && (kind === "translation" || !this.lostAt)) {
        const up = new MeshCat.THREE.Vector3(0, 0, (kind === "translation" ? 0.34 : 0.26) * this.settings.reach);
        up.applyQuaternion(new MeshCat.THREE.Quaternion(...e.flat));
        this.lostAt = [frame.tip[0] + up.x, frame.tip[1] + up.y, frame.tip[2] + up.z];
      }
    }
    for (let k = 0; k < this.settings.lines; k++) {
      const m = frame.lost[k];
      const seen = Boolean(m) && m.close && (m.kind === "line" || m.kind === "screw");
      this.node(`line/${k}`).visible = seen;
      if (seen) this.place(`line/${k}`, m.at, m.turn);
    }
    this.node("floor").visible = s.floor;
    this.viewer.set_dirty();
  }

  set(option, value) {
    this.options[option] = value;
    if (this.frame) this.show(this.frame);
  }

  // Everything of a frame that should be in the picture, in the base, z up.
  points(frame) {
    const out = [[0, 0, 0], frame.tip];
    for (const p of frame.links) out.push(p.slice(0, 3));
    const r = 0.3 * this.settings.reach;
    for (let k = 0; k < 3; k++) for (const sign of [-1, 1]) {
      const p = frame.tip.slice();
      p[k] += sign * r;
      out.push(p);
    }
    return out;
  }

  fit(frames) {
    const all = frames.flatMap((f) => this.points(f));
    const low = [0, 1, 2].map((k) => Math.min(...all.map((p) => p[k])));
    const high = [0, 1, 2].map((k) => Math.max(...all.map((p) => p[k])));
    const centre = low.map((v, k) => (v + high[k]) / 2);
    const radius = Math.max(...all.map((p) => Math.hypot(...p.map((v, k) => v - centre[k])))) || 1;
    const { camera, controls } = this.viewer;
    const aspect = Math.max(0.2, this.element.clientWidth / Math.max(1, this.element.clientHeight));
    const half = (camera.fov * Math.PI) / 360;
    const distance = radius / Math.sin(Math.min(half, Math.atan(Math.tan(half) * aspect)));
    const side = [0.68, -0.62, 0.39];
    const eye = centre.map((v, k) => v + 0.98 * distance * side[k]);
    const yUp = ([x, y, z]) => [x, z, -y];
    controls.target.set(...yUp(centre));
    camera.position.set(...yUp(eye));
    camera.updateProjectionMatrix();
    controls.update();
    this.viewer.set_dirty();
  }

  placeLabel() {
    if (!this.lostAt || document.body.classList.contains("picture")) { this.label.hidden = true; return; }
    const [x, y, z] = this.lostAt;
    const p = new MeshCat.THREE.Vector3(x, z, -y).project(this.viewer.camera);
    this.label.hidden = p.z > 1;
    this.label.style.left = `${((p.x + 1) / 2) * this.element.clientWidth}px`;
    this.label.style.top = `${((1 - p.y) / 2) * this.element.clientHeight}px`;
  }
}
