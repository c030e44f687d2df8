// Brings in the page's parts once the browser has done with the page itself. Until then its tab shows
// a wheel that turns, and where no graphics card draws, that wheel takes more time than the arm.
"use strict";

const ahead = Object.fromEntries(["page.json", "scene", "links"].map((name) => {
  const answer = fetch(name);
  answer.catch(() => {}); // told where it is waited for
  return [name, answer];
}));

window.addEventListener("load", () => {
  for (const name of ["meshcat.js", "page.js"]) {
    const script = document.createElement("script");
    script.async = false; // in this order
    script.src = name;
    document.body.append(script);
  }
});
