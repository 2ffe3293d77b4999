// Requests in words (idl/README.md). The replies arrive over the stream.
import type { ControlReply } from "./messages";
import { send } from "./requests";
import { toast } from "./shell";
import { client, store } from "./store";

let number = 0;
// Requests without a reply, by number. One that was given up is resolved already, and its late answer is shown.
const waiting = new Map<number, { resolve: (reply: ControlReply) => void; isGivenUp: boolean }>();
const mostWaiting = 32; // those before are forgotten

const refused = (reason: string): ControlReply => ({ client, number: 0, granted: false, reason, rows: [] });

// Never throws: errors are replies that are not granted, with number 0.
export async function ask(...words: string[]): Promise<ControlReply> {
  const { scene } = store;
  if (!scene) return refused("There is no service to ask.");
  const mine = ++number;
  const body = JSON.stringify({ client, number: mine, host: scene.host, pid: scene.pid, words });
  let came: ControlReply | null = null;
  const entry = { resolve: (reply: ControlReply) => (came = reply), isGivenUp: false };
  waiting.set(mine, entry);
  for (const old of waiting.keys()) if (old <= mine - mostWaiting) waiting.delete(old);
  const sent = await send("/api/control", body, () => came !== null, (seconds) => onWaiting(words, seconds));
  onWaiting(words, 0);
  if (came) return came;
  entry.isGivenUp = true;
  if (sent.outcome === "failed") waiting.delete(mine);
  return refused(sent.reason);
}

export function takeControlReply(reply: ControlReply): void {
  if (reply.client !== client) return;
  const entry = waiting.get(reply.number);
  if (!entry) return;
  waiting.delete(reply.number);
  if (entry.isGivenUp) toast(`A late answer: ${reply.reason}`);
  else entry.resolve(reply);
}

// ---- What is shown while a request that the user made waits.
let waitListener: (seconds: number) => void = () => {};
export function whileWaiting(listener: (seconds: number) => void): void {
  waitListener = listener;
}
// Questions for the state, once a second or so, are not the user's.
const isQuestion = (words: string[]) => ["state", "list", "controls"].includes(words[1]) || words[0] === "history";
function onWaiting(words: string[], seconds: number): void {
  if (!isQuestion(words)) waitListener(seconds);
}

// For a panel's line of text: at once that it works, then the result.
// The first sentence is emphasised.
export function say(element: HTMLElement, text: string, isBad = false, isBusy = false): void {
  if (element.textContent !== text) {
    const [first] = /^.*?[.?!](?= [A-Z])/s.exec(text) ?? [text];
    element.replaceChildren(Object.assign(document.createElement("b"), { textContent: first }), text.slice(first.length));
  }
  element.classList.toggle("bad", isBad);
  element.classList.toggle("busy", isBusy);
}
export async function askAloud(element: HTMLElement, ...words: string[]): Promise<ControlReply> {
  say(element, "Working…", false, true);
  whileWaiting((seconds) => seconds >= 2 && say(element, `Working… ${seconds} s`, false, true));
  const reply = await ask(...words);
  whileWaiting(() => {});
  say(element, reply.reason, !reply.granted);
  return reply;
}
