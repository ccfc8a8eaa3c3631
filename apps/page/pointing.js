// Pointing at things: a click, a box, a lasso or a polygon shows the outline at once, with how sure
// it is; points on it and off it correct it. The next words are about what was pointed at.
import { call } from "./api.js";
import { app, at, clear, fail, on, tell } from "./app.js";
import { announce, byId, h, latest, path, s } from "./dom.js";
import { layer, panned, pinching, place, pressed, unit } from "./picture.js";
import { pressedRobot } from "./dragging.js";

const svg = byId("scene"), tools = byId("tools"), hint = byId("hint");
const MOST_CORNERS = 150;
const HINTS = {
  point: "Click on the thing; what lights up was found already.",
  box: "Draw a box around the thing.",
  lasso: "Draw around the thing.",
  polygon: "Click corner after corner; double-click, or press Enter, to end.",
  plus: "Click on what belongs to it and was left out.",
  minus: "Click on what does not belong to it.",
};
let tool = "move", corners = [];

const show = (text) => {
  hint.textContent = text ?? "";
  hint.hidden = !text;
};

export const choose = (name) => {
  if ((name === "plus" || name === "minus") && !app.pointed.length) return;
  tool = name;
  corners = [];
  layer("drawing").replaceChildren();
  for (const button of tools.querySelectorAll("[data-tool]")) {
    button.setAttribute("aria-pressed", String(button.dataset.tool === name));
  }
  svg.dataset.tool = name;
  show(HINTS[name]);
  if (app.scene) drawPointed();
};

const nextId = () => {
  const used = [...(app.scene?.targets ?? []), ...app.pointed.map((one) => one.prompt)].map((one) => +one.id.slice(1));
  return `t${Math.max(0, ...used) + 1}`;
};

const rounded = (point) => point.map((v) => Math.round(v * 10) / 10);

const measure = async (prompt) => {
  clear("stage-problem");
  show("Measuring …");
  try {
    const outline = await call("POST", at("/outline"), { json: { prompt } });
    const before = app.pointed.find((one) => one.prompt.id === prompt.id);
    const others = app.pointed.filter((one) => one !== before);
    app.pointed = [...others, { prompt, outline, off: before?.off ?? false }];
    const sure = outline.sound ? "" : `, too little: ${outline.threshold} is needed`;
    announce(`Outlined ${prompt.id}, confidence ${outline.confidence}${sure}.`);
  } catch (problem) {
    fail("stage-problem", problem);
  }
  show(HINTS[tool]);
  tell("pointed");
};
const outlined = latest(measure);

const pointAt = (way) => outlined({ id: nextId(), ...way });

// Points correct what was drawn; of a thing that was found, its outline is.
const corrected = (kind, point) => {
  const { prompt: { candidate, ...prompt }, outline } = app.pointed.at(-1);
  if (candidate) prompt.outline = thinned(outline.rings[0].slice(0, -1));
  outlined({ ...prompt, [kind]: [...(prompt[kind] ?? []), rounded(point)] });
};

const drawn = (points, closed) => layer("drawing").replaceChildren(
  s("path", { class: "sketch", d: `M${points.map((p) => p.join(" ")).join("L")}${closed ? "Z" : ""}` }),
);

const thinned = (points) => {
  const step = Math.max(1, Math.ceil(points.length / MOST_CORNERS));
  return points.filter((_, i) => i % step === 0).map(rounded);
};

const boxed = (down) => {
  const [x, y] = place(down);
  let box = null;
  pressed(down, {
    move: (event) => {
      const [u, v] = place(event);
      box = [Math.min(x, u), Math.min(y, v), Math.max(x, u), Math.max(y, v)];
      drawn([[box[0], box[1]], [box[2], box[1]], [box[2], box[3]], [box[0], box[3]]], true);
    },
    end: () => (layer("drawing").replaceChildren(), box && pointAt({ box: rounded(box) })),
    cancel: () => layer("drawing").replaceChildren(),
  });
};

const lassoed = (down) => {
  const line = [place(down)];
  pressed(down, {
    move: (event) => (line.push(place(event)), drawn(line, true)),
    end: () => {
      layer("drawing").replaceChildren();
      if (line.length > 3) pointAt({ outline: thinned(line) });
    },
    cancel: () => layer("drawing").replaceChildren(),
  });
};

const cornered = (down) => {
  pressed(down, {
    end: (event) => {
      const point = place(event), last = corners.at(-1);
      const again = last && Math.hypot(point[0] - last[0], point[1] - last[1]) < 6 * unit();
      if (!again) corners.push(point);
      drawn(corners, corners.length > 2);
      if (again && corners.length > 2) closePolygon();
    },
  });
};

const closePolygon = () => {
  const outline = corners.map(rounded);
  corners = [];
  layer("drawing").replaceChildren();
  if (outline.length > 2) pointAt({ outline });
};

