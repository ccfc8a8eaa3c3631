// Requests to the server, and its events as they come, also after a connection was lost.
const TOKEN = "formup-token";
const PATIENCE = [500, 1000, 2000, 4000, 8000];
const SILENCE = 40_000; // ms; the server says something every 15 s

export class Problem extends Error {
  constructor(status, error) {
    super(error?.message ?? `The server answered ${status}.`);
    Object.assign(this, { status, code: error?.code ?? null });
  }
}

export const token = {
  get: () => sessionStorage.getItem(TOKEN),
  set: (value) => sessionStorage.setItem(TOKEN, value.trim()),
};

// The code of a shared link, while one is looked at.
let shared = null;
export const lookWith = (code) => (shared = code);

const signed = (headers = {}) => {
  if (shared) return { ...headers, Authorization: `Share ${shared}` };
  return token.get() ? { ...headers, Authorization: `Bearer ${token.get()}` } : headers;
};

const answered = async (method, path, { json, body, type, query, key } = {}) => {
  const headers = signed();
  if (json !== undefined) [headers["Content-Type"], body] = ["application/json", JSON.stringify(json)];
  if (type) headers["Content-Type"] = type;
  if (key) headers["Idempotency-Key"] = key;
  const given = Object.entries(query ?? {}).filter(([, value]) => value !== null && value !== "");
  const address = `/api${path}${given.length ? `?${new URLSearchParams(given)}` : ""}`;
  let response;
  try {
    response = await fetch(address, { method, headers, body });
  } catch {
    throw new Problem(0, { message: "The server cannot be reached. Try again once it is back." });
  }
  if (response.ok) return response;
  const told = await response.json().catch(() => ({}));
  throw new Problem(response.status, told.error);
};

export const call = async (method, path, options) => {
  const response = await answered(method, path, options);
  return response.status === 204 ? null : response.json();
};

export const fetched = async (path) => (await answered("GET", path)).blob();

export const newKey = () =>
  [...crypto.getRandomValues(new Uint8Array(16))].map((n) => n.toString(16).padStart(2, "0")).join("");

// Events of a session from its first one; `connected` is told whenever that changes.
export const follow = (session, { event, connected, gone }) => {
  const ending = new AbortController();
  let last = null, failed = 0;

  const read = async () => {
    const headers = signed(last ? { "Last-Event-ID": last } : {});
    const silent = new AbortController();
    const signal = AbortSignal.any([ending.signal, silent.signal]);
    const response = await fetch(`/api/sessions/${session}/events?watching=true`, { headers, signal });
    if (!response.ok) throw new Problem(response.status, (await response.json()).error);
    connected(true);
    failed = 0;
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    let text = "", quiet;
    for (;;) {
      clearTimeout(quiet);
      quiet = setTimeout(() => silent.abort(), SILENCE);
      const { value, done } = await reader.read();
      if (done) return clearTimeout(quiet);
      const frames = (text + value).split(/\r?\n\r?\n/);
      text = frames.pop();
      for (const frame of frames) take(frame);
    }
  };

  const take = (frame) => {
    const lines = frame.split(/\r?\n/);
    const data = lines.filter((line) => line.startsWith("data:")).map((line) => line.slice(5)).join("\n");
    if (data) event(JSON.parse(data));
    const id = lines.find((line) => line.startsWith("id:"));
    if (id) last = id.slice(3).trim();
  };

  const go = async () => {
    while (!ending.signal.aborted) {
      try {
        await read();
      } catch (problem) {
        if (ending.signal.aborted) return;
        if (problem.status === 401 || problem.status === 404) return gone(problem);
      }
      if (ending.signal.aborted) return;
      connected(false);
      await new Promise((over) => setTimeout(over, PATIENCE[Math.min(failed++, PATIENCE.length - 1)]));
    }
  };
  go();
  return () => ending.abort();
};
