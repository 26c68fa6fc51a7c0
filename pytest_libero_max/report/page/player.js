// Plays the films of a case together. A browser plays an MP4 itself and goes to any moment of it, so that a film
// needs no list of its frames: one second of a film is `hz` policy steps. The scrubber is a range input that lies
// over the curves of the case.

function svg(tag, properties, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(properties)) made.setAttribute(name, String(value));
  made.append(...children);
  return made;
}

// The largest distance of the curves, mm.
function highestOf(timeline) {
  return Math.max(1, ...Object.values(timeline.arms).flatMap((arm) => arm.curve ?? []));
}

// The distance to the trigger entity over the steps, the event, and the stale actions; marks alone without curves.
function curves(timeline) {
  const arms = Object.values(timeline.arms);
  const highest = highestOf(timeline);
  const line = (x, kind) => svg("line", { x1: x, x2: x, y1: 0, y2: 100, class: kind });
  const stale = arms
    .filter((arm) => arm.events.length && arm.stale)
    .map((arm) => svg("rect", { x: arm.events[0], y: 0, width: arm.stale, height: 100, class: "stale" }));
  const events = [...new Set(arms.flatMap((arm) => arm.events))].map((step) => line(step, "event"));
  const paths = arms.map(({ curve, every, kind }) => {
    const points = (curve ?? []).map((value, place) => `${1 + place * every},${100 - (95 * value) / highest}`);
    return svg("polyline", { points: points.join(" "), class: kind });
  });
  const box = { viewBox: `0 0 ${Math.max(timeline.steps, 1)} 100`, preserveAspectRatio: "none", "aria-hidden": "true" };
  return svg("svg", box, ...stale, ...events, ...paths);
}

function legend(timeline) {
  const named = Object.entries(timeline.arms).map(([name, arm]) =>
    element("li", {}, element("i", { class: arm.kind }), `${name}: ${arm.success ? "success" : "failed"} after ${arm.end} steps`),
  );
  const has = (test) => Object.values(timeline.arms).some(test);
  const curve = has((arm) => arm.curve) ? [element("li", {}, `Curves: distance of the hand to the trigger entity, 0 to ${Math.round(highestOf(timeline) / 10)} cm`)] : [];
  const event = has((arm) => arm.events.length) ? [element("li", {}, element("i", { class: "event" }), "event")] : [];
  const stale = has((arm) => arm.stale) ? [element("li", {}, element("i", { class: "stale" }), "stale actions")] : [];
  return element("ul", { class: "legend" }, ...named, ...event, ...stale, ...curve);
}

function drawn(timeline, ...over) {
  return element("div", { class: "scrubber" }, curves(timeline), ...over);
}

function player(videos, timeline, hz) {
  const events = Object.values(timeline.arms).flatMap((arm) => arm.events);
  const seek = element("input", { type: "range", min: 0, max: timeline.steps, step: 1, "aria-label": "Policy step" });
  const shown = element("output");
  const play = element("button", { type: "button" }, "Play");
  const say = () => {
    const first = Math.min(...events);
    const since = Number.isFinite(first) && seek.value >= first ? `, ${seek.value - first} after the event` : "";
    shown.textContent = `step ${seek.value} of ${timeline.steps}, ${(seek.value / hz).toFixed(2)} s${since}`;
    seek.setAttribute("aria-valuetext", shown.textContent);
  };
  const goTo = (step) => {
    seek.value = step;
    for (const video of videos) video.currentTime = Math.min((Number(seek.value) + 0.5) / hz, video.duration || Infinity);
    say();
  };
  const pause = () => videos.forEach((video) => video.pause());
  const follow = () => {
    const playing = videos.some((video) => !video.paused && !video.ended);
    play.textContent = playing ? "Pause" : "Play";
    if (!playing) return;
    seek.value = Math.floor(Math.max(...videos.map((video) => video.currentTime)) * hz);
    say();
    requestAnimationFrame(follow);
  };
  play.addEventListener("click", () => {
    if (play.textContent === "Pause") return pause();
    if (Number(seek.value) >= timeline.steps) goTo(0);
    videos.forEach((video) => video.play());
  });
  for (const video of videos) for (const name of ["play", "pause", "ended"]) video.addEventListener(name, follow);
  seek.addEventListener("input", () => (pause(), goTo(seek.value)));
  const step = (title, label, by) =>
    element("button", { type: "button", "aria-label": label, title: label, onclick: () => (pause(), goTo(Number(seek.value) + by)) }, title);
  const toEvent = events.length
    ? [element("button", { type: "button", onclick: () => (pause(), goTo(Math.min(...events))) }, "To the event")]
    : [];
  const speed = element("select", { "aria-label": "Speed" }, ...[1, 0.5, 0.25].map((rate) => element("option", { value: rate }, `${rate}×`)));
  speed.addEventListener("change", () => videos.forEach((video) => (video.playbackRate = Number(speed.value))));
  goTo(events.length ? Math.min(...events) : 0);
  return [
    drawn(timeline, seek),
    element("div", { class: "transport" }, step("◀", "One step back", -1), play, step("▶", "One step on", 1), ...toEvent, speed, shown),
    legend(timeline),
  ];
}
