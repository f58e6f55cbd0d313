// The map: scenery, trails, vehicles, notes. Drag to move, pinch or ctrl-wheel or the buttons to zoom.
(() => {
  const element = document.getElementById("map");
  if (!element) return;
  const { data, at, before, colour, series, markOf, current } = stage;
  const scenery = data.scenery || { places: [], roads: [], corridors: [], areas: [] };
  const view = { x: 0, y: 0, scale: 1, fitted: true };
  const bright = 90; // seconds of the way that stand out
  let followed = null;
  let size = [1, 1];

  // The corners of what is known of a map.
  function corners(map) {
    let left = map.columns, right = 0, bottom = map.rows, top = 0;
    for (let cell = 0, index = 0; index < map.runs.length; cell += map.runs[index + 1], index += 2) {
      if (map.runs[index] < 0) continue;
      const last = cell + map.runs[index + 1] - 1;
      const row = Math.floor(cell / map.columns), end = Math.floor(last / map.columns);
      bottom = Math.min(bottom, row);
      top = Math.max(top, end + 1);
      left = Math.min(left, row === end ? cell % map.columns : 0);
      right = Math.max(right, row === end ? last % map.columns + 1 : map.columns);
    }
    if (left >= right) return [];
    const cosine = Math.cos(map.yaw) * map.side, sine = Math.sin(map.yaw) * map.side;
    return [[left, bottom], [right, bottom], [right, top], [left, top]].map(
      ([x, y]) => [map.x + cosine * x - sine * y, map.y + sine * x + cosine * y]);
  }

  function bounds() {
    const xs = data.vehicles.flatMap((vehicle) => vehicle.x), ys = data.vehicles.flatMap((vehicle) => vehicle.y);
    for (const [, x, y] of scenery.places) { xs.push(x); ys.push(y); }
    for (const map of data.maps) for (const [x, y] of corners(map)) { xs.push(x); ys.push(y); }
    if (!xs.length) for (const [, , outline] of scenery.areas) for (const [x, y] of outline) { xs.push(x); ys.push(y); }
    const low = (list) => list.reduce((a, b) => Math.min(a, b), Infinity);
    const high = (list) => list.reduce((a, b) => Math.max(a, b), -Infinity);
    return xs.length ? [low(xs), low(ys), high(xs), high(ys)] : [-10, -10, 10, 10];
  }
  const box = bounds();

  function fit() {
    const margin = Math.min(70, size[0] / 8);
    const width = Math.max(box[2] - box[0], 10), height = Math.max(box[3] - box[1], 10);
    view.scale = Math.min((size[0] - 2 * margin) / width, (size[1] - 2 * margin) / height);
    view.x = (box[0] + box[2]) / 2;
    view.y = (box[1] + box[3]) / 2;
    view.fitted = true;
    element.style.touchAction = "pan-y";
  }
  const toX = (x) => size[0] / 2 + (x - view.x) * view.scale;
  const toY = (y) => size[1] / 2 - (y - view.y) * view.scale;

  function path(context, points, close) {
    context.beginPath();
    points.forEach(([x, y], index) => (index ? context.lineTo(toX(x), toY(y)) : context.moveTo(toX(x), toY(y))));
    if (close) context.closePath();
  }

  function hatch(context, outline) {
    context.save();
    path(context, outline, true);
    context.clip();
    const xs = outline.map(([x]) => toX(x)), ys = outline.map(([, y]) => toY(y));
    const left = Math.max(Math.min(...xs), -20), right = Math.min(Math.max(...xs), size[0] + 20);
    const top = Math.max(Math.min(...ys), -20), bottom = Math.min(Math.max(...ys), size[1] + 20);
    context.beginPath();
    for (let start = left - (bottom - top); start < right; start += 9) {
      context.moveTo(start, bottom);
      context.lineTo(start + (bottom - top), top);
    }
    context.stroke();
    context.restore();
  }

  function drawScenery(context, taken) {
    context.lineJoin = context.lineCap = "round";
    const named = { building: "building", water: "water", park: "park" };
    for (const [name, kind, outline] of scenery.areas) {
      if (kind === "no-fly") continue;
      path(context, outline, true);
      context.fillStyle = colour(named[kind] || "building");
      context.fill();
    }
    context.strokeStyle = colour("road");
    context.lineWidth = Math.min(Math.max(6 * view.scale, 2.5), 9);
    for (const road of scenery.roads) { path(context, road); context.stroke(); }
    context.strokeStyle = colour("lane");
    context.lineWidth = 1.5;
    context.setLineDash([7, 6]);
    for (const lane of scenery.corridors) { path(context, lane); context.stroke(); }
    context.setLineDash([]);
    for (const [name, kind, outline] of scenery.areas) {
      if (kind === "no-fly") {
        context.strokeStyle = colour("noflight");
        context.lineWidth = 1;
        context.globalAlpha = 0.45;
        hatch(context, outline);
        context.globalAlpha = 1;
        context.lineWidth = 1.5;
        path(context, outline, true);
        context.stroke();
      }
      const x = outline.reduce((sum, [value]) => sum + value, 0) / outline.length;
      const y = outline.reduce((sum, [, value]) => sum + value, 0) / outline.length;
      const xs = outline.map(([value]) => value * view.scale);
      if (Math.max(...xs) - Math.min(...xs) < 36) continue; // its name would hide it
      label(context, name, toX(x), toY(y) - 6, colour(kind === "no-fly" ? "noflight" : "soft"), taken, 0);
    }
  }

  const parts = (name) => [1, 3, 5].map((start) => parseInt(colour(name).slice(start, start + 2), 16));
  const painted = {};

  // A map as a picture of a pixel a cell, south on top; drawn anew when the colours change.
  function paint(index) {
    const map = data.maps[index], free = parts("surface"), occupied = parts("ink");
    const key = String([...free, ...occupied]);
    if (painted[index] && painted[index].key === key) return painted[index].canvas;
    const canvas = document.createElement("canvas");
    canvas.width = map.columns;
    canvas.height = map.rows;
    const picture = new ImageData(map.columns, map.rows);
    for (let cell = 0, index = 0; index < map.runs.length; index += 2) {
      const level = map.runs[index], end = cell + map.runs[index + 1];
      if (level >= 0) {
        const shade = [0, 1, 2].map((part) => free[part] + (occupied[part] - free[part]) * level / 10);
        for (let at = cell; at < end; at++) picture.data.set([...shade, 255], 4 * at);
      }
      cell = end;
    }
    canvas.getContext("2d").putImageData(picture, 0, 0);
    painted[index] = { key, canvas };
    return canvas;
  }

  const layer = document.getElementById("layer");

  function drawMap(context) {
    if (!layer || layer.value === "") return;
    const map = data.maps[layer.value], side = map.side * view.scale;
    context.save();
    context.translate(toX(map.x), toY(map.y));
    context.rotate(-map.yaw);
    context.scale(side, -side);
    context.imageSmoothingEnabled = side < 1;
    context.drawImage(paint(layer.value), 0, 0);
    context.restore();
  }

  function drawPaths(context) {
    for (const { points, past } of data.paths) {
      context.strokeStyle = colour(past ? "accent" : "warn");
      context.lineWidth = past ? 1.5 : 2;
      context.setLineDash(past ? [2, 4] : [9, 5]);
      path(context, points);
      context.stroke();
    }
    context.setLineDash([]);
  }

  function drawScans(context) {
    context.fillStyle = colour("noflight");
    for (const { points } of data.scans) for (const [x, y] of points) context.fillRect(toX(x) - 1, toY(y) - 1, 2, 2);
  }

  // Words with a halo, where they do not cover earlier ones.
  function label(context, words, x, y, ink, taken, below, bold) {
    context.font = (bold ? "600 " : "") + "12px " + getComputedStyle(document.body).fontFamily;
    const width = context.measureText(words).width;
    const spot = [x - width / 2 - 2, y + below - 2, x + width / 2 + 2, y + below + 14];
    if (taken.some((other) => spot[0] < other[2] && other[0] < spot[2] && spot[1] < other[3] && other[1] < spot[3])) return;
    taken.push(spot);
    context.textAlign = "center";
    context.textBaseline = "top";
    context.lineWidth = 3.5;
    context.strokeStyle = colour("sunken");
    context.strokeText(words, x, y + below);
    context.fillStyle = ink;
    context.fillText(words, x, y + below);
  }

  const signs = { hospital: "+", store: "▤", port: "H", home: "⌂" };

  function drawPlaces(context, taken) {
    for (const [, px, py] of scenery.places.filter((place) => !signs[place[3]])) {
      context.beginPath();
      context.arc(toX(px), toY(py), 3, 0, 2 * Math.PI);
      context.fillStyle = colour("faint");
      context.fill();
    }
    const important = [...scenery.places].sort((one, other) => !signs[one[3]] - !signs[other[3]]);
    for (const [name, px, py, kind] of important) {
      const x = toX(px), y = toY(py);
      if (!signs[kind]) {
        label(context, name.replaceAll("_", " "), x, y, colour("faint"), taken, 6);
        continue;
      }
      context.beginPath();
      if (kind === "port") context.arc(x, y, 11, 0, 2 * Math.PI); else context.roundRect(x - 10, y - 10, 20, 20, 5);
      context.fillStyle = colour("surface");
      context.fill();
      context.lineWidth = 1.5;
      context.strokeStyle = colour(kind === "hospital" ? "bad" : "soft");
      context.stroke();
      context.fillStyle = context.strokeStyle;
      context.font = "700 14px " + getComputedStyle(document.body).fontFamily;
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillText(signs[kind], x, y + 0.5);
      label(context, name.replaceAll("_", " "), x, y, colour("soft"), taken, 13);
    }
  }

  function where(vehicle, time) {
    return { x: at(vehicle.t, vehicle.x, time), y: at(vehicle.t, vehicle.y, time), z: at(vehicle.t, vehicle.z, time) };
  }

  function drawTrail(context, vehicle, ink, time) {
    if (!vehicle.t.length) return;
    const points = vehicle.t.map((_, index) => [vehicle.x[index], vehicle.y[index]]);
    if (points.length < 2) return;
    context.strokeStyle = ink;
    context.lineWidth = 1.2;
    context.globalAlpha = 0.28;
    path(context, points);
    context.stroke();
    const from = Math.max(time - bright, vehicle.t[0]);
    const [tail, here] = [where(vehicle, from), where(vehicle, time)];
    const between = points.slice(before(vehicle.t, from) + 1, before(vehicle.t, time) + 1);
    path(context, [[tail.x, tail.y], ...between, [here.x, here.y]]);
    context.globalAlpha = 0.9;
    context.lineWidth = 2.4;
    context.stroke();
    context.globalAlpha = 1;
  }

  function heading(vehicle, time) {
    for (let index = before(vehicle.t, time); index >= 0; index--) {
      const dx = vehicle.x[index + 1] - vehicle.x[index], dy = vehicle.y[index + 1] - vehicle.y[index];
      if (Math.hypot(dx, dy) > 0.5) return Math.atan2(dy, dx);
    }
    return Math.PI / 2;
  }

  function drawVehicle(context, vehicle, ink, time) {
    if (!vehicle.t.length) return;
    const spot = where(vehicle, time);
    const mode = current(vehicle.modes, time, (entry) => entry[0]);
    context.save();
    context.translate(toX(spot.x), toY(spot.y));
    context.rotate(-heading(vehicle, time));
    context.strokeStyle = colour("surface");
    context.fillStyle = ink;
    context.globalAlpha = mode && mode[2] ? 1 : 0.75;
    if (vehicle.kind === "rover") {
      context.beginPath();
      context.roundRect(-9, -6, 18, 12, 3);
      context.lineWidth = 2;
      context.fill();
      context.stroke();
      context.beginPath();
      context.moveTo(3, -3); context.lineTo(7, 0); context.lineTo(3, 3);
      context.lineWidth = 1.8;
      context.stroke();
    } else {
      context.lineWidth = 6;
      context.beginPath();
      for (const [x, y] of [[7, 7], [7, -7]]) { context.moveTo(-x, -y); context.lineTo(x, y); }
      context.stroke();
      context.strokeStyle = ink;
      context.lineWidth = 2.4;
      context.stroke();
      for (const [x, y] of [[7, 7], [7, -7], [-7, 7], [-7, -7]]) {
        context.beginPath();
        context.arc(x, y, 4.2, 0, 2 * Math.PI);
        context.fill();
        context.lineWidth = 1.2;
        context.strokeStyle = colour("surface");
        context.stroke();
      }
      context.beginPath();
      context.moveTo(5, -3.5); context.lineTo(11, 0); context.lineTo(5, 3.5);
      context.closePath();
      context.fill();
    }
    context.restore();
  }

  // Where a noted subject is: on the vehicle or at the place that its state speaks of, else where it was left;
  // if it was said of neither, where the vehicle of the component was that noted it.
  function spotOf(subject, time) {
    const known = subject.steps.findLastIndex((step) => step.t <= time);
    for (let index = known, until = time; index >= 0; index--) {
      const step = subject.steps[index];
      const place = scenery.places.find((one) => one[0] === step.place);
      if (place && step.place === subject.name) return { x: place[1], y: place[2] };
      const vehicle = data.vehicles.find((one) => one.name === step.vehicle);
      if (vehicle && vehicle.t.length) return where(vehicle, until);
      if (place) return { x: place[1], y: place[2] };
      until = step.t;
    }
    const step = subject.steps[known];
    const vehicle = step && data.vehicles.find((one) => one.name === step.from);
    return vehicle && vehicle.t.length ? where(vehicle, step.t) : null;
  }

  function drawCollisions(context, time) {
    context.strokeStyle = colour("bad");
    context.lineWidth = 3;
    for (const { t, x, y } of data.collisions) {
      if (t > time) continue;
      context.beginPath();
      for (const side of [-1, 1]) {
        context.moveTo(toX(x) - 8, toY(y) - 8 * side);
        context.lineTo(toX(x) + 8, toY(y) + 8 * side);
      }
      context.stroke();
    }
  }

  function drawNotes(context, time) {
    const stacked = {};
    data.notes.forEach((kind, index) => {
      for (const subject of kind.subjects) {
        const spot = spotOf(subject, time);
        if (!spot) continue;
        const key = Math.round(toX(spot.x) / 8) + "/" + Math.round(toY(spot.y) / 8);
        const row = stacked[key] = (stacked[key] || 0) + 1;
        drawMark(context, markOf(index), toX(spot.x) + 8 + 11 * (row - 1), toY(spot.y) - 20);
      }
    });
  }

  function drawMark(context, mark, left, top) {
    context.beginPath();
    if (mark.shape === "disc") context.arc(left + 5.5, top + 5.5, 5.5, 0, 2 * Math.PI);
    else if (mark.shape === "diamond") {
      for (const [x, y] of [[0, 5.5], [5.5, 0], [11, 5.5], [5.5, 11]]) context.lineTo(left + x, top + y);
      context.closePath();
    } else context.roundRect(left, top, 11, 11, 2);
    context.fillStyle = mark.fill;
    context.fill();
    context.lineWidth = 1.3;
    context.strokeStyle = mark.edge;
    if (mark.shape === "box") {
      context.moveTo(left + 5.5, top);
      context.lineTo(left + 5.5, top + 11);
    }
    context.stroke();
  }

  function drawScale(context) {
    const wanted = 110 / view.scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((factor) => factor * power).find((value) => value <= wanted) || power;
    const x = 14, y = size[1] - 16, width = length * view.scale;
    context.strokeStyle = context.fillStyle = colour("soft");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, y - 5); context.lineTo(x, y); context.lineTo(x + width, y); context.lineTo(x + width, y - 5);
    context.stroke();
    context.font = "11px " + getComputedStyle(document.body).fontFamily;
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.fillText(length >= 1000 ? length / 1000 + " km" : length + " m", x + 5, y - 2);
    context.textAlign = "center";
    context.fillText("N", 24, 28);
    context.beginPath();
    context.moveTo(24, 30); context.lineTo(28.5, 43); context.lineTo(24, 39.5); context.lineTo(19.5, 43);
    context.closePath();
    context.fill();
  }

  const redraw = stage.canvas(element, (context, width, height) => {
    size = [width, height];
    if (view.fitted) fit();
    const time = stage.now;
    if (followed !== null && data.vehicles[followed].t.length) {
      const spot = where(data.vehicles[followed], time);
      view.x = spot.x;
      view.y = spot.y;
    }
    const taken = [];
    drawMap(context);
    drawScenery(context, taken);
    drawScans(context);
    data.vehicles.forEach((vehicle, index) => drawTrail(context, vehicle, colour(series(index)), time));
    drawPaths(context);
    drawPlaces(context, taken);
    data.vehicles.forEach((vehicle, index) => drawVehicle(context, vehicle, colour(series(index)), time));
    drawNotes(context, time);
    drawCollisions(context, time);
    data.vehicles.forEach((vehicle) => {
      if (!vehicle.t.length) return;
      const spot = where(vehicle, time);
      const words = spot.z > 0.5 && vehicle.kind !== "rover" ? vehicle.name + "  " + Math.round(spot.z) + " m" : vehicle.name;
      label(context, words, toX(spot.x), toY(spot.y), colour("ink"), taken, -28, true);
    });
    drawScale(context);
  });
  stage.onTime(redraw);
  if (layer) layer.onchange = redraw;

  function zoom(factor, x = size[0] / 2, y = size[1] / 2) {
    const mapX = view.x + (x - size[0] / 2) / view.scale, mapY = view.y - (y - size[1] / 2) / view.scale;
    view.scale = Math.min(Math.max(view.scale * factor, 1e-3), 200);
    view.x = mapX - (x - size[0] / 2) / view.scale;
    view.y = mapY + (y - size[1] / 2) / view.scale;
    view.fitted = false;
    element.style.touchAction = "none";
    redraw();
  }
  document.getElementById("zoom-in").onclick = () => zoom(1.5);
  document.getElementById("zoom-out").onclick = () => zoom(1 / 1.5);
  document.getElementById("zoom-fit").onclick = () => { stage.follow(null); fit(); redraw(); };
  element.addEventListener("dblclick", (event) => zoom(2, event.offsetX, event.offsetY));
  element.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 300), event.offsetX, event.offsetY);
  }, { passive: false });

  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  element.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "mouse" && view.fitted && !fingers.size && event.isPrimary) {
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      return;
    }
    element.setPointerCapture(event.pointerId);
    element.classList.add("held");
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  element.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const apart = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (apart) {
      zoom(spread() / apart);
    } else if (event.pointerType === "mouse" || !view.fitted) {
      if (followed !== null) stage.follow(null);
      view.x -= (event.clientX - last[0]) / view.scale;
      view.y += (event.clientY - last[1]) / view.scale;
      view.fitted = false;
      redraw();
    }
  });
  for (const name of ["pointerup", "pointercancel", "pointerleave"]) {
    element.addEventListener(name, (event) => {
      fingers.delete(event.pointerId);
      element.classList.remove("held");
    });
  }

  stage.follow = (index) => {
    followed = index;
    if (index !== null && view.fitted) {
      view.fitted = false;
      view.scale *= 2.5;
    }
    document.querySelectorAll("#vehicles li").forEach((item, place) => item.classList.toggle("followed", place === index));
    redraw();
  };
  stage.followed = () => followed;
})();
