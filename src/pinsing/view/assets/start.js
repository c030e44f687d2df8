// Brings the page up.
"use strict";

async function unpack(element) {
  const packed = Uint8Array.from(atob(element.textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

(async () => {
  $("busy").hidden = false;
  if (asked().picture) document.body.classList.add("picture");
  try {
    let page, scene;
    if ($("baked-page")) {
      page = JSON.parse(new TextDecoder().decode(await unpack($("baked-page"))));
      scene = await unpack($("baked-scene"));
    } else {
      page = await (await fetch("page.json")).json();
      scene = new Uint8Array(await (await fetch("scene")).arrayBuffer());
    }
    window.pinsing = new (page.mechanism ? MechanismApp : App)(page, scene);
    await window.pinsing.start();
    window.pinsing.view.viewer.render();
    document.body.dataset.ready = "yes";
    $("busy").hidden = true;
  } catch (error) {
    $("busy").textContent = `The page cannot be shown: ${error.message}`;
    throw error;
  }
})();
