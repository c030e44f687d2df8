"""How a report looks on a screen and on paper."""

STYLE = """
:root { color-scheme: light; --ink: #1b2430; --soft: #4a5563; --line: #d5dae1; --ground: #f5f7f9;
  --link: #0b5394; }
* { box-sizing: border-box; }
html { font: 16px/1.5 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; color: var(--ink);
  background: #fff; -webkit-text-size-adjust: 100%; }
body { margin: 0 auto; max-width: 62rem; padding: 1.5rem 1.2rem 4rem; overflow-wrap: anywhere; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.35rem; margin: 2.6rem 0 .6rem; padding-bottom: .2rem;
  border-bottom: 2px solid var(--line); }
h3 { font-size: 1.1rem; margin: 1.6rem 0 .4rem; }
p { margin: .5rem 0; }
.sub { color: var(--soft); margin-top: 0; }
.lead { font-size: 1.08rem; }
a { color: var(--link); }
a:focus-visible, .wide:focus-visible, summary:focus-visible { outline: 3px solid #0b5394;
  outline-offset: 2px; }
.skip { position: absolute; left: -100rem; }
.skip:focus { left: 1rem; background: #fff; padding: .5rem; }
nav { background: var(--ground); border: 1px solid var(--line); border-radius: .4rem;
  padding: .6rem 1rem; margin: 1.2rem 0; }
nav ol { columns: 2; margin: .2rem 0; padding-left: 1.3rem; }
code { font: .93em ui-monospace, "DejaVu Sans Mono", Consolas, monospace; }
pre { background: var(--ground); border: 1px solid var(--line); border-radius: .3rem;
  padding: .5rem .7rem; margin: .5rem 0; white-space: pre-wrap; font-size: .9rem; }
.equation { background: var(--ground); border-left: 4px solid #7a8796; padding: .6rem .9rem;
  margin: .6rem 0; font-size: 1.15rem; }
.equation .math { display: block; overflow-x: auto; overflow-y: hidden; }
.equation .math math { margin: .1rem 0; }
.equation p { margin: .25rem 0; }
.wide { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .95rem; }
caption { text-align: left; color: var(--soft); padding-bottom: .25rem; }
th, td { text-align: left; vertical-align: top; padding: .3rem .7rem .3rem 0;
  border-bottom: 1px solid var(--line); overflow-wrap: normal; }
thead th { color: var(--soft); font-weight: 600; }
tbody th { font-weight: 600; }
.n { text-align: right; font-variant-numeric: tabular-nums; }
.badge { border-radius: .3rem; padding: .05rem .45rem; color: #fff; background: #4a5563;
  white-space: nowrap; }
.badge.alarm { background: #b00020; }
.badge.caution { background: #8a5a00; }
.badge.good { background: #1b6e3c; }
figure { margin: 1rem 0; }
figure img { max-width: 100%; height: auto; display: block; }
figure.map { max-width: 34rem; }
.maps { display: grid; grid-template-columns: 1fr 1fr; gap: 0 1.2rem; }
figcaption { color: var(--soft); font-size: .92rem; }
dl { margin: .6rem 0; }
dl > div { display: grid; grid-template-columns: 11rem 1fr; gap: .8rem; padding: .2rem 0;
  border-bottom: 1px solid var(--line); }
dt { color: var(--soft); }
dd { margin: 0; }
ul { padding-left: 1.3rem; }
li { margin: .2rem 0; }
iframe { width: 100%; height: 46rem; border: 1px solid var(--line); border-radius: .3rem; }
.paper { display: none; }
summary { cursor: pointer; font-weight: 600; padding: .4rem 0; }
footer { margin-top: 3rem; color: var(--soft); font-size: .9rem; }
@media (max-width: 40rem) {
  nav ol { columns: 1; }
  dl > div, .maps { grid-template-columns: 1fr; gap: 0; }
  iframe { height: 90vh; }
  .badge { white-space: normal; }
  .wide table { font-size: .85rem; }
  .wide th, .wide td { overflow-wrap: anywhere; padding-right: .4rem; }
}
@page { size: A4; margin: 16mm 15mm 18mm; }
@media print {
  html { font-size: 10.5pt; }
  body { max-width: none; padding: 0; }
  nav, .screen, .skip { display: none; }
  h2, h3, caption { break-after: avoid; }
  figure, .equation, tr, dl > div, pre, .wide.short { break-inside: avoid; }
  p:has(+ pre) { break-after: avoid; }
  .paper { display: block; }
  .wide, .equation .math { overflow: visible; }
  .badge { color: #000; background: none; border: 1px solid #000; }
  .badge.alarm, .badge.caution, .badge.good { background: none; }
  .equation { break-after: avoid; }
  figure { break-before: avoid; }
  figure img { max-height: 85mm; }
  /* Its one line is not a page of its own. */
  footer { margin-top: 1rem; break-before: avoid; }
  a { color: inherit; }
}
"""
