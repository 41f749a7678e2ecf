// SPDX-License-Identifier: Apache-2.0
// The panel of sliders: camera and projector, the touched surface, effects. It keeps the settings that settings.py reads.

const STEPS = 1000;  // of a slider

class Panel {
  // changed: called when a setting has moved.
  constructor(changed) {
    this.changed = changed;
    this.hide();
    document.getElementById("add-effect").onchange = (event) => this._add(event.target.value);
    document.getElementById("has-noise").onchange = () => this._moved();
    document.getElementById("reset").onclick = () => this.reset();
  }

  // Called before another entry is opened.
  hide() {
    document.getElementById("panel").hidden = true;
    this.frame = null;
  }

  // The catalogue of effects, and the sliders and effects of one frame. Of the frame before, surfaces and effects stay.
  open(catalogue, frame) {
    if (this.frame !== null) {
      this.frame = frame;
      this._showCamera();
      return;
    }
    this.catalogue = Object.fromEntries(catalogue.map((effect) => [effect.id, effect]));
    this.frame = frame;
    const families = [...new Set(catalogue.map((effect) => effect.family))].sort();
    const groups = families.map((family) => {
      const group = document.createElement("optgroup");
      group.label = family;
      group.append(...catalogue.filter((effect) => effect.family === family).map((effect) => new Option(effect.id, effect.id)));
      return group;
    });
    document.getElementById("add-effect").replaceChildren(new Option("add an effect...", ""), ...groups);
    this._begin();
    document.getElementById("panel").hidden = false;
  }

  reset() {
    this._begin();
    this.changed();
  }

  isMoved() {
    if (this.frame === null) return false;
    const same = JSON.stringify(this.effects) === JSON.stringify(this.frame.effects);
    return !(same && document.getElementById("has-noise").checked && !Object.keys({ ...this.camera, ...this.materials }).length);
  }

  settings() {
    return { ...this.camera, has_noise: document.getElementById("has-noise").checked, materials: this.materials, effects: this.effects };
  }

  // A picture tells the exposure and the gain that the sensor chose by itself.
  taken(picture) {
    for (const name of ["exposure_s", "gain"]) {
      if (!(name in this.camera) && this.rows[name] && picture[name] !== null) this.rows[name].show(picture[name]);
    }
  }

  // The answer to what was touched: its sliders take the place of those before.
  touched(answer) {
    this.touchedName = answer.name;
    document.getElementById("surface-name").textContent = answer.name === null ? "There is nothing at this pixel." : answer.name;
    const rows = answer.sliders.map((slider) => this._row(slider, (value) => {
      this.materials[answer.name] = { ...this.materials[answer.name], [slider.name]: value };
    }).element);
    document.getElementById("surface").replaceChildren(...rows);
    this._showEffects();
  }

  _begin() {
    this.materials = {};
    this.effects = structuredClone(this.frame.effects);
    document.getElementById("has-noise").checked = true;
    document.getElementById("surface-name").textContent = "Click a picture, or press t, to touch what is there.";
    document.getElementById("surface").replaceChildren();
    this.touchedName = null;
    this._showCamera();
    this._showEffects();
  }

  _showCamera() {
    [this.camera, this.rows] = [{}, {}];
    for (const slider of this.frame.camera) this.rows[slider.name] = this._row(slider, (value) => { this.camera[slider.name] = value; });
    document.getElementById("camera").replaceChildren(...Object.values(this.rows).map((row) => row.element));
  }

  _moved() {
    document.getElementById("saved").textContent = "";
    this.changed();
  }

  _add(id) {
    document.getElementById("add-effect").value = "";
    if (!id || id in this.effects) return;
    this.effects[id] = Object.fromEntries(this.catalogue[id].sliders.map((slider) => [slider.name, slider.value]));
    if (this.catalogue[id].on_surfaces && this.touchedName !== null) this.effects[id].surfaces = [this.touchedName];
    this._showEffects();
    this._moved();
  }

  _showEffects() {
    document.getElementById("effects").replaceChildren(...Object.keys(this.effects).map((id) => this._effect(id)));
  }

  _effect(id) {
    const [known, values] = [this.catalogue[id], this.effects[id]];
    const box = document.createElement("div");
    box.className = "effect";
    box.dataset.effect = id;
    const head = document.createElement("h3");
    const remove = document.createElement("button");
    remove.type = "button";
    remove.textContent = "remove";
    remove.onclick = () => { delete this.effects[id]; this._showEffects(); this._moved(); };
    head.append(id, remove);
    const summary = document.createElement("p");
    summary.className = "muted small";
    summary.textContent = known.summary + (values.surfaces ? ` On ${values.surfaces.join(", ")}.` : "");
    const rows = known.sliders.map((slider) => this._row({ ...slider, value: values[slider.name] ?? slider.value }, (value) => { values[slider.name] = value; }).element);
    box.append(head, summary, ...rows);
    return box;
  }

  // One slider with a field for its number. keep: takes the value that was set.
  _row(slider, keep) {
    const element = document.createElement("label");
    element.className = "slider";
    element.dataset.name = slider.name;
    const text = document.createElement("span");
    const name = document.createElement("b");
    name.textContent = slider.label;
    text.append(name, slider.unit);
    const range = document.createElement("input");
    Object.assign(range, { type: "range", min: 0, max: STEPS, step: 1 });
    range.setAttribute("aria-label", slider.label);
    const field = document.createElement("input");
    Object.assign(field, { type: "number", step: "any", min: slider.least, max: slider.most });
    field.setAttribute("aria-label", `${slider.label}, number`);
    element.append(text, range, field);
    const [low, high] = slider.is_log ? [Math.log(slider.low), Math.log(slider.high)] : [slider.low, slider.high];
    const show = (value) => {
      range.value = String(Math.round(STEPS * ((slider.is_log ? Math.log(value) : value) - low) / (high - low)));
      field.value = String(Number(value.toPrecision(4)));
    };
    const set = (value) => {
      element.classList.add("moved");
      keep(value);
      this._moved();
    };
    range.oninput = () => {
      const at = low + (Number(range.value) / STEPS) * (high - low);
      const value = Number((slider.is_log ? Math.exp(at) : at).toPrecision(6));
      field.value = String(Number(value.toPrecision(4)));
      set(Math.min(Math.max(value, slider.least), slider.most));
    };
    field.onchange = () => {
      const value = Number(field.value);
      if (field.value === "" || !(value >= slider.least && value <= slider.most)) {
        field.setCustomValidity(`from ${slider.least} to ${slider.most}`);
        field.reportValidity();
        return;
      }
      field.setCustomValidity("");
      show(value);
      set(value);
    };
    show(slider.value);
    return { element, show };
  }
}
