// The session of the page. Every request of the page goes through `api`. Without a session the page has no data: then a
// form takes a token, and says how to get a link that needs none.

const API = "/api/v1";
const byId = (id) => document.getElementById(id);
let isLocked = false;

// A request to the API: a path below its root, and what `fetch` takes.
export async function api(path, init = {}) {
  // Until somebody has signed in, what polls would only be refused.
  if (isLocked) throw new Error("not signed in");
  const answer = await fetch(API + path, signed(init));
  if (answer.status === 401) lock();
  return answer;
}

// Pages of other sites cannot send this header, so a change with it comes from this page.
export function signed(init) {
  const isRead = ["GET", "HEAD"].includes((init.method ?? "GET").toUpperCase());
  return isRead ? init : { ...init, headers: { ...init.headers, "x-waymark-page": "1" } };
}

// What the form says first.
export const greeting = (search) => new URLSearchParams(search).get("link") === "ended"
  ? "This link was used already, or is older than ten minutes."
  : "You are not signed in.";

// Shows the form in place of the page.
function lock() {
  isLocked = true;
  document.querySelector("main").hidden = true;
  byId("logout").hidden = true;
  byId("login").hidden = false;
  byId("login-hint").textContent = greeting(location.search);
  byId("login-token").focus();
}

async function login(event) {
  event.preventDefault();
  const token = byId("login-token").value.trim();
  const headers = { "content-type": "application/json" };
  const answer = await fetch("/login", signed({ method: "POST", headers, body: JSON.stringify({ token }) }));
  byId("login-token").value = "";
  if (answer.ok) return location.replace("/live/");
  const problem = await answer.json().catch(() => ({}));
  byId("login-hint").textContent = answer.status === 401 ? "This token is not valid here." : problem.detail ?? `${answer.status}`;
}

async function logout() {
  await fetch("/logout", signed({ method: "POST" }));
  location.replace("/live/");
}

if (globalThis.document) {
  byId("login-form").addEventListener("submit", login);
  byId("logout").addEventListener("click", logout);
}