svg.addEventListener("pointerdown", (down) => {
  if (down.button !== 0 || pinching() || !app.scene) return;
  const option = down.target.closest(".option");
  if (option) return;
  if (tool === "move") return pressedRobot(down) || panned(down);
  down.preventDefault();
  if (tool === "box") return boxed(down);
  if (tool === "lasso") return lassoed(down);
  if (tool === "polygon") return cornered(down);
  pressed(down, {
    end: (event, click) => {
      if (!click) return;
      const point = place(event);
      const found = down.target.closest(".thing");
      if (tool === "point") pointAt(found ? { candidate: found.dataset.id } : { points: [rounded(point)] });
      else corrected(tool === "plus" ? "points" : "negative", point);
    },
    move: () => {},
  });
});

tools.addEventListener("click", (event) => {
  const chosen = event.target.closest("[data-tool]");
  if (chosen) choose(chosen.dataset.tool);
});

export const toolKeys = { v: "move", p: "point", b: "box", l: "lasso", g: "polygon", "+": "plus", "-": "minus" };
export const drawingKey = (key) => {
  if (tool === "polygon" && key === "Enter") closePolygon();
  if (key === "Escape") choose("move");
};

const forget = (id) => {
  app.pointed = app.pointed.filter((one) => one.prompt.id !== id);
  tell("pointed");
};

const keptOff = (one, off) => {
  one.off = off;
  tell("pointed");
};

on("pointed", () => {
  if (!app.pointed.length && (tool === "plus" || tool === "minus")) choose("move");
  for (const name of ["plus", "minus"]) tools.querySelector(`[data-tool=${name}]`).disabled = !app.pointed.length;
  byId("pointed").replaceChildren(...app.pointed.map(chip));
  drawPointed();
});

const chip = (one) => {
  const { prompt: { id }, outline: { confidence, sound, threshold }, off } = one;
  const away = h("input", { type: "checkbox", checked: off, onchange: ({ target }) => keptOff(one, target.checked) });
  return h("li", { className: sound ? "chip" : "chip doubted" },
    `${id}: confidence ${confidence.toFixed(2)}`,
    sound ? "" : ` (${threshold.toFixed(2)} is needed: draw around it, or correct it)`,
    h("label", { title: "No robot stands on it or drives over it" }, away, " keep off"),
    h("button", { type: "button", ariaLabel: `Forget ${id}`, onclick: () => forget(id) }, "×"));
};

const area = (ring) => Math.abs(ring.reduce((sum, [x, y], i) => {
  const [u, v] = ring[(i + 1) % ring.length];
  return sum + x * v - u * y;
}, 0));

// What stands out lights up under the pointer before it is clicked on; the smallest lies on top.
const found = () => (tool !== "point" ? [] : [...app.things]
  .sort((a, b) => area(b.rings[0]) - area(a.rings[0]))
  .map((one) => s("path", {
    class: "thing", "data-id": one.id, d: path(one.rings), tabindex: 0, role: "button",
    "aria-label": `Point at ${one.id}: ${one.label}`,
    onkeydown: (event) => event.key === "Enter" && pointAt({ candidate: one.id }),
  })));

const drawPointed = () => {
  const r = 4 * unit();
  const marks = (points, kind) => (points ?? []).map(([cx, cy]) => s("circle", { class: kind, cx, cy, r }));
  layer("options").replaceChildren(
    ...found(),
    ...app.pointed.flatMap(({ prompt, outline, off }) => [
      s("path", { class: `pointed${outline.sound ? "" : " doubted"}${off ? " kept-off" : ""}`, d: path(outline.rings) }),
      ...marks(prompt.points, "plus"), ...marks(prompt.negative, "minus"),
    ]),
    ...asked().map(option),
  );
};

// What an open question offers, as numbered places on the picture.
const asked = () => {
  const last = app.state?.last;
  if (last?.status !== "question" || app.pointed.length) return [];
  return last.candidates ?? [];
};

const option = (choice) => {
  const found = [...(app.scene?.targets ?? []), ...app.things].find((one) => one.id === choice.id);
  const [x0, y0, x1, y1] = choice.box;
  const answer = () => tell("answer", choice.id);
  return s("g", {
    class: "option", tabindex: 0, role: "button", "aria-label": `${choice.id}: ${choice.label ?? ""}`,
    onclick: answer, onkeydown: (event) => event.key === "Enter" && answer(),
  },
  s("path", { d: found ? path(found.rings) : `M${x0} ${y0}H${x1}V${y1}H${x0}Z` }),
  s("circle", { cx: (x0 + x1) / 2, cy: (y0 + y1) / 2, r: 13 * unit() }),
  s("text", { x: (x0 + x1) / 2, y: (y0 + y1) / 2, dy: "0.35em", "font-size": 14 * unit() }, choice.id.slice(1)));
};

on("point", measure);
on("scene", drawPointed);
on("things", drawPointed);
on("picture", () => {
  app.pointed = [];
  choose("move");
  tell("pointed");
});
export { asked };
