// SPDX-License-Identifier: Apache-2.0
// Measured, simulated and their difference: what is shown, of which frame, and the values under the pointer.

const part = (id) => document.getElementById(id);
const PAGE = Math.floor(Math.random() * Number.MAX_SAFE_INTEGER);  // tells this page from others at the same server
const KINDS = ["left", "right", "disparity"];
const zoom = new SharedZoom(showReadout);
let maps = null;  // colour maps by name
let facts = null;  // of the opened entry
let kind = "left";
let pictures = {};  // measured, simulated: answers with their images
let before = {};  // of a scene without a measurement: its first pictures, draft and refined
const cloud = new Cloud(part("cloud"));
let clouds = "both";  // whose points are shown
const panel = new Panel(() => told(simulate));
let asked = 0;  // counts what was asked for, so that a slow answer does not replace a later one

const frameNumber = () => Number(part("frame").value);
const wanted = () => ({ entry: part("entry").value, frame: frameNumber() });

async function told(work) {
  try {
    await work();
    part("told").textContent = "";
  } catch (error) {
    part("told").textContent = error.message;
    part("view").dataset.shown = "nothing";
  }
}

async function openEntry() {
  const entry = part("entry").value;
  part("view").dataset.shown = "";
  panel.hide();
  cloud.isAimed = false;
  facts = await called("open", { entry });
  part("title").textContent = facts.title;
  document.title = `${facts.title} - activestereo view`;
  part("frame").replaceChildren(...facts.frames.map((one) => new Option(one.label, String(one.id))));
  await openFrame();
}

async function openFrame() {
  const serial = ++asked;
  part("view").dataset.shown = "";
  pictures = {};
  before = {};
  wait();
  const name = facts.is_simulated ? "measured" : "as in the file";  // which may hold a simulation's images
  part("measured-name").textContent = facts.has_measured ? name : "before any slider is moved";
  part("clouds").parentElement.hidden = !facts.is_simulated;  // one cloud leaves no choice
  part("clouds").children[0].textContent = facts.has_measured ? "measured" : "before";
  for (const side of ["left", "right"]) part(`dots-measured-${side}`).parentElement.hidden = !facts.has_measured;
  if (facts.has_measured) {
    const measured = await called("measured", wanted());
    if (serial !== asked) return;
    pictures.measured = measured;
    draw();
  }
  if (facts.is_simulated) {
    part("quality").textContent = facts.has_measured ? "(light and noise are fitted first: up to a minute)" : "(rendering)";
    const sliders = await called("sliders", wanted());
    if (serial !== asked) return;
    panel.open(facts.catalogue, sliders);
  }
  await simulate();
}

// A draft at once, and a refined picture when nothing else is asked for meanwhile.
async function simulate() {
  if (!facts.is_simulated) {
    part("view").dataset.shown = "measured";
    return;
  }
  const serial = ++asked;
  for (const is_draft of [true, false]) {
    const begin = performance.now();
    const answer = await called("simulate", { ...wanted(), settings: panel.settings(), is_draft, page: PAGE, serial });
    if (serial !== asked || answer.superseded) return;
    pictures.simulated = answer;
    if (!facts.has_measured) {  // a draft is compared with a draft alone: their noise is no effect
      if (!panel.isMoved()) before[is_draft] = answer;
      pictures.measured = before[is_draft];
    }
    panel.taken(answer);
    const seconds = ((performance.now() - begin) / 1000).toFixed(2);
    part("quality").textContent = `(${is_draft ? "draft" : "refined"}, ${seconds} s)`;
    draw();
    part("view").dataset.shown = is_draft ? "draft" : "refined";
    part("view").dataset.seconds = seconds;
  }
}

function quantile(values, share) {
  const sorted = values.filter((value) => !Number.isNaN(value)).sort();
  return sorted.length ? sorted[Math.floor(share * (sorted.length - 1))] : 0;
}

// The colours of a kind: [map, low, high, power, least limit of differences, unit].
function colours() {
  const values = (pictures.measured || pictures.simulated).images[kind];
  const at = (share) => quantile(values, share);
  if (kind === "disparity") return [maps.viridis, at(0.01), Math.max(at(0.99), at(0.01) + 0.01), 1, 1, "px"];
  const high = Math.max(at(0.998), 1);
  return [maps.gray, 0, high, 0.5, 0.02 * high, "DN"];
}

