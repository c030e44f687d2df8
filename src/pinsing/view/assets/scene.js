// The meshcat view: applies a frame to the scene that Python drew.
"use strict";

class SceneView {
  constructor(element, settings) {
    this.element = element;
    this.settings = settings;
    this.options = { mode: settings.mode, translation: true, rotation: true,
                     axis: true, lost: true, visual: settings.shapes, bone: !settings.shapes, floor: true };
    const V = this.viewer = new MeshCat.Viewer(element);
    const fullSize = V.set_3d_pane_size.bind(V);
    V.set_3d_pane_size = () => fullSize(element.clientWidth || 1, element.clientHeight || 1);
    new ResizeObserver(() => V.set_3d_pane_size()).observe(element);
    V.set_property(["Background"], "top_color", [0.97, 0.98, 0.99]);
    V.set_property(["Background"], "bottom_color", [0.77, 0.82, 0.87]);
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
    // Collada parts with several materials come merged as one group with a list of materials,
    // which three.js does not draw: give them the first.
    this.node("arm").traverse((o) => {
      if (Array.isArray(o.material)) o.material = o.material.map((m) => (Array.isArray(m) ? m[0] : m));
    });
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
      const lost = s.lost && s[kind] && e.flat !== null;
      this.node(`lost/${kind}`).visible = lost;
      if (lost) this.place(`lost/${kind}`, frame.tip, e.flat);
      if (lost && (kind === "translation" || !this.lostAt)) {
        const up = new MeshCat.THREE.Vector3(0, 0, (kind === "translation" ? 0.27 : 0.18) * this.settings.reach);
        up.applyQuaternion(new MeshCat.THREE.Quaternion(...e.flat));
        this.lostAt = [frame.tip[0] + up.x, frame.tip[1] + up.y, frame.tip[2] + up.z];
      }
    }
    if (frame.free) this.showFree(frame);
    for (let k = 0; k < this.settings.lines; k++) {
      const m = frame.lost[k];
      const seen = s.lost && Boolean(m) && m.close && (m.kind === "line" || m.kind === "screw");
      this.node(`line/${k}`).visible = seen;
      if (seen) this.place(`line/${k}`, m.at, m.turn);
    }
    this.node("floor").visible = s.floor;
    this.viewer.set_dirty();
  }

  // Motions of a mechanism that its actuators do not hold.
  showFree(frame) {
    this.label.textContent = this.lostAt ? "lost" : "not held";
    this.label.classList.toggle("free", !this.lostAt);
    for (const [kind, length] of [["translation", 0.27], ["rotation", 0.18]]) {
      const arrow = frame.free[kind];
      const seen = this.options.lost && arrow !== null;
      this.node(`free/${kind}`).visible = seen;
      if (!seen) continue;
      this.place(`free/${kind}`, arrow.at, arrow.turn);
      if (this.lostAt) continue;
      const end = new MeshCat.THREE.Vector3(0, 0, length * this.settings.reach);
      end.applyQuaternion(new MeshCat.THREE.Quaternion(...arrow.turn));
      this.lostAt = [arrow.at[0] + end.x, arrow.at[1] + end.y, arrow.at[2] + end.z];
    }
  }

  set(option, value) {
    this.options[option] = value;
    if (this.frame) this.show(this.frame);
  }

  // Points, in the axes of three.js (y up), that a picture of a frame should have in it.
  outline(frame) {
    const { Vector3, Quaternion } = MeshCat.THREE;
    const yUp = (v) => new Vector3(v.x, v.z, -v.y);
    const tip = new Vector3(...frame.tip);
    this.show(frame);
    this.viewer.scene.updateMatrixWorld(true);
    const out = [new Vector3(), yUp(tip), ...frame.links.map((p) => yUp(new Vector3(...p.slice(0, 3))))];
    const part = this.options.visual ? "visual" : "bone";
    for (let j = 1; j <= frame.links.length; j++) this.node(`arm/${j}/${part}`).traverse((o) => {
      if (!o.isMesh) return;
      if (!o.geometry.boundingBox) o.geometry.computeBoundingBox();
      const { min, max } = o.geometry.boundingBox;
      for (const x of [min.x, max.x]) for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) {
        out.push(new Vector3(x, y, z).applyMatrix4(o.matrixWorld));
      }
    });
    const along = (turn, k, length) => {
      const v = new Vector3().setComponent(k, length).applyQuaternion(new Quaternion(...turn));
      out.push(yUp(tip.clone().add(v)), yUp(tip.clone().sub(v)));
    };
    for (const kind of ["translation", "rotation"]) {
      const e = frame.ellipsoids[this.options.mode][kind];
      e.drawn.forEach((length, k) => along(e.turn, k, length));
      if (e.flat !== null) along(e.flat, 2, 0.27 * this.settings.reach);
    }
    return out;
  }

  fit(frames) {
    const shown = this.frame;
    const some = frames.filter((_, i) => i % Math.ceil(frames.length / 8) === 0);
    const points = some.flatMap((f) => this.outline(f));
    if (shown) this.show(shown);
    const { Vector3 } = MeshCat.THREE;
    const { camera, controls } = this.viewer;
    const side = new Vector3(...this.settings.side).normalize();
    const right = new Vector3(0, 1, 0).cross(side).normalize();
    const up = side.clone().cross(right);
    const centre = new Vector3();
    for (const axis of [right, up, side]) {
      const places = points.map((p) => p.dot(axis));
      centre.addScaledVector(axis, (Math.min(...places) + Math.max(...places)) / 2);
    }
    // The player covers the lower edge of the page.
    const picture = document.body.classList.contains("picture");
    const slope = Math.tan((camera.fov * Math.PI) / 360) * (picture ? 0.9 : 0.82);
    const aspect = Math.max(0.2, this.element.clientWidth / Math.max(1, this.element.clientHeight));
    const distance = Math.max(0.5 * this.settings.reach, ...points.map((p) => {
      const v = p.clone().sub(centre);
      return Math.max(Math.abs(v.dot(right)) / aspect, Math.abs(v.dot(up))) / slope + v.dot(side);
    }));
    if (!picture) centre.addScaledVector(up, -0.05 * distance * slope);
    controls.target.copy(centre);
    camera.position.copy(centre).addScaledVector(side, distance);
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
