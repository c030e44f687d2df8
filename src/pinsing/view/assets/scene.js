// The meshcat view: applies a frame to the scene that Python drew.

const LOST_LABELS = { translation: "lost translation", rotation: "lost rotation", line: "lost: along this line", screw: "lost: this screw motion" };

// Drawing commands as meshcat's own page takes them, each after its length.
function* commandsOf(bytes) {
  const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  for (let at = 0; at < bytes.byteLength;) {
    const length = data.getUint32(at, true);
    yield bytes.subarray(at + 4, at + 4 + length);
    at += 4 + length;
  }
}

// The point at a length along axis k of what is at `at` with a turn.
function along(at, turn, length, k = 2) {
  const { Vector3, Quaternion } = MeshCat.THREE, way = new Vector3().setComponent(k, length).applyQuaternion(new Quaternion(...turn));
  return way.add(new Vector3(...at)).toArray();
}

class SceneView {
  constructor(element) {
    this.element = element;
    const V = this.viewer = new MeshCat.Viewer(element, false); // frames begin with the arm
    V.gui.domElement.remove(); // our panel drives it
    V.renderer.debug.checkShaderErrors = false; // each question waits until all is drawn that was asked before
    const fullSize = V.set_3d_pane_size.bind(V), size = [0, 0];
    // A size set anew is drawn anew: only where it changes.
    V.set_3d_pane_size = () => {
      const wanted = [element.clientWidth || 1, element.clientHeight || 1];
      if (wanted.every((v, k) => v === size[k])) return;
      size.splice(0, 2, ...wanted);
      fullSize(...wanted);
    };
    new ResizeObserver(() => V.set_3d_pane_size()).observe(element);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const paint = () => {
      V.set_property(["Background"], "top_color", dark.matches ? [0.25, 0.29, 0.34] : [0.97, 0.98, 0.99]);
      V.set_property(["Background"], "bottom_color", dark.matches ? [0.42, 0.47, 0.53] : [0.77, 0.82, 0.87]);
      V.scene_tree.find(["Background"]).on_update();
      // The grid stays in the background.
      V.scene_tree.find(["pinsing", "floor"]).object.traverse((o) => o.material?.color.set(dark.matches ? 0x66717e : 0xc9d1d9));
      V.set_dirty();
    };
    this.paint = paint;
    dark.addEventListener("change", paint);
    V.set_property(["Grid"], "visible", false);
    V.set_property(["Axes"], "visible", false);
    V.camera.fov = 36;
    this.touched = false;
    V.controls.addEventListener("start", () => { this.touched = true; });
    this.labels = new Labels(element);
    this.pace = new Pace(V);
    const render = V.render.bind(V);
    V.render = () => {
      if (!this.frame) return; // links that no pose has placed yet: nobody wants to see them
      render();
      this.labels.place(V.camera);
      this.placed?.(V.camera);
    };
    this.paint();
  }

  // Draws a speck of each kind of paint, so that the graphics card (or what stands for it) knows them
  // when the arm comes. The canvas has its first, small size yet, which costs least.
  warmUp() {
    const { Group, Mesh, Line, SphereGeometry, MeshPhongMaterial, MeshBasicMaterial, LineBasicMaterial } = MeshCat.THREE;
    const V = this.viewer, specks = new Group(), shape = new SphereGeometry(1e-3, 6, 4);
    for (const material of [new MeshPhongMaterial(), new MeshPhongMaterial({ side: 2, transparent: true, opacity: 0.4, depthWrite: false }),
                            new MeshBasicMaterial({ transparent: true, opacity: 0.4 })]) specks.add(new Mesh(shape, material));
    specks.add(new Line(shape, new LineBasicMaterial()));
    V.scene.add(specks);
    V.renderer.render(V.scene, V.camera);
    V.scene.remove(specks);
    shape.dispose(); // not what paints it: that is what is to be known
  }

  // What there is to see, but for the shapes of links.
  begin(settings, scene) {
    this.settings = settings;
    this.options = { mode: settings.mode, translation: true, rotation: true,
                     axis: true, axes: false, lost: true, visual: settings.shapes, bone: !settings.shapes, floor: true };
    this.dressed = !settings.shapes;
    const { camera } = this.viewer;
    camera.near = 0.01 * settings.reach;
    camera.far = 100 * settings.reach;
    for (const command of commandsOf(scene)) this.viewer.handle_command_bytearray(command);
    this.seenThrough();
    this.lights();
    this.paint();
    this.viewer.animate();
  }

