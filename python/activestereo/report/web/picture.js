// SPDX-License-Identifier: Apache-2.0
// Decodes pictures of whole numbers into values (see encoded_image() of page.py), and values to colours.

function loaded(address) {
  return new Promise((resolve, reject) => {
    const image = new Image();
    image.onload = () => resolve(image);
    image.onerror = () => reject(new Error("a picture of this page is damaged"));
    image.src = address;
  });
}

// Float32Array of a layer's values; NaN where a pixel holds none.
async function decodedLayer(layer, width, height) {
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height * layer.planes;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(await loaded(layer.src), 0, 0);
  const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
  const count = width * height;
  const values = new Float32Array(count);
  for (let i = 0; i < count; ++i) {
    const code = layer.planes === 2 ? 256 * pixels[4 * i] + pixels[4 * (i + count)] : pixels[4 * i];
    values[i] = layer.has_empty && code === 0 ? NaN : layer.low + layer.step * code;
  }
  return values;
}

// {layer name: values} of a view, decoded once; the last few views are kept.
const KEPT_VIEWS = 6;
const decodedViews = new Map();
async function decodedView(view) {
  const key = `${view.frame} ${view.camera}`;
  if (!decodedViews.has(key)) {
    const names = Object.keys(view.layers);
    const values = await Promise.all(names.map((name) => decodedLayer(view.layers[name], view.width, view.height)));
    const layers = Object.fromEntries(names.map((name, i) => [name, values[i]]));
    for (const name of names) {
      const base = layers[view.layers[name].added_to];
      if (base) layers[name] = layers[name].map((value, i) => value + base[i]);
    }
    decodedViews.set(key, layers);
    if (decodedViews.size > KEPT_VIEWS) decodedViews.delete(decodedViews.keys().next().value);
  }
  return decodedViews.get(key);
}

// Values as a canvas of their own size: low..high over a colour map's stops, values without a number dark.
function colouredCanvas(values, width, height, stops, low, high, power) {
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const last = stops.length - 1;
  for (let i = 0; i < values.length; ++i) {
    const empty = Number.isNaN(values[i]);
    const share = Math.min(Math.max((values[i] - low) / (high - low), 0), 1);
    const at = empty ? 0 : last * (power === 1 ? share : Math.pow(share, power));
    const stop = Math.min(Math.floor(at), last - 1);
    for (let c = 0; c < 3; ++c) {
      const colour = stops[stop][c] + (at - stop) * (stops[stop + 1][c] - stops[stop][c]);
      image.data[4 * i + c] = empty ? 24 : colour;
    }
    image.data[4 * i + 3] = 255;
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

// The colour scale of a picture as a caption.
function showScale(element, stops, low, high, unit, power) {
  const shown = [0, 1, 2, 3, 4, 5, 6, 7, 8].map((i) => stops[Math.round((stops.length - 1) * Math.pow(i / 8, power))]);
  const bar = document.createElement("i");
  bar.style.background = `linear-gradient(90deg,${shown.map((rgb) => `rgb(${rgb.join(",")})`).join(",")})`;
  const number = (value) => String(Number(value.toPrecision(3)));
  element.replaceChildren(number(low), bar, `${number(high)} ${unit}`);
}
