// SPDX-License-Identifier: Apache-2.0
// The dots around the pointer, at pixel size: in the left image, and in the right one where the disparity says that they are.

const DOTS_SIDE = 25;  // pixels of a crop
const DOTS_SCALE = 12;  // canvas pixels for an image pixel

function showDots(pictures, width, height, pointer, stops, high) {
  const texts = [];
  for (const name of ["measured", "simulated"]) {
    const images = pictures[name] && pictures[name].images;
    const [u, v] = pointer;
    const disparity = images && images.disparity ? images.disparity[v * width + u] : NaN;
    showCrop(`dots-${name}-left`, images && images.left, width, height, u, v, stops, high);
    const isMatched = images && !Number.isNaN(disparity);
    showCrop(`dots-${name}-right`, isMatched ? images.right : null, width, height, Math.round(u - disparity), v, stops, high);
    if (images) texts.push(`${name}: brightest ${dotContrast(images.left, width, height, u, v).toFixed(1)} × the middle value around`);
  }
  document.getElementById("dots-text").textContent = texts.join("; ");
}

function showCrop(id, image, width, height, u, v, stops, high) {
  const half = (DOTS_SIDE - 1) / 2;
  const values = new Float32Array(DOTS_SIDE * DOTS_SIDE).fill(NaN);
  for (let y = 0; image && y < DOTS_SIDE; ++y) {
    for (let x = 0; x < DOTS_SIDE; ++x) {
      const [column, row] = [u + x - half, v + y - half];
      if (column >= 0 && column < width && row >= 0 && row < height) values[y * DOTS_SIDE + x] = image[row * width + column];
    }
  }
  const canvas = document.getElementById(id);
  canvas.width = canvas.height = DOTS_SIDE * DOTS_SCALE;
  const context = canvas.getContext("2d");
  context.imageSmoothingEnabled = false;
  context.drawImage(colouredCanvas(values, DOTS_SIDE, DOTS_SIDE, stops, 0, high, 0.5), 0, 0, canvas.width, canvas.height);
  context.strokeStyle = "#c8722c";
  context.strokeRect(half * DOTS_SCALE - 0.5, half * DOTS_SCALE - 0.5, DOTS_SCALE + 1, DOTS_SCALE + 1);
}

// The brightest pixel of 5x5 at the pointer over the median of the crop.
function dotContrast(image, width, height, u, v) {
  const half = (DOTS_SIDE - 1) / 2;
  const around = [];
  let brightest = 0;
  for (let row = Math.max(0, v - half); row <= Math.min(height - 1, v + half); ++row) {
    for (let column = Math.max(0, u - half); column <= Math.min(width - 1, u + half); ++column) {
      const value = image[row * width + column];
      around.push(value);
      if (Math.abs(column - u) <= 2 && Math.abs(row - v) <= 2) brightest = Math.max(brightest, value);
    }
  }
  around.sort((a, b) => a - b);
  return brightest / Math.max(around[around.length >> 1], 1e-6);
}