  // The shapes of links have come.
  dress() {
    this.dressed = true;
    // Collada parts with several materials come merged as one group with a list of materials,
    // which three.js does not draw: give them the first.
    this.node("arm").traverse((o) => {
      if (Array.isArray(o.material)) o.material = o.material.map((m) => (Array.isArray(m) ? m[0] : m));
      for (const m of [o.material].flat()) if (o.isMesh && m) this.lift(m);
    });
    // They are larger than the skeleton, and hide more. Who has moved since finds the view as it was.
    if (!this.touched && this.fitted?.frame === this.frame) this.fit(this.fitted.frames);
    else if (this.frame) this.show(this.frame);
  }

  // Outlines of the ellipsoids show faintly through the arm; what is marked shines by itself.
  seenThrough() {
    const lines = [];
    this.node("ellipsoid").traverse((o) => { if (o.isLine) lines.push(o); });
    for (const o of lines) {
      const ghost = o.clone(false);
      ghost.material = o.material.clone();
      Object.assign(ghost.material, { depthFunc: MeshCat.THREE.GreaterDepth, depthWrite: false, transparent: true, opacity: 0.45 });
      ghost.renderOrder = 1;
      o.parent.add(ghost);
    }
    const shine = (o) => o.traverse(({ material: m }) => { if (m?.emissive) m.emissive.copy(m.color).multiplyScalar(0.35); });
    for (const part of ["ellipsoid", "lost", "free"]) shine(this.node(part));
    this.settings.jointOf.forEach((_, j) => shine(this.node(`arm/${j + 1}/hot`)));
  }

  // A black robot would be a black silhouette: dark paint is lifted until its shape shows.
  lift(material) {
    if (!material.color || material.map) return;
    const { r, g, b } = material.color, dark = 0.2 - (0.3 * r + 0.59 * g + 0.11 * b);
    if (dark > 0) material.color.setRGB(r + dark, g + dark, b + dark * 1.15);
  }

  // Meshcat's lights fade ten metres away and stand at 1.5 m: move them out with large robots. Their
  // sum turns a white robot into a white silhouette: less of each keeps its shape.
  lights() {
    const far = Math.max(1, this.settings.reach), lamp = (name) => this.viewer.scene_tree.find(["Lights", name, "<object>"]).object;
    lamp("AmbientLight").intensity = 0.46;
    lamp("FillLight").intensity = 0.22;
    for (const [name, x] of [["PointLightNegativeX", 1.5], ["PointLightPositiveX", -1.5]]) {
      const light = lamp(name);
      light.intensity = 0.3;
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
      this.node(`arm/${j}/visual`).visible = s.visual && this.dressed;
      this.node(`arm/${j}/bone`).visible = s.bone || (s.visual && !(dressed && this.dressed));
      if (j === 0) continue;
      const hot = frame.hot.includes(this.settings.jointOf[j - 1]);
      this.node(`arm/${j}/axis`).visible = s.axes && !(s.axis && hot);
      this.node(`arm/${j}/hot`).visible = s.axis && hot;
    }
    for (const kind of ["translation", "rotation"]) {
      const e = frame.ellipsoids[s.mode][kind];
      const seen = s[kind] && e.drawn[0] > 0;
      this.node(`ellipsoid/${kind}`).visible = seen;
      if (seen) this.place(`ellipsoid/${kind}`, frame.tip, e.turn, e.drawn);
    }
    const symbols = this.symbols(frame);
    this.mark(symbols);
    // The legend has what is drawn.
    const drawn = { lost: symbols.some((m) => !m.free), hot: symbols.some((m) => m.free) || (s.axis && frame.hot.length > 0) };
    for (const [name, seen] of Object.entries(drawn)) document.querySelector(`#legend .key.${name}`).hidden = !seen;
    this.node("floor").visible = s.floor;
    this.viewer.set_dirty();
  }

  // Each lost motion is one thing: an arrow, a ring, or both where it is a screw. Those of a mechanism are the
  // flat directions of its ellipses; `free` are motions that its actuators do not hold.
  symbols(frame) {
    if (!this.options.lost) return [];
    const symbol = (node, { at, turn }, label, kind, free) => ({
      node, at, turn, label, free, arrow: kind !== "rotation", ring: ["rotation", "screw"].includes(kind), line: ["line", "screw"].includes(kind),
    });
    if (!frame.free) {
      return frame.lost.filter((m) => m.close).slice(0, this.settings.lines).map((m, k) =>
        symbol(`lost/${k}`, m, (frame.status === "singular" ? "" : "nearly ") + LOST_LABELS[m.kind], m.kind, false));
    }
    const flats = ["translation", "rotation"].filter((kind) => this.options[kind] && frame.ellipsoids[this.options.mode][kind].flat !== null);
    return [
      ...flats.map((kind, k) => symbol(`lost/${k}`, { at: frame.tip, turn: frame.ellipsoids[this.options.mode][kind].flat }, "lost", kind, false)),
      ...Object.entries(frame.free).flatMap(([kind, m]) => (m ? [symbol(`free/${kind}`, m, "not held", kind, true)] : [])),
    ];
  }

