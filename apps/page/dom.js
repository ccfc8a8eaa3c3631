// Making elements, for HTML and SVG; text is always text, never markup.
export const byId = (id) => document.getElementById(id);

const SVG = "http://www.w3.org/2000/svg";

const filled = (node, attributes, children) => {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name in node && !(node instanceof SVGElement)) node[name] = value;
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
};

export const h = (tag, attributes = {}, ...children) =>
  filled(document.createElement(tag), attributes, children);

export const s = (tag, attributes = {}, ...children) =>
  filled(document.createElementNS(SVG, tag), attributes, children);

export const path = (rings) =>
  rings.map((ring) => `M${ring.map((point) => point.join(" ")).join("L")}Z`).join("");

// Said by screen readers; the same text twice is said twice.
export const announce = (text) => {
  byId("live").textContent = "";
  requestAnimationFrame(() => (byId("live").textContent = text));
};

// Work that is asked for faster than it is done: one at a time, and of what waits only the latest.
export const latest = (work) => {
  let running = false, next = null;
  const run = async () => {
    running = true;
    while (next) {
      const wanted = next;
      next = null;
      await work(...wanted);
    }
    running = false;
  };
  return (...wanted) => {
    next = wanted;
    if (!running) run();
  };
};

// What a person did without words, as the log has it, and how it reads.
const COMMANDS = [
  [/^\/undo first$/, "Back to the first plan"], [/^\/undo (p-.*)$/, "Back to an earlier plan"], [/^\/undo.*$/, "Undo"],
  [/^\/redo.*$/, "Redo"], [/^\/go/, "Move the robots"], [/^\/edit.*$/, "Change"], [/^\/image (.*)$/, "Another picture: $1"],
  [/^\/stop/, "Stop"],
];

export const readable = (text) => {
  const known = COMMANDS.find(([pattern]) => pattern.test(text));
  return known ? text.replace(known[0], known[1]) : text;
};
