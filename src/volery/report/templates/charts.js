// Curves over time and processor load, with the time that is shown as a line through all of them.
(() => {
  const { data, at, before, tenths, colour, series, clock, element: make } = stage;
  const margin = { left: 46, right: 10, top: 8, bottom: 22 };

  function niceStep(span, count) {
    const power = 10 ** Math.floor(Math.log10(span / count));
    return [1, 2, 5, 10].map((factor) => factor * power).find((step) => span / step <= count);
  }

  function timeStep(width) {
    const fitting = Math.max(2, width / 85);
    return [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400].find((step) => data.end / step <= fitting) || 28800;
  }

  // Axes and the cursor; `draw` does the rest. Returns what turns values into places.
  function frame(holder, name, range, unit, draw, values) {
    const legend = make("div", "legend");
    const canvas = make("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", name + " over time");
    holder.append(legend, canvas);
    let place = null;
    const redraw = stage.canvas(canvas, (context, width, height) => {
      const inner = { width: width - margin.left - margin.right, height: height - margin.top - margin.bottom };
      const [low, high] = range;
      place = {
        x: (time) => margin.left + (data.end ? time / data.end : 0) * inner.width,
        y: (value) => margin.top + (1 - (value - low) / (high - low)) * inner.height,
        time: (x) => (x - margin.left) / inner.width * data.end,
        inner, margin,
      };
      context.font = "11px " + getComputedStyle(document.body).fontFamily;
      context.fillStyle = colour("faint");
      context.strokeStyle = colour("line");
      context.lineWidth = 1;
      const step = niceStep(high - low, 4);
      context.textAlign = "right";
      context.textBaseline = "middle";
      const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
      for (let value = Math.ceil(low / step - 1e-9) * step; value <= high + 1e-9; value += step) {
        const y = Math.round(place.y(value)) + 0.5;
        context.beginPath();
        context.moveTo(margin.left, y);
        context.lineTo(width - margin.right, y);
        context.stroke();
        context.fillText((Math.abs(value) < 1e-9 ? 0 : value).toFixed(Math.min(decimals, 3)) + unit, margin.left - 6, y);
      }
      context.textAlign = "center";
      context.textBaseline = "top";
      for (let time = 0, every = timeStep(inner.width); time <= data.end; time += every) {
        context.fillText(clock(time), Math.min(place.x(time), width - 24), height - margin.bottom + 6);
      }
      context.save();
      context.beginPath();
      context.rect(margin.left, margin.top - 4, inner.width + 2, inner.height + 6);
      context.clip();
      draw(context, place);
      context.restore();
      const x = place.x(stage.now);
      context.strokeStyle = colour("ink");
      context.globalAlpha = 0.7;
      context.beginPath();
      context.moveTo(x, margin.top - 4);
      context.lineTo(x, height - margin.bottom);
      context.stroke();
      context.globalAlpha = 1;
    });
    const entries = values.map(({ label, ink }) => {
      const entry = make("span");
      const swatch = make("i");
      swatch.style.background = "var(--" + ink + ")";
      const value = make("b");
      entry.append(swatch, label + " ", value);
      legend.append(entry);
      return value;
    });
    const tell = (time) => values.forEach(({ value }, index) => { entries[index].textContent = value(time); });
    stage.onTime((time) => { redraw(); tell(time); });
    tell(stage.now);
    const seek = (event) => {
      if (place && (event.type === "pointerdown" || event.buttons)) stage.now = place.time(event.offsetX);
    };
    canvas.style.touchAction = "pan-y";
    canvas.addEventListener("pointerdown", seek);
    canvas.addEventListener("pointermove", seek);
    return redraw;
  }

  // Curves of the vehicles, or of others that have a name, a colour and the same keys.
  function curves(id, key, name, drawn = data.vehicles) {
    const holder = document.getElementById(id);
    if (!holder) return;
    const ink = (one, index) => series(one.colour === undefined ? index : one.colour);
    const dashed = (one, index) => (one.colour === undefined ? index : one.colour) >= 8;
    const all = drawn.flatMap((one) => one[key].v);
    let low = all.reduce((a, b) => Math.min(a, b), 0) * 1.06, high = all.reduce((a, b) => Math.max(a, b), 1) * 1.06;
    const values = drawn.map((one, index) => ({
      label: one.name,
      ink: ink(one, index),
      value: (time) => {
        const found = at(one[key].t, one[key].v, time);
        return Number.isNaN(found) ? "" : tenths(found);
      },
    }));
    frame(holder, name, [low, high], "", (context, place) => {
      drawn.forEach((one, index) => {
        const { t, v } = one[key];
        context.strokeStyle = colour(ink(one, index));
        context.lineWidth = 1.7;
        context.lineJoin = "round";
        context.setLineDash(dashed(one, index) ? [5, 3] : []);
        context.beginPath();
        t.forEach((time, point) => context.lineTo(place.x(time), place.y(v[point])));
        context.stroke();
        context.setLineDash([]);
      });
    }, values);
  }

  const percent = (share) => share.toFixed(share && share < 0.95 ? 2 : 1) + " %";

  function load(processor) {
    const holder = document.getElementById("processors");
    const figure = make("figure");
    const used = processor.components
      .map((component) => ({ ...component, total: component.share.reduce((a, b) => a + b, 0) }))
      .sort((a, b) => b.total - a.total);
    const shown = used.slice(0, 7);
    if (used.length > 7) {
      const rest = used.slice(7);
      shown.push({
        name: rest.length + " others",
        share: rest[0].share.map((_, bin) => rest.reduce((sum, one) => sum + (one.share[bin] || 0), 0)),
      });
    }
    const bins = processor.misses.length;
    const top = Array.from({ length: bins }, (_, bin) => shown.reduce((sum, one) => sum + (one.share[bin] || 0), 0));
    const peak = top.reduce((a, b) => Math.max(a, b), 0);
    const usual = [...top].sort((a, b) => a - b)[Math.floor(0.98 * (bins - 1))] || 0;
    const cut = peak > 4 * usual && usual > 0; // a rare peak must not flatten everything else
    const high = Math.min(100, Math.max(0.05, cut ? 2 * usual : 1.15 * peak));
    const caption = make("figcaption");
    const title = make("h3", "", processor.name);
    const cores = processor.cores === 1 ? "1 core" : processor.cores + " cores";
    const missed = processor.misses.reduce((a, b) => a + b, 0);
    title.append(make("small", "", cores + (cut ? ", peak " + peak.toFixed(1) + " % beyond the chart" : "") + (missed ? ", " + missed + " missed deadlines" : "")));
    caption.append(title);
    const holderOf = make("div", "chart");
    figure.append(caption, holderOf);
    holder.append(figure);
    const binAt = (time) => Math.min(bins - 1, Math.floor(time / processor.step));
    frame(holderOf, "load of " + processor.name, [0, high], "%", (context, place) => {
      const base = new Array(bins).fill(0);
      shown.forEach((component, index) => {
        context.fillStyle = colour(series(index));
        context.beginPath();
        for (let bin = 0; bin < bins; bin++) {
          const y = place.y(base[bin] + (component.share[bin] || 0));
          context.lineTo(place.x(bin * processor.step), y);
          context.lineTo(place.x((bin + 1) * processor.step), y);
        }
        for (let bin = bins - 1; bin >= 0; bin--) {
          const y = place.y(base[bin]);
          context.lineTo(place.x((bin + 1) * processor.step), y);
          context.lineTo(place.x(bin * processor.step), y);
          base[bin] += component.share[bin] || 0;
        }
        context.fill();
      });
      context.fillStyle = colour("bad");
      processor.misses.forEach((count, bin) => {
        if (count) context.fillRect(place.x(bin * processor.step), 4, Math.max(1.5, place.x(processor.step) - place.x(0)), 5);
      });
    }, shown.map((component, index) => ({
      label: component.name,
      ink: series(index),
      value: (time) => percent(component.share[binAt(time)] || 0),
    })));
  }

  for (const key of ["height", "speed", "roll", "pitch", "yaw", "battery", "distance"]) {
    curves(key, key, key);
    curves(key + "-difference", key, "difference of " + key, data.differences);
  }
  if (document.getElementById("processors")) {
    data.processors.filter((processor) => processor.components.length).forEach(load);
  }
})();
