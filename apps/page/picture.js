// The picture as an SVG scene: what was found, what the contract allows, robots, and who moved.
import { app, on } from "./app.js";
import { byId, path, s } from "./dom.js";

const svg = byId("scene"), canvas = byId("motion");
export const MOST_DRAGGED = 300; // with more robots places are drawn, but not each one by itself
const SHARE = 0.42; // of the way to the neighbour: a robot's disc is no larger
const NUDGE = 4; // a press that moves less, in pixels of the screen, is a click

const layers = Object.fromEntries(
  ["picture", "areas", "things", "paths", "arrows", "robots", "drawing", "options"].map((name) => [
    name, s("g", { id: `layer-${name}` }),
  ]),
);
svg.append(...Object.values(layers));
export const layer = (name) => layers[name];

// What of the picture is seen: left, top, width, height, px of the picture.
let seen = null, fitted = true;
const size = () => [app.scene.picture.width, app.scene.picture.height];

export const unit = () => (seen ? seen[2] / Math.max(svg.clientWidth, 1) : 1);

export const place = (event) => {
  const matrix = svg.getScreenCTM().inverse();
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix);
  return [point.x, point.y];
};

const fit = () => {
  const [width, height] = size();
  const wide = Math.max(svg.clientWidth, 1) / Math.max(svg.clientHeight, 1);
  const across = Math.max(width, height * wide), down = across / wide;
  look([(width - across) / 2, (height - down) / 2, across, down]);
  fitted = true;
};

const look = (rectangle) => {
  [seen, fitted] = [rectangle, false];
  svg.setAttribute("viewBox", seen.join(" "));
  draw();
};

const zoom = (factor, [x, y] = [seen[0] + seen[2] / 2, seen[1] + seen[3] / 2]) => {
  const [width] = size(), across = seen[2] * factor;
  if (across > 3 * width || across < width / 60) return;
  look([x - (x - seen[0]) * factor, y - (y - seen[1]) * factor, across, seen[3] * factor]);
};

const pan = (dx, dy) => look([seen[0] - dx, seen[1] - dy, seen[2], seen[3]]);

// Sizes are those of the screen, whatever the picture's.
const radiusOf = (robots) => {
  const few = robots.slice(0, 400);
  let least = Infinity;
  few.forEach((a, i) => few.slice(i + 1).forEach((b) => {
    least = Math.min(least, Math.hypot(a.x - b.x, a.y - b.y));
  }));
  const most = robots.length > 60 ? 8 : 13;
  return Math.min(most * unit(), Math.max(SHARE * least, 2.5 * unit()));
};

export const placed = (group, robot, radius) => {
  group.setAttribute("transform", `translate(${robot.x} ${robot.y})`);
  group.classList.toggle("wrong", robot.wrong);
  group.dataset.x = robot.x;
  group.dataset.y = robot.y;
  const state = robot.wrong ? "not as the contract demands" : "as the contract demands";
  group.setAttribute(
    "aria-label", `Robot ${robot.id} at ${Math.round(robot.x)}, ${Math.round(robot.y)}, ${state}`,
  );
  if (radius) group.querySelector(".disc").setAttribute("r", radius);
};

const robotGroup = (robot, radius, worst) => {
  const group = s("g", { class: "robot", tabindex: 0, role: "button", "data-number": robot.number });
  const size = Math.min(radius * 1.15, 13 * unit());
  if (worst) group.append(s("circle", { class: "worst", r: radius + 4 * unit() }));
  group.append(s("circle", { class: "reach", r: Math.max(radius, 16 * unit()) }));
  if (robot.heading !== null) {
    const turn = `rotate(${robot.heading})`;
    group.append(s("path", { class: "nose", transform: turn, d: `M0 0H${2.1 * radius}` }));
  }
  group.append(s("circle", { class: "disc", r: radius }));
  group.append(s("text", { "font-size": size, dy: "0.35em" }, robot.id));
  placed(group, robot);
  return group;
};

