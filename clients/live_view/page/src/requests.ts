// How long a request waits: as long as the service lives. It lives if anything of it arrives: a status, a picture, a position, an
// answer. A late answer is taken whenever it comes.
import { serviceOf, store } from "./store";

const againAfter = [3, 6, 12, 24]; // s; then every 24 s. A repeated request is not executed twice (idl/README.md).
const silence = 12; // s without any sign of the service: a busy machine may take some, the status comes once a second

export type Outcome = "answered" | "restarted" | "silent" | "failed";
export interface Sent {
  outcome: Outcome;
  reason: string; // a sentence for the user; empty: answered
}

const sleep = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));

async function post(path: string, body: string): Promise<string> {
  try {
    const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body });
    return answer.ok ? "" : (await answer.text()).trim() || `status ${answer.status}`;
  } catch (error) {
    return error instanceof Error ? error.message : String(error);
  }
}

// isAnswered: whether the reply came. onWait: called once a second with the seconds since it was sent.
export async function send(path: string, body: string, isAnswered: () => boolean, onWait: (seconds: number) => void): Promise<Sent> {
  const service = store.scene ? serviceOf(store.scene) : "";
  const begun = performance.now();
  const seconds = () => (performance.now() - begun) / 1000;
  let attempt = 0;
  let refused = await post(path, body);
  // What the bridge itself refuses is refused again; a connection that breaks may come back.
  if (refused && store.connected) return { outcome: "failed", reason: `The request did not go through: ${refused}` };
  let reported = 0;
  for (;;) {
    await sleep(100);
    if (isAnswered()) return { outcome: "answered", reason: "" };
    if (store.scene && serviceOf(store.scene) !== service) return { outcome: "restarted", reason: "The service restarted meanwhile. Please repeat it." };
    const now = seconds();
    if (now - reported >= 1) onWait((reported = Math.floor(now)));
    const quiet = (performance.now() - Math.max(store.lifeAt, begun)) / 1000;
    if (quiet > silence)
      return { outcome: "silent", reason: `Nothing has come from the service for ${Math.floor(quiet)} s. It may have stopped; a late answer is still taken.` };
    const due = attempt < againAfter.length ? againAfter[attempt] : againAfter[againAfter.length - 1] * (attempt - againAfter.length + 2);
    if (now < due && !(refused && store.connected)) continue;
    attempt++;
    refused = await post(path, body);
    if (refused && store.connected) return { outcome: "failed", reason: `The request did not go through: ${refused}` };
  }
}