function draw() {
  if (!pictures.measured && !pictures.simulated) return;
  const [stops, low, high, power, least, unit] = colours();
  for (const name of ["measured", "simulated"]) {
    const values = pictures[name] && pictures[name].images[kind];
    wait(name, !values);
    if (!values) continue;
    zoom.show(part(name), colouredCanvas(values, facts.width, facts.height, stops, low, high, power));
    showScale(part(`${name}-scale`), stops, low, high, unit, power);
  }
  const residual = difference();
  part("difference").parentElement.hidden = part("simulated").parentElement.hidden = !facts.is_simulated;
  wait("difference", !residual);
  if (residual) {
    const limit = Math.max(least, quantile(residual.map(Math.abs), 0.995));
    zoom.show(part("difference"), colouredCanvas(residual, facts.width, facts.height, maps.RdBu_r, -limit, limit, 1));
    showScale(part("difference-scale"), maps.RdBu_r, -limit, limit, unit, 1);
    const squares = residual.filter((value) => !Number.isNaN(value)).map((value) => value * value);
    const mean = squares.reduce((sum, value) => sum + value, 0) / Math.max(squares.length, 1);
    part("rmse").textContent = `RMS ${Math.sqrt(mean).toFixed(2)} ${unit}`;
  }
  for (const button of part("kinds").children) button.setAttribute("aria-checked", String(button.dataset.kind === kind));
  drawCloud();
  showReadout();
}

// A picture that is on its way turns a wheel; an earlier one stays behind it.
function wait(name = "", is_waiting = true) {
  for (const one of name ? [name] : ["measured", "simulated", "difference"]) {
    part(one).parentElement.classList.toggle("waiting", is_waiting);
    if (!name || !is_waiting) part(one).parentElement.classList.toggle("empty", is_waiting);
  }
}

// The points of the pictures that are there. The first ones of a frame decide where one looks.
function drawCloud() {
  for (const name of ["measured", "simulated"]) {
    const picture = pictures[name];
    const is_shown = picture && [name, "both"].includes(clouds);
    if (is_shown && !picture.points) {
      picture.points = Cloud.points(picture.images.left, picture.images.disparity, facts, sortedHigh(picture));
      if (!cloud.isAimed) cloud.aimAt(picture.points);
      cloud.isAimed = true;
    }
    cloud.put(name, is_shown ? picture.points : new Float32Array());
  }
  for (const state of ["waiting", "empty"]) part("cloud").parentElement.classList.toggle(state, !(pictures.measured || pictures.simulated));
  if (!cloud.gl) part("cloud-text").textContent = "this browser has no WebGL: there is no point cloud";
  for (const button of part("clouds").children) button.setAttribute("aria-checked", String(button.dataset.cloud === clouds));
  cloud.draw();
}

// The point under the pointer, in the cloud that is shown.
function markPoint(u, v) {
  const picture = pictures[clouds === "simulated" ? "simulated" : "measured"] || pictures.simulated;
  const disparity = picture.images.disparity[v * facts.width + u];
  const place = Number.isNaN(disparity) ? [] : [...Cloud.place(v * facts.width + u, disparity, facts), 1];
  cloud.put("pointer", Float32Array.from(place));
  cloud.draw();
}

function difference() {
  if (!pictures.measured || !pictures.simulated) return null;
  const [measured, simulated] = [pictures.measured.images[kind], pictures.simulated.images[kind]];
  return measured.map((value, i) => value - simulated[i]);
}