const arrow = ({ from, x, y }, radius) => {
  const [dx, dy] = [x - from[0], y - from[1]], way = Math.hypot(dx, dy);
  if (way < 2 * radius) return null;
  const share = 1 - radius / way, end = [from[0] + dx * share, from[1] + dy * share];
  return s("path", { class: "arrow", d: `M${from.join(" ")}L${end.join(" ")}`, "marker-end": "url(#head)" });
};

const thing = (found, kind, name) => s(
  "path", { class: kind, d: path(found.rings) }, s("title", {}, name ?? `${found.id}: ${found.label}`),
);

export const draw = () => {
  if (!app.scene || !seen) return;
  const { plan, targets, keep_out: kept, met } = app.scene;
  layers.areas.replaceChildren(...(plan?.areas ?? []).map((rings) => s("path", { class: "area", d: path(rings) })));
  layers.things.replaceChildren(
    ...kept.map((found) => thing(found, "off")),
    ...met.map((found) => thing(found, "met", `${found.label}: robots stand on it, drive over it or go a long way round it`)),
    ...targets.map((found) => thing(found, "target", `${found.id}: ${found.label}, confidence ${found.confidence}`)),
  );
  // A disc does not reach onto what its robot keeps off.
  const off = Math.min(...(plan?.groups ?? []).map((group) => group.nearest_px ?? Infinity));
  const robots = plan?.robots ?? [], radius = Math.min(radiusOf(robots), Math.max(0.9 * off, 2.5 * unit())), single = robots.length <= MOST_DRAGGED;
  const body = plan?.radius ?? 0;
  layers.arrows.replaceChildren(
    ...(body ? robots.map((robot) => s("circle", { class: "body", cx: robot.x, cy: robot.y, r: body })) : []),
    ...(app.moving || plan?.arrival ? [] : robots.filter((robot) => robot.from).map((robot) => arrow(robot, radius))).filter(Boolean),
  );
  const focused = document.activeElement?.closest?.(".robot")?.dataset.number;
  layers.robots.replaceChildren(...(single
    ? robots.map((robot) => robotGroup(robot, radius, plan.worst?.robot === robot.id))
    : [s("path", {
        class: "places",
        d: robots.map(({ x, y }) => `M${x - radius} ${y}a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0`).join(""),
      })]));
  if (focused) layers.robots.querySelector(`[data-number="${focused}"]`)?.focus();
  drawMotion();
};

// Observed robots are drawn on a canvas: ten thousand of them still move smoothly.
const trails = new Map();
const TRAIL = 400;

export const drawMotion = () => {
  const scale = window.devicePixelRatio || 1, [width, height] = [svg.clientWidth, svg.clientHeight];
  if (canvas.width !== width * scale || canvas.height !== height * scale) {
    [canvas.width, canvas.height] = [width * scale, height * scale];
  }
  const ink = canvas.getContext("2d");
  ink.setTransform(1, 0, 0, 1, 0, 0);
  ink.clearRect(0, 0, canvas.width, canvas.height);
  const robots = app.poses.length ? app.poses : app.scene?.robots ?? [];
  if (!robots.length || !seen || app.looking) return;
  const out = (scale * width) / seen[2];
  ink.setTransform(out, 0, 0, out, -seen[0] * out, -seen[1] * out);
  const radius = Math.min(5 * unit(), robots.length > MOST_DRAGGED ? 2.5 * unit() : radiusOf(robots));
  ink.lineWidth = 1.5 * unit();
  ink.strokeStyle = "rgba(255, 209, 26, .55)";
  ink.beginPath();
  if (robots.length <= MOST_DRAGGED) {
    for (const trail of trails.values()) trail.forEach(([x, y], i) => (i ? ink.lineTo(x, y) : ink.moveTo(x, y)));
  }
  ink.stroke();
  // One that stands at its place is seen there: its number stays legible.
  const places = new Map((app.moving ? [] : app.scene.plan?.robots ?? []).map((robot) => [robot.id, robot]));
  ink.beginPath();
  for (const { id, x, y } of robots) {
    const goal = places.get(id);
    if (goal && Math.hypot(goal.x - x, goal.y - y) < radius) continue;
    ink.moveTo(x + radius, y);
    ink.arc(x, y, radius, 0, 7);
  }
  ink.fillStyle = app.moving ? "#ffd11a" : "rgba(255, 255, 255, .85)";
  ink.fill();
  ink.lineWidth = unit();
  ink.strokeStyle = "#14181f";
  ink.stroke();
};

