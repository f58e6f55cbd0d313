// The slider, the play button, and what stands beside the map.
(() => {
  const { data, at, tenths, current, clock, series, markOf, element: make } = stage;
  const slider = document.getElementById("time");
  if (!slider) return;
  const rate = document.getElementById("rate");
  const shown = document.getElementById("clock");
  const sign = document.getElementById("play-sign");
  let playing = false, last = 0;

  const rates = [...rate.options].map((option) => Number(option.value));
  rate.value = String(rates.find((value) => data.end / value <= 45) || rates[rates.length - 1]);

  const cards = data.vehicles.map((vehicle, index) => {
    const item = make("li"), button = make("button"), dot = make("i");
    dot.style.background = "var(--" + series(index) + ")";
    const mode = make("span", "state"), numbers = make("span", "numbers");
    button.append(dot, make("b", "", vehicle.name), mode, numbers);
    button.onclick = () => stage.follow(stage.followed() === index ? null : index);
    item.append(button);
    document.getElementById("vehicles").append(item);
    return { vehicle, mode, numbers };
  });
  const noted = data.notes.flatMap((kind, index) => {
    const list = make("ul", "cards"), mark = markOf(index);
    document.getElementById("noted").append(make("h3", "", kind.title), list);
    return kind.subjects.map((subject) => {
      const item = make("li", "noted"), sign = make("i", mark.shape), state = make("span", "state");
      sign.style.background = mark.fill;
      item.append(sign, make("b", "", subject.name), state);
      list.append(item);
      return { subject, item, state };
    });
  });
  const cursors = document.querySelectorAll(".lane .cursor");

  function tell(time) {
    slider.value = time;
    slider.setAttribute("aria-valuetext", clock(time, 1));
    shown.textContent = clock(time, 1);
    const place = data.end ? 100 * time / data.end : 0;
    cursors.forEach((cursor) => { cursor.style.left = place + "%"; });
    for (const { vehicle, mode, numbers } of cards) {
      const entry = current(vehicle.modes, time, (one) => one[0]);
      mode.textContent = entry ? entry[1] + (entry[2] ? "" : " · disarmed") : "not yet seen";
      const words = [];
      if (vehicle.kind !== "rover" && vehicle.height.t.length) {
        words.push(tenths(at(vehicle.height.t, vehicle.height.v, time)) + " m");
      }
      if (vehicle.speed.t.length) words.push(tenths(at(vehicle.speed.t, vehicle.speed.v, time)) + " m/s");
      if (vehicle.battery.t.length) words.push(Math.round(at(vehicle.battery.t, vehicle.battery.v, time)) + " %");
      numbers.textContent = words.join("  ·  ");
    }
    for (const { subject, item, state } of noted) {
      const step = current(subject.steps, time, (one) => one.t);
      item.hidden = !step;
      if (step) state.textContent = step.state;
    }
  }
  stage.onTime(tell);

  function step(moment) {
    if (!playing) return;
    stage.now = stage.now + Math.min(0.25, (moment - last) / 1000) * Number(rate.value);
    last = moment;
    if (stage.now >= data.end) play(false); else requestAnimationFrame(step);
  }
  function play(on) {
    playing = on;
    sign.textContent = on ? "❚❚" : "▶";
    if (!on) return;
    if (stage.now >= data.end) stage.now = 0;
    last = performance.now();
    requestAnimationFrame(step);
  }
  document.getElementById("play").onclick = () => play(!playing);
  slider.addEventListener("input", () => { stage.now = Number(slider.value); });
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && !/^(BUTTON|SELECT|SUMMARY|INPUT)$/.test(event.target.tagName)) {
      event.preventDefault();
      play(!playing);
    }
  });
  stage.now = 0;
})();