function showReadout() {
  part("zoom").textContent = `${Number(zoom.zoom.toPrecision(2))}×`;
  if (!zoom.pointer || !facts) return;
  const [u, v] = zoom.pointer;
  if (u >= facts.width || v >= facts.height) return;
  const at = v * facts.width + u;
  const names = ["measured", "simulated"].filter((name) => pictures[name]);
  const number = (value, digits) => (Number.isNaN(value) ? "none" : value.toFixed(digits));
  const words = { measured: facts.has_measured ? "measured" : "before", simulated: "simulated" };
  const list = (of, digits) => names.map((name) => `${words[name]} ${number(of(pictures[name].images), digits)}`).join(", ");
  const side = kind === "disparity" ? "left" : kind;
  const texts = [`${side} ${list((images) => images[side][at], 0)} DN`];
  texts.push(`disparity ${list((images) => images.disparity[at], 2)} px`);
  texts.push(`depth ${list((images) => facts.focal_baseline_px_m / images.disparity[at], 3)} m`);
  part("readout").textContent = `u ${u}, v ${v}:  ${texts.join("  ·  ")}`;
  const high = Math.max(...names.map((name) => sortedHigh(pictures[name])), 1);
  markPoint(u, v);
  document.querySelector(".dots").classList.remove("idle");
  showDots(pictures, facts.width, facts.height, [u, v], maps.gray, high);
}

// The brightness that is drawn white in the crops, found once for each answer.
function sortedHigh(picture) {
  picture.high = picture.high || Float32Array.from(picture.images.left).sort()[Math.floor(0.998 * (picture.images.left.length - 1))];
  return picture.high;
}

function showKind(name) {
  kind = name;
  draw();
}

function step(by) {
  const frames = facts.frames.map((one) => one.id);
  part("frame").value = String(frames[(frames.indexOf(frameNumber()) + by + frames.length) % frames.length]);
  told(openFrame);
}

// The surface at the pointer, whose properties get sliders. The right image's pixels are not asked: the call is of the left.
async function touch() {
  if (!zoom.pointer || !facts.is_simulated || kind === "right") return;
  const [u, v] = zoom.pointer;
  panel.touched(await called("surface", { ...wanted(), settings: panel.settings(), u, v }));
}

async function save() {
  const answer = await called("save", { ...wanted(), settings: panel.settings() });
  part("saved").textContent = `saved: ${answer.path}${answer.remark ? `; what a model has no words for: ${answer.remark}` : ""}`;
}

function movePointer(du, dv) {
  const [u, v] = zoom.pointer || [facts.width >> 1, facts.height >> 1];
  zoom.pointer = [Math.min(Math.max(u + du, 0), facts.width - 1), Math.min(Math.max(v + dv, 0), facts.height - 1)];
  zoom.drawAll();
  showReadout();
}

const typed = (element) => element.tagName === "SELECT" || (element.tagName === "INPUT" && element.type === "number");
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const KEYS = { n: () => step(1), p: () => step(-1), t: () => told(touch), r: () => panel.reset(), s: () => told(save), ...Object.fromEntries(KINDS.map((name, i) => [String(i + 1), () => showKind(name)])) };
document.addEventListener("keydown", (event) => {
  if (!facts || event.ctrlKey || event.metaKey || event.altKey || typed(event.target)) return;
  if (event.shiftKey && event.key in ARROWS) movePointer(...ARROWS[event.key]);
  else if (event.key in KEYS) KEYS[event.key]();
  else return;
  event.preventDefault();
  event.stopPropagation();
}, true);

part("entry").onchange = () => told(openEntry);
part("frame").onchange = () => told(openFrame);
part("previous-frame").onclick = () => step(-1);
part("next-frame").onclick = () => step(1);
for (const button of part("clouds").children) button.onclick = () => { clouds = button.dataset.cloud; drawCloud(); };
for (const button of part("kinds").children) button.onclick = () => showKind(button.dataset.kind);
part("zoom-in").onclick = () => zoom.zoomBy(2);
part("zoom-out").onclick = () => zoom.zoomBy(0.5);
part("zoom-reset").onclick = () => zoom.reset();
for (const name of ["measured", "simulated", "difference"]) {
  let pressed = null;
  part(name).addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
  part(name).addEventListener("click", (event) => {
    if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 3) told(touch);
  });
}
part("save").onclick = () => told(save);
window.addEventListener("resize", draw);
told(async () => {
  const listed = await called("list", {});
  maps = listed.maps;
  part("entry").replaceChildren(...listed.entries.map((name) => new Option(name === "." ? listed.root : name, name)));
  await openEntry();
});