let due = false;
on("poses", () => {
  for (const { id, x, y } of app.poses) {
    const trail = trails.get(id) ?? trails.set(id, []).get(id);
    trail.push([x, y]);
    if (trail.length > TRAIL) trail.shift();
  }
  if (due) return;
  due = true;
  requestAnimationFrame(() => ((due = false), drawMotion()));
});
// The ways that the robots are to take, from the approval on until they are there.
on("paths", (paths) => layers.paths.replaceChildren(...Object.values(paths).map((points) => s(
  "path", { class: "path", d: `M${points.map((point) => point.join(" ")).join("L")}` },
))));
on("moving", () => (app.moving && trails.clear(), draw()));
on("scene", () => (layers.paths.replaceChildren(), draw()));
on("picture", () => {
  const [width, height] = size();
  layers.picture.replaceChildren(
    s("defs", {}, s("marker", {
      id: "head", viewBox: "0 0 8 8", refX: 6, refY: 4, markerWidth: 5, markerHeight: 5, orient: "auto-start-reverse",
    }, s("path", { d: "M0 0L8 4L0 8z" }))),
    s("image", { href: app.picture, x: -0.5, y: -0.5, width, height, preserveAspectRatio: "none" }),
  );
  trails.clear();
  fit();
});
// A view that shows the whole picture goes on doing so; another keeps its middle.
new ResizeObserver(() => {
  if (!app.scene || !seen) return;
  if (fitted) return fit();
  const tall = (seen[2] * svg.clientHeight) / Math.max(svg.clientWidth, 1);
  look([seen[0], seen[1] + (seen[3] - tall) / 2, seen[2], tall]);
}).observe(svg);

// Looking around: the wheel, two fingers, and dragging where nothing else is.
svg.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(Math.sign(event.deltaY) * 0.15), place(event));
}, { passive: false });
byId("zoom-in").onclick = () => zoom(0.8);
byId("zoom-out").onclick = () => zoom(1.25);
byId("zoom-fit").onclick = fit;

const fingers = new Map();
let apart = 0;
export const pinching = () => fingers.size > 1;
svg.addEventListener("pointerdown", (event) => fingers.set(event.pointerId, event));
svg.addEventListener("pointermove", (event) => {
  if (!fingers.has(event.pointerId)) return;
  fingers.set(event.pointerId, event);
  if (fingers.size !== 2) return;
  const [a, b] = [...fingers.values()];
  const now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
  const middle = { clientX: (a.clientX + b.clientX) / 2, clientY: (a.clientY + b.clientY) / 2 };
  if (apart) zoom(apart / now, place(middle));
  apart = now;
});
for (const name of ["pointerup", "pointercancel"]) {
  window.addEventListener(name, (event) => (fingers.delete(event.pointerId), (apart = 0)));
}

// A press that is followed until it ends: `move` and `end` get the event and whether it was a click.
export const pressed = (down, { move, end, cancel }) => {
  const from = [down.clientX, down.clientY];
  let far = false;
  const ending = new AbortController();
  const on = (name, listener) => window.addEventListener(name, listener, { signal: ending.signal });
  on("pointermove", (event) => {
    if (event.pointerId !== down.pointerId) return;
    far ||= Math.hypot(event.clientX - from[0], event.clientY - from[1]) > NUDGE;
    if (far && !pinching()) move?.(event);
  });
  on("pointerup", (event) => {
    if (event.pointerId !== down.pointerId) return;
    ending.abort();
    end?.(event, !far);
  });
  const off = (event) => {
    if (event.type === "keydown" && event.key !== "Escape") return;
    ending.abort();
    cancel?.();
  };
  on("pointercancel", off);
  on("keydown", off);
};

export const panned = (down) => {
  let last = place(down);
  pressed(down, {
    move: (event) => {
      const now = place(event);
      pan(now[0] - last[0], now[1] - last[1]);
      last = place(event);
    },
  });
};
