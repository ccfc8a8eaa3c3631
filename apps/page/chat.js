// What was said, step by step, from the session's events; and where the next words are written.
import { app, on, tell, turn } from "./app.js";
import { announce, byId, h, readable } from "./dom.js";
import { asked } from "./pointing.js";

const log = byId("log"), words = byId("words");
const STEPS = {
  locate_object: "Looking for things", segment: "Measuring an outline", describe_shape: "Describing a shape",
  propose_formation: "Placing and certifying", edit_formation: "Changing the plan", undo: "Going back",
  deploy: "Moving the robots", measure: "Measuring", ask_user: "Asking", look: "Looking",
};
const EDITS = {
  place: ({ robot, stays }) => `Robot ${robot} moved${stays ? "" : ", by itself"}`,
  distance: ({ px }) => `Distance ${px} px`,
  count: ({ robots }) => `${robots} robots`,
};
let current = null; // the turn that is being told

const bottom = () => (log.scrollTop = log.scrollHeight);

const said = (who, text, kind = "") => h(
  "p", { className: `said ${kind}` }, h("span", { className: "who" }, who), text,
);

// Arguments of a call; those of a person's own edits say what was done.
const called = (text) => {
  current.steps.lastChild.title = text.slice(0, 2000);
  if (!current.words?.startsWith("/edit")) return;
  const { edits = [] } = JSON.parse(text);
  const done = edits.map((edit) => EDITS[edit.kind]?.(edit) ?? edit.kind).join(", ");
  reword(done);
};

const reword = (text) => {
  current.words ??= text;
  current.item.querySelector(".said").lastChild.textContent = text;
};

const begun = ({ runId, input }) => {
  const steps = h("ol"), details = h("details", { hidden: true }, h("summary", {}, "Steps"), steps);
  const item = h("li", { id: `turn-${runId}` }, said("You", readable(input.words ?? "…")), details);
  current = { item, steps, details, words: input.words };
  log.append(item);
  bottom();
};

const step = (text, title) => {
  current.details.hidden = false;
  current.steps.append(h("li", { title: title ?? "" }, text));
  current.details.querySelector("summary").textContent = `Steps (${current.steps.children.length})`;
};

const ended = (status, message) => {
  const kind = { question: "question", impossible: "bad", failed: "bad", stopped: "bad", needs_approval: "question" };
  current.item.append(said("formup", message, kind[status] ?? "good"));
  current.item.dataset.status = status;
  bottom();
};

// Each kind of event: what it adds to the log, and what it says of the session.
const TOLD = {
  RUN_STARTED: begun,
  TOOL_CALL_START: ({ toolCallName }) => step(STEPS[toolCallName] ?? toolCallName),
  TOOL_CALL_ARGS: ({ delta }) => called(delta),
  // A turn that goes on after a question or an approval begins with the answer.
  TOOL_CALL_RESULT: ({ content }) => current.words ?? reword(content),
  CUSTOM: ({ name }) => name === "approval" && reword("Yes"),
  RUN_FINISHED: ({ result }) => ended(result.status, result.message),
  RUN_ERROR: ({ code, message }) => ended(code, message),
};

let count = 0;
export const reset = () => {
  log.replaceChildren();
  [current, count] = [null, 0];
  app.turns = new Map();
};

export const told = (event, live) => {
  if (event.type === "RUN_STARTED" && event.input.words !== null) count++; // answers go on with a turn
  if (event.name === "world") {
    for (const id of Object.keys(event.value.changes?.plans?.items ?? {})) {
      if (!app.turns.has(id)) app.turns.set(id, count);
    }
  }
  if (current || event.type === "RUN_STARTED") TOLD[event.type]?.(event);
  if (live && event.type === "RUN_FINISHED") announce(event.result.message);
  if (live && event.type === "RUN_ERROR") announce(event.message);
};

export const say = async (text) => {
  const those = (off) => app.pointed.filter((one) => one.off === off).map((one) => one.prompt);
  const doubted = app.pointed.find((one) => !one.outline.sound);
  if (doubted) {
    const problem = `${doubted.prompt.id} is not outlined surely enough: draw around it, correct it, or forget it.`;
    byId("problem").textContent = problem;
    byId("problem").hidden = false;
    return void (words.value ||= text);
  }
  const done = await turn("problem", "/messages", { words: text, pointed: those(false), keep_out: those(true) });
  if (!done) return void (words.value ||= text);
  app.pointed = [];
  tell("pointed");
};

byId("composer").addEventListener("submit", (event) => {
  event.preventDefault();
  const text = words.value.trim();
  if (!text || (app.busy && !app.moving)) return;
  words.value = "";
  keep();
  say(text);
});

words.addEventListener("keydown", (event) => {
  if (event.key !== "Enter" || event.shiftKey || event.isComposing) return;
  event.preventDefault();
  byId("composer").requestSubmit();
});

// What was written or pointed at and not yet sent is there again after a reload.
const draft = () => `formup-draft-${app.session}`;
const keep = () => {
  const kept = { words: words.value, pointed: app.pointed.map((one) => one.prompt) };
  if (app.session) sessionStorage.setItem(draft(), JSON.stringify(kept));
};
export const drafted = () => JSON.parse(sessionStorage.getItem(draft()) ?? "{}");
words.addEventListener("input", keep);
on("pointed", () => app.scene && keep());

on("answer", say);
on("busy", () => {
  byId("send").disabled = app.busy && !app.moving;
  byId("talk").toggleAttribute("aria-busy", app.busy);
});
on("scene", () => {
  const { last } = app.state ?? {}, open = last?.status === "question" ? last.options ?? [] : [];
  const choices = [
    ...asked().map((choice) => [choice.id, `${choice.id}: ${choice.label ?? ""}`]), ...open.map((text) => [text, text]),
  ];
  byId("options").replaceChildren(...choices.map(([answer, text]) => h(
    "button", { type: "button", onclick: () => say(answer) }, text,
  )));
  words.placeholder = app.scene.plan ? "A bit further out; robot 3 to the left; go" : "Surround the largest coin with 8 robots";
});
