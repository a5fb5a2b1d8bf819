// Sliders, selections and their groups.

let created = 0;

/** Slider with a field for exact numbers, which may lie outside the range of the slider. */
class Slider {
  constructor({ label, unit = "", low, high, get, set, least = -Infinity }) {
    const id = `control-${created++}`;
    Object.assign(this, { get, unit, low, high });
    this.range = element("input", { type: "range", id, min: low, max: high, step: "any" });
    this.field = element("input", { type: "number", step: "any", "aria-label": `${label}, exact value` });
    if (least > -Infinity) this.field.min = least;
    this.row = element("div", { className: "row" }, element("label", { htmlFor: id }, label), this.range, this.field);
    this.range.addEventListener("input", () => set(this.range.valueAsNumber));
    this.field.addEventListener("input", () => {
      const value = this.field.valueAsNumber;
      if (Number.isFinite(value) && value >= least) set(value);
    });
    this.field.addEventListener("change", () => this.show());
  }

  /** Returns a value, rounded to a millionth of the range of the slider. */
  trimmed(value) {
    const digits = Math.ceil(6 - Math.log10(this.high - this.low));
    return Number(value.toFixed(Math.min(Math.max(digits, 0), 20)));
  }

  /** Shows the present value. */
  show() {
    const value = this.get();
    if (document.activeElement !== this.range) this.range.value = value;
    if (document.activeElement !== this.field) this.field.value = this.trimmed(value);
    this.range.setAttribute("aria-valuetext", `${short(value)} ${this.unit}`.trim());
  }
}

/** Selection of one of the values of a context, by a slider or, for labels, from a list. */
class Choice {
  constructor({ name, unit, values, set }) {
    const id = `control-${created++}`;
    Object.assign(this, { values, index: -1, unit });
    const label = element("label", { htmlFor: id }, name);
    this.isList = values.some((value) => typeof value === "string");
    if (this.isList) {
      const options = values.map((value, k) => element("option", { value: k }, String(value)));
      const none = element("option", { value: -1 }, "none");
      this.input = element("select", { id, className: "wide" }, none, ...options);
      this.row = element("div", { className: "row" }, label, this.input);
    } else {
      this.input = element("input", { type: "range", id, min: 0, max: values.length - 1, step: 1 });
      this.input.value = Math.floor(values.length / 2);
      this.output = element("output", { htmlFor: id });
      this.row = element("div", { className: "row" }, label, this.input, this.output);
    }
    this.input.addEventListener("input", () => set(Number(this.input.value)));
  }

  /** Shows a value by its index, or none for -1. */
  show(index) {
    this.index = index;
    if (this.isList) {
      this.input.value = index;
      return;
    }
    const text = index < 0 ? "none" : short(this.values[index]);
    if (index >= 0) this.input.value = index;
    this.output.value = text;
    this.input.setAttribute("aria-valuetext", text);
  }
}

/** Returns a group of rows that opens and closes. */
function group(title, open, rows) {
  const content = element("div", { role: "group", "aria-label": title }, ...rows.map((row) => row.row ?? row));
  return element("details", { open }, element("summary", {}, title), content);
}

/** Returns the range of a slider: that of the demonstrated values, and a share more on both sides. */
function sliderRange(values, share, minimum) {
  const [low, high] = extremes(values);
  const margin = Math.max((high - low) * share, minimum);
  return { low: low - margin, high: high + margin };
}
