// Robots under a hand, by mouse, touch or arrow keys: each place is certified as it comes, and what
// is let go of becomes an edit like any other.
import { call } from "./api.js";
import { app, at, clear, fail, on, tell, turn } from "./app.js";
import { announce, byId, latest } from "./dom.js";
import { draw, layer, place, placed, pressed, unit } from "./picture.js";

const REST = 1200; // ms after the last arrow key
const STEP = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

// What is tried: edits of the plan that stands, and what their certificate would say.
let trial = null;

const edits = (number, to) => {
  const stays = byId("snap").checked ? "near" : "there";
  return [{ kind: "place", robot: number, to: to.map((v) => Math.round(v * 1000) / 1000), stays }];
};

export const tried = latest(async (wanted, done) => {
  try {
    const found = await call("POST", at("/preview"), { json: { edits: wanted } });
    if (trial !== wanted) return;
    for (const robot of found.robots) {
      const group = layer("robots").querySelector(`[data-number="${robot.number}"]`);
      if (group) placed(group, robot);
    }
    tell("tried", found);
    done?.(found);
  } catch (problem) {
    if (trial === wanted) fail("stage-problem", problem);
  }
});

export const begin = (wanted, done) => {
  clear("stage-problem");
  trial = wanted;
  tried(wanted, done);
};

export const drop = () => {
  trial = null;
  tell("tried", null);
  draw();
};

export const commit = latest(async (wanted) => {
  trial = null;
  const state = await turn("plan-problem", "/edits", { edits: wanted });
  tell("tried", null);
  if (!state) draw();
  else announce(state.message);
});

// As it was shown last, without its group.
const free = ([{ kind, robot, to }], { robots }) => {
  const shown = robots.find((one) => one.number === robot);
  return [{ kind, robot, to: shown ? [shown.x, shown.y] : to }];
};

const usable = () => app.scene.plan && !app.reading && !app.looking && !app.busy && !app.scene.plan.void;

export const pressedRobot = (down) => {
  const group = down.target.closest(".robot");
  if (!group || !usable()) return false;
  down.preventDefault();
  group.focus();
  const number = +group.dataset.number, start = place(down);
  const from = [+group.dataset.x, +group.dataset.y];
  let wanted = null, last = null;
  pressed(down, {
    move: (event) => {
      const now = place(event);
      const to = [from[0] + now[0] - start[0], from[1] + now[1] - start[1]];
      if (!byId("snap").checked) group.setAttribute("transform", `translate(${to.join(" ")})`);
      begin((wanted = edits(number, to)), (found) => (last = found));
    },
    end: () => wanted && settle(wanted, last),
    cancel: drop,
  });
  return true;
};

// Where the contract no longer holds, the robot stands by itself, and the plan says so.
const settle = (wanted, last) => {
  if (trial !== wanted) return drop();
  return commit(last && !last.certified ? free(wanted, last) : wanted);
};

// A plan that another page has changed meanwhile is not dragged on.
let planned = null;
on("scene", () => {
  const now = app.scene.plan?.id ?? null;
  if (trial && now !== planned) {
    trial = null;
    announce("The plan was changed elsewhere; nothing was moved here.");
  }
  planned = now;
});

let resting = null, keyed = null;
layer("robots").addEventListener("keydown", (event) => {
  const group = event.target.closest(".robot"), step = STEP[event.key];
  if (!group || !usable()) return;
  if (event.key === "Enter" && keyed) return rest();
  if (event.key === "Escape" && keyed) return leave();
  if (!step) return;
  event.preventDefault();
  const number = +group.dataset.number, far = (event.shiftKey ? 10 : 1) * 2 * unit();
  if (keyed?.number !== number) keyed = { number, to: [+group.dataset.x, +group.dataset.y], last: null };
  keyed.to = keyed.to.map((v, i) => v + step[i] * far);
  const mine = keyed;
  begin((keyed.edits = edits(number, keyed.to)), (found) => (mine.last = found));
  clearTimeout(resting);
  resting = setTimeout(rest, REST);
});

const leave = () => {
  clearTimeout(resting);
  keyed = null;
  drop();
};

const rest = () => {
  clearTimeout(resting);
  const mine = keyed;
  keyed = null;
  if (mine) settle(mine.edits, mine.last);
};
