// Where a session begins: a picture of one's own, a photo, an example, or a session from before.
import { Problem, call, token } from "./api.js";
import { clear, fail, tell } from "./app.js";
import { byId, h, readable } from "./dom.js";

const NEEDS = {
  offline: "Rules that come with formup: no network, no key. They know many wordings, not all.",
  other: "A language model: the server has its key or address, and requests may cost money.",
};

const began = async (body, name, { robots = byId("robots").value, words, pointed } = {}) => {
  clear("start-problem");
  byId("drop").setAttribute("aria-busy", "true");
  try {
    const query = { name, robots, metres_per_pixel: byId("scale").value, agent: byId("agent").value };
    const type = body.type || "application/octet-stream";
    const made = await call("POST", "/sessions", { body, type, query });
    tell("open", { id: made.id, words, pointed });
  } catch (problem) {
    fail("start-problem", problem);
  }
  byId("drop").removeAttribute("aria-busy");
};

for (const name of ["file", "camera"]) {
  byId(name).addEventListener("change", ({ target }) => {
    if (target.files[0]) began(target.files[0], target.files[0].name);
    target.value = "";
  });
}

const given = (transfer) => [...(transfer?.files ?? [])].find((file) => file.type.startsWith("image/"));
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  const file = given(event.dataTransfer);
  if (file) tell("file", file);
});
addEventListener("paste", (event) => {
  const file = given(event.clipboardData);
  if (!file) return;
  event.preventDefault();
  tell("file", file);
});

// A picture that is dropped begins a session, or is the next picture of the one that is open.
export const received = (file) => began(file, file.name);

const example = ({ name, words, robots, pointed }) => h("li", {}, h("button", {
  type: "button",
  onclick: async () => {
    const response = await fetch(`/page/examples/${name}`).catch(() => null);
    if (!response?.ok) return fail("start-problem", new Problem(0, { message: "The example could not be fetched; try it again." }));
    return began(await response.blob(), name, { robots, words, pointed });
  },
}, h("img", { src: `/page/examples/${name}`, alt: "", loading: "lazy" }), h("span", {}, `“${words}”`)));

const row = (facts) => {
  const said = readable(facts.words), label = facts.name || said || facts.id;
  return h("li", {}, h("button", { type: "button", className: "link", onclick: () => tell("open", { id: facts.id }) },
    h("strong", {}, label), h("span", { className: "soft" }, ` ${said === label ? "" : said} · ${facts.turns === 1 ? "1 turn" : `${facts.turns} turns`} · ${new Date(facts.created).toLocaleString()}`)),
  h("button", { type: "button", ariaLabel: `Rename ${label}`, onclick: () => renamed(facts) }, "Rename"),
  h("button", { type: "button", ariaLabel: `Delete ${label}`, onclick: () => deleted(facts, label) }, "Delete"));
};

const renamed = async (facts) => {
  const name = prompt("What is it called?", facts.name);
  if (name === null) return;
  await call("PATCH", `/sessions/${facts.id}`, { json: { name } }).catch((problem) => fail("start-problem", problem));
  list();
};

const deleted = async (facts, label) => {
  if (!confirm(`Delete the session “${label}”? Its pictures and plans are gone then.`)) return;
  await call("DELETE", `/sessions/${facts.id}`).catch((problem) => fail("start-problem", problem));
  list();
};

const list = async () => {
  const text = byId("search").value;
  const found = await call("GET", "/sessions", { query: { text } });
  byId("sessions").replaceChildren(...found.slice(0, 50).map(row));
  if (!found.length) byId("sessions").append(h("li", { className: "soft" }, "None."));
};
byId("search").addEventListener("input", () => list().catch((problem) => fail("start-problem", problem)));

const pickers = async () => {
  const [agents, reports, examples] = await Promise.all([
    call("GET", "/agents"), call("GET", "/reports"), fetch("/page/examples.json").then((response) => response.json()),
  ]);
  byId("agent").replaceChildren(...agents.map((agent) => h("option", { value: agent.name }, agent.name || agent.model)));
  const chosen = () => {
    const model = agents.find((agent) => agent.name === byId("agent").value)?.model ?? "";
    byId("needs").textContent = model === "offline" ? NEEDS.offline : NEEDS.other;
  };
  byId("agent").onchange = chosen;
  chosen();
  byId("reported").hidden = !reports.length;
  byId("reports").replaceChildren(...reports.map(({ name, address }) => h(
    "li", {}, h("a", { href: address, target: "_blank", rel: "noopener" }, name),
  )));
  byId("examples").replaceChildren(...examples.map(example));
};

const signedIn = () => new Promise((over) => {
  const dialog = byId("sign-in");
  byId("not-accepted").hidden = !token.get();
  byId("token").value = "";
  dialog.addEventListener("close", () => (token.set(byId("token").value), over()), { once: true });
  dialog.showModal();
});

export const start = async () => {
  for (const name of ["talk", "view"]) byId(name).hidden = true;
  byId("start").hidden = false;
  byId("name").textContent = "";
  document.title = "formup";
  try {
    await Promise.all([pickers(), list()]);
  } catch (problem) {
    if (problem.status !== 401) return fail("start-problem", problem);
    await signedIn();
    await start();
  }
};
