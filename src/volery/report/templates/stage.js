"use strict";
// What all parts of the page share: the data of the run, the time that is shown, colours, canvases.
const stage = (() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const listeners = [];
  const redraws = [];
  let now = 0;

  // Index of the last value of a sorted list that is not after `value`, at least 0.
  function before(sorted, value) {
    let low = 0, high = sorted.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (sorted[middle] <= value) low = middle; else high = middle - 1;
    }
    return low;
  }

  function at(times, values, time) {
    if (!times.length) return NaN;
    const index = before(times, time);
    if (index + 1 >= times.length || time <= times[0]) return values[index];
    const share = (time - times[index]) / (times[index + 1] - times[index] || 1);
    return values[index] + share * (values[index + 1] - values[index]);
  }

  // A number with one decimal, without the sign of what is rounded to zero.
  const tenths = (value) => value.toFixed(1).replace(/^-0\.0$/, "0.0");

  // The last entry of a list of [time, ...] that has begun by `time`.
  function current(entries, time, timeOf) {
    let found = null;
    for (const entry of entries) {
      if (timeOf(entry) > time) break;
      found = entry;
    }
    return found;
  }

  const styles = getComputedStyle(document.documentElement);
  const colour = (name) => styles.getPropertyValue("--" + name).trim();
  const series = (index) => "c" + (index % 8 + 1);

  // How the subjects of the kinds of notes are marked, by the kind's index.
  const marks = [
    { shape: "box", fill: "#c99a5b", edge: "#5e4318" }, { shape: "disc", fill: "#6fa8c9", edge: "#1c4359" },
    { shape: "diamond", fill: "#9bb85f", edge: "#3d4c17" }, { shape: "box", fill: "#b98ac2", edge: "#4b2353" },
  ];
  const markOf = (index) => marks[index % marks.length];

  function clock(seconds, digits) {
    const whole = Math.floor(seconds + 1e-6);
    const two = (value) => String(value).padStart(2, "0");
    const text = Math.floor(whole / 3600) + ":" + two(Math.floor(whole / 60) % 60) + ":" + two(whole % 60);
    return digits ? text + "." + Math.floor((seconds + 1e-6 - whole) * 10) : text;
  }

  // A canvas that is as sharp as the screen and is drawn again when its size or the colours change.
  function canvas(element, draw) {
    const context = element.getContext("2d");
    const redraw = () => {
      const box = element.getBoundingClientRect();
      if (!box.width) return;
      const ratio = window.devicePixelRatio || 1;
      const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
      if (element.width !== width || element.height !== height) {
        element.width = width;
        element.height = height;
      }
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, box.width, box.height);
      draw(context, box.width, box.height);
    };
    new ResizeObserver(redraw).observe(element);
    redraws.push(redraw);
    return redraw;
  }

  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", () => redraws.forEach((redraw) => redraw()));

  return {
    data, before, at, tenths, current, colour, series, markOf, clock, canvas,
    element(tag, classes, text) {
      const made = document.createElement(tag);
      if (classes) made.className = classes;
      if (text !== undefined) made.textContent = text;
      return made;
    },
    get now() { return now; },
    set now(time) {
      now = Math.min(Math.max(time, 0), data.end);
      listeners.forEach((listener) => listener(now));
    },
    onTime(listener) { listeners.push(listener); },
  };
})();
