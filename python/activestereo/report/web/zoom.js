// SPDX-License-Identifier: Apache-2.0
// One zoom for all pictures: which part of the image they show, and where the pointer is.

const LARGEST_ZOOM = 32;

class SharedZoom {
  // changed: called when the part or the pointer has moved.
  constructor(changed) {
    this.pictures = new Map();  // canvas element -> canvas that holds the whole image
    this.changed = changed;
    this.zoom = 1;
    this.centre = [0.5, 0.5];  // share of the image's width and height
    this.pointer = null;  // [u, v], whole pixels
  }

  // Shows an image (a canvas) in a canvas element; its listeners are set up the first time.
  show(element, image) {
    if (!this.pictures.has(element)) this._listen(element);
    this.pictures.set(element, image);
    const width = Math.max(1, Math.round(element.clientWidth * window.devicePixelRatio));
    if (element.width !== width) element.width = width;
    const height = Math.max(1, Math.round((width * image.height) / image.width));
    if (element.height !== height) element.height = height;
    this._draw(element);
  }

  drawAll() {
    for (const element of this.pictures.keys()) this._draw(element);
  }

  // Zooms by a factor about a point of the image, given as shares of its size; the point stays where it is.
  zoomBy(factor, about = this.centre) {
    const before = this.zoom;
    this.zoom = Math.min(Math.max(this.zoom * factor, 1), LARGEST_ZOOM);
    const kept = before / this.zoom;
    this.moveTo(about.map((share, i) => share + (this.centre[i] - share) * kept));
  }

  moveTo(centre) {
    const half = 0.5 / this.zoom;
    this.centre = centre.map((share) => Math.min(Math.max(share, half), 1 - half));
    this.drawAll();
    this.changed();
  }

  reset() {
    this.zoom = 1;
    this.moveTo([0.5, 0.5]);
  }

  // The shares of the image's size under a mouse event.
  _shares(event) {
    const box = event.currentTarget.getBoundingClientRect();
    const place = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    return place.map((p, i) => this.centre[i] + (p - 0.5) / this.zoom);
  }

  _point(event) {
    const image = this.pictures.get(event.currentTarget);
    const [x, y] = this._shares(event);
    const inside = (share, size) => Math.min(Math.max(Math.floor(share * size), 0), size - 1);
    this.pointer = [inside(x, image.width), inside(y, image.height)];
    this.drawAll();
    this.changed();
  }

  _listen(element) {
    let held = null;
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoomBy(Math.pow(2, -event.deltaY / 240), this._shares(event));
    }, { passive: false });
    element.addEventListener("pointerdown", (event) => {
      held = [event.clientX, event.clientY];
      element.setPointerCapture(event.pointerId);
    });
    element.addEventListener("pointerup", () => { held = null; });
    element.addEventListener("pointermove", (event) => {
      if (held) {
        const box = element.getBoundingClientRect();
        const moved = [(event.clientX - held[0]) / box.width, (event.clientY - held[1]) / box.height];
        held = [event.clientX, event.clientY];
        this.moveTo(this.centre.map((share, i) => share - moved[i] / this.zoom));
      }
      this._point(event);
    });
    element.addEventListener("dblclick", () => this.reset());
    element.addEventListener("keydown", (event) => this._key(event));
  }

  _key(event) {
    const step = 0.1 / this.zoom;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    if (event.key === "+" || event.key === "=") this.zoomBy(2);
    else if (event.key === "-") this.zoomBy(0.5);
    else if (event.key === "0") this.reset();
    else if (moves[event.key]) this.moveTo(this.centre.map((share, i) => share + moves[event.key][i]));
    else return;
    event.preventDefault();
  }

  _draw(element) {
    const image = this.pictures.get(element);
    const context = element.getContext("2d");
    const size = [image.width / this.zoom, image.height / this.zoom];
    const corner = [this.centre[0] * image.width - size[0] / 2, this.centre[1] * image.height - size[1] / 2];
    context.imageSmoothingEnabled = false;
    context.drawImage(image, ...corner, ...size, 0, 0, element.width, element.height);
    element.dataset.shown = [...corner, ...size].map((value) => value.toFixed(2)).join(" ");
    if (!this.pointer) return;
    const scale = element.width / size[0];
    const [x, y] = this.pointer.map((pixel, i) => (pixel - corner[i]) * scale);
    context.strokeStyle = "#c8722c";
    context.lineWidth = Math.max(1, window.devicePixelRatio);
    context.strokeRect(x - 1, y - 1, scale + 2, scale + 2);
  }
}