  // Draws symbols and their labels.
  mark(symbols) {
    const { lines, reach } = this.settings, { frame } = this, shown = (node) => symbols.find((m) => m.node === node);
    for (let k = 0; k < lines; k++) for (const part of ["arrow", "ring", "line"]) this.node(`lost/${k}/${part}`).visible = Boolean(shown(`lost/${k}`)?.[part]);
    for (const kind of Object.keys(frame.free ?? {})) this.node(`free/${kind}`).visible = Boolean(shown(`free/${kind}`));
    this.labels.set(symbols.map(({ node, at, turn, label, free, arrow }) => {
      this.place(node, at, turn);
      const ends = [1, -1].map((way) => along(at, turn, (arrow ? 0.27 : 0.18) * way * reach));
      // The label stands at the end that is away from the arm.
      const near = (end) => Math.min(...frame.links.map((l) => Math.hypot(end[0] - l[0], end[1] - l[1], end[2] - l[2])));
      return { at: arrow && near(ends[1]) > near(ends[0]) + 1e-6 ? ends[1] : ends[0], text: label, free };
    }), frame.tip);
  }

  set(option, value) {
    this.options[option] = value;
    if (this.frame) this.show(this.frame);
  }

  // Points, in the axes of three.js (y up), that a picture of a frame should have in it.
  outline(frame) {
    const { Vector3 } = MeshCat.THREE;
    this.show(frame);
    this.viewer.scene.updateMatrixWorld(true);
    const out = [new Vector3(), yUp(frame.tip), ...frame.links.map(yUp)];
    const part = this.part;
    for (let j = 1; j <= frame.links.length; j++) this.node(`arm/${j}/${part}`).traverse((o) => {
      if (!o.isMesh) return;
      if (!o.geometry.boundingBox) o.geometry.computeBoundingBox();
      const { min, max } = o.geometry.boundingBox;
      for (const x of [min.x, max.x]) for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) {
        out.push(new Vector3(x, y, z).applyMatrix4(o.matrixWorld));
      }
    });
    const bars = this.symbols(frame).filter((m) => !m.free).map(({ at, turn }) => [at, turn, 0.27 * this.settings.reach, 2]);
    for (const { turn, drawn } of Object.values(frame.ellipsoids[this.options.mode])) {
      drawn.forEach((length, k) => bars.push([frame.tip, turn, length, k]));
    }
    for (const [at, turn, length, k] of bars) for (const way of [1, -1]) out.push(yUp(along(at, turn, way * length, k)));
    return out;
  }

  // What of the links is seen.
  get part() { return this.options.visual && this.dressed ? "visual" : "bone"; }

  fit(frames) {
    const shown = this.frame;
    const some = frames.filter((_, i) => i % Math.ceil(frames.length / 8) === 0);
    const points = some.flatMap((f) => this.outline(f));
    if (shown) this.show(shown);
    const { Vector3 } = MeshCat.THREE;
    const { camera, controls } = this.viewer;
    const side = this.side(frames, points, new Vector3(...this.settings.side).normalize());
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
    this.fitted = { frames, frame: this.frame };
    this.putLegend(points);
    this.viewer.set_dirty();
  }

  // The legend stands in the upper corner in which it covers less of some points.
  putLegend(points) {
    const legend = $("legend"), { camera } = this.viewer, wide = this.element.clientWidth;
    legend.classList.remove("right");
    if (getComputedStyle(legend).position !== "absolute") return;
    camera.updateMatrixWorld();
    const box = boxIn(this.element, legend), low = box.bottom + 10, end = box.right + 10; // px beside it
    const above = points.map((p) => pixelsOf(p, camera, this.element)).filter(([, y]) => y < low);
    const left = above.filter(([x]) => x < end).length, right = above.filter(([x]) => x > wide - end).length;
    legend.classList.toggle("right", right < left);
  }

  // Where to look from: obliquely at the flat ellipsoid, so that it is seen to be flat, with the
  // tool in front of the arm; from the usual side where nothing is flat.
  side(frames, points, usual) {
    const { Vector3 } = MeshCat.THREE, frame = frames[frames.length - 1], chosen = frame.ellipsoids[this.options.mode];
    const flats = frame.free ? [] : ["translation", "rotation"].filter((kind) => this.options[kind] && chosen[kind].flat !== null);
    if (!flats.length) return usual;
    const normals = flats.map((kind) => yUp(along([0, 0, 0], chosen[kind].flat, 1))), tip = yUp(frame.tip);
    const middle = points.reduce((sum, p) => sum.add(p), new Vector3()).multiplyScalar(1 / points.length);
    const out = tip.clone().sub(middle).divideScalar(this.settings.reach);
    const sides = [];
    for (let k = 0; k < 48; k++) for (const height of [0.15, 0.35, 0.55]) {
      const angle = (2 * Math.PI * k) / 48, level = Math.sqrt(1 - height * height);
      const side = new Vector3(level * Math.cos(angle), height, level * Math.sin(angle));
      // 0.35: a disc seen some twenty degrees off its edge.
      const oblique = normals.reduce((sum, n, i) => sum - (i ? 0.4 : 1.2) * Math.abs(Math.abs(n.dot(side)) - 0.35), 0);
      sides.push({ side, value: oblique + 0.9 * out.dot(side) + 0.15 * usual.dot(side) });
    }
    sides.sort((a, b) => b.value - a.value);
    // The best one from which the tool is not behind the arm, unless that costs much.
    const open = sides.find(({ side, value }, k) => k % 3 === 0 && value > sides[0].value - 0.8 && this.seesTip(tip, side));
    return (open ?? sides[0]).side;
  }

  // Whether nothing of the arm is between a point (y up) and who looks at it from `side`.
  seesTip(tip, side) {
    const { Raycaster } = MeshCat.THREE, from = tip.clone().addScaledVector(side, 0.04 * this.settings.reach);
    const { part } = this, meshes = [];
    for (let j = 0; j <= this.frame.links.length; j++) this.node(`arm/${j}/${part}`).traverse((o) => { if (o.isMesh) meshes.push(o); });
    return new Raycaster(from, side, 0, 10 * this.settings.reach).intersectObjects(meshes, false).length === 0;
  }

  // The way of the tip, coloured by clearance: red where a family is near, green where it is far (three
  // degrees, thirty).
  trail(points) {
    const { BufferGeometry, Float32BufferAttribute, LineBasicMaterial, Line } = MeshCat.THREE, geometry = new BufferGeometry();
    const colors = points.map(({ clearance }) => {
      const t = Math.min(1, Math.max(0, Math.log10(Math.max(clearance, 1e-6) / 0.052)));
      return [0.8 * (1 - t), 0.15 + 0.45 * t, 0.15 + 0.25 * t];
    });
    geometry.setAttribute("position", new Float32BufferAttribute(points.flatMap(({ at }) => at), 3));
    geometry.setAttribute("color", new Float32BufferAttribute(colors.flat(), 3));
    this.drawnTrail?.parent.remove(this.drawnTrail);
    this.drawnTrail?.geometry.dispose();
    this.drawnTrail = new Line(geometry, new LineBasicMaterial({ vertexColors: true }));
    this.viewer.scene_tree.find(["pinsing"]).object.add(this.drawnTrail);
    this.viewer.set_dirty();
  }

  // What is in the view, with its labels and, unless it stands beside, its legend, as a canvas: it stays, and can be printed.
  still(legend = false) {
    this.pace.full();
    this.viewer.render();
    const { element, viewer: { renderer: { domElement: source } } } = this, ratio = source.width / element.clientWidth;
    // On a narrow screen the legend stands above the view, and so it does in the picture.
    const above = legend ? Math.max(0, -boxIn(element, $("legend")).top) : 0, font = "system-ui, sans-serif";
    const canvas = make("canvas", { width: source.width, height: source.height + Math.ceil(above * ratio) }), pen = canvas.getContext("2d");
    pen.fillStyle = getComputedStyle(document.body).backgroundColor;
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.scale(ratio, ratio);
    pen.translate(0, above);
    pen.drawImage(source, 0, 0, element.clientWidth, source.height / ratio);
    pen.textBaseline = "middle";
    for (const key of legend ? $("legend").querySelectorAll(".key") : []) {
      const { x, y, height } = boxIn(element, key), look = getComputedStyle(key);
      if (!height) continue;
      pen.font = `${look.fontSize} ${font}`;
      pen.fillStyle = getComputedStyle(key, "::before").backgroundColor;
      pen.fillRect(x, y + height / 2 - 5, 11, 11);
      pen.fillStyle = look.color;
      pen.fillText(key.textContent, x + 18, y + height / 2);
    }
    pen.font = `600 12px ${font}`;
    this.labels.draw(pen);
    return canvas;
  }
}
