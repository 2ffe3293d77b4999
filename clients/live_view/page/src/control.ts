// Requests in words, as `huetrack control` (idl/README.md). One at a time; the reply arrives over the stream.
import type { ControlReply } from "./messages";
import { client, store } from "./store";

const patience = 3000; // ms, for a reply
const attempts = 3; // discovery may not be complete

let number = 0;
let waiting: { number: number; resolve: (reply: ControlReply) => void } | null = null;
let queue: Promise<unknown> = Promise.resolve();

const refused = (reason: string): ControlReply => ({ client, number: 0, granted: false, reason, rows: [] });

// Never throws: errors are replies that are not granted.
export function ask(...words: string[]): Promise<ControlReply> {
  const mine = queue.then(() => send(words));
  queue = mine;
  return mine;
}

async function send(words: string[]): Promise<ControlReply> {
  const { scene } = store;
  if (!scene) return refused("There is no service to ask.");
  const mine = ++number;
  const body = JSON.stringify({ client, number: mine, host: scene.host, pid: scene.pid, words });
  const reply = new Promise<ControlReply>((resolve) => (waiting = { number: mine, resolve }));
  try {
    for (let attempt = 0; attempt < attempts; attempt++) {
      const answer = await fetch("/api/control", { method: "POST", headers: { "Content-Type": "application/json" }, body });
      if (!answer.ok) throw new Error((await answer.text()).trim());
      const came = await Promise.race([reply, new Promise<null>((resolve) => setTimeout(() => resolve(null), patience))]);
      if (came) return came;
    }
    return refused("The service did not answer. Is it still running?");
  } catch (error) {
    return refused(`The request did not go through: ${error instanceof Error ? error.message : error}`);
  } finally {
    waiting = null;
  }
}

export function takeControlReply(reply: ControlReply): void {
  if (waiting && reply.client === client && reply.number === waiting.number) waiting.resolve(reply);
}
