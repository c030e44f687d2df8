// Brings the page up.

const ENDED = "the program that serves this page has ended";

async function unpack(element) {
  const text = atob(element.textContent.trim()), packed = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) packed[k] = text.charCodeAt(k);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Parts of the page: out of the page itself, or from the program behind it.
function parts() {
  if ($("baked-page")) {
    return {
      page: unpack($("baked-page")).then((bytes) => JSON.parse(new TextDecoder().decode(bytes))),
      scene: unpack($("baked-scene")),
      links: async () => {
        // They stand at the end of the page.
        if (document.readyState === "loading") await new Promise((resolve) => document.addEventListener("DOMContentLoaded", resolve, { once: true }));
        return unpack($("baked-links"));
      },
    };
  }
  const file = async (name) => {
    const answer = await ahead[name].catch(() => null);
    if (!answer?.ok) throw new Error(ENDED);
    return answer;
  };
  const bytes = async (name) => new Uint8Array(await (await file(name)).arrayBuffer());
  const links = bytes("links");
  links.catch(() => {}); // told where they are waited for
  return { page: file("page.json").then((answer) => answer.json()), scene: bytes("scene"), links: () => links };
}

// What was drawn is on the screen.
const onScreen = () => new Promise((resolve) => {
  if (document.hidden) { resolve(); return; } // a page in the background has no frames
  setTimeout(resolve, 1000);
  requestAnimationFrame(() => requestAnimationFrame(resolve));
});

(async () => {
  const busy = $("busy"), { body } = document, taken = asked();
  busy.hidden = false;
  busy.textContent = "loading the arm\u2026";
  if (taken.picture) body.classList.add("picture");
  try {
    if (typeof MeshCat === "undefined") throw new Error(ENDED);
    const stream = $("baked-page") ? null : new LiveSource();
    const wanted = parts(), view = new SceneView($("view"));
    if (stream) {
      busy.textContent = "computing\u2026";
      view.warmUp();
    }
    const [page, scene] = await Promise.all([wanted.page, wanted.scene]);
    const app = window.pinsing = new (page.mechanism ? MechanismApp : App)(page, view, scene, stream);
    // First the arm as a skeleton, which is there at once; then its links.
    await app.start();
    busy.textContent = "loading the shapes of links\u2026";
    busy.classList.add("aside");
    await onScreen();
    performance.mark("first picture");
    await app.dress(await wanted.links());
    view.viewer.render();
    body.dataset.ready = "yes";
    busy.hidden = true;
  } catch (error) {
    busy.hidden = false;
    busy.textContent = `The page cannot be shown: ${error.message}`;
    throw error;
  }
})();
