// The plan that stands: its certificate in words, sliders that it follows, earlier plans, approval.
import { call, newKey } from "./api.js";
import { app, at, clear, fail, on, refresh, tell, turn } from "./app.js";
import { begin, commit } from "./dragging.js";
import { announce, byId, h, readable, s } from "./dom.js";
import { MOST_DRAGGED } from "./picture.js";

const certificate = byId("certificate"), sliders = byId("sliders"), strip = byId("strip");
const MOST_GROUPS = 4;
const REST = 350; // ms after the last step of a slider

const lines = (texts, kind) => texts.map((text) => h("p", { className: kind }, text));

const seconds = (value) => (value < 90 ? `${value.toFixed(0)} s` : `${(value / 60).toFixed(1)} min`);

const metres = () => app.scene.metres_per_pixel;
const length = (px) => (metres() ? `${(px * metres()).toFixed(2)} m` : `${px.toFixed(0)} px`);

const way = ({ motion }) => motion && motion.makespan_s > 0
  ? `The longest path is ${length(motion.longest_px)}, ${seconds(motion.makespan_s)}.` : "";

const told = (found) => {
  const { plan } = app.scene, shown = found ?? plan;
  const badge = plan.void ? ["wrong", "void"] : shown.partial ? ["partial", "partial"]
    : shown.certified ? ["certified", "certified"] : ["wrong", "not certified"];
  if (plan.void) {
    const why = "The picture, or what the plan is about, has changed since. Say what to do now.";
    return certificate.replaceChildren(h("p", {}, h("strong", { className: "badge wrong" }, "void"), ` ${why}`));
  }
  const worst = plan.worst && !found ? [`nearest is robot ${plan.worst.robot}, ${plan.worst.text}`] : [];
  certificate.replaceChildren(
    h("p", {}, h("strong", { className: `badge ${badge[0]}` }, badge[1]), " ",
      `${shown.robots.length} robots`, ...[...(found ? [] : plan.measures), ...worst].map((text) => `; ${text}`)),
    ...(shown.partial ? lines([shown.partial], "partial") : []),
    ...lines(shown.findings, "bad"),
    ...(found ? [] : lines([...plan.notes, way(plan)].filter(Boolean), "soft")),
    ...(found ? [] : arrived(plan)),
    ...(found || !plan.groups.length ? [] : [h("details", {}, h("summary", {}, "Contract"),
      h("pre", { tabIndex: 0 }, JSON.stringify(plan.groups.map(({ nearest_px: _, ...group }) => group), null, 1)))]),
  );
};

const arrived = ({ arrival }) => {
  if (!arrival) return [];
  const worst = Math.max(0, ...arrival.residual_px);
  return lines([arrival.arrived
    ? `All robots were seen at their places; the furthest is ${worst.toFixed(1)} px off.`
    : `Not all have arrived: ${arrival.reason ?? arrival.ended}.`], arrival.arrived ? "good" : "bad");
};

// A slider tries as it moves and changes the plan once it is let go of.
let resting = 0;
const slider = (name, { value, least, most, step, edit }) => {
  const output = h("output", {}, String(value));
  return h("label", {}, `${name} `, h("input", {
    type: "range", min: least, max: most, step, value, ariaLabel: name,
    oninput: ({ target }) => {
      output.value = target.value;
      begin([edit(+target.value)], (found) => tell("tried", found));
    },
    onchange: ({ target }) => {
      clearTimeout(resting);
      resting = setTimeout(() => commit([edit(+target.value)]), REST);
    },
  }), " ", output);
};

const slidersOf = (group, number) => {
  const { width, height } = app.scene.picture, among = app.scene.plan.groups.length > 1;
  const name = among ? ` of group ${number}` : "", more = among ? { group: number } : {};
  const found = [];
  if (group.nearest_px !== undefined && !group.radius) {
    const scale = metres() ?? 1, rounded = (px) => +(px * scale).toPrecision(3);
    found.push(slider(`Distance${name}, ${metres() ? "m" : "px"}`, {
      value: rounded(group.nearest_px), least: rounded(1), most: rounded(Math.max(width, height) / 5), step: rounded(metres() ? 1 : 0.5),
      edit: (value) => ({ kind: "distance", px: value / scale, ...more }),
    }));
  }
  if (group.relation !== "at") {
    found.push(slider(`Robots${name}`, {
      value: group.robots, least: 1, most: Math.max(24, 2 * group.robots), step: 1,
      edit: (robots) => ({ kind: "count", robots, ...more }),
    }));
  }
  return found;
};

const thumbnail = (plan) => {
  const { width, height } = app.scene.picture, r = Math.max(width, height) / 45;
  return s("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": true },
    plan.void ? null : s("image", { href: app.picture, width, height }),
    ...plan.points.slice(0, MOST_DRAGGED).map(([cx, cy]) => s("circle", { cx, cy, r })));
};

