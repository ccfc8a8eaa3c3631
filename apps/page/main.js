// The page as a whole: which session is open, what its events mean, keys, light and dark.
import { Problem, call, fetched, follow, lookWith } from "./api.js";
import { NARROW, app, at, clear, fail, on, refresh, stop, tell, turn } from "./app.js";
import { drafted, reset, told } from "./chat.js";
import { announce, byId, h, readable } from "./dom.js";
import { choose, drawingKey, toolKeys } from "./pointing.js";
import "./plan.js";
import { received, start } from "./start.js";

let leave = null;

const open = async ({ id: session, words, pointed }) => {
  leave?.();
  reset();
  Object.assign(app, { session, state: null, scene: null, looking: null, pointed: [], poses: [], moving: false });
  if (!app.reading && location.hash !== `#${session}`) history.pushState(null, "", `#${session}`);
  byId("start").hidden = true;
  for (const name of ["talk", "view", "share", "export", "stop"]) byId(name).hidden = false;
  clear("problem");
  const kept = drafted();
  try {
    await refresh();
  } catch (problem) {
    return gone(problem);
  }
  leave = follow(session, { event: happened, connected, gone });
  const begun = { words: "", pointed: [], ...kept, ...(words ? { words, pointed } : {}) };
  byId("words").value = begun.words;
  if (innerWidth > NARROW) byId("words").focus(); // on a phone the picture would be scrolled away
  begun.pointed.forEach((prompt) => tell("point", prompt));
};

// A session that is not there, or may not be seen, leads back to the start, which says so.
const gone = async (problem) => {
  leave?.();
  Object.assign(app, { session: null, scene: null, state: null });
  history.replaceState(null, "", "/");
  for (const name of ["share", "export", "stop"]) byId(name).hidden = true;
  byId("connection").textContent = "";
  await start();
  const missing = new Problem(404, { message: "That session is not here: it was deleted, or its address is wrong." });
  if (problem.status !== 401) fail("start-problem", problem.status === 404 ? missing : problem);
};

// Events up to the one that the page was opened at tell what was; later ones what happens now.
const happened = (event) => {
  const live = +(event.runId ?? 0) > (app.state?.events ?? 0);
  told(event, live);
  if (event.name === "poses") {
    app.poses = event.value.poses;
    return tell("poses");
  }
  if (event.name === "moving") moving(true);
  if (event.type === "RUN_STARTED") moving(false);
  if (event.type !== "RUN_FINISHED" && event.type !== "RUN_ERROR") return;
  moving(false);
  if (!app.busy) settled();
};

// Many events at once, as after a reload, are looked up once.
let settling = 0;
const settled = () => {
  clearTimeout(settling);
  settling = setTimeout(() => refresh().catch((problem) => fail("problem", problem)), 60);
};

const moving = (now) => {
  if (app.moving === now) return;
  app.moving = now;
  if (!now) app.poses = [];
  byId("stop").classList.toggle("urgent", now);
  tell("moving");
  tell("busy");
};

let lost = false;
const connected = (now) => {
  byId("connection").textContent = now ? "" : "Connection lost; trying again …";
  if (now) ["problem", "plan-problem"].forEach((place) => lost && clear(place));
  if (now && lost) settled();
  if (now !== !lost) announce(now ? "Connected again." : "Connection lost.");
  lost = !now;
};

on("open", open);
on("file", (file) => {
  if (!app.session || byId("view").hidden) return received(file);
  turn("problem", `/picture?name=${encodeURIComponent(file.name)}`, undefined, { method: "PUT", body: file, type: file.type });
});
on("scene", () => {
  const name = readable(app.state.last?.instruction ?? "");
  byId("name").textContent = name;
  document.title = name ? `${name} – formup` : "formup";
});

byId("stop").onclick = stop;
byId("export").onclick = async () => {
  try {
    const address = URL.createObjectURL(await fetched(at("/export")));
    h("a", { href: address, download: `formup-${app.session}.zip` }).click();
    setTimeout(() => URL.revokeObjectURL(address), 10_000);
  } catch (problem) {
    fail("problem", problem);
  }
};

byId("share").onclick = async () => {
  try {
    const { code } = await call("POST", at("/shares"));
    byId("link").value = `${location.origin}/#share=${code}`;
    byId("shared").showModal();
    byId("link").select();
  } catch (problem) {
    fail("problem", problem);
  }
};
byId("copy").onclick = () => {
  byId("link").select();
  navigator.clipboard?.writeText(byId("link").value);
};

const writing = () => /^(INPUT|TEXTAREA|SELECT)$/.test(document.activeElement?.tagName ?? "");
addEventListener("keydown", (event) => {
  if (byId("view").hidden) return;
  if (event.key === "Escape" && app.moving) return stop();
  if (document.querySelector("dialog[open]")) return;
  const redo = event.key === "y" || (event.shiftKey && event.key.toLowerCase() === "z");
  if ((event.ctrlKey || event.metaKey) && /^[zy]$/i.test(event.key) && !byId("words").value) {
    event.preventDefault();
    return turn("plan-problem", "/undo", { steps: redo ? -1 : 1 });
  }
  if (event.key === "Escape") drawingKey("Escape");
  if (writing() || event.ctrlKey || event.metaKey || event.altKey) return;
  if (toolKeys[event.key]) choose(toolKeys[event.key]);
  if (event.key === "Enter" && document.activeElement === document.body) drawingKey("Enter");
});

const SCHEMES = ["", "light", "dark"];
byId("scheme").onclick = () => {
  const now = document.documentElement.dataset.scheme ?? "";
  const next = SCHEMES[(SCHEMES.indexOf(now) + 1) % SCHEMES.length];
  document.documentElement.dataset.scheme = next;
  localStorage.setItem("formup-scheme", next);
};
document.documentElement.dataset.scheme = localStorage.getItem("formup-scheme") ?? "";

const routed = () => {
  const shared = location.hash.startsWith("#share=") ? location.hash.slice(7) : null;
  lookWith(shared);
  document.body.classList.toggle("reading", shared !== null);
  app.reading = shared !== null;
  const session = shared ? shared.split(".")[0] : location.hash.slice(1);
  if (session && session !== app.session) return open({ id: session });
  if (session) return undefined;
  leave?.();
  app.session = null;
  for (const name of ["share", "export", "stop"]) byId(name).hidden = true;
  return start();
};
addEventListener("popstate", routed);
addEventListener("hashchange", routed);
routed();
