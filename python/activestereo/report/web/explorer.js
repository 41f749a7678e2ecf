// SPDX-License-Identifier: Apache-2.0
// The explored pictures: frame, camera and model pickers, the fading slider, values under the pointer, a residual in each row of the ranking.

const data = JSON.parse(document.getElementById("explorer-data").textContent);
const part = (id) => document.getElementById(id);
const zoom = new SharedZoom(showReadout);
const rows = [...document.querySelectorAll("canvas[data-model]")];
const frames = [...new Set(data.views.map((view) => view.frame))];
let view = null;  // the one that is shown
let layers = null;  // its values by layer
let picked = "found";  // the model of the third picture, where a view has it
let asked = 0;  // counts requests, so that a slow one does not replace a later one

function camerasOf(frame) {
  return data.views.filter((one) => one.frame === frame).map((one) => one.camera);
}

// The models that the slider passes, in its order: it ends at the one of the third picture.
function stations() {
  return [...new Set(["measured", "base", part("other").value])].filter((name) => name in view.layers);
}

function words(name) {
  if (name === "measured") return view.camera === "depth" ? "device" : "measured";
  return data.models[name];
}

async function showView(frame, camera) {
  const ticket = ++asked;
  const cameras = camerasOf(frame);
  const chosen = data.views.find((one) => one.frame === frame && one.camera === (cameras.includes(camera) ? camera : cameras[0]));
  const values = await decodedView(chosen);
  if (ticket !== asked) return;
  [view, layers] = [chosen, values];
  part("frame").value = String(frame);
  part("cameras").replaceChildren(...cameras.map(cameraButton));
  showOtherModels();
  showStations();
  drawFaded();
  drawResiduals();
  showReadout();
  part("explorer").dataset.view = `${view.frame} ${view.camera}`;
}

function cameraButton(camera) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = camera;
  button.setAttribute("role", "radio");
  button.setAttribute("aria-checked", String(camera === view.camera));
  button.dataset.camera = camera;
  button.onclick = () => showView(view.frame, camera);
  return button;
}

function showStations() {
  const names = stations();
  const slider = part("fade");
  slider.max = String(names.length - 1);
  slider.value = String(Math.min(Number(slider.value), names.length - 1));
  part("fade-names").replaceChildren(...names.map((name, i) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words(name);
    button.onclick = () => { slider.value = String(i); drawFaded(); };
    return button;
  }));
}

function showOtherModels() {
  const names = Object.keys(view.layers).filter((name) => name !== "measured");
  part("other").replaceChildren(...names.map((name) => new Option(`${words("measured")} − ${words(name)}`, name)));
  part("other").value = names.includes(picked) ? picked : names.includes("found") ? "found" : names[names.length - 1];
  part("residual-other").parentElement.hidden = names.length < 2;
}

function drawFaded() {
  const names = stations();
  const at = Number(part("fade").value);
  const first = Math.min(Math.floor(at), names.length - 1);
  const second = Math.min(first + 1, names.length - 1);
  const [a, b, share] = [layers[names[first]], layers[names[second]], at - first];
  const mixed = share === 0 ? a : a.map((value, i) => (1 - share) * value + share * b[i]);
  const [low, high] = view.range;
  zoom.show(part("picture"), colouredCanvas(mixed, view.width, view.height, data.maps[view.map], low, high, view.power));
  const percent = Math.round(100 * share);
  part("picture-name").textContent = percent === 0 ? words(names[first]) : `${100 - percent} % ${words(names[first])}, ${percent} % ${words(names[second])}`;
  showScale(part("picture-scale"), data.maps[view.map], low, high, view.unit, view.power);
}

function residual(name) {
  const [measured, model] = [layers.measured, layers[name]];
  return measured.map((value, i) => value - model[i]);
}

function drawResidual(element, name) {
  const stops = data.maps.RdBu_r;
  zoom.show(element, colouredCanvas(residual(name), view.width, view.height, stops, -view.limit, view.limit, 1));
}

function rmseText(name) {
  const value = view.rmse[name];
  return value === undefined || value === null ? "" : `RMSE ${value.toFixed(view.digits + 1)} ${view.unit}`;
}

function drawResiduals() {
  const first = "base" in layers ? "base" : "found";
  drawResidual(part("residual-base"), first);
  part("residual-base-name").textContent = `${words("measured")} − ${words(first)}`;
  part("residual-base-rmse").textContent = rmseText(first);
  drawOther();
  for (const id of ["residual-base-scale", "residual-other-scale"]) showScale(part(id), data.maps.RdBu_r, -view.limit, view.limit, view.unit, 1);
  for (const canvas of rows) {
    const name = canvas.dataset.model;
    const note = canvas.parentElement.querySelector("figcaption");
    canvas.hidden = !(name in layers);
    const elsewhere = `${rmseText(name)}, shown with frame ${data.rows.join(" or ")}`;
    note.textContent = name in layers ? rmseText(name) : view.camera === "depth" ? "judged on the infrared images" : elsewhere;
    if (!canvas.hidden) drawResidual(canvas, name);
  }
}

function drawOther() {
  drawResidual(part("residual-other"), part("other").value);
  part("residual-other").dataset.model = part("other").value;
  part("residual-other-rmse").textContent = rmseText(part("other").value);
}

function showReadout() {
  part("zoom").textContent = `${Number(zoom.zoom.toPrecision(2))}×`;
  if (!zoom.pointer || !view) return;
  const [u, v] = zoom.pointer;
  if (u >= view.width || v >= view.height) return;
  const at = v * view.width + u;
  const number = (value) => (Number.isNaN(value) ? "none" : value.toFixed(view.digits));
  const signed = (value) => (Number.isNaN(value) ? "none" : `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(view.digits)}`);
  const shown = [...new Set([...stations().slice(1), part("other").value])];
  const texts = shown.map((name) => `${words(name)} ${number(layers[name][at])} (residual ${signed(layers.measured[at] - layers[name][at])})`);
  const value = `${words("measured")} ${layers.measured[at].toFixed(view.camera === "depth" ? 2 : 0)}`;
  part("readout").textContent = `u ${u}, v ${v}:  ${[Number.isNaN(layers.measured[at]) ? "device none" : value, ...texts].join("  ·  ")}  ${view.unit}`;
}

function step(by) {
  const place = (frames.indexOf(view.frame) + by + frames.length) % frames.length;
  showView(frames[place], view.camera);
}

for (const frame of frames) {
  const one = data.views.find((candidate) => candidate.frame === frame);
  part("frame").append(new Option(`${frame}, ${one.split}`, String(frame)));
}
part("frame").onchange = () => showView(Number(part("frame").value), view.camera);
part("previous-frame").onclick = () => step(-1);
part("next-frame").onclick = () => step(1);
part("fade").oninput = drawFaded;
function showOther() {
  picked = part("other").value;
  drawOther();
  showStations();
  drawFaded();
  showReadout();
}

part("other").onchange = showOther;
part("zoom-in").onclick = () => zoom.zoomBy(2);
part("zoom-out").onclick = () => zoom.zoomBy(0.5);
part("zoom-reset").onclick = () => zoom.reset();
for (const canvas of rows) {
  canvas.addEventListener("click", () => {
    if (!(canvas.dataset.model in view.layers)) return;
    part("other").value = canvas.dataset.model;
    showOther();
  });
}
window.addEventListener("resize", () => { drawFaded(); drawResiduals(); });
showView(frames.includes(data.start) ? data.start : frames[0], "left");