const drawStrip = () => strip.replaceChildren(...app.scene.plans.map((plan) => {
  const here = plan.id === (app.looking ?? app.scene.current);
  return h("li", {}, h("button", {
    type: "button", className: here ? "here" : "", title: readable(plan.words), ariaCurrent: here ? "true" : "false",
    ariaLabel: `Plan ${plan.id}: ${readable(plan.words)}${plan.void ? ", void" : plan.certified ? "" : ", not certified"}`,
    onclick: () => lookAt(plan.id),
  }, thumbnail(plan)));
}));

const lookAt = (id) => {
  app.looking = id === app.scene.current ? null : id;
  refresh().catch((problem) => fail("plan-problem", problem));
};

const backed = () => turn("plan-problem", "/undo", { to: app.looking });

const forked = async () => {
  try {
    const made = await call("POST", at("/forks"), { json: { turn: app.turns.get(app.looking) ?? null } });
    tell("open", { id: made.id });
  } catch (problem) {
    fail("plan-problem", problem);
  }
};

on("tried", (found) => app.scene?.plan && told(found));
on("scene", () => {
  const { plan } = app.scene;
  clear("plan-problem");
  byId("plan").hidden = !plan;
  strip.hidden = app.scene.plans.length < 2;
  if (!plan) return;
  told(null);
  drawStrip();
  if (app.looking) {
    sliders.replaceChildren(h("p", { className: "row" }, "This is an earlier plan. ",
      h("button", { type: "button", onclick: backed }, "Go back to it"),
      h("button", { type: "button", onclick: forked }, "Go on from it in a session of its own"),
      h("button", { type: "button", onclick: () => lookAt(app.scene.current) }, "Close")));
  } else {
    const focused = sliders.contains(document.activeElement) && document.activeElement.ariaLabel;
    sliders.replaceChildren(...(plan.void || app.reading ? [] : plan.groups.slice(0, MOST_GROUPS).flatMap((g, i) => slidersOf(g, i + 1))));
    if (focused) sliders.querySelector(`[aria-label="${focused}"]`)?.focus();
  }
  usable();
});

const usable = () => {
  const ready = app.scene?.plan && !app.busy && !app.looking && !app.moving;
  byId("go").disabled = !ready || app.scene.plan.void || !app.scene.plan.certified;
  const may = ["move", "approve"].includes(app.state?.scope);
  byId("go").hidden = !may;
  byId("may-not").hidden = may;
  byId("may-not").textContent = `Your token has the scope ${app.state?.scope}; moving the robots needs move.`;
  byId("go").textContent = app.state?.waits ? "Approve …" : "Move the robots …";
  for (const name of ["undo", "redo"]) byId(name).disabled = app.busy || app.moving;
  for (const input of sliders.querySelectorAll("input")) input.disabled = app.moving;
};
on("busy", usable);

byId("undo").onclick = () => turn("plan-problem", "/undo", { steps: 1 });
byId("redo").onclick = () => turn("plan-problem", "/undo", { steps: -1 });

// The approval names what is to be moved, how far, and what is not certain.
const dialog = byId("approval");
export const approve = () => {
  const { plan } = app.scene, { waits } = app.state, count = plan.robots.length;
  const unsure = [...plan.notes, ...(plan.partial ? [plan.partial] : [])];
  const doubted = app.scene.targets.filter((found) => found.confidence < 0.7);
  unsure.push(...doubted.map((found) => `The outline of ${found.id} is known with confidence ${found.confidence} only.`));
  byId("approval-text").replaceChildren(
    h("p", {}, `Plan ${waits?.plan_id ?? plan.id}: ${count} ${count === 1 ? "robot" : "robots"}. ${way(plan)}`),
    ...(waits ? lines([waits.message], "") : []),
    ...(unsure.length ? [h("p", {}, "Not certain:"), h("ul", {}, ...unsure.map((text) => h("li", {}, text)))] : []),
  );
  byId("approve").textContent = `Move ${count} ${count === 1 ? "robot" : "robots"}`;
  dialog.returnValue = "no";
  dialog.showModal();
  call("GET", at(`/plans/${waits?.plan_id ?? plan.id}/paths`)).then((paths) => tell("paths", paths), () => {});
};
byId("go").onclick = approve;
dialog.addEventListener("close", async () => {
  if (dialog.returnValue !== "yes") return;
  const { plan } = app.scene, { waits } = app.state;
  clear("plan-problem");
  try {
    if (waits) await call("POST", at("/approvals"), { json: { plan_id: waits.plan_id, nonce: waits.nonce } });
    else await call("POST", at("/deployments"), { json: { plan_id: plan.id }, key: newKey() });
    announce("The robots move.");
  } catch (problem) {
    fail("plan-problem", problem);
  }
});
