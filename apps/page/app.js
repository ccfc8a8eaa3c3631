// What the page knows, in one place; parts of it are told when that changes.
import { Problem, call, fetched, newKey } from "./api.js";
import { announce, byId } from "./dom.js";

export const app = {
  session: null, // its id
  state: null, // as GET /sessions/ID has it
  scene: null, // as GET /sessions/ID/scene has it
  looking: null, // the id of an earlier plan that is looked at
  picture: null, // the address of the picture
  things: [], // what stands out in it
  pointed: [], // {prompt, outline}: what the next words point at
  turns: new Map(), // plan id -> how many turns led to it
  busy: false,
  reading: false, // whether it is only looked at, by a shared link
  moving: false,
  poses: [],
};

export const NARROW = 860; // px: below, the picture is above the conversation

const listeners = new Map();
export const on = (name, listener) => listeners.set(name, [...(listeners.get(name) ?? []), listener]);
export const tell = (name, value) => listeners.get(name)?.forEach((listener) => listener(value));

export const at = (path = "") => `/sessions/${app.session}${path}`;

// Errors stand where they arise, and are said.
export const fail = (place, problem) => {
  if (!(problem instanceof Problem)) throw problem;
  byId(place).textContent = problem.message;
  byId(place).hidden = false;
};

export const clear = (place) => (byId(place).hidden = true);

let refreshed = 0;
export const refresh = async () => {
  const mine = ++refreshed, session = app.session;
  const query = { plan: app.looking };
  const [state, scene] = await Promise.all([call("GET", at()), call("GET", at("/scene"), { query })]);
  if (mine !== refreshed || session !== app.session) return;
  const changed = app.scene?.picture.sha256 !== scene.picture.sha256;
  Object.assign(app, { state, scene });
  if (changed) await loadPicture();
  if (app.scene !== scene) return; // another session was opened meanwhile
  tell("scene");
};

const loadPicture = async () => {
  const session = app.session, scene = app.scene;
  const file = await fetched(at("/picture"));
  if (app.scene !== scene) return;
  if (app.picture) URL.revokeObjectURL(app.picture);
  app.picture = URL.createObjectURL(file);
  app.things = [];
  if (!app.reading) call("GET", at("/things")).then((things) => {
    if (session === app.session) app.things = things;
    tell("things");
  }, () => {});
  tell("picture");
};

// A turn, whatever asks for it: the page waits for its end, which the events tell as well.
export const turn = async (place, path, json, { method = "POST", key, ...more } = {}) => {
  ["problem", "stage-problem", "plan-problem"].forEach(clear);
  app.busy = true;
  tell("busy");
  try {
    const state = await call(method, at(path), { json, key: key ?? newKey(), ...more });
    app.looking = null;
    await refresh();
    if (innerWidth <= NARROW) byId("stage").scrollIntoView({ block: "nearest" });
    return state;
  } catch (problem) {
    fail(place, problem);
    return null;
  } finally {
    app.busy = false;
    tell("busy");
  }
};

export const stop = async () => {
  try {
    const state = await call("POST", at("/stop"));
    announce(state.message);
    await refresh();
  } catch (problem) {
    fail("problem", problem);
  }
};
